//! The header of a C library: what the model has, and what is to be had of it.

use std::fmt::Write as _;

use modelmill_boundary::text::comment;

use super::LanguageBinding;
use super::c_abi::{STATUS, storage_words};
use super::functions::{ArrayDimension, WrappedFunction, wrapped_functions};
use crate::identifier::field_identifier;

#[allow(clippy::too_many_lines, reason = "one text from top to bottom")]
pub(super) fn header(face: &LanguageBinding<'_>) -> String {
    let name = &face.name;
    let upper = name.to_uppercase();
    let mechanism = &face.derivation.mechanism;
    let title = comment(mechanism.title.as_deref().unwrap_or(&mechanism.name));
    let count = |name, n| ArrayDimension { name, n };
    let [active, passive, drives, base, constants, parameters] = [
        count("ACTIVE", face.n_active()),
        count("PASSIVE", face.n_passive()),
        count("DRIVES", face.n_drives()),
        count("BASE", face.n_base()),
        count("CONSTANTS", face.constants().len()),
        count("PARAMETERS", face.parameters().len()),
    ];
    let room = |count: &ArrayDimension| match count.n {
        0 => "1".to_owned(),
        _ => format!("{upper}_N_{}", count.name),
    };
    let mut text = format!(
        "/* {name}: {title}.
 *
 * Inverse dynamics tau = H_min(q, q', q'') p_min, written by modelmill; do not edit.
 *
 * Prepare once, then call; nothing allocates, locks or throws, and all of it is reentrant:
 *
 *     double geometry[{}], parameters[{}], base[{}];
 *     {name}_dynamics dynamics;
 *     {name}_default_geometry(geometry);
 *     {name}_nominal_parameters(parameters);
 *     {name}_base_parameters(geometry, parameters, base);
 *     {name}_prepare(&dynamics, geometry, base);
 *
 * SI units. Pointers must be aligned and point to as many numbers as the declaration says; arrays that are read and
 * written must not overlap. Functions return a status; results are only written when it is OK. */
#ifndef {upper}_H
#define {upper}_H

#include <stddef.h>
#include <stdint.h>

",
        room(&constants),
        room(&parameters),
        room(&base),
    );
    for count in [active, passive, drives, base, constants, parameters] {
        _ = writeln!(text, "#define {upper}_N_{} {}", count.name, count.n);
    }
    text.push_str("\n/* What functions return. */\n");
    for (k, (status, meaning)) in STATUS.iter().enumerate() {
        _ = writeln!(text, "#define {upper}_{status} {k} /* {meaning} */");
    }
    let (of_active, of_passive) = face.derivation.coordinates();
    let coordinates = |places: &[usize]| -> Vec<&str> {
        let named = places
            .iter()
            .map(|i| mechanism.coordinates[*i].name.as_str());
        named.collect()
    };
    let of_drives = mechanism.drives.iter().map(|d| d.name.as_str());
    for (what, prefix, names) in [
        ("Coordinates", "COORDINATE", coordinates(&of_active)),
        ("Passive coordinates", "PASSIVE", coordinates(&of_passive)),
        ("Drives", "DRIVE", of_drives.collect()),
        ("Known quantities", "CONSTANT", face.constants()),
        ("Dynamic parameters", "PARAMETER", face.parameters()),
    ] {
        if names.is_empty() {
            continue;
        }
        _ = writeln!(text, "\n/* {what}, in order. */");
        for (k, place) in names.iter().enumerate() {
            let place = field_identifier(place).to_string();
            let place = place.trim_start_matches("r#");
            _ = writeln!(text, "#define {upper}_{prefix}_{place} {k}");
        }
    }
    text.push_str("\n/* Base parameters, in order:\n");
    for base in face.derivation.base_parameters() {
        let line = format!("{} = {} ({})", base.name, base.expression, base.unit);
        _ = writeln!(text, " * {}", comment(&line));
    }
    // An array of nothing is no C.
    let array = |what: &str, count: &ArrayDimension| match count.n {
        0 => format!("*{what}"),
        _ => format!("{what}[{upper}_N_{}]", count.name),
    };
    let base = array("base", &base);
    _ = writeln!(
        text,
        " */

#ifdef __cplusplus
extern \"C\" {{
#endif

/* A prepared model. Its content is its own. */
typedef struct {name}_dynamics {{
  uint64_t ready;
  uint64_t room[{}];
}} {name}_dynamics;

/* The model file's values. */
int32_t {name}_default_geometry(double {});
int32_t {name}_nominal_parameters(double {});

/* Base parameters of physical ones. */
int32_t {name}_base_parameters(const double *geometry, const double *parameters, double {base});

/* Computes what depends on geometry and base parameters alone. */
int32_t {name}_prepare({name}_dynamics *dynamics, const double *geometry, const double {base});",
        storage_words(face),
        array("geometry", &constants),
        array("parameters", &parameters)
    );
    let functions = wrapped_functions(face);
    if functions.iter().any(|one| one.follows) {
        text.push_str(
            "\n/* Passive coordinates are followed from the nominal pose to that of a state. Functions that end in `_near` take those
 * of a pose near by, such as the last cycle's, which is faster; they become those of this state. */\n",
        );
    }
    for one in &functions {
        let unread = if one.reads_accelerations {
            ""
        } else {
            " Accelerations of the state are not read."
        };
        _ = writeln!(text, "\n/* {}.{unread} */", one.doc);
        _ = writeln!(text, "{}", declaration(face, one, false));
        if one.follows {
            _ = writeln!(text, "{}", declaration(face, one, true));
        }
    }
    if face.newton {
        text.push_str("\n/* Passive coordinates of a pose; or from those of a pose near by, which they replace. */\n");
        for suffix in ["", "_near"] {
            _ = writeln!(
                text,
                "int32_t {name}_passive_position{suffix}(const {name}_dynamics *dynamics, const double q[{upper}_N_ACTIVE], \
                 double passive[{upper}_N_PASSIVE]);"
            );
        }
    }
    let states = face
        .state_parts()
        .iter()
        .fold(String::new(), |mut s, (part, _)| {
            _ = write!(s, "const double *{part}, ");
            s
        });
    _ = writeln!(
        text,
        "
/* Forces and H_min for n states at once, in the widest vectors of the machine. Number i of coordinate k stands at
 * k * n + i, and so do results (the regressor's entries row by row). Where a state has no answer, its number goes to
 * `failed`, which may be NULL, and all results before it are in place. */
int32_t {name}_inverse_dynamics_many(const {name}_dynamics *dynamics, size_t n, {states}double *forces, size_t *failed);
int32_t {name}_regressor_many(const {name}_dynamics *dynamics, size_t n, {states}double *regressor, size_t *failed);

#ifdef __cplusplus
}}
#endif

#endif"
    );
    text
}

/// How a function of one state is declared.
fn declaration(face: &LanguageBinding<'_>, one: &WrappedFunction, near: bool) -> String {
    let name = &face.name;
    let upper = name.to_uppercase();
    let mut arguments = vec![format!("const {name}_dynamics *dynamics")];
    for (part, n) in face.state_parts() {
        arguments.push(format!("const double {part}[{n}]"));
    }
    if one.takes_forces {
        arguments.push(format!("const double forces[{upper}_N_DRIVES]"));
    }
    if near {
        arguments.push(format!("double passive[{upper}_N_PASSIVE]"));
    }
    let sizes = one.parts.iter().map(|part| {
        let counts = part
            .shape
            .iter()
            .map(|count| format!("{upper}_N_{}", count.name));
        counts.collect::<Vec<String>>().join(" * ")
    });
    let sizes = sizes.collect::<Vec<String>>().join(" + ");
    let result = match one.parts.as_slice() {
        [part] => part.name,
        _ => "motion",
    };
    arguments.push(match one.n_results() {
        0 => format!("double *{result}"),
        _ => format!("double {result}[{sizes}]"),
    });
    let suffix = if near { "_near" } else { "" };
    format!(
        "int32_t {name}_{}{suffix}({});",
        one.name,
        arguments.join(", ")
    )
}
