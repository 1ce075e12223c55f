//! Estimation of base parameters. Input: rows of a regressor and measured values; output: parameters with their
//! uncertainty.
//!
//! Estimators read the rows several times instead of storing them, or work on the R factor of the rows.
//!
//! 1. [`LeastSquares`]: QR factorisation of the rows, channel by channel, so that columns that are zero for a joint
//!    cost nothing; [`RFactor`] is its result as a value, [`RegressionSolution`] the solution.
//! 2. [`estimate`]: weights of channels and Huber's function by reweighted rows.
//! 3. [`uncertainty_with_autocorrelation`]: covariance from the influence of each sample, for every estimator.
//! 4. On the R factor alone: [`solve_with_prior`] (nominal values as soft constraints), [`select_essential`]
//!    (parameters that the recording supports), [`physical_parameters`] (physically possible parameters).
//! 5. [`estimate_with_instruments`]: R factor of instruments and regressor together, for noisy states.
//!
//! [`numeric_rank`] is eq. (9) on given values, and [`reduce_numerically`] the numeric fallback reduction.

mod body_matrices;
mod deviations;
mod divergence;
mod error;
mod essential;
mod instruments;
mod lags;
mod least_squares;
mod magnitudes;
mod numeric_rank;
mod physical;
mod prior;
mod r_factor;
mod reflections;
mod reweighted;
mod rows;
mod solution;
mod thresholds;
mod undetermined;
mod weighted_rows;

pub use body_matrices::{BodyMatrix, MatrixMap, planar_pseudo_inertia, pseudo_inertia};
pub use deviations::{ParameterUncertainty, uncertainty_with_autocorrelation};
pub use divergence::BaseMap;
pub use error::{LeastSquaresError, PhysicalError};
pub use essential::{DroppedParameter, EssentialOptions, EssentialParameters, select_essential};
pub use instruments::{InstrumentalEstimate, estimate_with_instruments};
pub use least_squares::LeastSquares;
pub use numeric_rank::{
    NumericDependency, NumericReduction, RegressorRank, condition_number, measure_rank_and_condition, numeric_rank,
    reduce_numerically,
};
pub use physical::{NOMINAL_WEIGHT, PhysicalParameters, physical_parameters};
pub use prior::{ParameterPrior, solve_with_prior};
pub use r_factor::RFactor;
pub use reweighted::{EstimateOptions, WeightedEstimate, estimate};
pub use rows::RowVisitor;
pub use solution::RegressionSolution;
pub use thresholds::{FEWEST_ROWS, HUBER_BOUND, RANK_TOLERANCE};
pub use undetermined::NullDirection;
pub use weighted_rows::RowWeighting;

pub(crate) use undetermined::null_directions;
