//! The header of a C library: names and sizes of the model, and the functions of the library.

use std::fmt::Write as _;

use modelmill_boundary::text::comment;

use super::LanguageBinding;
use super::c_abi::{STATUS, storage_words};
use super::functions::{ArrayDimension, WrappedFunction, wrapped_functions};
use crate::identifier::field_identifier;

/// The text of the header. Its declarations match the exported functions of `c_abi`.
#[allow(clippy::too_many_lines, reason = "one text from top to bottom")]
pub(super) fn header(face: &LanguageBinding<'_>) -> String {
    let name = &face.name;
    let upper = name.to_uppercase();
    let mechanism = &face.derivation.mechanism;
    // Text of the model file may contain the end of a comment.
    let title = comment(mechanism.title.as_deref().unwrap_or(&mechanism.name));
    // Sizes by the names of their constants.
    let count = |name, n| ArrayDimension { name, n };
    let [active, passive, drives, base, constants, parameters] = [
        count("ACTIVE", face.n_active()),
        count("PASSIVE", face.n_passive()),
        count("DRIVES", face.n_drives()),
        count("BASE", face.n_base()),
        count("CONSTANTS", face.constants().len()),
        count("PARAMETERS", face.parameters().len()),
    ];
    // C has no arrays of length zero.
    let room = |count: &ArrayDimension| match count.n {
        0 => "1".to_owned(),
        _ => format!("{upper}_N_{}", count.name),
    };
    let mut text = format!(
        "/* {name}: {title}.
 *
 * Inverse dynamics tau = H_min(q, q', q'') p_min, written by modelmill; do not edit.
 *
 * Prepare once, then call. No function allocates, locks or throws; all functions are reentrant:
 *
 *     double geometry[{}], parameters[{}], base[{}];
 *     {name}_dynamics dynamics;
 *     {name}_default_geometry(geometry);
 *     {name}_nominal_parameters(parameters);
 *     {name}_base_parameters(geometry, parameters, base);
 *     {name}_prepare(&dynamics, geometry, base);
 *
 * SI units. Pointers must be aligned and point to as many numbers as the declaration states. Arrays that are read must not
 * overlap arrays that are written. Functions return a status; results are written only if it is OK. */
#ifndef {upper}_H
#define {upper}_H

#include <stddef.h>
#include <stdint.h>

",
        room(&constants),
        room(&parameters),
        room(&base),
    );
    // Sizes, then status codes, then names of positions in the arrays.
    for count in [active, passive, drives, base, constants, parameters] {
        _ = writeln!(text, "#define {upper}_N_{} {}", count.name, count.n);
    }
    text.push_str("\n/* Status codes. */\n");
    for (k, (status, meaning)) in STATUS.iter().enumerate() {
        _ = writeln!(text, "#define {upper}_{status} {k} /* {meaning} */");
    }
    // Names of positions, so that callers need not count.
    let (of_active, of_passive) = face.derivation.coordinates();
    let coordinates = |places: &[usize]| -> Vec<&str> {
        let named = places.iter().map(|i| mechanism.coordinates[*i].name.as_str());
        named.collect()
    };
    // Names of the drives.
    let of_drives = mechanism.drives.iter().map(|d| d.name.as_str());
    // One list of positions per array.
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
            // Keywords of Rust are spelled as in the emitted module, without the raw prefix.
            let place = field_identifier(place).to_string();
            let place = place.trim_start_matches("r#");
            _ = writeln!(text, "#define {upper}_{prefix}_{place} {k}");
        }
    }
    // Base parameters as a comment: name, expression, unit.
    text.push_str("\n/* Base parameters, in order:\n");
    // One line per base parameter.
    for base in face.derivation.base_parameters() {
        let line = format!("{} = {} ({})", base.name, base.expression, base.unit);
        _ = writeln!(text, " * {}", comment(&line));
    }
    // C has no arrays of length zero, so an empty one is declared as a pointer.
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

/* A prepared model. Do not read or change its fields. */
typedef struct {name}_dynamics {{
  uint64_t ready;
  uint64_t room[{}];
}} {name}_dynamics;

/* The model file's values. */
int32_t {name}_default_geometry(double {});
int32_t {name}_nominal_parameters(double {});

/* Base parameters from physical parameters. */
int32_t {name}_base_parameters(const double *geometry, const double *parameters, double {base});

/* Computes what depends only on geometry and base parameters. */
int32_t {name}_prepare({name}_dynamics *dynamics, const double *geometry, const double {base});",
        storage_words(face),
        array("geometry", &constants),
        array("parameters", &parameters)
    );
    // One declaration per function of one state, and one with a guess where loops are followed.
    let functions = wrapped_functions(face);
    if functions.iter().any(|one| one.follows) {
        text.push_str(
            "\n/* Passive coordinates are followed from the nominal pose to the pose of a state. Functions that end in `_near` start
 * from those of a nearby pose, such as the last cycle's, which is faster; they are replaced by those of this state. */\n",
        );
    }
    for one in &functions {
        // The state always has accelerations; the comment states where they are not read.
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
    // Solution for the passive coordinates only.
    if face.newton {
        text.push_str(
            "\n/* Passive coordinates of a pose; `_near`: from those of a nearby pose, which are replaced. */\n",
        );
        for suffix in ["", "_near"] {
            _ = writeln!(
                text,
                "int32_t {name}_passive_position{suffix}(const {name}_dynamics *dynamics, const double q[{upper}_N_ACTIVE], \
                 double passive[{upper}_N_PASSIVE]);"
            );
        }
    }
    // Functions of many states take one pointer per part of the state.
    let states = face.state_parts().iter().fold(String::new(), |mut s, (part, _)| {
        _ = write!(s, "const double *{part}, ");
        s
    });
    _ = writeln!(
        text,
        "
/* Forces and H_min for n states at once, in the widest vectors of the machine. Coordinate k of state i has the index
 * k * n + i; results are stored alike (the regressor's entries row by row). If a state has no solution, its number is
 * written to `failed`, which may be NULL, and all results before it are valid. */
int32_t {name}_inverse_dynamics_many(const {name}_dynamics *dynamics, size_t n, {states}double *forces, size_t *failed);
int32_t {name}_regressor_many(const {name}_dynamics *dynamics, size_t n, {states}double *regressor, size_t *failed);

#ifdef __cplusplus
}}
#endif

#endif"
    );
    text
}

/// The declaration of a function of one state.
fn declaration(face: &LanguageBinding<'_>, one: &WrappedFunction, near: bool) -> String {
    let name = &face.name;
    let upper = name.to_uppercase();
    // Arguments in the order of the exported function.
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
    // The length of the result as a product or sum of named sizes.
    let sizes = one.parts.iter().map(|part| {
        let counts = part.shape.iter().map(|count| format!("{upper}_N_{}", count.name));
        counts.collect::<Vec<String>>().join(" * ")
    });
    let sizes = sizes.collect::<Vec<String>>().join(" + ");
    // Several arrays are returned one after the other in one argument.
    let result = match one.parts.as_slice() {
        [part] => part.name,
        _ => "motion",
    };
    arguments.push(match one.n_results() {
        0 => format!("double *{result}"),
        _ => format!("double {result}[{sizes}]"),
    });
    // Names as in `c_abi`.
    let suffix = if near { "_near" } else { "" };
    format!("int32_t {name}_{}{suffix}({});", one.name, arguments.join(", "))
}
