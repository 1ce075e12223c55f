//! What emitted models need at run time: a trait for `f32` and `f64`, the errors of a pose, and Newton's method on
//! loops.
//!
//! There is no allocation and no unsafe code here, and without the feature `std` no standard library either.
//!
//! Decision: this is a crate of its own, because emitted modules of several crates share its number trait and its
//! pose errors. It stays `no_std` and depends on one small crate (`libm`).
#![cfg_attr(not(feature = "std"), no_std)]

mod arithmetic;
pub mod blocks;
mod geometry;
mod lanes;
pub mod live;
mod loops;
mod model;
mod numbers;
#[cfg(feature = "rayon")]
mod parallel;
mod random;
mod reactions;
mod real;
mod self_test;
mod solve;
#[cfg(feature = "source")]
pub mod source;
#[cfg(feature = "std")]
mod wide;

use core::cmp::Ordering;
use core::fmt;

pub use arithmetic::{DeferredProduct, ProgramValue, Term, Var};
pub use geometry::{SpecialGeometry, divisor};
pub use lanes::{LARGEST_ANGLE, sin_cos_lanes};
pub use loops::{Loops, Scales, correct, follow, solve_passive};
pub use model::{
    Assembly, ContinuationProgram, Drives, Linearisation, LoadedState, Passive, ProgramRun, Run, State, accelerations,
    check_base, check_block_input, run_checked, run_unchecked,
};
pub use numbers::{AngleBatch, Numbers, OutputSink, ScalarNumbers, ZeroedOutputs};
pub use random::{RandomBits, scramble_bits};
pub use reactions::{ClosedLoop, Joint, Wrench};
pub use real::Real;
pub use self_test::{Random, SelfTestError, ShowRows, self_test};
pub use solve::solve;

/// What emitted modules bring into scope.
pub mod emitted {
    pub use crate::{
        Assembly, BaseParameter, Linearisation, Loops, Numbers, PoseError, Quantity, Real, Run, ScalarNumbers, Scales,
        SpecialGeometry, Term, Var, accelerations, check_base, check_finite, divisor, read, run_checked, run_unchecked,
        solve_passive, values, variables,
    };
}

/// A pose for which a model has no answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PoseError {
    /// The loops cannot close there.
    OutOfReach,
    /// The passive coordinates or the drives' forces are not determined there.
    Singular,
    /// A term of the model, such as an effect of its own, has no finite value there.
    Undefined,
    /// An input is NaN, infinite or larger than [`Real::largest`]. Contains its name in the model file, with `_d` and
    /// `_dd` for rates and accelerations.
    NotFinite(&'static str),
}

impl fmt::Display for PoseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OutOfReach => f.write_str("the loops cannot close: the pose is out of reach"),
            Self::Singular => f.write_str("the pose is singular"),
            Self::Undefined => f.write_str("a term of the model has no finite value at this state"),
            Self::NotFinite(input) => {
                write!(f, "`{input}` is NaN, infinite or too large to compute with")
            }
        }
    }
}

impl core::error::Error for PoseError {}

/// Checks that inputs are finite and not larger than [`Real::largest`].
///
/// # Errors
/// [`PoseError::NotFinite`] with the name of the first that is not.
#[inline]
pub fn check_finite<T: Real>(values: &[T], names: &[&'static str]) -> Result<(), PoseError> {
    // One branch for all of them.
    let mut fine = true;
    for value in values {
        fine &= value.abs() < T::largest();
    }
    if fine {
        return Ok(());
    }
    let mut named = values.iter().zip(names);
    let found = named.find(|(value, _)| value.abs().partial_cmp(&T::largest()) != Some(Ordering::Less));
    found.map_or(Ok(()), |(_, name)| Err(PoseError::NotFinite(name)))
}

/// Name, unit and the model file's value of a quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantity {
    /// Name in the model file.
    pub name: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// Value in the model file.
    pub value: f64,
}

impl Quantity {
    /// Name, SI unit and value.
    #[must_use]
    pub const fn new(name: &'static str, unit: &'static str, value: f64) -> Self {
        Self { name, unit, value }
    }
}

/// One base parameter: which product is retained, and what it gathers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BaseParameter {
    /// `p1_min`, `p2_min`, ...
    pub name: &'static str,
    /// The product of dynamic parameters whose column is retained.
    pub retained: &'static str,
    /// The base parameter in dynamic parameters and constants.
    pub expression: &'static str,
    /// SI unit.
    pub unit: &'static str,
}

impl BaseParameter {
    /// Name, retained product, SI unit, and expression.
    #[must_use]
    pub const fn new(name: &'static str, retained: &'static str, unit: &'static str, expression: &'static str) -> Self {
        Self {
            name,
            retained,
            expression,
            unit,
        }
    }
}
