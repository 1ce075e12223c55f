//! Newton's method for loops that have no closed form: the C code that solves for the passive coordinates.

use std::fmt::Write as _;

use super::TranslationUnit;
use super::source::{parameter_bindings, single_value};
use crate::tree::StatementRoutine;

/// Appends the nominal pose, Newton's method, and the solution at the nominal pose that `prepare` starts from.
pub(super) fn newton(unit: &TranslationUnit<'_>, text: &mut String) {
    let TranslationUnit { name, upper, .. } = unit;
    let derivation = unit.source.derivation;
    let (active, passive) = derivation.coordinates();
    // Coordinates that occur in the closure equations.
    let in_loops = derivation.coordinates_in_loops();
    let has_scale = derivation.programs.scale.is_some();
    // Lengths in loops are scaled with the geometry, so that the nominal pose of a larger machine is near its solution.
    let nominal = |i: &usize| {
        let coordinate = &derivation.mechanism.coordinates[*i];
        let value = coordinate.nominal;
        if has_scale && coordinate.motion.is_length() && in_loops.contains(i) {
            format!("self->scale * {value:?}")
        } else {
            format!("{value:?}")
        }
    };
    _ = writeln!(
        text,
        "\nstatic void {name}_nominal_active(const {name}_dynamics *self, double *q)\n{{\n    (void)self;"
    );
    // The pose from which all others are followed.
    for (k, i) in active.iter().enumerate() {
        _ = writeln!(text, "    q[{k}] = {};", nominal(i));
    }
    text.push_str("}\n\n");
    // The same template serves any struct with a geometry.
    let driver = include_str!("loops.c").replace("NAME_model", "NAME_dynamics");
    text.push_str(&unit.expand_template(&driver));
    _ = writeln!(
        text,
        "\nstatic void {name}_settle({name}_dynamics *self)\n{{\n    const {name}_rule rule = {{50, 0, 0.0}};\n    \
         double q[{upper}_N_ACTIVE], contraction;"
    );
    // The scale of the geometry relative to the file's, or 1 if no coordinate of the loops is a length.
    let mut lines = Vec::new();
    if let Some(program) = &derivation.programs.scale {
        // The scale is a program of the geometry only.
        let routine = StatementRoutine::new(program, &unit.scope, &[]);
        let read = routine.read_once.union(&routine.read).copied().collect();
        parameter_bindings(unit, &read, "self->geometry.", "", "", &mut lines);
        unit.syntax().statements(&routine.once, &mut lines);
        if let Some(result) = routine.results.first() {
            lines.push(format!("self->scale = {};", single_value(unit, result)));
        }
    } else {
        lines.push("self->scale = 1.0;".to_owned());
    }
    // The file's values are the first guess.
    for (k, i) in passive.iter().enumerate() {
        lines.push(format!("self->nominal[{k}] = {};", nominal(i)));
    }
    lines.push(format!("{name}_nominal_active(self, q);"));
    lines.push(format!(
        "self->nominal_status = {name}_newton(self, q, self->nominal, rule, &contraction);"
    ));
    for line in lines {
        _ = writeln!(text, "    {line}");
    }
    text.push_str("}\n");
}
