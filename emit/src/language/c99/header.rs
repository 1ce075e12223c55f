//! The header: what the model has, and what is to be had of it.

use std::fmt::Write as _;

use super::statements::{CSyntax, comment};
use super::{CFunction, TranslationUnit};
use crate::language::syntax::LanguageSyntax;

/// What functions return, with its name after the prefix, and its meaning.
const STATUS: [(&str, &str); 6] = [
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
        "SPECIAL",
        "base parameters divide by what vanishes for this geometry",
    ),
];

#[allow(clippy::too_many_lines, reason = "one text from top to bottom")]
pub(super) fn header(unit: &TranslationUnit<'_>) -> String {
    let TranslationUnit { name, upper, .. } = unit;
    let derivation = unit.source.derivation;
    let mechanism = &derivation.mechanism;
    let c = CSyntax { name, upper };
    let mut text = String::new();
    let title = comment(mechanism.title.as_deref().unwrap_or(&mechanism.name));
    _ = write!(
        text,
        "/* {name}: {title}.
 *
 * Inverse dynamics tau = H_min(q, q', q'') p_min, written by modelmill; do not edit.
 *
 * Prepare once, then call; nothing allocates or locks, and all of it is reentrant:
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
 * SI units. Arrays have as many numbers as coordinates (q, qd, qdd) or drives (forces, load); functions return a status, and
 * write results only when it is OK. Links with the library of mathematics (-lm). */
#ifndef {upper}_H
#define {upper}_H

#ifdef __cplusplus
extern \"C\" {{
#endif

",
        unit.state_arguments()
    );
    for (what, n) in [
        ("ACTIVE", unit.n_active()),
        ("PASSIVE", unit.n_passive()),
        ("DRIVES", unit.n_drives()),
        ("BASE", unit.n_base()),
    ] {
        _ = writeln!(text, "#define {upper}_N_{what} {n}");
    }
    text.push_str("\n/* What functions return. */\n");
    for (k, (status, meaning)) in STATUS.iter().enumerate() {
        _ = writeln!(text, "#define {upper}_{status} {k} /* {meaning} */");
    }
    let (active, passive) = derivation.coordinates();
    let coordinate = |i: &usize| mechanism.coordinates[*i].name.as_str();
    let mut places = |what: &str, prefix: &str, names: Vec<&str>| {
        if names.is_empty() {
            return;
        }
        _ = writeln!(text, "\n/* {what}, in order. */");
        for (k, place) in names.iter().enumerate() {
            _ = writeln!(text, "#define {upper}_{prefix}_{} {k}", c.name(place));
        }
    };
    places(
        "Coordinates",
        "COORDINATE",
        active.iter().map(coordinate).collect(),
    );
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
    let mut record = |what: &str, name: &str, fields: Vec<(&str, &str)>| {
        _ = writeln!(text, "\n/* {what} */\ntypedef struct {{");
        if fields.is_empty() {
            text.push_str("    double nothing;\n");
        }
        for (field, measure) in fields {
            _ = writeln!(
                text,
                "    double {}; /* {} */",
                c.name(field),
                comment(measure)
            );
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
        "\n/* A prepared model: what depends on geometry and base parameters alone. */\ntypedef struct {{\n    int input;\n    \
         {name}_geometry geometry;\n    double base[{}];\n    double once[{}];",
        unit.n_base().max(1),
        unit.once.kept.len().max(1)
    );
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

/* Base parameters of physical ones, eq. (16). */
int {name}_base_parameters(const {name}_geometry *geometry, const {name}_parameters *parameters, double *base);

/* Computes what depends on geometry and base parameters alone; says what is wrong with them, as all functions then do. */
int {name}_prepare({name}_dynamics *dynamics, const {name}_geometry *geometry, const double *base);"
    );
    if unit.newton {
        _ = writeln!(
            text,
            "
/* Passive coordinates of a pose, followed from the nominal pose; or from those of a pose near by, which they replace. */
int {name}_passive_position(const {name}_dynamics *dynamics, const double *q, double *passive);
int {name}_passive_position_near(const {name}_dynamics *dynamics, const double *q, double *passive);"
        );
    }
    for function in unit.functions.iter().filter(|f| f.is_public) {
        _ = writeln!(
            text,
            "\n/* {}. {}. */",
            function.doc,
            super::source::operation_count(function)
        );
        _ = writeln!(text, "{};", signature(unit, function, "dynamics", false));
        if function.follows {
            text.push_str("/* The same from the passive coordinates of a pose near by, which become those of this state. */\n");
            _ = writeln!(text, "{};", signature(unit, function, "dynamics", true));
        }
    }
    if unit.source.dynamics.is_some() {
        text.push_str("\n/* c + g + e alone. */\n");
        for near in bias_variants(unit) {
            _ = writeln!(text, "{};", bias_declaration(unit, *near));
        }
        _ = writeln!(
            text,
            "\n/* Forward dynamics: accelerations under given forces of the drives; those of the state are not read. */\n{};",
            forward_dynamics_declaration(unit)
        );
    }
    if let (Some((function, once)), Some(reactions)) = (&unit.reactions, unit.source.reactions) {
        text.push_str(
            "\n/* What the joints transmit to the side away from the base: in order, with what is not determined left out.\n",
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
    if unit.columns.is_some() {
        _ = writeln!(
            text,
            "
/* Holds the base parameters against all parameters at random states around the nominal pose: 0 if H and H_min have rank
 * {upper}_N_BASE and H p = H_min p_min; 1 if too few states have an answer; 2 for the rank of H_min; 3 for that of H; 4 if
 * H_min p_min differs; 5 if the inverse dynamics differ; 6 if base parameters divide by what vanishes for this geometry. */
int {name}_self_test(const {name}_geometry *geometry);"
        );
    }
    text.push_str("\n#ifdef __cplusplus\n}\n#endif\n\n#endif\n");
    text
}

/// What each output of the reactions is.
fn source_names(reactions: &modelmill_codegen::ReactionPrograms) -> Vec<String> {
    let mut names = vec![String::new(); reactions.program.outputs.len()];
    let mut name = |what: &str, of: &str, places: &[Option<usize>; 3]| {
        for (place, axis) in places.iter().zip(["x", "y", "z"]) {
            if let Some(name) = place.and_then(|k| names.get_mut(k)) {
                *name = format!("{what} {of}, {axis}");
            }
        }
    };
    for joint in &reactions.joints {
        name("force in joint", &joint.name, &joint.force);
        name("moment in joint", &joint.name, &joint.moment);
    }
    for closed in &reactions.loops {
        name("force that closes loop", &closed.name, &closed.force);
    }
    names
}

/// How a function is declared.
pub(super) fn signature(
    unit: &TranslationUnit<'_>,
    function: &CFunction<'_>,
    owner: &str,
    near: bool,
) -> String {
    declaration(unit, function.name, owner, near, function.result)
}

fn declaration(
    unit: &TranslationUnit<'_>,
    what: &str,
    owner: &str,
    near: bool,
    result: &str,
) -> String {
    let name = &unit.name;
    let (suffix, passive) = if near {
        ("_near", ", double *passive")
    } else {
        ("", "")
    };
    format!(
        "int {name}_{what}{suffix}(const {name}_{owner} *{owner}, {}{passive}, double *{result})",
        unit.state_parameters()
    )
}

/// Whether the bias forces come from the nominal pose, and from a pose near by.
pub(super) fn bias_variants(unit: &TranslationUnit<'_>) -> &'static [bool] {
    let follows = |f: &CFunction<'_>| f.name == "bias_and_drives" && f.follows;
    if unit.functions.iter().any(follows) {
        &[false, true]
    } else {
        &[false]
    }
}

/// How the bias forces are declared.
pub(super) fn bias_declaration(unit: &TranslationUnit<'_>, near: bool) -> String {
    declaration(unit, "bias", "dynamics", near, "bias")
}

/// How forward dynamics are declared.
pub(super) fn forward_dynamics_declaration(unit: &TranslationUnit<'_>) -> String {
    let name = &unit.name;
    format!(
        "int {name}_forward(const {name}_dynamics *dynamics, {}, const double *forces, double *accelerations)",
        unit.state_parameters()
    )
}
