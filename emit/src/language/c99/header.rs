//! The C header: names and sizes of the model, and the functions of the source.

use std::fmt::Write as _;

use super::TranslationUnit;
use super::statements::{CSyntax, comment};
use crate::fingerprint::Fingerprint;
use crate::language::syntax::LanguageSyntax;
use crate::tree::ProgramFunction;

/// Status codes in the order of their values: name after the prefix, and meaning.
const STATUS: [(&str, &str); 6] = [
    ("OK", "no error"),
    ("OUT_OF_REACH", "the loops cannot close: the pose is out of reach"),
    ("SINGULAR", "the pose is singular"),
    ("UNDEFINED", "a term of the model has no finite value at this state"),
    ("NOT_FINITE", "an input is NaN, infinite, or above 1e60"),
    (
        "SPECIAL",
        "a denominator of the base parameters is zero for this geometry",
    ),
];

/// The text of the header without its end.
#[allow(clippy::too_many_lines, reason = "one text from top to bottom")]
pub(super) fn header_body(unit: &TranslationUnit<'_>) -> String {
    let TranslationUnit { name, upper, .. } = unit;
    let derivation = unit.source.derivation;
    let mechanism = &derivation.mechanism;
    // Names that C allows.
    let c = CSyntax { name, upper };
    let mut text = String::new();
    // Text of the model file may contain the end of a comment.
    let title = comment(mechanism.title.as_deref().unwrap_or(&mechanism.name));
    _ = write!(
        text,
        "/* {name}: {title}.
 *
 * Inverse dynamics tau = H_min(q, q', q'') p_min, written by modelmill; do not edit.
 *
 * Prepare once, then call. No function allocates or locks; all functions are reentrant:
 *
 *     {name}_geometry geometry;
 *     {name}_parameters parameters;
 *     {name}_dynamics dynamics;
 *     double base[{upper}_N_BASE];
 *     {name}_default_geometry(&geometry);
 *     {name}_nominal_parameters(&parameters);
 *     status = {name}_base_parameters(&geometry, &parameters, base);
 *     {name}_prepare(&dynamics, &geometry, base);
 *     status = {name}_inverse_dynamics(&dynamics, {}, forces);
 *
 * SI units. Arrays have as many numbers as coordinates (q, qd, qdd) or drives (forces, load). Functions return a status and
 * write results only if it is OK. Link with the math library (-lm). */
#ifndef {upper}_H
#define {upper}_H

#ifdef __cplusplus
extern \"C\" {{
#endif

",
        unit.state_arguments()
    );
    // Sizes, then status codes, then names of positions in the arrays.
    for (what, n) in [
        ("ACTIVE", unit.n_active()),
        ("PASSIVE", unit.n_passive()),
        ("DRIVES", unit.n_drives()),
        ("BASE", unit.n_base()),
    ] {
        _ = writeln!(text, "#define {upper}_N_{what} {n}");
    }
    text.push_str("\n/* Status codes. */\n");
    for (k, (status, meaning)) in STATUS.iter().enumerate() {
        _ = writeln!(text, "#define {upper}_{status} {k} /* {meaning} */");
    }
    // Coordinates in the order of `q` and of the passive ones.
    let (active, passive) = derivation.coordinates();
    let coordinate = |i: &usize| mechanism.coordinates[*i].name.as_str();
    // One constant per name: its position in the array.
    let mut places = |what: &str, prefix: &str, names: Vec<&str>| {
        if names.is_empty() {
            return;
        }
        _ = writeln!(text, "\n/* {what}, in order. */");
        for (k, place) in names.iter().enumerate() {
            _ = writeln!(text, "#define {upper}_{prefix}_{} {k}", c.name(place));
        }
    };
    places("Coordinates", "COORDINATE", active.iter().map(coordinate).collect());
    places(
        "Passive coordinates",
        "PASSIVE",
        passive.iter().map(coordinate).collect(),
    );
    places(
        "Drives",
        "DRIVE",
        mechanism.drives.iter().map(|d| d.name.as_str()).collect(),
    );
    text.push_str("\n/* Base parameters, in order, eq. (16).\n");
    // One line per base parameter: name, expression and unit.
    for base in derivation.base_parameters() {
        _ = writeln!(
            text,
            " * {} = {} [{}]",
            base.name,
            comment(&base.expression),
            comment(&base.unit)
        );
    }
    text.push_str(" */\n");
    // A struct of named quantities with their units as comments.
    let mut record = |what: &str, name: &str, fields: Vec<(&str, &str)>| {
        _ = writeln!(text, "\n/* {what} */\ntypedef struct {{");
        // C has no empty structs.
        if fields.is_empty() {
            text.push_str("    double nothing;\n");
        }
        // The unit of each field is its comment.
        for (field, measure) in fields {
            _ = writeln!(text, "    double {}; /* {} */", c.name(field), comment(measure));
        }
        _ = writeln!(text, "}} {}_{name};", unit.name);
    };
    record(
        "Known quantities.",
        "geometry",
        mechanism
            .constants
            .iter()
            .map(|c| (c.name.as_str(), c.unit.as_str()))
            .collect(),
    );
    record(
        "Dynamic parameters.",
        "parameters",
        mechanism
            .parameters
            .iter()
            .map(|p| (p.name.as_str(), p.unit.as_str()))
            .collect(),
    );
    _ = writeln!(
        text,
        "\n/* A prepared model: values that depend only on geometry and base parameters. */\ntypedef struct {{\n    int input;\n    \
         {name}_geometry geometry;\n    double base[{}];\n    double once[{}];",
        unit.n_base().max(1),
        unit.once.kept.len().max(1)
    );
    // Loops without closed form store their scale and the solution at the nominal pose.
    if unit.newton {
        _ = writeln!(
            text,
            "    double scale;\n    double nominal[{upper}_N_PASSIVE];\n    int nominal_status;"
        );
    }
    _ = writeln!(
        text,
        "}} {name}_dynamics;

/* The model file's values. */
void {name}_default_geometry({name}_geometry *geometry);
void {name}_nominal_parameters({name}_parameters *parameters);

/* Base parameters from physical parameters, eq. (16). */
int {name}_base_parameters(const {name}_geometry *geometry, const {name}_parameters *parameters, double *base);

/* Computes what depends only on geometry and base parameters. If they are invalid, this and all other functions return the
 * status. */
int {name}_prepare({name}_dynamics *dynamics, const {name}_geometry *geometry, const double *base);"
    );
    // The solution for the passive coordinates is a function of its own.
    if unit.newton {
        _ = writeln!(
            text,
            "
/* Passive coordinates of a pose, followed from the nominal pose; `_near`: from those of a nearby pose, which are replaced. */
int {name}_passive_position(const {name}_dynamics *dynamics, const double *q, double *passive);
int {name}_passive_position_near(const {name}_dynamics *dynamics, const double *q, double *passive);"
        );
    }
    // Each public function with its documentation and its operations per state.
    for function in unit.functions.iter().filter(|f| f.is_public) {
        _ = writeln!(
            text,
            "\n/* {}. {}. */",
            function.doc,
            super::source::operation_count(function)
        );
        _ = writeln!(text, "{};", signature(unit, function, "dynamics", false));
        if function.follows {
            text.push_str("/* The same, starting from the passive coordinates of a nearby pose, which are replaced by those of this state. */\n");
            _ = writeln!(text, "{};", signature(unit, function, "dynamics", true));
        }
    }
    // The equation of motion, if it is requested.
    if unit.source.dynamics.is_some() {
        text.push_str("\n/* c + g + e only. */\n");
        for near in bias_variants(unit) {
            _ = writeln!(text, "{};", bias_declaration(unit, *near));
        }
        _ = writeln!(
            text,
            "\n/* Forward dynamics: accelerations under given forces of the drives. Accelerations of the state are not read. */\n{};",
            forward_dynamics_declaration(unit)
        );
    }
    // The outputs of the reactions are listed, because some components may be missing.
    if let (Some((function, once)), Some(reactions)) = (&unit.reactions, unit.source.reactions) {
        text.push_str(
            "\n/* Forces and moments that the joints transmit to the side away from the base, in order; undetermined components are left out.\n",
        );
        for (k, of) in source_names(reactions).iter().enumerate() {
            _ = writeln!(text, " * {k}: {}", comment(of));
        }
        _ = writeln!(
            text,
            " */
#define {upper}_N_WRENCHES {}
typedef struct {{
    {name}_dynamics dynamics;
    {name}_parameters parameters;
    double once[{}];
}} {name}_reactions;

int {name}_prepare_reactions({name}_reactions *reactions, const {name}_geometry *geometry, const {name}_parameters *parameters);
{};",
            function.routine.n_outputs,
            once.kept.len().max(1),
            signature(unit, function, "reactions", false)
        );
        if function.follows {
            _ = writeln!(text, "{};", signature(unit, function, "reactions", true));
        }
    }
    // The self-test, if it is requested.
    if unit.columns.is_some() {
        _ = writeln!(
            text,
            "
/* Compares the base parameters with all parameters at random states around the nominal pose. Returns 0 if H and H_min have
 * rank {upper}_N_BASE and H p = H_min p_min; 1 if too few states have a solution; 2 if the rank of H_min is wrong; 3 if that of
 * H is wrong; 4 if H_min p_min differs from H p; 5 if the inverse dynamics differ from H p; 6 if a denominator of the base
 * parameters is zero for this geometry. */
int {name}_self_test(const {name}_geometry *geometry);"
        );
    }
    text
}

/// The header with its fingerprint, which the source compares with its own.
pub(super) fn complete_header(unit: &TranslationUnit<'_>, mut body: String, fingerprint: Fingerprint) -> String {
    _ = write!(
        body,
        "
/* Header and source were written together: the source has the same number and compiles with no other header. */
#define {}_FINGERPRINT {fingerprint}ULL

#ifdef __cplusplus
}}
#endif

#endif
",
        unit.upper
    );
    body
}

/// The meaning of each output of the reactions, with its axis.
fn source_names(reactions: &modelmill_codegen::ReactionPrograms) -> Vec<String> {
    let mut names = vec![String::new(); reactions.program.outputs.len()];
    // The three components of a vector.
    let mut name = |what: &str, of: &str, places: &[Option<usize>; 3]| {
        for (place, axis) in places.iter().zip(["x", "y", "z"]) {
            if let Some(name) = place.and_then(|k| names.get_mut(k)) {
                *name = format!("{what} {of}, {axis}");
            }
        }
    };
    // Each joint has a force and a moment.
    for joint in &reactions.joints {
        name("force in joint", &joint.name, &joint.force);
        name("moment in joint", &joint.name, &joint.moment);
    }
    // Loops follow the joints.
    for closed in &reactions.loops {
        name("force that closes loop", &closed.name, &closed.force);
    }
    names
}

/// The declaration of a function of one state.
pub(super) fn signature(unit: &TranslationUnit<'_>, function: &ProgramFunction<'_>, owner: &str, near: bool) -> String {
    declaration(unit, function.name, owner, near, function.result)
}

/// A declaration with the arguments that all functions of a state share; `near` adds the passive coordinates.
fn declaration(unit: &TranslationUnit<'_>, what: &str, owner: &str, near: bool, result: &str) -> String {
    let name = &unit.name;
    // The guess is an argument that is overwritten.
    let (suffix, passive) = if near { ("_near", ", double *passive") } else { ("", "") };
    format!(
        "int {name}_{what}{suffix}(const {name}_{owner} *{owner}, {}{passive}, double *{result})",
        unit.state_parameters()
    )
}

/// Which forms the function `bias` has: without guess, and with a guess if its program follows the loops.
pub(super) fn bias_variants(unit: &TranslationUnit<'_>) -> &'static [bool] {
    // The program of the bias.
    let follows = |f: &ProgramFunction<'_>| f.name == "bias_and_drives" && f.follows;
    if unit.functions.iter().any(follows) {
        &[false, true]
    } else {
        &[false]
    }
}

/// The declaration of `bias`.
pub(super) fn bias_declaration(unit: &TranslationUnit<'_>, near: bool) -> String {
    declaration(unit, "bias", "dynamics", near, "bias")
}

/// The declaration of `forward`.
pub(super) fn forward_dynamics_declaration(unit: &TranslationUnit<'_>) -> String {
    let name = &unit.name;
    format!(
        "int {name}_forward(const {name}_dynamics *dynamics, {}, const double *forces, double *accelerations)",
        unit.state_parameters()
    )
}
