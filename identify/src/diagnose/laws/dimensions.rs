//! Units of the parameters and constants of laws, from the dimensions of what they multiply.

use super::features::{Factor, Product, Site};
use super::shapes::Variable;

/// A unit as powers of N, m, rad and s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Unit([i32; 4]);

const NAMES: [&str; 4] = ["N", "m", "rad", "s"];

impl Unit {
    fn over(mut self, other: Self, times: i32) -> Self {
        for (own, other) in self.0.iter_mut().zip(other.0) {
            *own -= times * other;
        }
        self
    }

    /// As model files write it: `N s/(m rad)`.
    fn text(self) -> String {
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
fn force(is_angle: bool) -> Unit {
    Unit([1, i32::from(is_angle), 0, 0])
}

fn unit_of(variable: Variable, own_is_angle: bool, other_is_angle: bool) -> Unit {
    let along = |is_angle: bool, over_time: i32| {
        Unit([0, i32::from(!is_angle), i32::from(is_angle), -over_time])
    };
    match variable {
        Variable::Position => along(own_is_angle, 0),
        Variable::Rate => along(own_is_angle, 1),
        Variable::Acceleration => along(own_is_angle, 2),
        Variable::Load => force(own_is_angle),
        Variable::OtherPosition => along(other_is_angle, 0),
        Variable::OtherRate => along(other_is_angle, 1),
    }
}

impl Product {
    /// Unit of the parameter that it is multiplied by to be a force or torque at a place.
    pub fn unit(&self, site: &Site, sites: &[Site]) -> String {
        let other = self.other.is_some_and(|other| sites[other].is_angle);
        let unit = self
            .factors
            .iter()
            .fold(force(site.is_angle), |unit, factor| {
                let variable = unit_of(factor.variable, site.is_angle, other);
                unit.over(variable, factor.shape.exponent())
            });
        unit.text()
    }
}

impl Factor {
    /// Unit of the constants that bend it, which is that of its variable.
    pub fn unit(&self, own_is_angle: bool, other_is_angle: bool) -> String {
        unit_of(self.variable, own_is_angle, other_is_angle).text()
    }
}

#[cfg(test)]
mod tests {
    use super::super::shapes::Shape;
    use super::*;

    #[test]
    fn units_follow_from_what_is_multiplied() {
        use Variable::{Acceleration, Load, OtherPosition, Position, Rate};
        let site = |is_angle| Site {
            is_angle,
            ..Site::default()
        };
        let sites = [site(false), site(true)];
        let unit = |at: usize, other: Option<usize>, factors: &[(Variable, Shape)]| {
            let factor = |(variable, shape): &(Variable, Shape)| Factor {
                variable: *variable,
                shape: *shape,
            };
            let factors = factors.iter().map(factor).collect();
            Product { other, factors }.unit(&sites[at], &sites)
        };
        assert_eq!(
            unit(
                0,
                Some(1),
                &[(OtherPosition, Shape::LINEAR), (Rate, Shape::LINEAR)]
            ),
            "N s/(m rad)"
        );
        assert_eq!(
            unit(1, None, &[(Rate, Shape::whole(2, true))]),
            "N m s^2/rad^2"
        );
        assert_eq!(unit(0, None, &[(Load, Shape::whole(2, false))]), "1/N");
        assert_eq!(
            unit(1, None, &[(Load, Shape::MAGNITUDE), (Rate, Shape::SIGN)]),
            "1"
        );
        assert_eq!(
            unit(
                1,
                None,
                &[(Position, Shape::LINEAR), (Acceleration, Shape::LINEAR)]
            ),
            "N m s^2/rad^2"
        );
        assert_eq!(unit(0, None, &[(Position, Shape::whole(3, true))]), "N/m^3");
    }
}
