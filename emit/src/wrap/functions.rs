//! The functions of one state that the C and Python interfaces offer: one list for both.

use proc_macro2::TokenStream;
use quote::{format_ident, quote};

use super::LanguageBinding;
use crate::tree::reads_passive;

/// A function of one state: its name, the method of the emitted module that it calls, and its result.
pub(super) struct WrappedFunction {
    /// Name without the prefix of the model.
    pub(super) name: &'static str,
    /// The emitted struct with the method: `model`, `dynamics` (inverse dynamics) or `equation` (equation of motion).
    pub(super) owner: &'static str,
    /// Name of the method.
    pub(super) method: &'static str,
    /// First sentence of its documentation, without a full stop.
    pub(super) doc: &'static str,
    /// Whether it reads the accelerations of the state.
    pub(super) reads_accelerations: bool,
    /// Whether forces of the drives are an argument in addition to the state.
    pub(super) takes_forces: bool,
    /// Whether passive coordinates are solved for by Newton's method first.
    pub(super) follows: bool,
    /// The arrays of its result, in order.
    pub(super) parts: Vec<ResultPart>,
}

/// An array of a result; if there are several, its name is also the field of the emitted module's result.
pub(super) struct ResultPart {
    /// Name of the array.
    pub(super) name: &'static str,
    /// Dimensions, outermost first.
    pub(super) shape: Vec<ArrayDimension>,
}

/// A dimension of an array.
#[derive(Clone, Copy)]
pub(super) struct ArrayDimension {
    /// End of the name of its constant in the C header.
    pub(super) name: &'static str,
    /// Number of entries along it.
    pub(super) n: usize,
}

impl WrappedFunction {
    /// Number of numbers in its result.
    pub(super) fn n_results(&self) -> usize {
        self.parts.iter().map(ResultPart::n_entries).sum()
    }

    /// The expression of one array, if the method's result is named `found`.
    pub(super) fn part_tokens(&self, part: &ResultPart) -> TokenStream {
        // A single array is returned as it is, several as fields of a struct.
        if self.parts.len() == 1 {
            return quote! { found };
        }
        let field = format_ident!("{}", part.name);
        quote! { found.#field }
    }
}

impl ResultPart {
    /// An array with a name and dimensions.
    fn new(name: &'static str, shape: &[ArrayDimension]) -> Self {
        Self {
            name,
            shape: shape.to_vec(),
        }
    }

    /// Number of numbers in the array.
    pub(super) fn n_entries(&self) -> usize {
        self.shape.iter().map(|count| count.n).product()
    }
}

/// All functions of one state that a model has; those of the equation of motion only if it is requested.
#[allow(clippy::too_many_lines, reason = "a list of functions, one after the other")]
pub(super) fn wrapped_functions(face: &LanguageBinding<'_>) -> Vec<WrappedFunction> {
    // Dimensions by the names that the C header gives them.
    let count = |name, n| ArrayDimension { name, n };
    let active = count("ACTIVE", face.n_active());
    let passive = count("PASSIVE", face.n_passive());
    let drives = count("DRIVES", face.n_drives());
    let base = count("BASE", face.n_base());
    let programs = &face.derivation.programs;
    // Whether a program needs passive coordinates that have no closed form.
    let follows = |program| reads_passive(face.derivation, program);
    let mut all = vec![
        WrappedFunction {
            // tau = H_min p_min.
            name: "inverse_dynamics",
            owner: "dynamics",
            method: "forces",
            doc: "Forces of the drives, N or N m",
            reads_accelerations: true,
            takes_forces: false,
            follows: follows(&programs.inverse_dynamics),
            parts: vec![ResultPart::new("forces", &[drives])],
        },
        WrappedFunction {
            // H_min, for identification.
            name: "regressor",
            owner: "model",
            method: "regressor",
            doc: "H_min: one row per drive, one column per base parameter",
            reads_accelerations: true,
            takes_forces: false,
            follows: follows(&programs.regressor),
            parts: vec![ResultPart::new("regressor", &[drives, base])],
        },
        WrappedFunction {
            // Kinematics of the drives.
            name: "drives",
            owner: "model",
            method: "drives",
            doc: "Motion of the drives, rad or m and seconds: lengths or angles, their rates, and their Jacobian J, one row per \
                  drive and one column per coordinate",
            reads_accelerations: true,
            takes_forces: false,
            follows: follows(&programs.drives),
            parts: vec![
                ResultPart::new("coordinate", &[drives]),
                ResultPart::new("rate", &[drives]),
                ResultPart::new("jacobian", &[drives, active]),
            ],
        },
    ];
    // Only mechanisms with loops have passive coordinates.
    if passive.n > 0 {
        all.push(WrappedFunction {
            name: "passive",
            owner: "model",
            method: "passive",
            doc: "Motion of the passive coordinates, rad or m and seconds: coordinates, rates, accelerations",
            reads_accelerations: true,
            takes_forces: false,
            follows: follows(&programs.passive),
            parts: ["q", "qd", "qdd"].map(|name| ResultPart::new(name, &[passive])).into(),
        });
    }
    // The functions below belong to the equation of motion.
    let Some(dynamics) = face.dynamics else {
        return all;
    };
    // Results of the equation of motion: a matrix or a vector of generalised forces.
    let matrix = || vec![ResultPart::new("matrix", &[active, active])];
    let forces = || vec![ResultPart::new("forces", &[active])];
    let equation = [
        (
            "mass_matrix",
            "M(q) of J' f = M q'' + c + g + e, row by row: generalised force per acceleration of the coordinates",
            &dynamics.mass_matrix,
            matrix(),
        ),
        (
            "coriolis",
            "c: generalised forces that depend on the rates, centrifugal and Coriolis",
            &dynamics.coriolis,
            forces(),
        ),
        (
            "gravity",
            "g: generalised forces of gravity",
            &dynamics.gravity,
            forces(),
        ),
        (
            "effects",
            "e: generalised forces of the effects at zero acceleration, such as friction and springs",
            &dynamics.effects,
            forces(),
        ),
        (
            "bias",
            "c + g + e: generalised forces at zero acceleration",
            &dynamics.bias,
            forces(),
        ),
    ];
    // None of its terms reads accelerations.
    all.extend(equation.map(|(name, doc, program, parts)| WrappedFunction {
        name,
        owner: "equation",
        method: name,
        doc,
        reads_accelerations: false,
        takes_forces: false,
        follows: follows(program),
        parts,
    }));
    // Forward dynamics needs two programs, so it follows the loops if one of them does.
    all.push(WrappedFunction {
        name: "forward",
        owner: "equation",
        method: "forward",
        doc: "Forward dynamics: accelerations of the coordinates under given forces of the drives, N or N m",
        reads_accelerations: false,
        takes_forces: true,
        follows: follows(&dynamics.mass_matrix) || follows(&dynamics.bias),
        parts: vec![ResultPart::new("accelerations", &[active])],
    });
    all
}
