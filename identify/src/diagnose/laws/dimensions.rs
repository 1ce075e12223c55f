//! Units of the parameters and constants of laws, from the dimensions of what they multiply.

use super::features::{LawFactor, LawProduct, LawSite};
use super::shapes::LawVariable;

/// A unit as powers of N, m, rad and s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct LawUnit([i32; 4]);

const NAMES: [&str; 4] = ["N", "m", "rad", "s"];

impl LawUnit {
    fn divide_by(mut self, other: Self, times: i32) -> Self {
        for (own, other) in self.0.iter_mut().zip(other.0) {
            *own -= times * other;
        }
        self
    }

    /// As model files write it: `N s/(m rad)`.
    fn format_unit(self) -> String {
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

/// Unit of what a place carries.
fn force_unit(is_angle: bool) -> LawUnit {
    LawUnit([1, i32::from(is_angle), 0, 0])
}

fn unit_of(variable: LawVariable, own_is_angle: bool, other_is_angle: bool) -> LawUnit {
    let along = |is_angle: bool, over_time: i32| {
        LawUnit([0, i32::from(!is_angle), i32::from(is_angle), -over_time])
    };
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
    /// Unit of the parameter that it is multiplied by to be a force or torque at a place.
    pub fn unit(&self, site: &LawSite, sites: &[LawSite]) -> String {
        let other = self.other.is_some_and(|other| sites[other].is_angle);
        let unit = self
            .factors
            .iter()
            .fold(force_unit(site.is_angle), |unit, factor| {
                let variable = unit_of(factor.variable, site.is_angle, other);
                unit.divide_by(variable, factor.shape.unit_exponent())
            });
        unit.format_unit()
    }
}

impl LawFactor {
    /// Unit of the constants that bend it, which is that of its variable.
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
        assert_eq!(
            unit(0, None, &[(Load, LawShape::integer_power(2, false))]),
            "1/N"
        );
        assert_eq!(
            unit(
                1,
                None,
                &[(Load, LawShape::MAGNITUDE), (Rate, LawShape::SIGN)]
            ),
            "1"
        );
        assert_eq!(
            unit(
                1,
                None,
                &[
                    (Position, LawShape::LINEAR),
                    (Acceleration, LawShape::LINEAR)
                ]
            ),
            "N m s^2/rad^2"
        );
        assert_eq!(
            unit(0, None, &[(Position, LawShape::integer_power(3, true))]),
            "N/m^3"
        );
    }
}
