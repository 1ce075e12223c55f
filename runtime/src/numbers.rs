//! The arithmetic of an emitted program: one number at a time, or as many as a vector register of the machine takes.
//!
//! A program is written once, for [`Numbers`]. With [`ScalarNumbers`] it is the function of one state; with the vectors
//! of [`crate::blocks`] it runs over many states at once.
//!
//! Decision: an emitted program is generic over what computes, so that vectors cost no second copy to parse and
//! check. They are instantiated where a user calls them; `modelmill-generated` compiles no vector code. The Panda's
//! two functions in three instruction sets take 2.4 s of processor time in release, compared with 0.6 s for one
//! state (AMD Zen 4, Rust 1.95).

use core::marker::PhantomData;

use crate::arithmetic::{ProgramValue, Term, Var};
use crate::{PoseError, Real};

/// Arithmetic of a program: constants, sines and cosines, and the checks that may fail.
pub trait Numbers {
    /// The numbers of the model: `f32` or `f64`.
    type Scalar: Real;
    /// Type of a variable: one number or a vector of them.
    type Value: ProgramValue;

    /// A value that is the same at every state.
    fn broadcast(&self, x: Self::Scalar) -> Var<Self::Value>;
    /// A literal number of the program.
    #[allow(clippy::inline_always, reason = "nothing at all")]
    #[inline(always)]
    fn number(&self, x: f64) -> Var<Self::Value> {
        self.broadcast(Self::Scalar::from_f64(x))
    }
    /// Sine and cosine of an angle in rad.
    fn sin_cos(&self, angle: impl Term<Self::Value>) -> (Var<Self::Value>, Var<Self::Value>);
    /// Prepares angles in rad, whose sines and cosines [`Self::sin_cos_of`] returns later. For one number all of them
    /// are computed here, which takes less time than one by one. Vectors have too few registers for the results, so
    /// they compute later and only check here whether an angle is too large.
    #[allow(clippy::inline_always, reason = "nothing at all")]
    #[inline(always)]
    fn angles<const N: usize>(&self, angles: [Var<Self::Value>; N]) -> AngleBatch<Self::Value, N> {
        AngleBatch {
            sines: angles,
            cosines: angles,
        }
    }
    /// Sine and cosine of one of [`Self::angles`].
    #[allow(clippy::inline_always, reason = "as for one")]
    #[inline(always)]
    fn sin_cos_of<const N: usize>(
        &self,
        angles: &AngleBatch<Self::Value, N>,
        k: usize,
    ) -> (Var<Self::Value>, Var<Self::Value>) {
        self.sin_cos(angles.sines[k])
    }

    /// Checks that a value is not negative.
    ///
    /// # Errors
    /// [`PoseError::OutOfReach`] for one number. A block records the failure and evaluates its states one by one.
    fn reachable(&self, x: impl Term<Self::Value>) -> Result<(), PoseError>;
    /// Checks that a determinant is not zero relative to the magnitude of its terms; see [`Real::singular`].
    ///
    /// # Errors
    /// [`PoseError::Singular`] for one number. A block records the failure and evaluates its states one by one.
    fn regular(&self, x: impl Term<Self::Value>, size: impl Term<Self::Value>) -> Result<(), PoseError>;
    /// Checks that a value is a finite number.
    ///
    /// # Errors
    /// [`PoseError::Undefined`] for one number. A block records the failure and evaluates its states one by one.
    fn finite(&self, x: impl Term<Self::Value>) -> Result<(), PoseError>;
}

/// Angles whose sines and cosines are needed later: the sines and cosines, or the angles where those are not computed
/// yet.
#[derive(Clone, Copy, Debug)]
pub struct AngleBatch<V, const N: usize> {
    pub(crate) sines: [Var<V>; N],
    pub(crate) cosines: [Var<V>; N],
}

/// One number at a time.
#[derive(Clone, Copy, Debug, Default)]
pub struct ScalarNumbers<T>(PhantomData<T>);

impl<T> ScalarNumbers<T> {
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
impl<T: Real> Numbers for ScalarNumbers<T> {
    type Scalar = T;
    type Value = T;

    #[inline(always)]
    fn broadcast(&self, x: T) -> Var<T> {
        Var(x)
    }
    #[inline(always)]
    fn sin_cos(&self, angle: impl Term<T>) -> (Var<T>, Var<T>) {
        let (sin, cos) = angle.get().sin_cos();
        (Var(sin), Var(cos))
    }
    #[inline(always)]
    fn angles<const N: usize>(&self, angles: [Var<T>; N]) -> AngleBatch<T, N> {
        let (sines, cosines) = T::sin_cos_all(angles.map(|angle| angle.0));
        AngleBatch {
            sines: sines.map(Var),
            cosines: cosines.map(Var),
        }
    }
    #[inline(always)]
    fn sin_cos_of<const N: usize>(&self, angles: &AngleBatch<T, N>, k: usize) -> (Var<T>, Var<T>) {
        (angles.sines[k], angles.cosines[k])
    }
    // The comparisons are written so that NaN fails as well.
    #[inline(always)]
    fn reachable(&self, x: impl Term<T>) -> Result<(), PoseError> {
        if x.get() >= T::from_f64(0.0) {
            Ok(())
        } else {
            Err(PoseError::OutOfReach)
        }
    }
    #[inline(always)]
    fn regular(&self, x: impl Term<T>, size: impl Term<T>) -> Result<(), PoseError> {
        if Real::abs(x.get()) > T::singular() * size.get() {
            Ok(())
        } else {
            Err(PoseError::Singular)
        }
    }
    #[inline(always)]
    fn finite(&self, x: impl Term<T>) -> Result<(), PoseError> {
        if x.get().is_finite() {
            Ok(())
        } else {
            Err(PoseError::Undefined)
        }
    }
}

/// Destination of the results of a program.
pub trait OutputSink<V> {
    /// Takes output `k`.
    fn put(&mut self, k: usize, value: impl Term<V>);
}

/// Results that begin as zeros.
pub trait ZeroedOutputs<T>: OutputSink<T> {
    /// All of them zero.
    fn zeros() -> Self;
}

#[allow(clippy::inline_always, reason = "as above")]
impl<V, const N: usize> OutputSink<V> for [V; N] {
    #[inline(always)]
    fn put(&mut self, k: usize, value: impl Term<V>) {
        self[k] = value.get();
    }
}

/// Outputs row by row.
#[allow(clippy::inline_always, reason = "as above")]
impl<V, const ROWS: usize, const COLUMNS: usize> OutputSink<V> for [[V; COLUMNS]; ROWS] {
    #[inline(always)]
    fn put(&mut self, k: usize, value: impl Term<V>) {
        self[k / COLUMNS][k % COLUMNS] = value.get();
    }
}

impl<T: Real, const N: usize> ZeroedOutputs<T> for [T; N] {
    fn zeros() -> Self {
        [T::from_f64(0.0); N]
    }
}

impl<T: Real, const ROWS: usize, const COLUMNS: usize> ZeroedOutputs<T> for [[T; COLUMNS]; ROWS] {
    fn zeros() -> Self {
        [[T::from_f64(0.0); COLUMNS]; ROWS]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A determinant of terms of size 100 counts as zero below 1e-7 where numbers have 16 digits, and where they have
    /// 7, below ten times what rounding leaves.
    #[test]
    fn singular_poses_are_told_by_the_digits_that_there_are() {
        let double = |x| ScalarNumbers::<f64>::new().regular(Var(x), Var(100.0));
        assert_eq!(double(0.9e-7), Err(PoseError::Singular));
        assert_eq!(double(-1.1e-7), Ok(()));
        let single = |x| ScalarNumbers::<f32>::new().regular(Var(x), Var(100.0));
        assert_eq!(single(1e-4), Err(PoseError::Singular));
        assert_eq!(single(-1.3e-4), Ok(()));
        assert_eq!(single(f32::NAN), Err(PoseError::Singular));
    }
}
