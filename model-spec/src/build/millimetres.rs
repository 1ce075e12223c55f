//! Warns of lengths that are probably millimetres: constants and nominal values of parameters in m.
//!
//! A model file goes in; warnings come out.

use crate::build::thresholds::LARGEST_LENGTH;
use crate::diagnostic::{Diagnostic, DiagnosticLog};
use crate::schema::ModelEntry;
use crate::unit::ModelUnit;
use crate::values::SpannedNumber;

/// Warns of lengths larger than a machine has them.
pub(super) fn warn_of_millimetres(model: &ModelEntry, log: &mut DiagnosticLog) {
    let constants = model.constants.iter().flat_map(|table| &table.entries);
    for (key, entry) in constants {
        warn(&key.name, entry.unit.as_ref(), entry.value, log);
    }
    let parameters = model.parameters.iter().flat_map(|table| &table.entries);
    for (key, entry) in parameters {
        warn(&key.name, entry.unit.as_ref(), entry.nominal, log);
    }
}

/// Warns of one value, if it is a length that is too large.
fn warn(name: &str, unit: Option<&ModelUnit>, number: Option<SpannedNumber>, log: &mut DiagnosticLog) {
    if let (Some(unit), Some(number)) = (unit, number)
        && unit.is_length()
        && number.value.abs() > LARGEST_LENGTH
    {
        log.push(
            Diagnostic::warning(number.span, format!("the length `{name}` is {} m", number.value))
                .label("lengths are in m")
                .help(format!(
                    "if this is {} mm, write {}",
                    number.value,
                    number.value / 1000.0
                )),
        );
    }
}
