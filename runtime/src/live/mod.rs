//! A watch over a model in use: a recursive estimator of the base parameters with forgetting, and a test for changes.
//!
//! Rows of `H_min` and measured forces go in, sample after sample. A [`WatchVerdict`] comes out: whether a base
//! parameter has changed, and which one. Memory is fixed, nothing is allocated, nothing panics, and no step takes much
//! longer than another.
//!
//! 1. `averages`: rows and forces of a drive are averaged over blocks of samples, in the same way, so that the equation
//!    remains valid. A first-order autoregression of the drive's residual whitens them (D. Cochrane, G. Orcutt 1949).
//! 2. [`RecursiveEstimator`]: the R factor of the rows by Givens' rotations. It is a square root of the information
//!    matrix, with exponential forgetting. There are two of them: a short window, and a long memory as the reference.
//! 3. `comparison`: a test of the window for a change of each parameter, with all others common to window and reference
//!    (generalised likelihood ratio; A. Willsky, H. Jones 1976).
//! 4. [`ParameterWatch`]: compares a change with the usual differences between windows (`scatter`), for each parameter,
//!    and identifies the parameter that changed.

mod averages;
mod comparison;
mod emitted;
mod estimator;
mod options;
mod scatter;
mod watch;

pub use estimator::{EstimatorPrior, RecursiveEstimator};
pub use options::Options;
pub use watch::{ParameterWatch, WatchChange, WatchVerdict};

/// The name of [`ParameterWatch`] in earlier versions.
#[deprecated(note = "renamed to `ParameterWatch`")]
pub type Watch<T, const NB: usize, const NQ: usize> = ParameterWatch<T, NB, NQ>;
/// The name of [`WatchVerdict`] in earlier versions.
#[deprecated(note = "renamed to `WatchVerdict`")]
pub type Verdict<T, const NB: usize> = WatchVerdict<T, NB>;
/// The name of [`WatchChange`] in earlier versions.
#[deprecated(note = "renamed to `WatchChange`")]
pub type Change<T, const NB: usize> = WatchChange<T, NB>;
/// The name of [`RecursiveEstimator`] in earlier versions.
#[deprecated(note = "renamed to `RecursiveEstimator`")]
pub type Estimator<T, const NB: usize> = RecursiveEstimator<T, NB>;
/// The name of [`EstimatorPrior`] in earlier versions.
#[deprecated(note = "renamed to `EstimatorPrior`")]
pub type Prior<T, const NB: usize> = EstimatorPrior<T, NB>;
