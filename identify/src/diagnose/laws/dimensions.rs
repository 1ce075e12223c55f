//! Units of the parameters and constants of laws, derived from the variables that they multiply.

use super::features::{LawFactor, LawProduct, LawSite};
use super::shapes::LawVariable;

/// A unit as powers of N, m, rad and s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct LawUnit([i32; 4]);

/// Names of the base units, in the order of the powers.
const NAMES: [&str; 4] = ["N", "m", "rad", "s"];

impl LawUnit {
    /// Divides by another unit, raised to the power `times`.
    fn divide_by(mut self, other: Self, times: i32) -> Self {
        for (own, other) in self.0.iter_mut().zip(other.0) {
            *own -= times * other;
        }
        self
    }

    /// The unit as model files write it, for example `N s/(m rad)`; "1" without unit.
    fn format_unit(self) -> String {
        // Units with positive powers, then those with negative ones.
        let side = |sign: i32| -> Vec<String> {
            let powers = NAMES.iter().zip(self.0.map(|power| sign * power));
            powers
                .filter(|(_, power)| *power > 0)
                .map(|(name, power)| match power {
                    1 => (*name).to_owned(),
                    _ => format!("{name}^{power}"),
                })
                .collect()
        };
        // Numerator and denominator.
        let (above, below) = (side(1), side(-1));
        let above = if above.is_empty() {
            "1".to_owned()
        } else {
            above.join(" ")
        };
        match below.as_slice() {
            [] => above,
            [one] => format!("{above}/{one}"),
            _ => format!("{above}/({})", below.join(" ")),
        }
    }
}

/// Unit of the force at a place: N, or N m if it is revolute.
fn force_unit(is_angle: bool) -> LawUnit {
    LawUnit([1, i32::from(is_angle), 0, 0])
}

/// Unit of a variable of a place or of another place.
fn unit_of(variable: LawVariable, own_is_angle: bool, other_is_angle: bool) -> LawUnit {
    // m or rad, divided by a power of s.
    let along = |is_angle: bool, over_time: i32| LawUnit([0, i32::from(!is_angle), i32::from(is_angle), -over_time]);
    match variable {
        LawVariable::Position => along(own_is_angle, 0),
        LawVariable::Rate => along(own_is_angle, 1),
        LawVariable::Acceleration => along(own_is_angle, 2),
        LawVariable::Load => force_unit(own_is_angle),
        LawVariable::OtherPosition => along(other_is_angle, 0),
        LawVariable::OtherRate => along(other_is_angle, 1),
    }
}

impl LawProduct {
    /// Unit of its parameter, such that the product is a force or torque at the place.
    pub fn unit(&self, site: &LawSite, sites: &[LawSite]) -> String {
        // Whether the other place is revolute.
        let other = self.other.is_some_and(|other| sites[other].is_angle);
        // Start from the unit of the force and divide by that of every factor.
        let unit = self.factors.iter().fold(force_unit(site.is_angle), |unit, factor| {
            let variable = unit_of(factor.variable, site.is_angle, other);
            unit.divide_by(variable, factor.shape.unit_exponent())
        });
        unit.format_unit()
    }
}

impl LawFactor {
    /// Unit of its constants, which is that of its variable.
    pub fn unit(&self, own_is_angle: bool, other_is_angle: bool) -> String {
        unit_of(self.variable, own_is_angle, other_is_angle).format_unit()
    }
}

#[cfg(test)]
mod tests {
    use super::super::shapes::LawShape;
    use super::*;

    #[test]
    fn units_follow_from_what_is_multiplied() {
        use LawVariable::{Acceleration, Load, OtherPosition, Position, Rate};
        let site = |is_angle| LawSite {
            is_angle,
            ..LawSite::default()
        };
        let sites = [site(false), site(true)];
        let unit = |at: usize, other: Option<usize>, factors: &[(LawVariable, LawShape)]| {
            let factor = |(variable, shape): &(LawVariable, LawShape)| LawFactor {
                variable: *variable,
                shape: *shape,
            };
            let factors = factors.iter().map(factor).collect();
            LawProduct { other, factors }.unit(&sites[at], &sites)
        };
        assert_eq!(
            unit(
                0,
                Some(1),
                &[(OtherPosition, LawShape::LINEAR), (Rate, LawShape::LINEAR)]
            ),
            "N s/(m rad)"
        );
        assert_eq!(
            unit(1, None, &[(Rate, LawShape::integer_power(2, true))]),
            "N m s^2/rad^2"
        );
        assert_eq!(unit(0, None, &[(Load, LawShape::integer_power(2, false))]), "1/N");
        assert_eq!(
            unit(1, None, &[(Load, LawShape::MAGNITUDE), (Rate, LawShape::SIGN)]),
            "1"
        );
        assert_eq!(
            unit(
                1,
                None,
                &[(Position, LawShape::LINEAR), (Acceleration, LawShape::LINEAR)]
            ),
            "N m s^2/rad^2"
        );
        assert_eq!(unit(0, None, &[(Position, LawShape::integer_power(3, true))]), "N/m^3");
    }
}
