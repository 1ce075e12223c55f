//! Warns of angles that are probably degrees: nominal values, constants in rad, and limits of several turns.
//!
//! A built mechanism and its file go in; warnings come out.

use std::f64::consts::TAU;

use crate::build::thresholds::{LARGEST_ANGLE, LARGEST_ANGLE_LIMIT, NO_LIMIT};
use crate::diagnostic::{Diagnostic, DiagnosticLog, SourceSpan};
use crate::mechanism::Mechanism;
use crate::schema::ModelEntry;

/// Warns of angles larger than a machine has them.
pub(super) fn warn_of_degrees(model: &ModelEntry, mechanism: &Mechanism, log: &mut DiagnosticLog) {
    for (key, entry) in model.constants.iter().flat_map(|table| &table.entries) {
        let is_angle = entry.unit.as_ref().is_some_and(crate::unit::ModelUnit::is_angle);
        if let (true, Some(number)) = (is_angle, entry.value)
            && number.value.abs() > LARGEST_ANGLE
        {
            warn(&format!("the constant `{}`", key.name), number.value, number.span, log);
        }
    }
    let angles: Vec<&str> = mechanism
        .coordinates
        .iter()
        .filter(|one| one.motion.is_angle())
        .map(|one| one.name.as_str())
        .collect();
    for (key, entry) in model.coordinates.iter().flat_map(|table| &table.entries) {
        // Angles that follow others by gears have no nominal value of their own, so they may have many turns.
        if let (true, Some(number)) = (angles.contains(&key.name.as_str()), entry.nominal)
            && number.value.abs() > LARGEST_ANGLE
        {
            let what = format!("the nominal value of `{}`", key.name);
            warn(&what, number.value, number.span, log);
        }
    }
    let limits = model.limits.iter().flat_map(|limits| &limits.coordinates);
    for (key, entry) in limits.flat_map(|table| &table.entries) {
        let Some(range) = entry.position.as_ref().filter(|_| angles.contains(&key.name.as_str())) else {
            continue;
        };
        let largest = range.ends.iter().fold(0.0_f64, |most, end| most.max(end.abs()));
        if largest > LARGEST_ANGLE_LIMIT && largest < NO_LIMIT {
            warn(&format!("a limit of `{}`", key.name), largest, range.span, log);
        }
    }
}

/// Warns of one angle, rad.
fn warn(what: &str, value: f64, span: SourceSpan, log: &mut DiagnosticLog) {
    log.push(
        Diagnostic::warning(span, format!("{what} is {value} rad, or {:.3} turns", value / TAU))
            .label("angles are in rad")
            .help(format!("if this is {value} degrees, write {:.6}", value.to_radians())),
    );
}
