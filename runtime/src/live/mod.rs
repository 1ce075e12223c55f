//! A watch over a model in use: a recursive estimator of the base parameters with forgetting, and a test for changes.
//!
//! Rows of `H_min` and measured forces go in, sample after sample; a [`WatchVerdict`] comes out: whether a base parameter is no
//! longer what it was, and which one. Memory is fixed, nothing is allocated, nothing panics, and no step does much more
//! than another.
//!
//! 1. `averages`: rows and forces of a drive are averaged over blocks of some samples, alike, so that the equation still
//!    holds, and made white by a first-order autoregression of the drive's residual (D. Cochrane, G. Orcutt 1949).
//! 2. [`RecursiveEstimator`]: a triangle of rows by Givens' rotations: the square root of the information matrix, with exponential
//!    forgetting. There are two: a short window, and a long memory as the reference.
//! 3. `comparison`: what the window says of a change of each parameter, all others being those of both (generalised
//!    likelihood ratio; A. Willsky, H. Jones 1976).
//! 4. [`ParameterWatch`]: holds that against how windows differ anyway, parameter by parameter, and names what changed.

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
