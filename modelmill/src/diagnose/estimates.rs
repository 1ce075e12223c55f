//! Estimates of effects: one value for each parameter and constant, which text, JSON, commands, pages and the completed
//! model file state with the same digits. Inputs are effects that a search found.
//!
//! Decision: values are those of the search, since it fits disturbances of the recordings together with the effects and
//! leaves standstill out. An identification that ignores them gives biased values.

use modelmill_identify::diagnose::IdentifiedEffect;
use modelmill_identify::float_to_count;

use super::problem::DiagnosisSolution;
use super::thresholds::{ESTIMATE_FEWEST_DIGITS, ESTIMATE_MOST_DIGITS};

/// The estimate of a parameter or constant of an effect, rounded to the digits that its standard deviation supports.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectEstimate {
    /// Symbol of the parameter or constant.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Standard deviation. `None` for a constant that was searched, and for a parameter that is identifiable only in
    /// combination with others, not individually.
    pub std: Option<f64>,
    /// SI unit of the value.
    pub unit: String,
}

/// Estimates of the parameters and constants of an effect by the symbols of its kind.
pub(crate) fn effect_estimates(answer: &DiagnosisSolution, found: &IdentifiedEffect) -> Vec<EffectEstimate> {
    let parameters = &answer.problem.candidates[found.candidate].parameters;
    let values = found.estimates.iter().zip(&found.standard_deviations);
    let fitted: Vec<(&str, f64, Option<f64>, &str)> = parameters
        .iter()
        .zip(values)
        .map(|(p, (value, std))| (p.symbol.as_str(), *value, *std, p.unit.as_str()))
        .collect();
    let mut all = Vec::new();
    for (symbol, value, std, unit) in &fitted {
        // A product of a parameter and a constant gives the constant, once the parameter is known.
        let product = symbol.split_once('*');
        let factor = product.and_then(|(factor, _)| fitted.iter().find(|one| one.0 == factor && one.1 != 0.0));
        let (Some((_, constant)), Some((_, factor, factor_std, _))) = (product, factor) else {
            all.push(rounded_estimate(symbol, *value, *std, unit));
            continue;
        };
        let quotient = value / factor;
        // The bound of a quotient whose parts are correlated in an unknown way.
        let std = std
            .zip(*factor_std)
            .map(|(std, factor_std)| (std + quotient.abs() * factor_std) / factor.abs());
        let unit = unit_of_constant(answer, found, constant);
        all.push(rounded_estimate(constant, quotient, std, &unit));
    }
    // Constants have no standard deviation, since they were found by a search.
    all.extend(found.constants.iter().map(|(name, value)| {
        let unit = unit_of_constant(answer, found, name);
        rounded_estimate(name, *value, None, &unit)
    }));
    all
}

/// An estimate with its value rounded.
pub(crate) fn rounded_estimate(name: &str, value: f64, std: Option<f64>, unit: &str) -> EffectEstimate {
    EffectEstimate {
        name: name.to_owned(),
        value: round_by_deviation(value, std),
        std,
        unit: unit.to_owned(),
    }
}

/// A value rounded to the second digit of its standard deviation, but not to fewer than some digits.
pub(crate) fn round_by_deviation(value: f64, std: Option<f64>) -> f64 {
    let digits =
        std.filter(|std| *std > 0.0 && std.is_finite() && value != 0.0)
            .map_or(ESTIMATE_FEWEST_DIGITS, |std| {
                let digits = value.abs().log10().floor() - std.log10().floor() + 2.0;
                float_to_count(digits.clamp(ESTIMATE_FEWEST_DIGITS as f64, ESTIMATE_MOST_DIGITS as f64))
            });
    round_significant(value, digits)
}

/// A value with some significant digits.
pub(crate) fn round_significant(value: f64, digits: usize) -> f64 {
    let text = format!("{value:.*e}", digits.saturating_sub(1));
    text.parse().unwrap_or(value)
}

/// Unit of a constant of a found effect at its places.
fn unit_of_constant(answer: &DiagnosisSolution, found: &IdentifiedEffect, name: &str) -> String {
    let candidates = &answer.candidates;
    let kind = (candidates.kinds.iter()).find(|kind| kind.name == found.effect.kind);
    let constant = kind.and_then(|kind| kind.constants.iter().find(|one| one.symbol == name));
    let mut spots = candidates.singles.iter().flat_map(|single| &single.spots);
    let spot = spots.find(|spot| found.effect.at.contains(&spot.name));
    let units = constant.zip(spot).and_then(|(constant, spot)| {
        let mut units = constant.units.iter();
        units.find(|(carries, _)| *carries == spot.carries)
    });
    if let Some((_, unit)) = units {
        return unit.clone();
    }
    // Dahl friction is in no library. Its distance has the unit of the drive's position.
    if found.effect.kind == "dahl_friction" && name == "length" {
        let force = answer.problem.candidates[found.candidate].parameters.first();
        let is_linear = force.is_some_and(|force| force.unit == "N");
        let unit = if is_linear { "m" } else { "rad" };
        return unit.to_owned();
    }
    String::new()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounding never moves a value by a visible part of its standard deviation, and adds no digits that mean nothing.
    #[test]
    fn values_are_rounded_by_their_standard_deviations() {
        for (value, std, expected) in [
            (2.160_229_7, Some(6.9e-5), 2.160_230),
            (0.123_456_789_012, Some(1e-12), 0.123_456_789),
            (25.903_412, Some(0.2), 25.903),
            (-1234.5678, Some(31.0), -1234.6),
            (12.345_678, Some(30.0), 12.346),
            (1.0 / 3.0, None, 0.333_33),
            (0.0, Some(0.1), 0.0),
        ] {
            let rounded = round_by_deviation(value, std);
            assert_eq!(rounded.to_string(), f64::to_string(&expected));
            // At most as many digits as recordings have.
            let bound = |std: f64| (0.05 * std).max(1e-9 * value.abs());
            assert!(std.is_none_or(|std| (rounded - value).abs() <= bound(std)), "{value}");
        }
    }
}
