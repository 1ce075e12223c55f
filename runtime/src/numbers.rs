//! What an emitted program computes with: one number, or as many as a vector of the machine holds.
//!
//! A program is written once, for [`Numbers`]. With [`One`] it is the function of one state; with the vectors of
//! [`crate::blocks`] it runs over many states at once.

use core::marker::PhantomData;
use core::ops::{Add, Div, Mul, Neg, Sub};

use crate::{PoseError, Real};

/// Arithmetic of a program; whatever needs more than `+ - * /` is asked of `self`.
pub trait Numbers {
    /// The numbers of the model: `f32` or `f64`.
    type Scalar: Real;
    /// What a variable of the program holds.
    type Value: Copy
        + Add<Output = Self::Value>
        + Sub<Output = Self::Value>
        + Mul<Output = Self::Value>
        + Div<Output = Self::Value>
        + Neg<Output = Self::Value>;

    /// A value that is the same at every state.
    fn of(&self, x: Self::Scalar) -> Self::Value;
    /// A number that stands in the program.
    fn number(&self, x: f64) -> Self::Value;
    /// Sine and cosine of an angle in rad.
    fn sin_cos(&self, angle: Self::Value) -> (Self::Value, Self::Value);
    /// Angles in rad whose sines and cosines [`Self::sin_cos_of`] gives later. One number computes all of them here, which
    /// takes less time than one by one; vectors wait, since they lack the registers to hold the results, and look only
    /// whether one is too large.
    #[allow(clippy::inline_always, reason = "nothing at all")]
    #[inline(always)]
    fn angles<const N: usize>(
        &self,
        angles: [Self::Value; N],
    ) -> ([Self::Value; N], [Self::Value; N]) {
        (angles, angles)
    }
    /// Sine and cosine of one of [`Self::angles`], by what stands in both arrays.
    #[allow(clippy::inline_always, reason = "as for one")]
    #[inline(always)]
    fn sin_cos_of(&self, angle: Self::Value, _: Self::Value) -> (Self::Value, Self::Value) {
        self.sin_cos(angle)
    }
    /// Square root.
    fn sqrt(&self, x: Self::Value) -> Self::Value;
    /// Absolute value.
    fn abs(&self, x: Self::Value) -> Self::Value;
    /// -1, 0 or 1; what is no number stays what it is.
    fn sign(&self, x: Self::Value) -> Self::Value;
    /// Hyperbolic tangent.
    fn tanh(&self, x: Self::Value) -> Self::Value;
    /// Exponential.
    fn exp(&self, x: Self::Value) -> Self::Value;
    /// Angle of the point (`x`, `y`) in rad.
    fn atan2(&self, y: Self::Value, x: Self::Value) -> Self::Value;

    /// `a * b + c`, rounded once where the machine does so at no cost.
    #[allow(clippy::inline_always, reason = "an instruction or two")]
    #[inline(always)]
    fn mul_add(&self, a: Self::Value, b: Self::Value, c: Self::Value) -> Self::Value {
        a * b + c
    }
    /// `a * b - c`, as [`Self::mul_add`].
    #[allow(clippy::inline_always, reason = "an instruction or two")]
    #[inline(always)]
    fn mul_sub(&self, a: Self::Value, b: Self::Value, c: Self::Value) -> Self::Value {
        a * b - c
    }
    /// `c - a * b`, as [`Self::mul_add`].
    #[allow(clippy::inline_always, reason = "an instruction or two")]
    #[inline(always)]
    fn sub_mul(&self, c: Self::Value, a: Self::Value, b: Self::Value) -> Self::Value {
        c - a * b
    }

    /// Asks that a value is not negative.
    ///
    /// # Errors
    /// [`PoseError::OutOfReach`] for one number; a block remembers it and is looked at one by one.
    fn reachable(&self, x: Self::Value) -> Result<(), PoseError>;
    /// Asks that a determinant does not vanish beside the magnitude of its terms; see [`Real::singular`].
    ///
    /// # Errors
    /// [`PoseError::Singular`] for one number; a block remembers it and is looked at one by one.
    fn regular(&self, x: Self::Value, size: Self::Scalar) -> Result<(), PoseError>;
    /// Asks that a value is a finite number.
    ///
    /// # Errors
    /// [`PoseError::Undefined`] for one number; a block remembers it and is looked at one by one.
    fn finite(&self, x: Self::Value) -> Result<(), PoseError>;
}

/// One number at a time.
#[derive(Clone, Copy, Debug, Default)]
pub struct One<T>(PhantomData<T>);

impl<T> One<T> {
    /// The arithmetic of `T`.
    #[must_use]
    pub const fn new() -> Self {
        Self(PhantomData)
    }
}

#[allow(
    clippy::inline_always,
    reason = "each is an instruction or a call; without optimisation a program would be thousands of calls"
)]
impl<T: Real> Numbers for One<T> {
    type Scalar = T;
    type Value = T;

    #[inline(always)]
    fn of(&self, x: T) -> T {
        x
    }
    #[inline(always)]
    fn number(&self, x: f64) -> T {
        T::from_f64(x)
    }
    #[inline(always)]
    fn sin_cos(&self, angle: T) -> (T, T) {
        angle.sin_cos()
    }
    #[inline(always)]
    fn angles<const N: usize>(&self, angles: [T; N]) -> ([T; N], [T; N]) {
        T::sin_cos_all(angles)
    }
    #[inline(always)]
    fn sin_cos_of(&self, sin: T, cos: T) -> (T, T) {
        (sin, cos)
    }
    #[inline(always)]
    fn sqrt(&self, x: T) -> T {
        x.sqrt()
    }
    #[inline(always)]
    fn abs(&self, x: T) -> T {
        x.abs()
    }
    #[inline(always)]
    fn sign(&self, x: T) -> T {
        x.sign()
    }
    #[inline(always)]
    fn tanh(&self, x: T) -> T {
        x.tanh()
    }
    #[inline(always)]
    fn exp(&self, x: T) -> T {
        x.exp()
    }
    #[inline(always)]
    fn atan2(&self, y: T, x: T) -> T {
        y.atan2(x)
    }
    // Each is written so that what is no number fails as well.
    #[inline(always)]
    fn reachable(&self, x: T) -> Result<(), PoseError> {
        if x >= T::from_f64(0.0) {
            Ok(())
        } else {
            Err(PoseError::OutOfReach)
        }
    }
    #[inline(always)]
    fn regular(&self, x: T, size: T) -> Result<(), PoseError> {
        if x.abs() > T::singular() * size {
            Ok(())
        } else {
            Err(PoseError::Singular)
        }
    }
    #[inline(always)]
    fn finite(&self, x: T) -> Result<(), PoseError> {
        if x.is_finite() {
            Ok(())
        } else {
            Err(PoseError::Undefined)
        }
    }
}

/// Where a program leaves its results.
pub trait Outputs<V> {
    /// Takes output `k`.
    fn put(&mut self, k: usize, value: V);
}

#[allow(clippy::inline_always, reason = "as above")]
impl<V, const N: usize> Outputs<V> for [V; N] {
    #[inline(always)]
    fn put(&mut self, k: usize, value: V) {
        self[k] = value;
    }
}

/// Outputs row by row.
#[allow(clippy::inline_always, reason = "as above")]
impl<V, const ROWS: usize, const COLUMNS: usize> Outputs<V> for [[V; COLUMNS]; ROWS] {
    #[inline(always)]
    fn put(&mut self, k: usize, value: V) {
        self[k / COLUMNS][k % COLUMNS] = value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A determinant of terms of size 100 counts as zero below 1e-7 where numbers have 16 digits, and where they have 7,
    /// below ten times what rounding leaves.
    #[test]
    fn singular_poses_are_told_by_the_digits_that_there_are() {
        let double = |x| One::<f64>::new().regular(x, 100.0);
        assert_eq!(double(0.9e-7), Err(PoseError::Singular));
        assert_eq!(double(-1.1e-7), Ok(()));
        let single = |x| One::<f32>::new().regular(x, 100.0);
        assert_eq!(single(1e-4), Err(PoseError::Singular));
        assert_eq!(single(-1.3e-4), Ok(()));
        assert_eq!(single(f32::NAN), Err(PoseError::Singular));
    }
}
