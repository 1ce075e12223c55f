//! Base parameters from rows of a regressor and measured values, with what they are worth.
//!
//! Every estimator shows the rows again and again rather than keep them, or works on the triangle that they leave.
//!
//! 1. [`LeastSquares`]: rows to a triangle, channel by channel, so that columns that are zero for a joint cost nothing;
//!    [`RFactor`] is that triangle as a value, [`RegressionSolution`] what it says.
//! 2. [`estimate`]: weights of channels and Huber's function by reweighted rows.
//! 3. [`uncertainty_with_autocorrelation`]: covariance from the influence of each sample, whichever estimator made it.
//! 4. On the triangle alone: [`solve_with_prior`] (nominal values as soft constraints), [`essential`] (what the recording
//!    supports), [`physical_parameters`] (what bodies can have).
//! 5. [`estimate_with_instruments`]: the triangle of instruments and regressor side by side, for states that are noisy themselves.
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
mod reflections;
mod reweighted;
mod rows;
mod solution;
mod triangle;
mod undetermined;
mod weighted_rows;

pub use body_matrices::{BodyMatrix, MatrixMap, planar_pseudo_inertia, pseudo_inertia};
pub use deviations::{FEWEST_ROWS, ParameterUncertainty, uncertainty_with_autocorrelation};
pub use divergence::BaseMap;
pub use error::{LeastSquaresError, PhysicalError};
pub use essential::{DroppedParameter, EssentialOptions, EssentialParameters, select_essential};
pub use instruments::{InstrumentalEstimate, estimate_with_instruments};
pub use least_squares::LeastSquares;
pub use numeric_rank::{
    NumericDependency, NumericReduction, RegressorRank, condition_number, numeric_rank,
    reduce_numerically,
};
pub use physical::{NOMINAL_WEIGHT, PhysicalParameters, physical_parameters};
pub use prior::{ParameterPrior, solve_with_prior};
pub use reweighted::{EstimateOptions, HUBER_BOUND, WeightedEstimate, estimate};
pub use rows::RowVisitor;
pub use solution::{RANK_TOLERANCE, RegressionSolution};
pub use triangle::RFactor;
pub use undetermined::NullDirection;
pub use weighted_rows::RowWeighting;

pub(crate) use undetermined::null_directions;
