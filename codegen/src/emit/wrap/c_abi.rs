//! A crate that makes a C library of a model: a static library, a shared one, and the header for both.

use std::fmt::Write as _;

use proc_macro2::TokenStream;
use quote::{format_ident, quote};

use modelmill_boundary::text::comment;

use super::{Face, source};
use crate::Derivation;
use crate::emit::language::EmittedFile;
use crate::emit::language::c99::RESERVED;

/// What a function returns, with its name in the header after the prefix, and its meaning.
const STATUS: [(&str, &str); 8] = [
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
];

/// The files of the crate. It needs `modelmill-runtime` in the folder `modelmill-runtime` beside its manifest.
pub fn emit_c(derivation: &Derivation) -> Vec<EmittedFile> {
    let face = Face::new(derivation, &RESERVED);
    let doc = "The model for C: see the header in `include`. All `unsafe` code is here, and all of it reads and writes what the \
               caller's pointers point to.";
    vec![
        manifest(&face),
        source("src/lib.rs", doc, &items(&face)),
        face.module(),
        EmittedFile {
            path: format!("include/{}.h", face.name),
            text: header(&face),
        },
    ]
}

fn manifest(face: &Face<'_>) -> EmittedFile {
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
fn words(face: &Face<'_>) -> usize {
    let programs = &face.derivation.programs;
    let mut all = vec![
        &programs.regressor,
        &programs.drives,
        &programs.passive,
        &programs.inverse_dynamics,
    ];
    if let crate::programs::PassivePosition::Newton(loops) = &programs.passive_position {
        all.extend([&loops.residual, &loops.scales]);
    }
    // The inverse dynamics may hold the model once more.
    let fixed: usize = all.iter().map(|p| p.ops.len().min(fixed_values(p))).sum();
    let geometry = face.constants().len();
    2 * (fixed + face.n_passive()) + 3 * geometry + face.n_base() + 32
}

fn fixed_values(program: &crate::Program) -> usize {
    let fixed = program.stages.iter();
    fixed.filter(|stage| **stage == crate::Stage::Fixed).count()
}

#[allow(clippy::too_many_lines, reason = "one text from top to bottom")]
fn items(face: &Face<'_>) -> TokenStream {
    let function = |name: &str| format_ident!("{}_{name}", face.name);
    let (dynamics, words) = (function("dynamics"), words(face));
    let (n_base, n_drives) = (face.n_base(), face.n_drives());
    let (constants, parameters) = (face.constants(), face.parameters());
    let (n_constants, n_parameters) = (constants.len(), parameters.len());
    let records = [
        Face::record("geometry", "Geometry", &constants),
        Face::record("parameters", "Parameters", &parameters),
    ];
    let parts = face.state();
    let names: Vec<_> = parts.iter().map(|(name, _)| name).collect();
    let state_arguments = quote! { #(#names: *const f64),* };
    let one = {
        let sizes = parts.iter().map(|(_, n)| n);
        quote! {
            let (#(Some(#names)),*) = (#(unsafe { array::<#sizes>(#names) }),*) else {
                return NULL_POINTER;
            };
            let state = model::State { #(#names: *#names),* };
        }
    };
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
        let Some(prepared) = (unsafe { prepared(dynamics) }) else {
            return NOT_PREPARED;
        };
    };
    let single = |name: &str, owner: &str, method: &str, output: TokenStream| {
        let (name, owner, method) = (
            function(name),
            format_ident!("{owner}"),
            format_ident!("{method}"),
        );
        quote! {
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn #name(dynamics: *const #dynamics, #state_arguments, output: *mut f64) -> i32 {
                #prepared
                #one
                let Some(output) = (unsafe { output.cast::<#output>().as_mut() }) else {
                    return NULL_POINTER;
                };
                match prepared.#owner.#method(&state) {
                    Ok(found) => {
                        *output = found;
                        OK
                    }
                    Err(error) => status(error),
                }
            }
        }
    };
    let forces = single(
        "inverse_dynamics",
        "dynamics",
        "forces",
        quote! { [f64; #n_drives] },
    );
    let n_entries = n_drives * n_base;
    let regressor = single(
        "regressor",
        "model",
        "regressor",
        quote! { [[f64; #n_base]; #n_drives] },
    );
    let near = face.newton.then(|| {
        let (name, n) = (function("inverse_dynamics_near"), face.n_passive());
        quote! {
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn #name(
                dynamics: *const #dynamics, #state_arguments, passive: *mut f64, output: *mut f64,
            ) -> i32 {
                #prepared
                #one
                let (Some(passive), Some(output)) =
                    (unsafe { (array_mut::<#n>(passive), array_mut::<#n_drives>(output)) })
                else {
                    return NULL_POINTER;
                };
                match prepared.dynamics.forces_near(&state, passive) {
                    Ok(found) => {
                        *output = found;
                        OK
                    }
                    Err(error) => status(error),
                }
            }
        }
    });
    let nominal_passive = face.newton.then(|| {
        let (name, n, n_active) = (function("passive_position"), face.n_passive(), face.n_active());
        quote! {
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn #name(dynamics: *const #dynamics, q: *const f64, output: *mut f64) -> i32 {
                #prepared
                let (Some(q), Some(output)) = (unsafe { (array::<#n_active>(q), array_mut::<#n>(output)) }) else {
                    return NULL_POINTER;
                };
                match prepared.model.passive_position(q) {
                    Ok(found) => {
                        *output = found;
                        OK
                    }
                    Err(error) => status(error),
                }
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

        struct Prepared {
            model: model::Model<f64>,
            dynamics: model::InverseDynamics<f64>,
        }

        const _: () = assert!(core::mem::size_of::<Prepared>() <= #words * 8 && core::mem::align_of::<Prepared>() <= 8);

        #(#records)*

        fn status(error: PoseError) -> i32 {
            match error {
                PoseError::OutOfReach => OUT_OF_REACH,
                PoseError::Singular => SINGULAR,
                PoseError::Undefined => UNDEFINED,
                PoseError::NotFinite(_) => NOT_FINITE,
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

        unsafe fn prepared<'a>(dynamics: *const #dynamics) -> Option<&'a Prepared> {
            let dynamics = unsafe { dynamics.as_ref() }?;
            (dynamics.ready == READY).then(|| unsafe { &*dynamics.room.as_ptr().cast::<Prepared>() })
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
            *base = model::base_parameters(&self::geometry(geometry), &self::parameters(values));
            OK
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
            let prepared = Prepared {
                model: model::Model::new(&geometry),
                dynamics: model::InverseDynamics::new(&geometry, base),
            };
            unsafe {
                (&raw mut (*dynamics).room).cast::<Prepared>().write(prepared);
                (&raw mut (*dynamics).ready).write(READY);
            }
            OK
        }

        #forces
        #regressor
        #nominal_passive
        #near
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

#[allow(clippy::too_many_lines, reason = "one text from top to bottom")]
fn header(face: &Face<'_>) -> String {
    let name = &face.name;
    let upper = name.to_uppercase();
    let mechanism = &face.derivation.mechanism;
    let (active, passive) = face.derivation.coordinates();
    let mut text = String::new();
    let mut line = |s: &str| {
        text.push_str(s);
        text.push('\n');
    };
    let plain = |s: &str| comment(s).into_owned();
    line(&format!(
        "/* {}: {}.",
        name,
        plain(mechanism.title.as_deref().unwrap_or(&mechanism.name))
    ));
    line(" *");
    line(" * Inverse dynamics tau = H_min(q, q', q'') p_min, written by modelmill; do not edit.");
    line(" *");
    line(
        " * Prepare once, then call; nothing allocates, locks or throws, and all of it is reentrant:",
    );
    line(" *");
    let room = |count: &str, n: usize| match n {
        0 => "1".to_owned(),
        _ => format!("{upper}_N_{count}"),
    };
    line(&format!(
        " *     double geometry[{}], parameters[{}], base[{}];",
        room("CONSTANTS", mechanism.constants.len()),
        room("PARAMETERS", mechanism.parameters.len()),
        room("BASE", face.n_base()),
    ));
    line(&format!(" *     {name}_dynamics dynamics;"));
    line(&format!(" *     {name}_default_geometry(geometry);"));
    line(&format!(" *     {name}_nominal_parameters(parameters);"));
    line(&format!(
        " *     {name}_base_parameters(geometry, parameters, base);"
    ));
    line(&format!(
        " *     {name}_prepare(&dynamics, geometry, base);"
    ));
    line(" *");
    line(
        " * SI units. Pointers must be aligned and point to as many numbers as the declaration says; arrays that are read and",
    );
    line(
        " * written must not overlap. Functions return a status; results are only written when it is OK. */",
    );
    line(&format!(
        "#ifndef {upper}_H\n#define {upper}_H\n\n#include <stddef.h>\n#include <stdint.h>\n"
    ));
    for (what, n) in [
        ("ACTIVE", face.n_active()),
        ("PASSIVE", face.n_passive()),
        ("DRIVES", face.n_drives()),
        ("BASE", face.n_base()),
        ("CONSTANTS", face.constants().len()),
        ("PARAMETERS", face.parameters().len()),
    ] {
        line(&format!("#define {upper}_N_{what} {n}"));
    }
    line("\n/* What functions return. */");
    for (k, (status, meaning)) in STATUS.iter().enumerate() {
        line(&format!("#define {upper}_{status} {k} /* {meaning} */"));
    }
    let mut places = |what: &str, prefix: &str, names: &mut dyn Iterator<Item = String>| {
        line(&format!("\n/* {what}, in order. */"));
        for (k, name) in names.enumerate() {
            line(&format!("#define {upper}_{prefix}_{name} {k}"));
        }
    };
    let identifier = |s: &str| {
        crate::emit::identifier::of_field(s)
            .to_string()
            .trim_start_matches("r#")
            .to_owned()
    };
    let coordinate = |i: &usize| identifier(&mechanism.coordinates[*i].name);
    places(
        "Coordinates",
        "COORDINATE",
        &mut active.iter().map(coordinate),
    );
    if face.newton {
        places(
            "Passive coordinates",
            "PASSIVE",
            &mut passive.iter().map(coordinate),
        );
    }
    places(
        "Drives",
        "DRIVE",
        &mut mechanism.drives.iter().map(|d| identifier(&d.name)),
    );
    places(
        "Known quantities",
        "CONSTANT",
        &mut mechanism.constants.iter().map(|c| identifier(&c.name)),
    );
    places(
        "Dynamic parameters",
        "PARAMETER",
        &mut mechanism.parameters.iter().map(|p| identifier(&p.name)),
    );
    line("\n/* Base parameters, in order:");
    for base in face.derivation.base_parameters() {
        line(&plain(&format!(
            " * {} = {} ({})",
            base.name,
            base.expression,
            comment(&base.unit)
        )));
    }
    line(" */\n\n#ifdef __cplusplus\nextern \"C\" {\n#endif\n");
    line("/* A prepared model. Its content is its own. */");
    line(&format!(
        "typedef struct {name}_dynamics {{\n  uint64_t ready;\n  uint64_t room[{}];\n}} {name}_dynamics;\n",
        words(face)
    ));
    let state: String = face.state().iter().fold(String::new(), |mut s, (part, n)| {
        _ = write!(s, "const double {part}[{n}], ");
        s
    });
    let states: String = face.state().iter().fold(String::new(), |mut s, (part, _)| {
        _ = write!(s, "const double *{part}, ");
        s
    });
    // An array of nothing is no C.
    let array = |what: &str, count: &str| {
        let n = match count {
            "CONSTANTS" => mechanism.constants.len(),
            "PARAMETERS" => mechanism.parameters.len(),
            _ => face.n_base(),
        };
        if n == 0 {
            format!("*{what}")
        } else {
            format!("{what}[{upper}_N_{count}]")
        }
    };
    line("/* The model file's values. */");
    line(&format!(
        "int32_t {name}_default_geometry(double {});",
        array("geometry", "CONSTANTS")
    ));
    line(&format!(
        "int32_t {name}_nominal_parameters(double {});",
        array("parameters", "PARAMETERS")
    ));
    line("\n/* Base parameters of physical ones. */");
    line(&format!(
        "int32_t {name}_base_parameters(const double *geometry, const double *parameters, double {});",
        array("base", "BASE")
    ));
    line("\n/* Computes what depends on geometry and base parameters alone. */");
    line(&format!(
        "int32_t {name}_prepare({name}_dynamics *dynamics, const double *geometry, const double {});",
        array("base", "BASE")
    ));
    line("\n/* Forces of the drives, N or N m. */");
    line(&format!(
        "int32_t {name}_inverse_dynamics(const {name}_dynamics *dynamics, {state}double forces[{upper}_N_DRIVES]);"
    ));
    line("\n/* H_min row by row: one row per drive, one column per base parameter. */");
    line(&format!(
        "int32_t {name}_regressor(const {name}_dynamics *dynamics, {state}double {});",
        match face.n_drives() * face.n_base() {
            0 => "*regressor".to_owned(),
            n => format!("regressor[{n}]"),
        }
    ));
    if face.newton {
        line("\n/* Passive coordinates of a pose, followed from the nominal pose. */");
        line(&format!(
            "int32_t {name}_passive_position(const {name}_dynamics *dynamics, const double q[{upper}_N_ACTIVE], double passive[{upper}_N_PASSIVE]);"
        ));
        line(
            "\n/* Forces, with the passive coordinates of a pose near by, such as the last cycle's; they become those of this state. */",
        );
        line(&format!(
            "int32_t {name}_inverse_dynamics_near(const {name}_dynamics *dynamics, {state}double passive[{upper}_N_PASSIVE], double forces[{upper}_N_DRIVES]);"
        ));
    }
    line(
        "\n/* The same for n states at once, in the widest vectors of the machine. Number i of coordinate k stands at k * n + i, and",
    );
    line(
        " * so do results (the regressor's entries row by row). Where a state has no answer, its number goes to `failed`, which may",
    );
    line(" * be NULL, and all results before it are in place. */");
    line(&format!(
        "int32_t {name}_inverse_dynamics_many(const {name}_dynamics *dynamics, size_t n, {states}double *forces, size_t *failed);"
    ));
    line(&format!(
        "int32_t {name}_regressor_many(const {name}_dynamics *dynamics, size_t n, {states}double *regressor, size_t *failed);"
    ));
    line("\n#ifdef __cplusplus\n}\n#endif\n\n#endif");
    text
}
