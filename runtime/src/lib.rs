//! What emitted models need at run time: a trait for `f32` and `f64`, the errors of a pose, and a small linear solver.
//!
//! There is no allocation and no unsafe code here, and without the feature `std` no standard library either.
#![cfg_attr(not(feature = "std"), no_std)]

mod real;
mod solve;

use core::fmt;

pub use real::Real;
pub use solve::solve;

/// A pose for which a model has no answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PoseError {
    /// The loops cannot close there.
    OutOfReach,
    /// The passive coordinates or the drives' forces are not determined there.
    Singular,
}

impl fmt::Display for PoseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::OutOfReach => "the loops cannot close: the pose is out of reach",
            Self::Singular => "the pose is singular",
        })
    }
}

impl core::error::Error for PoseError {}

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
