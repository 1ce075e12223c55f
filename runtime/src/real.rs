//! Floating-point numbers.

use core::fmt::Debug;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// What an emitted model requires of its numbers; implemented for `f32` and `f64`.
pub trait Real:
    Copy
    + Debug
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The nearest number of this type.
    fn from_f64(value: f64) -> Self;
    /// The same number as `f64`.
    fn to_f64(self) -> f64;
    /// Distance from 1 to the next larger number.
    fn epsilon() -> Self;
    /// Upper limit of inputs, in any unit. Below it, powers up to the fifth are finite, or for `f32` up to the
    /// third. Products of more inputs may still overflow.
    #[inline]
    #[must_use]
    fn largest() -> Self {
        let single = Self::epsilon().to_f64() > 1e-12;
        Self::from_f64(if single { 1e12 } else { 1e60 })
    }
    /// Smallest regular determinant, relative to the magnitude of its terms: 1e-9, but not less than ten times the
    /// rounding error of those terms in this type.
    #[inline]
    #[must_use]
    fn singular() -> Self {
        Self::from_f64((10.0 * Self::epsilon().to_f64()).max(1e-9))
    }
    /// Whether it is finite and not NaN.
    fn is_finite(self) -> bool;
    /// Sine and cosine of an angle in rad.
    fn sin_cos(self) -> (Self, Self);
    /// Sines and cosines of several angles in rad: the same values as one by one.
    #[inline]
    #[must_use]
    fn sin_cos_all<const N: usize>(angles: [Self; N]) -> ([Self; N], [Self; N]) {
        let both = angles.map(Self::sin_cos);
        (both.map(|(sin, _)| sin), both.map(|(_, cos)| cos))
    }
    /// Square root.
    #[must_use]
    fn sqrt(self) -> Self;
    /// Angle of the point (`x`, `self`) in rad.
    #[must_use]
    fn atan2(self, x: Self) -> Self;
    /// Absolute value.
    #[must_use]
    fn abs(self) -> Self;
    /// Hyperbolic tangent.
    #[must_use]
    fn tanh(self) -> Self;
    /// Exponential.
    #[must_use]
    fn exp(self) -> Self;

    /// -1, 0 or 1; NaN stays NaN.
    #[must_use]
    fn sign(self) -> Self {
        let zero = Self::from_f64(0.0);
        if self > zero {
            Self::from_f64(1.0)
        } else if self < zero {
            Self::from_f64(-1.0)
        } else {
            self
        }
    }
}

macro_rules! real {
    ($float:ty, $sincos:path, $sqrt:path, $atan2:path, $tanh:path, $exp:path) => {
        #[cfg(feature = "std")]
        impl Real for $float {
            #[inline]
            #[allow(clippy::cast_possible_truncation, trivial_numeric_casts)]
            fn from_f64(value: f64) -> Self {
                value as Self
            }
            #[inline]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
            #[inline]
            fn epsilon() -> Self {
                <$float>::EPSILON
            }
            #[inline]
            fn is_finite(self) -> bool {
                self.is_finite()
            }
            #[inline]
            fn sin_cos(self) -> (Self, Self) {
                $sincos(self)
            }
            #[inline]
            fn sin_cos_all<const N: usize>(angles: [Self; N]) -> ([Self; N], [Self; N]) {
                let (sin, cos) = crate::lanes::sin_cos_each(angles.map(Self::to_f64));
                (sin.map(Self::from_f64), cos.map(Self::from_f64))
            }
            #[inline]
            fn sqrt(self) -> Self {
                self.sqrt()
            }
            #[inline]
            fn atan2(self, x: Self) -> Self {
                self.atan2(x)
            }
            #[inline]
            fn abs(self) -> Self {
                self.abs()
            }
            #[inline]
            fn tanh(self) -> Self {
                self.tanh()
            }
            #[inline]
            fn exp(self) -> Self {
                self.exp()
            }
        }

        #[cfg(not(feature = "std"))]
        impl Real for $float {
            #[inline]
            #[allow(clippy::cast_possible_truncation, trivial_numeric_casts)]
            fn from_f64(value: f64) -> Self {
                value as Self
            }
            #[inline]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
            #[inline]
            fn epsilon() -> Self {
                <$float>::EPSILON
            }
            #[inline]
            fn is_finite(self) -> bool {
                self.is_finite()
            }
            #[inline]
            fn sin_cos(self) -> (Self, Self) {
                $sincos(self)
            }
            #[inline]
            fn sin_cos_all<const N: usize>(angles: [Self; N]) -> ([Self; N], [Self; N]) {
                let (sin, cos) = crate::lanes::sin_cos_each(angles.map(Self::to_f64));
                (sin.map(Self::from_f64), cos.map(Self::from_f64))
            }
            #[inline]
            fn sqrt(self) -> Self {
                $sqrt(self)
            }
            #[inline]
            fn atan2(self, x: Self) -> Self {
                $atan2(self, x)
            }
            #[inline]
            fn abs(self) -> Self {
                self.abs()
            }
            #[inline]
            fn tanh(self) -> Self {
                $tanh(self)
            }
            #[inline]
            fn exp(self) -> Self {
                $exp(self)
            }
        }
    };
}

/// Through `f64`, and rounded once more.
#[inline]
#[allow(clippy::cast_possible_truncation)]
fn sin_cos_single(angle: f32) -> (f32, f32) {
    let (sin, cos) = crate::lanes::sin_cos_once(f64::from(angle));
    (sin as f32, cos as f32)
}

real!(
    f64,
    crate::lanes::sin_cos_once,
    libm::sqrt,
    libm::atan2,
    libm::tanh,
    libm::exp
);
real!(f32, sin_cos_single, libm::sqrtf, libm::atan2f, libm::tanhf, libm::expf);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sign_of_what_is_no_number_is_no_number() {
        let exact = [2.0, -3.0, 0.0_f64].map(|x| Real::sign(x).to_bits());
        assert_eq!(exact, [1.0, -1.0, 0.0_f64].map(f64::to_bits));
        assert!(Real::sign(f64::NAN).is_nan());
    }
}
