//! Units of forces and variables of recordings, for axes and sentences.

use crate::compare;
use crate::model::Model;

/// Unit of a drive's force.
pub(crate) fn force_unit(model: &Model, drive: usize) -> &'static str {
    model.force_unit(drive)
}

/// Unit of a variable by its name: a coordinate or the length of a drive, their rates and accelerations, a
/// force, the time.
pub(crate) fn variable_unit(model: &Model, name: &str) -> String {
    typographic_unit(&compare::variable_unit(model, name))
}

/// A unit as it is written by hand: `kg m^2` as `kg m²`.
pub(crate) fn typographic_unit(unit: &str) -> String {
    unit.replace("^2", "²").replace("^3", "³")
}
