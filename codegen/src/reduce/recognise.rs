//! Numbers written in a form that a person would choose: a small rational, or one times constants of the model file.
//!
//! Among all forms that equal a number in all its digits and have its unit, the shortest is used. A number without such
//! a form is rounded.

use modelmill_algebra::digits::BigFloat;
use modelmill_spec::Mechanism;
use num_traits::ToPrimitive;

use super::base;
use super::rational_function::{FactorVariable, PowerProduct, RationalFunction, TrigonometricPolynomial};
use crate::expr::Rational;
use crate::tree::expressions::ParameterMonomial;

/// Largest denominator of a rational that is recognised.
const LARGEST_DENOMINATOR: i64 = 24;
/// Largest numerator of a rational that is recognised.
const LARGEST_NUMERATOR: f64 = 1000.0;

/// Products of several constants are tried only if numbers are known to this relative accuracy.
const TOGETHER: f64 = 1e-20;
/// Products of three constants are tried only in files with at most this many constants.
const MOST_IN_THREES: usize = 12;
/// The same for products of two constants.
const MOST_IN_PAIRS: usize = 60;

/// Constants of a model file, and products of powers of a few of them.
pub(super) struct FileConstants<'a> {
    /// The mechanism whose constants these are.
    mechanism: &'a Mechanism,
    /// All products that are tried; the first one is 1.
    powers: Vec<ConstantPower>,
    /// Largest relative difference between a number and a form that it is recognised as.
    rounding: f64,
}

/// A product of powers of constants with its value.
struct ConstantPower {
    /// Constants in the numerator; a constant may occur twice.
    above: Vec<FactorVariable>,
    /// Constants in the denominator.
    below: Vec<FactorVariable>,
    /// Exact value for the values of the constants.
    value: BigFloat,
    /// The same in double precision.
    rough: f64,
    /// Exponent of the metre in its unit.
    metres: i32,
}

impl ConstantPower {
    /// Whether it is the product without factors.
    fn is_one(&self) -> bool {
        self.above.is_empty() && self.below.is_empty()
    }
}

impl<'a> FileConstants<'a> {
    /// Collects the products that may occur for numbers with a relative error of `rounding`. `value` returns the exact
    /// value of a constant.
    pub(super) fn new(mechanism: &'a Mechanism, value: &dyn Fn(usize) -> Option<BigFloat>, rounding: f64) -> Self {
        let one = ConstantPower {
            above: Vec::new(),
            below: Vec::new(),
            value: BigFloat::integer(1),
            rough: 1.0,
            metres: 0,
        };
        let mut powers = vec![one];
        let mut lengths: Vec<(FactorVariable, BigFloat, i32)> = Vec::new();
        for (i, constant) in mechanism.constants.iter().enumerate().filter(|(_, c)| c.value != 0.0) {
            let Some(value) = value(i) else { continue };
            // Angles occur in factors only through sines and cosines.
            if constant.is_angle {
                let Some((cosine, sine)) = value.cos_sin() else {
                    continue;
                };
                let pair = [(FactorVariable::Cos(i), cosine), (FactorVariable::Sin(i), sine)];
                let pair = pair.into_iter().filter(|(_, x)| x.to_f64().abs() > BigFloat::ROUNDING);
                lengths.extend(pair.map(|(variable, x)| (variable, x, 0)));
                continue;
            }
            match constant.unit.as_str() {
                "m" => lengths.push((FactorVariable::Constant(i), value, 1)),
                "1" => lengths.push((FactorVariable::Constant(i), value, 0)),
                _ => {}
            }
        }
        let mut push = |above: &[usize], below: &[usize]| {
            let of = |chosen: &[usize]| -> Vec<FactorVariable> { chosen.iter().map(|i| lengths[*i].0).collect() };
            let product = |chosen: &[usize]| {
                chosen
                    .iter()
                    .fold(BigFloat::integer(1), |product, i| &product * &lengths[*i].1)
            };
            let metres = |chosen: &[usize]| chosen.iter().map(|i| lengths[*i].2).sum::<i32>();
            let value = product(above) / product(below);
            powers.push(ConstantPower {
                above: of(above),
                below: of(below),
                rough: value.to_f64(),
                value,
                metres: metres(above) - metres(below),
            });
        };
        for i in 0..lengths.len() {
            push(&[i], &[]);
            push(&[], &[i]);
        }
        // There are so many products that with few digits some would equal any number by chance.
        let together = if rounding <= TOGETHER { lengths.len() } else { 0 };
        for i in 0..together {
            for j in (0..lengths.len()).filter(|_| lengths.len() <= MOST_IN_PAIRS) {
                if i <= j {
                    push(&[i, j], &[]);
                    push(&[], &[i, j]);
                }
                if i != j {
                    push(&[i], &[j]);
                }
                for k in 0..lengths.len() {
                    if i <= j && k != i && k != j && lengths.len() <= MOST_IN_THREES {
                        push(&[i, j], &[k]);
                    }
                }
            }
        }
        Self {
            mechanism,
            powers,
            rounding,
        }
    }

    /// The factor of the retained column `kept` in the column of `product`, with the value `value`.
    pub(super) fn recognise_factor(
        &self,
        value: &BigFloat,
        product: &ParameterMonomial,
        kept: &ParameterMonomial,
    ) -> RationalFunction {
        let [of_product, of_kept] = [product, kept].map(|of| base::product_unit(self.mechanism, of));
        // The column of a product has its inverse unit.
        let wanted = if of_product == of_kept {
            Some(0)
        } else {
            length_exponent(&of_product)
                .zip(length_exponent(&of_kept))
                .map(|(a, b)| b - a)
        };
        let fitting = self.powers.iter().filter(|p| match wanted {
            Some(n) => p.metres == n,
            None => p.is_one(),
        });
        // A short form has small numbers and few constants.
        let found = fitting.filter_map(|power| {
            let number = self.small_rational(value, power)?;
            let (n, d) = number.as_small()?;
            let length = n.abs() + d + 2 * (power.above.len() + power.below.len()).to_i64()?;
            Some((length, number, power))
        });
        match found.min_by_key(|(length, _, _)| *length) {
            Some((_, number, power)) => to_rational_function(number, power),
            None => decimal_function(value.to_f64()),
        }
    }

    /// `value` divided by `power`, if that is a small rational number.
    fn small_rational(&self, value: &BigFloat, power: &ConstantPower) -> Option<Rational> {
        // Relative difference up to which the exact comparison is made.
        const ROUGH: f64 = 1e-9;
        let ratio = value.to_f64() / power.rough;
        // Denominators in increasing order; double precision rules out most of them before the exact comparison.
        (1..=LARGEST_DENOMINATOR).find_map(|below| {
            let wanted = ratio * below as f64;
            let above = wanted.round();
            if above == 0.0 || above.abs() > LARGEST_NUMERATOR || (above - wanted).abs() > ROUGH * wanted.abs() {
                return None;
            }
            let number = Rational::new(above.to_i64()?, below);
            let off = &(&BigFloat::from_rational(&number) * &power.value) - value;
            (off.to_f64().abs() <= self.rounding * value.to_f64().abs()).then_some(number)
        })
    }
}

/// A number times a product of powers as a rational function.
fn to_rational_function(number: Rational, power: &ConstantPower) -> RationalFunction {
    let powers = |of: &[FactorVariable]| {
        let mut powers = PowerProduct::new();
        for variable in of {
            match powers.iter_mut().find(|(v, _)| v == variable) {
                Some((_, n)) => *n += 1,
                None => powers.push((*variable, 1)),
            }
        }
        powers.sort_unstable();
        powers
    };
    RationalFunction::new(
        TrigonometricPolynomial::from([(powers(&power.above), number)]),
        TrigonometricPolynomial::from([(powers(&power.below), Rational::ONE)]),
    )
}

/// The exponent of the metre in the unit of a mass or one of its moments; `None` for other units.
pub(super) fn length_exponent(unit: &str) -> Option<i32> {
    match unit {
        "kg" => Some(0),
        "kg m" => Some(1),
        "kg m^2" => Some(2),
        _ => None,
    }
}

/// A number rounded to thirteen significant digits, as an exact rational, so that later steps treat it like any other
/// factor.
fn decimal_function(value: f64) -> RationalFunction {
    // Digits after the decimal point of the mantissa.
    const DIGITS: i32 = 12;
    let written = format!("{value:.12e}");
    let rational = written.split_once('e').and_then(|(mantissa, exponent)| {
        let mantissa: i64 = mantissa.replace('.', "").parse().ok()?;
        let exponent: i32 = exponent.parse().ok()?;
        Some(&Rational::integer(mantissa) * &Rational::integer(10).pow(exponent - DIGITS))
    });
    RationalFunction::constant(rational.expect("a finite number has a mantissa and an exponent"))
}
