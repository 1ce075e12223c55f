//! Recordings held against a model: measured columns and a regressor go in; base parameters with
//! honest uncertainty, error figures and the places where the error lives come out.
//!
//! The crate takes numbers and knows nothing of how a regressor is made. The pipeline:
//!
//! 1. [`Recording::read`] - CSV, Parquet or MATLAB's format 5 into named columns; every fault has its line and its remedy.
//! 2. [`Recording::suspicions`] - what looks wrong with them; [`Recording::runs_with`] - coordinates with derivatives ([`derivatives`], [`filters`]) and
//!    forces, as a [`Run`] for each stretch between gaps in time; the caller evaluates its regressor along it, rows interleaved per
//!    sample (`row = sample * n_channels + channel`), and applies [`decimation::decimate_table`] to
//!    regressor and force where the run asks for it.
//! 3. [`LeastSquares`] - eq. (12) from a stream of rows; [`deviations::autocorrelated`] - what
//!    the result is worth.
//!    [`estimate`] weighs and reweighs rows (channels, outliers); [`instruments`] are for states that are noisy themselves.
//!    On the reduced rows work [`prior`] (nominal values as soft constraints), [`essential`] (what the recording supports)
//!    and [`physical`] (parameters that a body can have).
//! 4. [`figures`] and [`locate`] - how far the model is off, and where.
//! 5. [`FitFile`] - the result on disk and back.
//!
//! Beside it, [`interpret`]: physical parameters from identified base parameters, all real solutions;
//! [`excite`]: the motion that tells base parameters apart best, within limits;
//! and [`numeric_rank`]: eq. (9) on given values, and the numeric fallback reduction.

mod audit;
pub mod diagnose;
pub mod estimate;
pub mod excite;
pub mod figures;
pub mod interpret;
mod motion;
mod recording;
#[cfg(test)]
mod test_noise;

pub use audit::suspects;
pub use estimate::deviations::Deviations;
pub use estimate::least_squares::{LeastSquares, LeastSquaresError};
pub use estimate::solution::{RANK_TOLERANCE, Solution};
pub use estimate::triangle::Triangle;
pub use estimate::undetermined::Direction;
pub use estimate::{
    deviations, essential, instruments, least_squares, numeric_rank, physical, prior,
};
pub use figures::fit_file::{
    FitFile, FitFileError, FitParameter, ParameterInfo, Status, fit_parameters,
};
pub use figures::locate::{LocateOptions, Region};
pub use figures::{ChannelFigures, Comparison, Figures, FiguresError, locate};
pub use motion::derivatives::{Preparation, Smoothing};
pub use motion::filters::FilterError;
pub use motion::periods::Repeats;
pub use motion::run::{PreparedAs, Run};
pub use motion::{cutoff, decimation, derivatives, filters, local_polynomials, periods, series};
pub use recording::error::{Fault, RecordingError, name_of_bytes, place_word};
pub use recording::notes::{Note, Severity};
pub use recording::{Computed, NotFinite, ReadOptions, Recording};
