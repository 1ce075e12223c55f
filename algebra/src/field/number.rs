//! Operations that the prime field and its quadratic extension have in common: points of motion are drawn over either.

use std::ops::{Add, Mul, Neg, Sub};

use super::{FieldElement, RandomStream, hash_element};
use crate::Rational;

/// A number of a field in which expressions are evaluated.
pub trait FieldNumber:
    Copy
    + Ord
    + Default
    + std::fmt::Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Neg<Output = Self>
    + Mul<Output = Self>
{
    /// 0
    const ZERO: Self;
    /// 1
    const ONE: Self;

    /// The number congruent to a rational; `None` if the modulus divides its denominator.
    fn from_rational(value: &Rational) -> Option<Self>;

    /// Multiplicative inverse; `None` for 0.
    fn inverse(self) -> Option<Self>;

    /// A square root, if there is one.
    fn square_root(self) -> Option<Self>;

    /// A pseudorandom number that depends on `self` and `seed` alone; in the prime field for its elements.
    #[must_use]
    fn hash_with_seed(self, seed: u64) -> Self;

    /// 64 pseudorandom bits that depend on `self` and `seed` alone.
    fn hash_bits(self, seed: u64) -> u64;

    /// A random number of the prime field.
    fn draw(stream: &mut RandomStream) -> Self;

    /// A random rational point (cosine, sine) of the unit circle over the prime field.
    fn draw_circle(stream: &mut RandomStream) -> (Self, Self);

    /// Integer power; `None` for a negative power of 0.
    fn integer_power(self, exponent: i32) -> Option<Self> {
        // Repeated squaring of the number or of its inverse.
        let mut base = if exponent < 0 { self.inverse()? } else { self };
        let mut left = exponent.unsigned_abs();
        let mut result = Self::ONE;
        while left > 0 {
            if left & 1 == 1 {
                result = result * base;
            }
            left >>= 1;
            if left > 0 {
                base = base * base;
            }
        }
        Some(result)
    }
}

impl<const P: u64> FieldNumber for FieldElement<P> {
    const ZERO: Self = Self::ZERO;
    const ONE: Self = Self::ONE;

    fn from_rational(value: &Rational) -> Option<Self> {
        Self::from_rational(value)
    }

    fn inverse(self) -> Option<Self> {
        self.inverse()
    }

    fn square_root(self) -> Option<Self> {
        self.square_root()
    }

    fn hash_with_seed(self, seed: u64) -> Self {
        hash_element(seed, self)
    }

    fn hash_bits(self, seed: u64) -> u64 {
        hash_element(seed, self).representative()
    }

    fn draw(stream: &mut RandomStream) -> Self {
        stream.next_element()
    }

    fn draw_circle(stream: &mut RandomStream) -> (Self, Self) {
        stream.next_circle_point()
    }
}
