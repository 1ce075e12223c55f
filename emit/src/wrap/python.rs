//! Output: manifest, `pyproject.toml`, `src/lib.rs` with the functions, and the emitted module.
//! A crate that makes a Python module of a model, with PyO3: functions of numpy arrays, one state or many.

use proc_macro2::{Ident, TokenStream};
use quote::{format_ident, quote};

use super::functions::{WrappedFunction, wrapped_functions};
use super::{LanguageBinding, seal_files, source_file};
use crate::language::rust::doc_lines;
use crate::language::{EmissionRequest, EmittedFile};

/// Names that a Python module cannot have: keywords, and `numpy`, which it would hide from its callers.
const RESERVED: &[&str] = &[
    "False", "None", "True", "and", "as", "assert", "async", "await", "break", "class", "continue", "def", "del",
    "elif", "else", "except", "finally", "for", "from", "global", "if", "import", "in", "is", "lambda", "nonlocal",
    "not", "numpy", "or", "pass", "raise", "return", "try", "while", "with", "yield",
];

/// The files of the crate, without reactions and self-test. The caller copies `modelmill-runtime` into the folder of
/// that name next to the manifest.
#[allow(clippy::too_many_lines, reason = "one text from top to bottom")]
pub(crate) fn emit_python(from: &EmissionRequest<'_>) -> Vec<EmittedFile> {
    let face = LanguageBinding::new(from, RESERVED);
    let name = &face.name;
    // A package name may not begin with an underscore.
    let package = name.trim_start_matches('_');
    // The manifest for cargo.
    let cargo = format!(
        "# Written by modelmill. `maturin build --release` builds a wheel; without maturin, `cargo build --release` builds
# target/release/lib{name}.so, which Python imports under the name {name}.so.
[package]
name = \"model-{package}\"
version = \"0.1.0\"
edition = \"2024\"
publish = false

[lib]
name = \"{name}\"
crate-type = [\"cdylib\"]

[dependencies]
modelmill-runtime = {{ path = \"modelmill-runtime\", features = [\"rayon\"] }}
numpy = \"0.30\"
pyo3 = {{ version = \"0.30\", features = [\"extension-module\", \"abi3-py39\"] }}

[workspace]
"
    );
    // The manifest for maturin.
    let pyproject = format!(
        "[build-system]
requires = [\"maturin>=1.7,<2\"]
build-backend = \"maturin\"

[project]
name = \"model-{package}\"
version = \"0.1.0\"
requires-python = \">=3.9\"
dependencies = [\"numpy\"]

[tool.maturin]
module-name = \"{name}\"
"
    );
    let file = |path: &str, text: String| EmittedFile {
        path: path.to_owned(),
        text,
    };
    seal_files(vec![
        file("Cargo.toml", cargo),
        file("pyproject.toml", pyproject),
        source_file("src/lib.rs", "The model for Python.", &items(&face)),
        face.emitted_module(),
    ])
}

/// The items of `src/lib.rs`: conversions of arrays, the functions, and the module.
#[allow(clippy::too_many_lines, reason = "one text from top to bottom")]
fn items(face: &LanguageBinding<'_>) -> TokenStream {
    let module = &face.name;
    let mechanism = &face.derivation.mechanism;
    // The documentation of the module, which `help` prints.
    let title = format!(
        "{}.\n\nInverse dynamics tau = H_min(q, q', q'') p_min. Arrays of one state have one number per coordinate. \
         Arrays of n states have shape (coordinates, n), contiguous in memory; so have results: forces (drives, n), regressor \
         (drives, base parameters, n). SI units.\n\nArrays of another type or shape, NaN and poses without a solution raise \
         ValueError with the number of the state. Unknown names raise KeyError.",
        modelmill_boundary::text::comment(mechanism.title.as_deref().unwrap_or(&mechanism.name))
    );
    let title = doc_lines(&title, false);
    let (constants, parameters) = (face.constants(), face.parameters());
    let (n_active, n_drives, n_base) = (face.n_active(), face.n_drives(), face.n_base());
    // Conversions between arrays and the structs of the module.
    let records = [
        LanguageBinding::record_functions("geometry", "Geometry", &constants),
        LanguageBinding::record_functions("parameters", "Parameters", &parameters),
    ];
    // Arguments of a state, and their conversion to columns.
    let parts = face.state_parts();
    let names: Vec<_> = parts.iter().map(|(name, _)| name).collect();
    let arguments = quote! { #(#names: PyReadonlyArrayDyn<'py, f64>),* };
    let arrays = arrays(&parts);
    let states = quote! {
        #arrays
        let states = model::States { #(#names),* };
    };
    // Forces and regressor have a vector form for many states, which the text below calls.
    // Everything else is computed state by state.
    let of_blocks = ["inverse_dynamics", "regressor"];
    // All other functions of a state.
    let singles = wrapped_functions(face);
    let singles = singles.iter().filter(|one| !of_blocks.contains(&one.name));
    // Their names, for the registration in the module.
    let called: Vec<Ident> = singles
        .clone()
        .map(|one| format_ident!("{}", python_name(one)))
        .collect();
    let singles: Vec<TokenStream> = singles.map(|one| single_state_function(face, one)).collect();
    // Documentation of the three functions that are written out.
    let doc_forces = "Forces of the drives, N or N m, for base parameters `p`. `parallel` uses all cores; `geometry` has the \
                      known quantities that differ from the model file, by name.";
    let doc_regressor =
        "H_min: one row per drive, one column per base parameter. `parallel` and `geometry` as in `inverse_dynamics`.";
    let doc_base = "Base parameters from physical parameters; those that are not named have the model file's values.";
    quote! {
        #![allow(clippy::needless_pass_by_value, reason = "pyo3 passes arguments by value")]

        pub mod model;

        use std::collections::BTreeMap;

        use modelmill_runtime::PoseError;
        use modelmill_runtime::blocks::BlockError;
        use numpy::{PyArray, PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArray1, PyReadonlyArrayDyn, PyUntypedArrayMethods};
        use pyo3::exceptions::{PyKeyError, PyValueError};
        use pyo3::prelude::*;

        #(#records)*

        /// Values with some replaced by name.
        fn with_replacements<const N: usize>(
            mut values: [f64; N], names: &[&str], by: Option<BTreeMap<String, f64>>,
        ) -> PyResult<[f64; N]> {
            for (name, value) in by.unwrap_or_default() {
                // An unknown name is an error.
                let place = names.iter().position(|n| *n == name);
                let place = place.and_then(|k| values.get_mut(k)).ok_or_else(|| {
                    PyKeyError::new_err(format!("the model has no `{name}`; it has {}", names.join(", ")))
                })?;
                *place = value;
            }
            Ok(values)
        }

        // Constants of the model file with some replaced by name.
        fn geometry_of(by: Option<BTreeMap<String, f64>>) -> PyResult<model::Geometry<f64>> {
            let names = model::CONSTANTS.map(|c| c.name);
            Ok(geometry(&with_replacements(geometry_values(), &names, by)?))
        }

        // A ValueError with a text.
        fn value_error(text: String) -> PyErr {
            PyValueError::new_err(text)
        }

        // The error of a pose without a solution.
        fn pose_error(error: PoseError) -> PyErr {
            value_error(error.to_string())
        }

        /// Number of states in the arrays, and whether results have an axis for them.
        struct BatchShape {
            n: usize,
            axis: bool,
        }

        impl BatchShape {
            // Checks that all arrays have the shape that the first one implies.
            fn from_arrays(arrays: &[(&PyReadonlyArrayDyn<'_, f64>, &str, usize)]) -> PyResult<Self> {
                let shape = arrays.first().map_or(&[][..], |a| a.0.shape());
                let axis = shape.len() == 2;
                let n = if axis { shape[1] } else { 1 };
                // Every array must have the same number of states.
                for (array, name, rows) in arrays {
                    let expected: &[usize] = if axis { &[*rows, n] } else { &[*rows] };
                    if array.shape() != expected {
                        return Err(value_error(format!(
                            "{name} has shape {:?}; expected {expected:?}", array.shape()
                        )));
                    }
                }
                Ok(Self { n, axis })
            }

            // Shape of a result, with an axis for the states if the arguments have one.
            fn shape(&self, first: &[usize]) -> Vec<usize> {
                let mut shape = first.to_vec();
                shape.extend(self.axis.then_some(self.n));
                shape
            }

            // The error of a state; its number is stated only if there are several.
            fn error(&self, error: BlockError) -> PyErr {
                match error {
                    BlockError::At { reason, .. } if !self.axis => pose_error(reason),
                    other => value_error(other.to_string()),
                }
            }
        }

        // The numbers of a row-major array.
        fn slice<'a>(array: &'a PyReadonlyArrayDyn<'_, f64>, name: &str) -> PyResult<&'a [f64]> {
            // `as_slice` alone would also accept a column-major array, and read it in the wrong order.
            let rows = array.is_c_contiguous().then(|| array.as_slice().ok()).flatten();
            rows.ok_or_else(|| {
                value_error(format!("{name} is not row-major in memory: pass numpy.ascontiguousarray({name})"))
            })
        }

        // The rows of an array: one per coordinate, each with `n` numbers.
        fn columns<const N: usize>(all: &[f64], n: usize) -> [&[f64]; N] {
            std::array::from_fn(|k| all.get(k * n..(k + 1) * n).unwrap_or_default())
        }

        // Base parameters; their number is checked.
        fn base_of(p: &PyReadonlyArray1<'_, f64>) -> PyResult<[f64; #n_base]> {
            let p = p.as_array();
            if p.len() != #n_base {
                return Err(value_error(format!("p has {} numbers; the model has {} base parameters", p.len(), #n_base)));
            }
            Ok(std::array::from_fn(|k| p[k]))
        }

        #[doc = #doc_forces]
        #[pyfunction]
        #[pyo3(signature = (#(#names,)* p, *, geometry=None, parallel=false))]
        fn inverse_dynamics<'py>(
            py: Python<'py>, #arguments, p: PyReadonlyArray1<'py, f64>,
            geometry: Option<BTreeMap<String, f64>>, parallel: bool,
        ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
            #states
            let dynamics = model::InverseDynamics::new(&geometry_of(geometry)?, &base_of(&p)?);
            let forces = PyArray::zeros(py, many.shape(&[#n_drives]), false);
            // Results are computed in place, without a copy.
            let mut to = forces.readwrite();
            let to = to.as_slice_mut().map_err(|error| value_error(error.to_string()))?;
            let done = py.detach(|| {
                let mut to = modelmill_runtime::blocks::columns_of::<f64, #n_drives>(to, n)?;
                if parallel {
                    dynamics.forces_of_many_in_parallel(&states, &mut to)
                } else {
                    dynamics.forces_of_many(&states, &mut to)
                }
            });
            done.map_err(|error| many.error(error))?;
            Ok(forces)
        }

        #[doc = #doc_regressor]
        #[pyfunction]
        #[pyo3(signature = (#(#names,)* *, geometry=None, parallel=false))]
        fn regressor<'py>(
            py: Python<'py>, #arguments, geometry: Option<BTreeMap<String, f64>>, parallel: bool,
        ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
            #states
            let model = model::Model::new(&geometry_of(geometry)?);
            let regressor = PyArray::zeros(py, many.shape(&[#n_drives, #n_base]), false);
            // Results are computed in place, without a copy.
            let mut to = regressor.readwrite();
            let to = to.as_slice_mut().map_err(|error| value_error(error.to_string()))?;
            let done = py.detach(|| {
                if parallel {
                    model.regressor_of_many_in_parallel(&states, to)
                } else {
                    model.regressor_of_many(&states, to)
                }
            });
            done.map_err(|error| many.error(error))?;
            Ok(regressor)
        }

        /// Results state by state, stored entry by entry, with Python's lock released.
        fn compute_results(
            py: Python<'_>, many: &BatchShape, entries: usize, at: impl Fn(usize) -> Result<Vec<f64>, PoseError> + Sync,
        ) -> PyResult<Vec<f64>> {
            let n = many.n;
            let done = py.detach(|| {
                let mut to = vec![0.0; entries * n];
                for sample in 0..n {
                    let found = at(sample).map_err(|reason| BlockError::At { sample, reason })?;
                    for (to, value) in to.iter_mut().skip(sample).step_by(n).zip(found) {
                        *to = value;
                    }
                }
                Ok(to)
            });
            done.map_err(|error| many.error(error))
        }

        /// An array of results for Python.
        fn shape_results<'py>(
            py: Python<'py>, many: &BatchShape, values: &[f64], shape: &[usize],
        ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
            PyArray1::from_slice(py, values).reshape(many.shape(shape))
        }

        #(#singles)*

        #[doc = #doc_base]
        #[pyfunction]
        #[pyo3(signature = (parameters=None, geometry=None))]
        fn base_parameters<'py>(
            py: Python<'py>, parameters: Option<BTreeMap<String, f64>>, geometry: Option<BTreeMap<String, f64>>,
        ) -> PyResult<Bound<'py, PyArray1<f64>>> {
            let names = model::PARAMETERS.map(|c| c.name);
            let values = with_replacements(parameters_values(), &names, parameters)?;
            let base = model::base_parameters(&geometry_of(geometry)?, &self::parameters(&values))
                .map_err(|special| value_error(special.to_string()))?;
            Ok(PyArray1::from_slice(py, &base))
        }

        #title
        #[pymodule]
        #[pyo3(name = #module)]
        fn python_module(m: &Bound<'_, PyModule>) -> PyResult<()> {
            m.add_function(wrap_pyfunction!(inverse_dynamics, m)?)?;
            m.add_function(wrap_pyfunction!(regressor, m)?)?;
            m.add_function(wrap_pyfunction!(base_parameters, m)?)?;
            #(m.add_function(wrap_pyfunction!(#called, m)?)?;)*
            // Names and values, so that scripts need no copy of the model file.
            m.add("COORDINATES", model::ACTIVE.to_vec())?;
            m.add("PASSIVE", model::PASSIVE.to_vec())?;
            m.add("DRIVES", model::DRIVES.to_vec())?;
            let base = model::BASE_PARAMETERS.map(|b| (b.name, b.expression, b.unit));
            m.add("BASE_PARAMETERS", base.to_vec())?;
            m.add("CONSTANTS", BTreeMap::from(model::CONSTANTS.map(|c| (c.name, c.value))))?;
            m.add("PARAMETERS", BTreeMap::from(model::PARAMETERS.map(|c| (c.name, c.value))))?;
            debug_assert_eq!(model::N_ACTIVE, #n_active);
            Ok(())
        }
    }
}

/// The name of a function in Python; `forward` alone would be unclear in a module.
fn python_name(one: &WrappedFunction) -> &'static str {
    match one.name {
        "forward" => "forward_dynamics",
        name => name,
    }
}

/// Statements that bind arrays to columns of `n` states and their common shape to `many`.
fn arrays(parts: &[(Ident, usize)]) -> TokenStream {
    let (names, sizes): (Vec<_>, Vec<usize>) = parts.iter().map(|(name, n)| (name, *n)).unzip();
    let texts: Vec<String> = names.iter().map(ToString::to_string).collect();
    quote! {
        let many = BatchShape::from_arrays(&[#((&#names, #texts, #sizes)),*])?;
        let n = many.n;
        #(let #names = columns::<#sizes>(slice(&#names, #texts)?, n);)*
    }
}

/// A function that is evaluated state by state.
fn single_state_function(face: &LanguageBinding<'_>, one: &WrappedFunction) -> TokenStream {
    let (name, method) = (format_ident!("{}", python_name(one)), format_ident!("{}", one.method));
    let state = face.state_parts();
    // Accelerations are no argument of a function that does not read them.
    let is_given = |part: &&(Ident, usize)| one.reads_accelerations || part.0 != "qdd";
    let forces = one.takes_forces.then(|| (format_ident!("forces"), face.n_drives()));
    let given: Vec<(Ident, usize)> = state.iter().filter(is_given).chain(&forces).cloned().collect();
    // Names of the arguments.
    let names: Vec<_> = given.iter().map(|(name, _)| name).collect();
    let arrays = arrays(&given);
    // Parts of the state that are no argument are zero.
    let fields = state.iter().map(|(name, n)| {
        if given.iter().any(|(given, _)| given == name) {
            quote! { #name: #name.map(|values| values[sample]) }
        } else {
            quote! { #name: [0.0; #n] }
        }
    });
    // Forces of the drives of one state.
    let forces = one
        .takes_forces
        .then(|| quote! { , &forces.map(|values| values[sample]) });
    // Functions of the equation of motion take base parameters; those of the model do not.
    let (p_argument, p_name, owner) = if one.owner == "model" {
        let model = quote! { model::Model::new(&geometry_of(geometry)?) };
        (None, None, model)
    } else {
        let owner = quote! { model::Dynamics::new(&geometry_of(geometry)?, &base_of(&p)?) };
        let argument = quote! { p: PyReadonlyArray1<'py, f64>, };
        (Some(argument), Some(quote! { p, }), owner)
    };
    // A matrix is flattened row by row.
    let values = one.parts.iter().map(|part| {
        let value = one.part_tokens(part);
        match part.shape.len() {
            1 => quote! { &#value[..] },
            _ => quote! { #value.as_flattened() },
        }
    });
    // Numbers per state.
    let entries = one.n_results();
    let mut at = 0;
    // Each array of the result is a range of the computed values.
    let results = one.parts.iter().map(|part| {
        let (from, shape) = (at, part.shape.iter().map(|count| count.n));
        at += part.n_entries();
        quote! { shape_results(py, &many, &values[#from * n..#at * n], &[#(#shape),*])? }
    });
    let results: Vec<TokenStream> = results.collect();
    // The type of one array.
    let one_array = quote! { Bound<'py, PyArrayDyn<f64>> };
    // One array is returned as it is, several as a tuple.
    let (results, kind) = match results.as_slice() {
        [result] => (result.clone(), one_array),
        several => {
            let kinds = several.iter().map(|_| &one_array);
            (quote! { (#(#several),*) }, quote! { (#(#kinds),*) })
        }
    };
    // Shapes for the documentation.
    let shapes = one.parts.iter().map(|part| {
        let counts = part.shape.iter().map(|count| count.n.to_string());
        format!("({}, n)", counts.collect::<Vec<String>>().join(", "))
    });
    let shapes = shapes.collect::<Vec<String>>().join(", ");
    // The documentation states the shapes for many states.
    let doc = format!(
        "{}; shape for n states {shapes}. `geometry` as in `inverse_dynamics`.",
        one.doc
    );
    quote! {
        #[doc = #doc]
        #[pyfunction]
        #[pyo3(signature = (#(#names,)* #p_name *, geometry=None))]
        fn #name<'py>(
            py: Python<'py>, #(#names: PyReadonlyArrayDyn<'py, f64>,)* #p_argument geometry: Option<BTreeMap<String, f64>>,
        ) -> PyResult<#kind> {
            #arrays
            let owner = #owner;
            let values = compute_results(py, &many, #entries, |sample| {
                let state = model::State { #(#fields),* };
                let found = owner.#method(&state #forces)?;
                Ok([#(#values),*].concat())
            })?;
            Ok(#results)
        }
    }
}
