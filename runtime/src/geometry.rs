//! Special geometries, for which the base parameters of a model are not valid.

use core::fmt;

use crate::Real;
use crate::arithmetic::Term;

/// A special geometry: a denominator of the base parameters is zero, or as small as rounding.
///
/// Base parameters are written for general values of the constants. Where a denominator of theirs vanishes, columns of
/// the regressor coincide that are independent elsewhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SpecialGeometry {
    /// The denominator, in the constants of the model file.
    pub denominator: &'static str,
}

impl fmt::Display for SpecialGeometry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the base parameters divide by {}, which vanishes for this geometry; derive the model from a file with these values",
            self.denominator
        )
    }
}

impl core::error::Error for SpecialGeometry {}

/// Checks that a denominator is not zero relative to the sum of its terms' magnitudes; see [`Real::singular`].
///
/// # Errors
/// [`SpecialGeometry`] with the expression of the denominator, also if its value is NaN.
pub fn divisor<T: Real>(
    denominator: &'static str,
    value: impl Term<T>,
    size: impl Term<T>,
) -> Result<(), SpecialGeometry> {
    // Written so that NaN fails as well.
    if Real::abs(value.get()) > T::singular() * size.get() {
        Ok(())
    } else {
        Err(SpecialGeometry { denominator })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Var;

    #[test]
    fn differences_that_rounding_leaves_are_no_divisors() {
        let vanishes = Err(SpecialGeometry { denominator: "a - b" });
        let difference = |a: f64, b: f64| divisor("a - b", Var(a - b), Var(a.abs() + b.abs()));
        assert_eq!(difference(0.3, 0.300_000_1), Ok(()));
        assert_eq!(difference(0.300_000_000_000_000_04, 0.3), vanishes);
        assert_eq!(difference(0.3, 0.3), vanishes);
        assert_eq!(difference(0.3, f64::NAN), vanishes);
        let in_single = divisor("a - b", Var(0.3_f32 - 0.300_000_1), Var(0.6));
        assert_eq!(in_single, vanishes);
    }
}
