//! Output: manifest, `src/lib.rs` with the `extern "C"` functions, the emitted module, and the header.
//! A crate that makes a C library of a model: a static library, a shared one, and the header for both.

use proc_macro2::TokenStream;
use quote::{format_ident, quote};

use super::c_header::header;
use super::functions::{WrappedFunction, wrapped_functions};
use super::{LanguageBinding, seal_files, source_file};
use crate::language::c99::RESERVED;
use crate::language::{EmissionRequest, EmittedFile};

/// Status codes in the order of their values: name in the header after the prefix, and meaning.
pub(super) const STATUS: [(&str, &str); 9] = [
    ("OK", "no error"),
    ("OUT_OF_REACH", "the loops cannot close: the pose is out of reach"),
    ("SINGULAR", "the pose is singular"),
    ("UNDEFINED", "a term of the model has no finite value at this state"),
    ("NOT_FINITE", "an input is NaN, infinite, or above 1e60"),
    ("NOT_PREPARED", "the structure was not filled by the function `prepare`"),
    ("NULL_POINTER", "an argument is a null pointer"),
    ("LENGTH", "arrays of different lengths"),
    (
        "SPECIAL",
        "a denominator of the base parameters is zero for this geometry",
    ),
];

/// The files of the crate, without reactions and self-test. The caller copies `modelmill-runtime` into the folder of
/// that name next to the manifest.
pub(crate) fn emit_c(from: &EmissionRequest<'_>) -> Vec<EmittedFile> {
    // The library is named after the model.
    let face = LanguageBinding::new(from, &RESERVED);
    let doc = "The model for C: see the header in `include`. All `unsafe` code is here. It only reads and writes the memory that \
               the caller's pointers point to.";
    seal_files(vec![
        manifest(&face),
        source_file("src/lib.rs", doc, &items(&face)),
        face.emitted_module(),
        EmittedFile {
            path: format!("include/{}.h", face.name),
            text: header(&face),
        },
    ])
}

/// `Cargo.toml` of the crate. A panic aborts, because unwinding must not reach C.
fn manifest(face: &LanguageBinding<'_>) -> EmittedFile {
    let name = &face.name;
    let package = name.trim_start_matches('_');
    let text = format!(
        "# Written by modelmill.
#
#     cargo build --release                         target/release/lib{name}.a and lib{name}.so, vectors chosen at run time
#     cargo build --release --no-default-features   the same without the standard library, for one state at a time
[package]
name = \"model-{package}\"
version = \"0.1.0\"
edition = \"2024\"
publish = false

[lib]
name = \"{name}\"
crate-type = [\"staticlib\", \"cdylib\"]

[features]
default = [\"std\"]
std = [\"modelmill-runtime/std\"]

[dependencies]
modelmill-runtime = {{ path = \"modelmill-runtime\" }}

[profile.release]
panic = \"abort\"
lto = \"fat\"
codegen-units = 1

[workspace]
"
    );
    EmittedFile {
        path: "Cargo.toml".to_owned(),
        text,
    }
}

/// Number of 64-bit words that is at least the size of a prepared model: fixed values, passive coordinates, constants,
/// base parameters. The emitted crate checks it at compile time.
pub(super) fn storage_words(face: &LanguageBinding<'_>) -> usize {
    let programs = &face.derivation.programs;
    let mut all = vec![
        &programs.regressor,
        &programs.drives,
        &programs.passive,
        &programs.inverse_dynamics,
    ];
    // Loops without closed form store the solution at the nominal pose.
    if let modelmill_codegen::PassivePosition::Newton(loops) = &programs.passive_position {
        all.extend([&loops.residual, &loops.scales]);
    }
    // The equation of motion is a struct of its own.
    if let Some(d) = face.dynamics {
        all.extend([&d.mass_matrix, &d.coriolis, &d.gravity, &d.effects, &d.bias]);
    }
    // A program stores at most its fixed values.
    let fixed: usize = all.iter().map(|p| p.ops.len().min(fixed_values(p))).sum();
    // The model itself, and once more in the inverse dynamics and in the equation of motion.
    let parts = 2 + usize::from(face.dynamics.is_some());
    // Constants are stored by the model and by the shared pose.
    let geometry = 2 * face.constants().len();
    parts * (fixed + face.n_passive() + geometry + face.n_base() + 16)
}

/// Number of values of a program that do not depend on the state.
fn fixed_values(program: &modelmill_codegen::StraightLineProgram) -> usize {
    let fixed = program.stages.iter();
    fixed
        .filter(|stage| **stage == modelmill_codegen::ProgramStage::Fixed)
        .count()
}

/// The items of `src/lib.rs`: structs, conversions of pointers, and the exported functions.
#[allow(clippy::too_many_lines, reason = "one text from top to bottom")]
fn items(face: &LanguageBinding<'_>) -> TokenStream {
    // Exported names begin with the name of the library.
    let function = |name: &str| format_ident!("{}_{name}", face.name);
    let (dynamics, words) = (function("dynamics"), storage_words(face));
    let (n_base, n_drives) = (face.n_base(), face.n_drives());
    let (constants, parameters) = (face.constants(), face.parameters());
    let (n_constants, n_parameters) = (constants.len(), parameters.len());
    // Conversions between the arrays of C and the structs of the module.
    let records = [
        LanguageBinding::record_functions("geometry", "Geometry", &constants),
        LanguageBinding::record_functions("parameters", "Parameters", &parameters),
    ];
    let parts = face.state_parts();
    let names: Vec<_> = parts.iter().map(|(name, _)| name).collect();
    let state_arguments = quote! { #(#names: *const f64),* };
    // Arguments of functions of many states: one pointer per part of the state, to columns of `n` numbers.
    let many = {
        let sizes = parts.iter().map(|(_, n)| n);
        quote! {
            if #(#names.is_null())||* || (n > 0 && outputs.is_null()) {
                return NULL_POINTER;
            }
            let states = model::States { #(#names: unsafe { columns::<#sizes>(#names, n) }),* };
        }
    };
    // Every function first checks that the structure is prepared.
    let prepared = quote! {
        let Some(prepared) = (unsafe { prepared_model(dynamics) }) else {
            return NOT_PREPARED;
        };
    };
    // Functions of one state; those that follow the loops have a second form with a guess.
    let singles: Vec<TokenStream> = wrapped_functions(face)
        .iter()
        .flat_map(|one| {
            let near = one.follows.then(|| single_state_function(face, one, true));
            [Some(single_state_function(face, one, false)), near]
        })
        .flatten()
        .collect();
    // Numbers of a regressor.
    let n_entries = n_drives * n_base;
    // Loops without closed form also export the solution for the passive coordinates.
    let passive_position = face.newton.then(|| {
        let [position, near] = ["passive_position", "passive_position_near"].map(function);
        let (n, n_active) = (face.n_passive(), face.n_active());
        quote! {
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn #position(dynamics: *const #dynamics, q: *const f64, passive: *mut f64) -> i32 {
                #prepared
                let (Some(q), Some(passive)) = (unsafe { (array::<#n_active>(q), array_mut::<#n>(passive)) }) else {
                    return NULL_POINTER;
                };
                answer(prepared.model.passive_position(q), |found| *passive = found)
            }

            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn #near(dynamics: *const #dynamics, q: *const f64, passive: *mut f64) -> i32 {
                #prepared
                let (Some(q), Some(passive)) = (unsafe { (array::<#n_active>(q), array_mut::<#n>(passive)) }) else {
                    return NULL_POINTER;
                };
                answer(prepared.model.passive_position_near(q, passive), |found| *passive = found)
            }
        }
    });
    // Forces and regressor of many states, which the runtime computes in vectors.
    let [forces_many, regressor_many] = [
        (
            function("inverse_dynamics_many"),
            quote! {
                prepared.dynamics.forces_of_many(&states, &mut unsafe { columns_mut::<#n_drives>(outputs, n) })
            },
        ),
        (
            function("regressor_many"),
            quote! {
                match unsafe { all_mut(outputs, n, #n_entries) } {
                    Some(outputs) => prepared.model.regressor_of_many(&states, outputs),
                    None => return LENGTH,
                }
            },
        ),
    ]
    .map(|(name, call)| {
        quote! {
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn #name(
                dynamics: *const #dynamics, n: usize, #state_arguments, outputs: *mut f64, failed: *mut usize,
            ) -> i32 {
                #prepared
                #many
                match #call {
                    Ok(()) => OK,
                    Err(BlockError::At { sample, reason }) => {
                        if let Some(failed) = unsafe { failed.as_mut() } {
                            *failed = sample;
                        }
                        status(reason)
                    }
                    Err(BlockError::Length { .. }) => LENGTH,
                }
            }
        }
    });
    // Names of the exported functions for preparation.
    let [default_geometry, nominal_parameters, base_parameters, prepare] =
        ["default_geometry", "nominal_parameters", "base_parameters", "prepare"].map(function);
    // The equation of motion is prepared only if it is part of the module.
    let equation_field = face.dynamics.map(|_| quote! { equation: model::Dynamics<f64>, });
    let equation_init = face
        .dynamics
        .map(|_| quote! { equation: model::Dynamics::new(&geometry, base), });
    // Status codes as constants of the crate.
    let status_constants = STATUS.iter().enumerate().map(|(k, (name, _))| {
        let (name, k) = (format_ident!("{name}"), i32::try_from(k).unwrap_or(0));
        quote! { const #name: i32 = #k; }
    });
    quote! {
        #![cfg_attr(not(feature = "std"), no_std)]
        #![allow(non_camel_case_types, clippy::missing_safety_doc, reason = "the header states what pointers must point to")]

        pub mod model;

        use modelmill_runtime::PoseError;
        use modelmill_runtime::blocks::BlockError;

        #(#status_constants)*

        /// First word of a prepared structure.
        const READY: u64 = 0x6d6f_6465_6c6d_696c;

        /// Memory for a prepared model, as the header declares it.
        #[repr(C)]
        pub struct #dynamics {
            ready: u64,
            room: [u64; #words],
        }

        // What the storage contains; C knows only its size.
        struct PreparedModel {
            model: model::Model<f64>,
            dynamics: model::InverseDynamics<f64>,
            #equation_field
        }

        // The size was estimated when this file was written, so the compiler checks it.
        const _: () = assert!(core::mem::size_of::<PreparedModel>() <= #words * 8 && core::mem::align_of::<PreparedModel>() <= 8);

        #(#records)*

        // The status of a pose without a solution.
        fn status(error: PoseError) -> i32 {
            match error {
                PoseError::OutOfReach => OUT_OF_REACH,
                PoseError::Singular => SINGULAR,
                PoseError::Undefined => UNDEFINED,
                PoseError::NotFinite(_) => NOT_FINITE,
            }
        }

        // Writes a result and returns OK, or returns the status of the error.
        fn answer<T>(found: Result<T, PoseError>, write: impl FnOnce(T)) -> i32 {
            match found {
                Ok(found) => {
                    write(found);
                    OK
                }
                Err(error) => status(error),
            }
        }

        // The array behind a pointer; `None` for a null pointer.
        unsafe fn array<'a, const N: usize>(from: *const f64) -> Option<&'a [f64; N]> {
            // Nothing is read of an array of length zero, so any pointer is allowed for it.
            let from = if N == 0 { core::ptr::NonNull::<[f64; N]>::dangling().as_ptr().cast_const() } else { from.cast() };
            unsafe { from.as_ref() }
        }

        // The same for an array that is written.
        unsafe fn array_mut<'a, const N: usize>(to: *mut f64) -> Option<&'a mut [f64; N]> {
            let to = if N == 0 { core::ptr::NonNull::<[f64; N]>::dangling().as_ptr() } else { to.cast() };
            unsafe { to.as_mut() }
        }

        // Columns of `n` numbers that follow each other in memory.
        unsafe fn columns<'a, const N: usize>(from: *const f64, n: usize) -> [&'a [f64]; N] {
            core::array::from_fn(|k| unsafe { core::slice::from_raw_parts(from.wrapping_add(k * n), n) })
        }

        // The same for columns that are written; without states nothing is borrowed.
        unsafe fn columns_mut<'a, const N: usize>(to: *mut f64, n: usize) -> [&'a mut [f64]; N] {
            core::array::from_fn(|k| {
                if n == 0 {
                    <&mut [f64]>::default()
                } else {
                    unsafe { core::slice::from_raw_parts_mut(to.wrapping_add(k * n), n) }
                }
            })
        }

        // All numbers of a result; `None` if their count overflows.
        unsafe fn all_mut<'a>(to: *mut f64, n: usize, columns: usize) -> Option<&'a mut [f64]> {
            if n == 0 {
                return Some(Default::default());
            }
            Some(unsafe { core::slice::from_raw_parts_mut(to, n.checked_mul(columns)?) })
        }

        // The prepared model, if the structure was filled.
        unsafe fn prepared_model<'a>(dynamics: *const #dynamics) -> Option<&'a PreparedModel> {
            let dynamics = unsafe { dynamics.as_ref() }?;
            (dynamics.ready == READY).then(|| unsafe { &*dynamics.room.as_ptr().cast::<PreparedModel>() })
        }

        #[unsafe(no_mangle)]
        // Fills the array with the constants of the model file.
        pub unsafe extern "C" fn #default_geometry(geometry: *mut f64) -> i32 {
            let Some(geometry) = (unsafe { array_mut::<#n_constants>(geometry) }) else {
                return NULL_POINTER;
            };
            *geometry = geometry_values();
            OK
        }

        #[unsafe(no_mangle)]
        // Fills the array with the nominal parameters of the model file.
        pub unsafe extern "C" fn #nominal_parameters(parameters: *mut f64) -> i32 {
            let Some(parameters) = (unsafe { array_mut::<#n_parameters>(parameters) }) else {
                return NULL_POINTER;
            };
            *parameters = parameters_values();
            OK
        }

        #[unsafe(no_mangle)]
        // Base parameters from physical parameters, eq. (16).
        pub unsafe extern "C" fn #base_parameters(
            geometry: *const f64, parameters: *const f64, base: *mut f64,
        ) -> i32 {
            let (Some(geometry), Some(values), Some(base)) = (unsafe {
                (array::<#n_constants>(geometry), array::<#n_parameters>(parameters), array_mut::<#n_base>(base))
            }) else {
                return NULL_POINTER;
            };
            match model::base_parameters(&self::geometry(geometry), &self::parameters(values)) {
                Ok(found) => {
                    *base = found;
                    OK
                }
                Err(_) => SPECIAL,
            }
        }

        #[unsafe(no_mangle)]
        // Computes everything that does not depend on the state.
        pub unsafe extern "C" fn #prepare(
            dynamics: *mut #dynamics, geometry: *const f64, base: *const f64,
        ) -> i32 {
            let (Some(geometry), Some(base)) =
                (unsafe { (array::<#n_constants>(geometry), array::<#n_base>(base)) })
            else {
                return NULL_POINTER;
            };
            if dynamics.is_null() {
                return NULL_POINTER;
            }
            let geometry = self::geometry(geometry);
            let prepared = PreparedModel {
                model: model::Model::new(&geometry),
                dynamics: model::InverseDynamics::new(&geometry, base),
                #equation_init
            };
            unsafe {
                // The first word is written last, so that an incomplete structure is not taken for a prepared one.
                (&raw mut (*dynamics).room).cast::<PreparedModel>().write(prepared);
                (&raw mut (*dynamics).ready).write(READY);
            }
            OK
        }

        #(#singles)*
        #passive_position
        #forces_many
        #regressor_many

        /// Without the standard library a panic handler is required. None of the code above can panic.
        #[cfg(not(feature = "std"))]
        #[panic_handler]
        fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
            loop {}
        }
    }
}

/// The exported function of one state. With `near`, it takes the passive coordinates of a nearby pose and replaces
/// them.
fn single_state_function(face: &LanguageBinding<'_>, one: &WrappedFunction, near: bool) -> TokenStream {
    // Names as in the emitted module.
    let suffix = if near { "_near" } else { "" };
    let name = format_ident!("{}_{}{suffix}", face.name, one.name);
    let dynamics = format_ident!("{}_dynamics", face.name);
    let (owner, method) = (format_ident!("{}", one.owner), format_ident!("{}{suffix}", one.method));
    // Arguments: the state, forces if they are read, and passive coordinates.
    let state = face.state_parts();
    let given = one.takes_forces.then(|| (format_ident!("forces"), face.n_drives()));
    // Pointers with the lengths of their arrays.
    let inputs: Vec<_> = state.iter().chain(&given).collect();
    let (names, sizes): (Vec<_>, Vec<usize>) = inputs.iter().map(|(name, n)| (name, *n)).unzip();
    // The state as a struct of the module.
    let fields = state.iter().map(|(name, _)| name);
    let forces = one.takes_forces.then(|| quote! { , forces });
    let n_passive = face.n_passive();
    // The three places where passive coordinates occur: argument, conversion of the pointer, and call.
    let (passive_argument, passive_array, passive) = if near {
        (
            quote! { passive: *mut f64, },
            quote! {
                let Some(passive) = (unsafe { array_mut::<#n_passive>(passive) }) else {
                    return NULL_POINTER;
                };
            },
            quote! { , passive },
        )
    } else {
        Default::default()
    };
    // Results are written one array after the other, each at its offset.
    let mut at = 0;
    let writes = one.parts.iter().map(|part| {
        let value = one.part_tokens(part);
        // The type of an array, with the innermost dimension last.
        let kind = part.shape.iter().rev().fold(quote! { f64 }, |inner, count| {
            let n = count.n;
            quote! { [#inner; #n] }
        });
        // Offset of this array in the output.
        let place = at;
        at += part.n_entries();
        quote! { output.add(#place).cast::<#kind>().write(#value); }
    });
    let writes: Vec<TokenStream> = writes.collect();
    quote! {
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn #name(
            dynamics: *const #dynamics, #(#names: *const f64,)* #passive_argument output: *mut f64,
        ) -> i32 {
            let Some(prepared) = (unsafe { prepared_model(dynamics) }) else {
                return NOT_PREPARED;
            };
            let (#(Some(#names)),*) = (#(unsafe { array::<#sizes>(#names) }),*) else {
                return NULL_POINTER;
            };
            #passive_array
            if output.is_null() {
                return NULL_POINTER;
            }
            let state = model::State { #(#fields: *#fields),* };
            answer(prepared.#owner.#method(&state #forces #passive), |found| unsafe { #(#writes)* })
        }
    }
}
