//! A crate that makes a C library of a model: a static library, a shared one, and the header for both.

use proc_macro2::TokenStream;
use quote::{format_ident, quote};

use super::c_header::header;
use super::functions::{WrappedFunction, wrapped_functions};
use super::{LanguageBinding, source_file};
use crate::language::c99::RESERVED;
use crate::language::{EmissionRequest, EmittedFile};

/// What a function returns, with its name in the header after the prefix, and its meaning.
pub(super) const STATUS: [(&str, &str); 9] = [
    ("OK", "all is well"),
    (
        "OUT_OF_REACH",
        "the loops cannot close: the pose is out of reach",
    ),
    ("SINGULAR", "the pose is singular"),
    ("UNDEFINED", "a term of the model has no finite value there"),
    (
        "NOT_FINITE",
        "an input is no number, or too large to compute with",
    ),
    (
        "NOT_PREPARED",
        "the structure was not filled by the function that prepares it",
    ),
    ("NULL_POINTER", "an argument is a null pointer"),
    ("LENGTH", "arrays of different lengths"),
    (
        "SPECIAL",
        "base parameters divide by what vanishes for this geometry",
    ),
];

/// The files of the crate, without reactions and self-test. It needs `modelmill-runtime` in the folder `modelmill-runtime`
/// beside its manifest.
pub(crate) fn emit_c(from: &EmissionRequest<'_>) -> Vec<EmittedFile> {
    let face = LanguageBinding::new(from, &RESERVED);
    let doc = "The model for C: see the header in `include`. All `unsafe` code is here, and all of it reads and writes what the \
               caller's pointers point to.";
    vec![
        manifest(&face),
        source_file("src/lib.rs", doc, &items(&face)),
        face.emitted_module(),
        EmittedFile {
            path: format!("include/{}.h", face.name),
            text: header(&face),
        },
    ]
}

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

/// 64-bit words that surely hold a prepared model: every fixed value, and what errors and passive coordinates take.
pub(super) fn storage_words(face: &LanguageBinding<'_>) -> usize {
    let programs = &face.derivation.programs;
    let mut all = vec![
        &programs.regressor,
        &programs.drives,
        &programs.passive,
        &programs.inverse_dynamics,
    ];
    if let modelmill_codegen::PassivePosition::Newton(loops) = &programs.passive_position {
        all.extend([&loops.residual, &loops.scales]);
    }
    if let Some(d) = face.dynamics {
        all.extend([&d.mass_matrix, &d.coriolis, &d.gravity, &d.effects, &d.bias]);
    }
    let fixed: usize = all.iter().map(|p| p.ops.len().min(fixed_values(p))).sum();
    // Inverse dynamics and equation of motion may hold the model once more each.
    let parts = 2 + usize::from(face.dynamics.is_some());
    let geometry = 2 * face.constants().len();
    parts * (fixed + face.n_passive() + geometry + face.n_base() + 16)
}

fn fixed_values(program: &modelmill_codegen::StraightLineProgram) -> usize {
    let fixed = program.stages.iter();
    fixed
        .filter(|stage| **stage == modelmill_codegen::ProgramStage::Fixed)
        .count()
}

#[allow(clippy::too_many_lines, reason = "one text from top to bottom")]
fn items(face: &LanguageBinding<'_>) -> TokenStream {
    let function = |name: &str| format_ident!("{}_{name}", face.name);
    let (dynamics, words) = (function("dynamics"), storage_words(face));
    let (n_base, n_drives) = (face.n_base(), face.n_drives());
    let (constants, parameters) = (face.constants(), face.parameters());
    let (n_constants, n_parameters) = (constants.len(), parameters.len());
    let records = [
        LanguageBinding::record_functions("geometry", "Geometry", &constants),
        LanguageBinding::record_functions("parameters", "Parameters", &parameters),
    ];
    let parts = face.state_parts();
    let names: Vec<_> = parts.iter().map(|(name, _)| name).collect();
    let state_arguments = quote! { #(#names: *const f64),* };
    let many = {
        let sizes = parts.iter().map(|(_, n)| n);
        quote! {
            if #(#names.is_null())||* || (n > 0 && outputs.is_null()) {
                return NULL_POINTER;
            }
            let states = model::States { #(#names: unsafe { columns::<#sizes>(#names, n) }),* };
        }
    };
    let prepared = quote! {
        let Some(prepared) = (unsafe { prepared_model(dynamics) }) else {
            return NOT_PREPARED;
        };
    };
    let singles: Vec<TokenStream> = wrapped_functions(face)
        .iter()
        .flat_map(|one| {
            let near = one.follows.then(|| single_state_function(face, one, true));
            [Some(single_state_function(face, one, false)), near]
        })
        .flatten()
        .collect();
    let n_entries = n_drives * n_base;
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
    let [forces_many, regressor_many] = [
        (function("inverse_dynamics_many"), quote! {
            prepared.dynamics.forces_of_many(&states, &mut unsafe { columns_mut::<#n_drives>(outputs, n) })
        }),
        (function("regressor_many"), quote! {
            match unsafe { all_mut(outputs, n, #n_entries) } {
                Some(outputs) => prepared.model.regressor_of_many(&states, outputs),
                None => return LENGTH,
            }
        }),
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
    let [
        default_geometry,
        nominal_parameters,
        base_parameters,
        prepare,
    ] = [
        "default_geometry",
        "nominal_parameters",
        "base_parameters",
        "prepare",
    ]
    .map(function);
    let equation_field = face
        .dynamics
        .map(|_| quote! { equation: model::Dynamics<f64>, });
    let equation_init = face
        .dynamics
        .map(|_| quote! { equation: model::Dynamics::new(&geometry, base), });
    let status_constants = STATUS.iter().enumerate().map(|(k, (name, _))| {
        let (name, k) = (format_ident!("{name}"), i32::try_from(k).unwrap_or(0));
        quote! { const #name: i32 = #k; }
    });
    quote! {
        #![cfg_attr(not(feature = "std"), no_std)]
        #![allow(non_camel_case_types, clippy::missing_safety_doc, reason = "the header says what pointers must point to")]

        pub mod model;

        use modelmill_runtime::PoseError;
        use modelmill_runtime::blocks::BlockError;

        #(#status_constants)*

        /// What a prepared structure begins with.
        const READY: u64 = 0x6d6f_6465_6c6d_696c;

        /// Room for a prepared model, as the header declares it.
        #[repr(C)]
        pub struct #dynamics {
            ready: u64,
            room: [u64; #words],
        }

        struct PreparedModel {
            model: model::Model<f64>,
            dynamics: model::InverseDynamics<f64>,
            #equation_field
        }

        const _: () = assert!(core::mem::size_of::<PreparedModel>() <= #words * 8 && core::mem::align_of::<PreparedModel>() <= 8);

        #(#records)*

        fn status(error: PoseError) -> i32 {
            match error {
                PoseError::OutOfReach => OUT_OF_REACH,
                PoseError::Singular => SINGULAR,
                PoseError::Undefined => UNDEFINED,
                PoseError::NotFinite(_) => NOT_FINITE,
            }
        }

        fn answer<T>(found: Result<T, PoseError>, write: impl FnOnce(T)) -> i32 {
            match found {
                Ok(found) => {
                    write(found);
                    OK
                }
                Err(error) => status(error),
            }
        }

        unsafe fn array<'a, const N: usize>(from: *const f64) -> Option<&'a [f64; N]> {
            // Of nothing nothing is read, whatever the pointer is.
            let from = if N == 0 { core::ptr::NonNull::<[f64; N]>::dangling().as_ptr().cast_const() } else { from.cast() };
            unsafe { from.as_ref() }
        }

        unsafe fn array_mut<'a, const N: usize>(to: *mut f64) -> Option<&'a mut [f64; N]> {
            let to = if N == 0 { core::ptr::NonNull::<[f64; N]>::dangling().as_ptr() } else { to.cast() };
            unsafe { to.as_mut() }
        }

        unsafe fn columns<'a, const N: usize>(from: *const f64, n: usize) -> [&'a [f64]; N] {
            core::array::from_fn(|k| unsafe { core::slice::from_raw_parts(from.wrapping_add(k * n), n) })
        }

        unsafe fn columns_mut<'a, const N: usize>(to: *mut f64, n: usize) -> [&'a mut [f64]; N] {
            core::array::from_fn(|k| {
                if n == 0 {
                    <&mut [f64]>::default()
                } else {
                    unsafe { core::slice::from_raw_parts_mut(to.wrapping_add(k * n), n) }
                }
            })
        }

        unsafe fn all_mut<'a>(to: *mut f64, n: usize, columns: usize) -> Option<&'a mut [f64]> {
            if n == 0 {
                return Some(Default::default());
            }
            Some(unsafe { core::slice::from_raw_parts_mut(to, n.checked_mul(columns)?) })
        }

        unsafe fn prepared_model<'a>(dynamics: *const #dynamics) -> Option<&'a PreparedModel> {
            let dynamics = unsafe { dynamics.as_ref() }?;
            (dynamics.ready == READY).then(|| unsafe { &*dynamics.room.as_ptr().cast::<PreparedModel>() })
        }

        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn #default_geometry(geometry: *mut f64) -> i32 {
            let Some(geometry) = (unsafe { array_mut::<#n_constants>(geometry) }) else {
                return NULL_POINTER;
            };
            *geometry = geometry_values();
            OK
        }

        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn #nominal_parameters(parameters: *mut f64) -> i32 {
            let Some(parameters) = (unsafe { array_mut::<#n_parameters>(parameters) }) else {
                return NULL_POINTER;
            };
            *parameters = parameters_values();
            OK
        }

        #[unsafe(no_mangle)]
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
                (&raw mut (*dynamics).room).cast::<PreparedModel>().write(prepared);
                (&raw mut (*dynamics).ready).write(READY);
            }
            OK
        }

        #(#singles)*
        #passive_position
        #forces_many
        #regressor_many

        /// Without the standard library somebody has to say what a panic does. None of the code above can.
        #[cfg(not(feature = "std"))]
        #[panic_handler]
        fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
            loop {}
        }
    }
}

/// A function of one state; one that is `near` takes passive coordinates of a pose near by.
fn single_state_function(
    face: &LanguageBinding<'_>,
    one: &WrappedFunction,
    near: bool,
) -> TokenStream {
    let suffix = if near { "_near" } else { "" };
    let name = format_ident!("{}_{}{suffix}", face.name, one.name);
    let dynamics = format_ident!("{}_dynamics", face.name);
    let (owner, method) = (
        format_ident!("{}", one.owner),
        format_ident!("{}{suffix}", one.method),
    );
    let state = face.state_parts();
    let given = one
        .takes_forces
        .then(|| (format_ident!("forces"), face.n_drives()));
    let inputs: Vec<_> = state.iter().chain(&given).collect();
    let (names, sizes): (Vec<_>, Vec<usize>) = inputs.iter().map(|(name, n)| (name, *n)).unzip();
    let fields = state.iter().map(|(name, _)| name);
    let forces = one.takes_forces.then(|| quote! { , forces });
    let n_passive = face.n_passive();
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
    let mut at = 0;
    let writes = one.parts.iter().map(|part| {
        let value = one.part_tokens(part);
        let kind = part
            .shape
            .iter()
            .rev()
            .fold(quote! { f64 }, |inner, count| {
                let n = count.n;
                quote! { [#inner; #n] }
            });
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
