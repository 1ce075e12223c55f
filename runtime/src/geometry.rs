//! Geometries for which base parameters are not what they are for others.

use core::fmt;

use crate::Real;
use crate::arithmetic::Term;

/// A geometry at which base parameters divide by nothing, or by what rounding leaves.
///
/// Base parameters are written for general values of the constants. Where a denominator of theirs vanishes, columns of the
/// regressor coincide that are independent elsewhere.
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

/// Asks that a denominator does not vanish beside the sum of its terms' magnitudes; see [`Real::singular`].
///
/// # Errors
/// [`SpecialGeometry`] with its text, also where it is no number.
pub fn divisor<T: Real>(
    denominator: &'static str,
    value: impl Term<T>,
    size: impl Term<T>,
) -> Result<(), SpecialGeometry> {
    // Written so that what is no number fails as well.
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
        let vanishes = Err(SpecialGeometry {
            denominator: "a - b",
        });
        let difference = |a: f64, b: f64| divisor("a - b", Var(a - b), Var(a.abs() + b.abs()));
        assert_eq!(difference(0.3, 0.300_000_1), Ok(()));
        assert_eq!(difference(0.300_000_000_000_000_04, 0.3), vanishes);
        assert_eq!(difference(0.3, 0.3), vanishes);
        assert_eq!(difference(0.3, f64::NAN), vanishes);
        let in_single = divisor("a - b", Var(0.3_f32 - 0.300_000_1), Var(0.6));
        assert_eq!(in_single, vanishes);
    }
}
