//! The derivative of an exact expression by one coordinate, in double precision.

use crate::exact::{CoordinateIdx, ExactExpression, ExactFunction, ModelSymbol};

impl ExactExpression {
    /// The derivative by a coordinate; `value` gives the values of symbols. It is not finite where the derivative does
    /// not exist. The sign function counts as constant.
    pub fn slope(&self, by: CoordinateIdx, value: &dyn Fn(ModelSymbol) -> f64) -> f64 {
        match self {
            Self::Rational(_) | Self::Pi | Self::Power(_, 0) => 0.0,
            Self::Symbol(symbol) => f64::from(u8::from(*symbol == ModelSymbol::Coordinate(by))),
            Self::Sum(terms) => terms.iter().map(|term| term.slope(by, value)).sum(),
            // One factor at a time is replaced by its derivative.
            Self::Product(factors) => (0..factors.len())
                .map(|k| {
                    let inner = factors[k].slope(by, value);
                    if inner == 0.0 {
                        return 0.0;
                    }
                    let others = factors.iter().enumerate().filter(|(other, _)| *other != k);
                    inner * others.map(|(_, factor)| factor.evaluate(value)).product::<f64>()
                })
                .sum(),
            Self::Quotient(above, below) => {
                let divisor = below.evaluate(value);
                (above.slope(by, value) - above.evaluate(value) / divisor * below.slope(by, value)) / divisor
            }
            Self::Negative(inner) => -inner.slope(by, value),
            Self::Power(base, exponent) => {
                f64::from(*exponent) * base.evaluate(value).powi(exponent - 1) * base.slope(by, value)
            }
            Self::Apply(function, inner) => {
                let rate = inner.slope(by, value);
                if rate == 0.0 {
                    return 0.0;
                }
                let x = inner.evaluate(value);
                rate * match function {
                    ExactFunction::Sin => x.cos(),
                    ExactFunction::Cos => -x.sin(),
                    ExactFunction::Sqrt => 0.5 / x.sqrt(),
                    // Zero at zero, as the sign there.
                    ExactFunction::Abs if x == 0.0 => 0.0,
                    ExactFunction::Abs => x.signum(),
                    ExactFunction::Sign => 0.0,
                    ExactFunction::Tanh => 1.0 - x.tanh().powi(2),
                    ExactFunction::Exp => x.exp(),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use num_rational::BigRational;

    use super::*;

    /// Every kind of node, compared with a central difference.
    #[test]
    fn agrees_with_differences() {
        let q = |i: usize| ExactExpression::Symbol(ModelSymbol::Coordinate(CoordinateIdx(i)));
        let number = |n: i64| ExactExpression::Rational(BigRational::from_integer(n.into()));
        let apply = |function, x| ExactExpression::Apply(function, Box::new(x));
        let product = |a, b| ExactExpression::Product(vec![a, b]);
        let all = [
            product(q(0), product(q(1), q(0))),
            ExactExpression::Quotient(Box::new(q(1)), Box::new(ExactExpression::Sum(vec![number(2), q(0)]))),
            ExactExpression::Power(Box::new(product(number(3), q(0))), -2),
            ExactExpression::Negative(Box::new(apply(ExactFunction::Tanh, product(q(0), q(1))))),
            apply(
                ExactFunction::Sqrt,
                ExactExpression::Sum(vec![number(2), apply(ExactFunction::Sin, q(0))]),
            ),
            apply(ExactFunction::Exp, apply(ExactFunction::Cos, product(number(2), q(0)))),
            ExactExpression::Power(Box::new(apply(ExactFunction::Abs, q(0))), 3),
            apply(ExactFunction::Sign, q(0)),
        ];
        let at = |x: f64| {
            move |symbol: ModelSymbol| match symbol {
                ModelSymbol::Coordinate(CoordinateIdx(0)) => x,
                _ => 0.7,
            }
        };
        for exact in &all {
            let (x, step) = (-0.6, 1e-6);
            let [high, low] = [x + step, x - step].map(|x| exact.evaluate(&at(x)));
            let difference = (high - low) / (2.0 * step);
            let slope = exact.slope(CoordinateIdx(0), &at(x));
            assert!(
                (slope - difference).abs() < 1e-8,
                "{exact:?}: {slope} instead of {difference}"
            );
        }
    }
}
