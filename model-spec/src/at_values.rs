//! A mechanism at the values of its file: constants become numbers, so that their special values are visible to all
//! later stages, such as lengths that are zero or equal, and parallel axes.
//!
//! A [`Mechanism`] goes in, one with fewer constants comes out. Its geometry is the same up to rounding.

use num_bigint::BigInt;
use num_rational::BigRational;
use num_traits::{One, ToPrimitive, Zero};

use crate::exact::{ConstantIdx, ExactAngle, ExactExpression, ExactLength, ModelSymbol};
use crate::mechanism::{EffectBodies, FrameStep, LumpedMass, Mechanism, ModelConstant, ModelPart, PartInertia};

/// Number of significant digits of a decimal that are kept; digits behind them are rounding.
const DIGITS: usize = 15;

/// A constant below this share of the largest of the same unit counts as zero. An angle that differs from a multiple
/// of pi/12 by less than this share counts as that multiple.
const ROUNDING_SHARE: f64 = 1e-15;

impl Mechanism {
    /// The same mechanism with its constants replaced by their values.
    ///
    /// Constants become decimals of 15 digits, and angles near multiples of pi/12 become these multiples. Other
    /// angles stay constants, because their sines are not rational. Those with equal values share one constant.
    #[must_use]
    pub fn with_numeric_constants(&self) -> Self {
        let mut at = self.clone();
        let stands = ConstantSubstitutes::new(&self.constants);
        // Only angles that stay constants are kept, under new indices.
        at.constants = stands.kept.iter().map(|i| self.constants[*i].clone()).collect();
        at.gravity = self.gravity.each_ref().map(|x| stands.exact(x));
        // Replace constants in every expression: frames, points, couplings, bodies and effects.
        for frame in &mut at.frames {
            for step in &mut frame.steps {
                *step = match step {
                    FrameStep::Rotate(axis, angle) => FrameStep::Rotate(*axis, stands.angle(angle)),
                    FrameStep::Translate(axis, length) => FrameStep::Translate(
                        *axis,
                        ExactLength {
                            offset: stands.exact(&length.offset),
                            coordinates: length.coordinates.clone(),
                        },
                    ),
                    FrameStep::Free(body) => FrameStep::Free(*body),
                };
            }
        }
        for point in &mut at.points {
            point.at = point.at.each_ref().map(|x| stands.exact(x));
        }
        for coupling in &mut at.couplings {
            for (_, factor) in &mut coupling.terms {
                *factor = stands.exact(factor);
            }
            coupling.offset = stands.exact(&coupling.offset);
            if let Some(function) = &mut coupling.function {
                function.value = stands.exact(&function.value);
                if let Some(table) = &mut function.table {
                    table.argument = stands.exact(&table.argument);
                }
            }
        }
        stands.bodies(&mut at.parts, &mut at.lumped_masses);
        let actuators = at.actuators.iter_mut().flat_map(|actuator| &mut actuator.terms);
        let forces = at.servo_forces.iter_mut().flat_map(|force| &mut force.terms);
        for term in actuators.chain(forces) {
            term.factor = stands.exact(&term.factor);
        }
        for effect in &mut at.effects {
            for term in &mut effect.terms {
                term.expression = stands.exact(&term.expression);
            }
            for (_, value) in &mut effect.constants {
                *value = stands.exact(value);
            }
            let EffectBodies { parts, lumped_masses } = &mut effect.bodies;
            stands.bodies(parts, lumped_masses);
        }
        at.has_numeric_constants = true;
        at
    }
}

/// The replacement of a constant.
enum SubstituteValue {
    /// A rational number.
    Number(BigRational),
    /// An angle, as a multiple of pi.
    Turn(BigRational),
    /// An angle that stays a constant, by its index in the new mechanism.
    Constant(ConstantIdx),
}

/// The replacements of all constants.
struct ConstantSubstitutes {
    /// By index in the old mechanism.
    values: Vec<SubstituteValue>,
    /// Old indices of the constants that are kept, in their new order.
    kept: Vec<usize>,
}

impl ConstantSubstitutes {
    /// Decides for each constant by its value and its unit.
    fn new(constants: &[ModelConstant]) -> Self {
        let (mut of, mut kept): (Vec<SubstituteValue>, Vec<usize>) = Default::default();
        for constant in constants {
            if !constant.is_angle {
                // Zero is decided relative to the largest constant of the same unit.
                let alike = constants.iter().filter(|c| c.unit == constant.unit);
                // Values of the same unit, this one included.
                let largest = alike.map(|c| c.value.abs()).fold(0.0, f64::max);
                of.push(SubstituteValue::Number(
                    if constant.value.abs() < ROUNDING_SHARE * largest {
                        BigRational::zero()
                    } else {
                        exact_decimal(constant.value)
                    },
                ));
                continue;
            }
            let twelfths = constant.value * 12.0 / std::f64::consts::PI;
            // The nearest multiple of pi/12, if the value is that multiple up to rounding.
            let whole = twelfths.round();
            if (twelfths - whole).abs() <= ROUNDING_SHARE * 12.0 * whole.abs().max(1.0) {
                let whole = BigInt::from(whole.to_i64().unwrap_or(0));
                of.push(SubstituteValue::Turn(BigRational::new(whole, BigInt::from(12))));
                continue;
            }
            // Equal angles share one constant, so that their sines are recognised as equal.
            let same = |at: &usize| exact_decimal(constants[*at].value) == exact_decimal(constant.value);
            let at = kept.iter().position(same).unwrap_or(kept.len());
            if at == kept.len() {
                kept.push(of.len());
            }
            of.push(SubstituteValue::Constant(ConstantIdx(at)));
        }
        Self { values: of, kept }
    }

    /// An expression with all constants replaced.
    fn exact(&self, exact: &ExactExpression) -> ExactExpression {
        // Operands are replaced one by one; the shape of the expression stays.
        let inner = |a: &ExactExpression| Box::new(self.exact(a));
        let all = |operands: &[ExactExpression]| operands.iter().map(|a| self.exact(a)).collect();
        match exact {
            ExactExpression::Symbol(ModelSymbol::Constant(i)) => match &self.values[i.0] {
                SubstituteValue::Number(value) => ExactExpression::Rational(value.clone()),
                // A zero angle becomes the number zero, which later stages recognise.
                SubstituteValue::Turn(value) if value.is_zero() => ExactExpression::Rational(value.clone()),
                SubstituteValue::Turn(value) => {
                    ExactExpression::Product(vec![ExactExpression::Rational(value.clone()), ExactExpression::Pi])
                }
                SubstituteValue::Constant(i) => ExactExpression::Symbol(ModelSymbol::Constant(*i)),
            },
            ExactExpression::Rational(_) | ExactExpression::Pi | ExactExpression::Symbol(_) => exact.clone(),
            ExactExpression::Sum(operands) => ExactExpression::Sum(all(operands)),
            ExactExpression::Product(operands) => ExactExpression::Product(all(operands)),
            ExactExpression::Quotient(a, b) => ExactExpression::Quotient(inner(a), inner(b)),
            ExactExpression::Negative(a) => ExactExpression::Negative(inner(a)),
            ExactExpression::Power(a, n) => ExactExpression::Power(inner(a), *n),
            ExactExpression::Apply(function, a) => ExactExpression::Apply(*function, inner(a)),
        }
    }

    /// An angle with its constants replaced; equal symbols are added, and the terms are sorted.
    fn angle(&self, angle: &ExactAngle) -> ExactAngle {
        let mut pi = angle.pi.clone();
        let mut terms: Vec<(ModelSymbol, i32)> = Vec::new();
        // Terms with the same constant are added.
        for (symbol, n) in &angle.terms {
            let symbol = match symbol {
                ModelSymbol::Constant(i) => match &self.values[i.0] {
                    SubstituteValue::Turn(value) => {
                        pi += value * BigRational::from_integer(BigInt::from(*n));
                        continue;
                    }
                    SubstituteValue::Constant(i) => ModelSymbol::Constant(*i),
                    SubstituteValue::Number(_) => {
                        unreachable!("constants in an angle have the unit rad")
                    }
                },
                other => *other,
            };
            match terms.iter_mut().find(|(known, _)| *known == symbol) {
                Some((_, sum)) => *sum += n,
                None => terms.push((symbol, *n)),
            }
        }
        terms.retain(|(_, n)| *n != 0);
        terms.sort_unstable();
        ExactAngle { pi, terms }
    }

    /// Replaces constants in the inertias of parts and in lumped masses.
    fn bodies(&self, parts: &mut [ModelPart], lumped_masses: &mut [LumpedMass]) {
        // Both forms of an inertia have the same quantities to replace.
        for part in parts {
            let (PartInertia::AboutCentre {
                mass,
                centre: moment,
                inertia,
            }
            | PartInertia::Linear {
                mass,
                first_moment: moment,
                inertia,
            }) = &mut part.inertial;
            for entry in std::iter::once(mass).chain(moment).chain(inertia) {
                *entry = self.exact(entry);
            }
        }
        for lump in lumped_masses {
            let places = lump.force_at.iter_mut().chain(&mut lump.moment_at);
            for entry in std::iter::once(&mut lump.mass).chain(places) {
                *entry = self.exact(entry);
            }
        }
    }
}

/// The decimal of 15 digits for a floating-point number, as an exact rational.
///
/// Panics if the number is not finite.
pub(crate) fn exact_decimal(value: f64) -> BigRational {
    let digits = DIGITS - 1;
    // The printed mantissa and exponent are read back as integers.
    let written = format!("{value:.digits$e}");
    let read = written.split_once('e').and_then(|(mantissa, exponent)| {
        let mantissa: BigInt = mantissa.replace('.', "").parse().ok()?;
        let exponent = exponent.parse::<i32>().ok()? - i32::try_from(digits).ok()?;
        let ten = BigRational::from_integer(BigInt::from(10));
        let scale = num_traits::pow(ten, exponent.unsigned_abs() as usize);
        let scale = if exponent < 0 {
            BigRational::one() / scale
        } else {
            scale
        };
        Some(BigRational::from_integer(mantissa) * scale)
    });
    read.expect("a finite number has a mantissa and an exponent")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimals_are_those_that_were_written() {
        let ratio = |a: i64, b: i64| BigRational::new(a.into(), b.into());
        assert_eq!(exact_decimal(0.3), ratio(3, 10));
        assert_eq!(exact_decimal(0.1 + 0.2), ratio(3, 10));
        assert_eq!(exact_decimal(-12.5e-7), ratio(-125, 100_000_000));
        assert_eq!(exact_decimal(0.0), BigRational::zero());
        assert_eq!(
            exact_decimal(6.02e23),
            BigRational::from_integer(BigInt::from(602) * BigInt::from(10).pow(21))
        );
    }

    #[test]
    fn angles_that_are_parts_of_a_turn_stand_as_such() {
        let constant = |value: f64, unit: &str| ModelConstant {
            name: "x".to_owned(),
            value,
            unit: unit.to_owned(),
            is_angle: unit == "rad",
            note: None,
        };
        let constants = [
            constant(std::f64::consts::FRAC_PI_2, "rad"),
            constant(0.5, "rad"),
            constant(6e-17, "m"),
            constant(0.25, "m"),
            constant(0.5, "rad"),
            constant(0.0, "rad"),
        ];
        let stands = ConstantSubstitutes::new(&constants);
        assert_eq!(stands.kept, [1]);
        let name = |i: usize| ModelSymbol::Constant(ConstantIdx(i));
        let angle = stands.angle(&ExactAngle {
            pi: BigRational::zero(),
            terms: vec![(name(0), 1), (name(1), 2), (name(4), -1), (name(5), 3)],
        });
        assert_eq!(angle.pi, BigRational::new(1.into(), 2.into()));
        assert_eq!(angle.terms, [(name(0), 1)]);
        assert_eq!(
            stands.exact(&ExactExpression::Symbol(name(2))),
            ExactExpression::Rational(BigRational::zero())
        );
    }
}
