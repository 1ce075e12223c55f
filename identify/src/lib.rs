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

pub mod base_fit;
mod csv_text;
pub mod cutoff;
pub mod decimation;
mod delay;
pub mod derivatives;
pub mod deviations;
pub mod diagnose;
pub mod essential;
pub mod estimate;
pub mod excite;
pub mod figures;
pub mod filters;
pub mod instruments;
mod intake;
pub mod interpret;
pub mod least_squares;
pub mod local_polynomials;
pub mod locate;
mod magnitudes;
mod mat_file;
mod notes;
pub mod numeric_rank;
mod parquet_file;
pub mod periods;
pub mod physical;
mod preparing;
pub mod prior;
mod recording;
mod recording_checks;
mod recording_error;
mod reflections;
mod run;
mod run_checks;
pub mod series;
mod signal_checks;
mod smoothing;
mod solution;
mod spectrum;
pub mod suspects;
#[cfg(test)]
mod test_noise;
mod triangle;
mod undetermined;

pub use base_fit::{FitFile, FitFileError, FitParameter, ParameterInfo, Status};
pub use derivatives::{Preparation, Smoothing};
pub use deviations::Deviations;
pub use figures::{ChannelFigures, Comparison, Figures, FiguresError};
pub use filters::FilterError;
pub use least_squares::{LeastSquares, LeastSquaresError};
pub use locate::{LocateOptions, Region};
pub use notes::{Note, Severity};
pub use periods::Repeats;
pub use recording::{Computed, NotFinite, ReadOptions, Recording};
pub use recording_error::{Fault, RecordingError, name_of_bytes, place_word};
pub use run::{PreparedAs, Run};
pub use solution::{RANK_TOLERANCE, Solution};
pub use triangle::Triangle;
pub use undetermined::Direction;
