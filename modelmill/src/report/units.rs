//! Units of forces and variables of recordings, for axes and sentences.

use crate::model::Model;

/// Unit of a drive's force.
pub(crate) fn force_unit(model: &Model, drive: usize) -> &'static str {
    model.force_unit(drive)
}

/// Unit of a variable by its name: a coordinate or the length of a drive, their rates and accelerations, a
/// force, the time.
pub(crate) fn variable_unit(model: &Model, name: &str) -> String {
    let mechanism = &model.derivation.mechanism;
    if name == modelmill_identify::TIME_COLUMN {
        return "s".to_owned();
    }
    if let Some(d) = mechanism.drives.iter().position(|d| d.name == name) {
        return force_unit(model, d).to_owned();
    }
    let (of, per) = if let Some(of) = name.strip_suffix("_dd") {
        (of, "/s²")
    } else if let Some(of) = name.strip_suffix("_d") {
        (of, "/s")
    } else {
        (name, "")
    };
    let of = of.strip_suffix("_length").unwrap_or(of);
    let coordinate = mechanism.coordinates.iter().find(|c| c.name == of);
    let unit = coordinate.map_or("m", |c| c.motion.unit());
    format!("{unit}{per}")
}

/// A unit as it is written by hand: `kg m^2` as `kg m²`.
pub(crate) fn typographic_unit(unit: &str) -> String {
    unit.replace("^2", "²").replace("^3", "³")
}
