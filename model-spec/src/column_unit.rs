//! Units in the names of columns: `q1 [deg]` and `torque (Nm)` go in, the name, the unit and its factor to SI come out.

use crate::column::{ColumnQuantity, units};

/// All quantities that have units, for the question whether a text is a unit at all.
const QUANTITIES: [ColumnQuantity; 14] = [
    ColumnQuantity::Time,
    ColumnQuantity::Angle(0),
    ColumnQuantity::Angle(1),
    ColumnQuantity::Angle(2),
    ColumnQuantity::Length(0),
    ColumnQuantity::Length(1),
    ColumnQuantity::Length(2),
    ColumnQuantity::Force,
    ColumnQuantity::Torque,
    ColumnQuantity::ForceVariance,
    ColumnQuantity::TorqueVariance,
    ColumnQuantity::Current,
    ColumnQuantity::Voltage,
    ColumnQuantity::Pressure,
];

/// Units of signals that no column of a model has, such as powers.
const OTHER_UNITS: [&str; 12] = [
    "W", "J", "Hz", "%", "1", "inc", "counts", "ticks", "C", "K", "kg", "Arms",
];

/// Spellings of units, each with the one that the tables of units have. Longer ones come first.
const SPELLINGS: [(&str, &str); 16] = [
    ("radians", "rad"),
    ("radian", "rad"),
    ("degrees", "deg"),
    ("degree", "deg"),
    ("seconds", "s"),
    ("second", "s"),
    ("sec", "s"),
    ("1/min", "rpm"),
    ("°", "deg"),
    ("µ", "u"),
    ("μ", "u"),
    ("²", "^2"),
    ("/s/s", "/s^2"),
    ("**", "^"),
    ("·", " "),
    ("*", " "),
];

/// The name of a column without the unit behind it, and the unit; `None` if there is no unit in brackets.
///
/// ```
/// use modelmill_spec::split_header_unit;
/// assert_eq!(split_header_unit("torque (Nm)"), Some(("torque", "Nm")));
/// assert_eq!(split_header_unit("sin(q)"), None);
/// ```
pub fn split_header_unit(name: &str) -> Option<(&str, &str)> {
    let name = name.trim();
    let split = match name.strip_suffix(']') {
        Some(rest) => rest.rsplit_once('['),
        None => name.strip_suffix(')').and_then(|rest| rest.rsplit_once('(')),
    };
    let (base, unit) = split?;
    let (base, unit) = (base.trim(), unit.trim());
    let is_known = OTHER_UNITS.contains(&unit) || QUANTITIES.iter().any(|one| unit_factor(unit, *one).is_some());
    (!base.is_empty() && is_known).then_some((base, unit))
}

/// The factor from a unit to SI; `None` if the unit does not fit the quantity.
pub fn unit_factor(unit: &str, quantity: ColumnQuantity) -> Option<f64> {
    let find = |unit: &str| {
        let found = units(quantity).iter().find(|(name, _)| *name == unit);
        found.map(|(_, factor)| *factor)
    };
    find(unit).or_else(|| find(&usual_spelling(unit)))
}

/// A unit as the tables of units spell it.
fn usual_spelling(unit: &str) -> String {
    let mut usual = unit.trim().to_owned();
    for (other, usual_one) in SPELLINGS {
        usual = usual.replace(other, usual_one);
    }
    // The power of `rad/s2`.
    if usual.ends_with("/s2") {
        usual.insert(usual.len() - 1, '^');
    }
    usual
}
