//! Recordings held against a model: measured columns and a regressor go in; base parameters with
//! honest uncertainty, error figures and the places where the error lives come out.
//!
//! The crate takes numbers and knows nothing of how a regressor is made. The pipeline:
//!
//! 1. [`SignalRecording::read`] - CSV, Parquet, MATLAB, HDF5, MCAP or rosbag2 into named columns; every fault has its line and its remedy.
//! 2. [`SignalRecording::runs_with`] - coordinates with derivatives and forces, as a [`PreparedRun`] for each stretch between gaps in time;
//!    the caller evaluates its regressor along it, rows interleaved per sample (`row = sample * n_channels + channel`), and
//!    applies [`decimate_table`] to regressor and force where the run asks for it.
//! 3. [`SignalRecording::suspicious_columns`] and [`ForceAudit`] - what looks wrong with them.
//! 4. [`estimate`] - eq. (12) from a stream of rows ([`LeastSquares`]), weighted, robust, with instruments or nominal values,
//!    and what the result is worth.
//! 5. [`ErrorAccumulator`] and [`locate_errors`] - how far the model is off, and where; [`FitFile`] - the result on disk and back.
//!
//! Beside it, [`diagnose`]: which effects the recording needs; [`excite`]: the motion that tells base parameters apart best,
//! within limits; and [`interpret`]: physical parameters from identified base parameters, all real solutions.
//!
//! Folders, each of which uses only those above it:
//!
//! - `words`: words of messages
//! - `signal`: filters, spectra, statistics of plain numbers
//! - `recording`: files to named columns
//! - `motion`: columns to states
//! - `audit`: what looks wrong
//! - `estimate`: rows to parameters
//! - `figures`: how far off, and where; the file of a fit
//! - `diagnose`: which effects are missing
//! - `changes`: what differs between runs
//! - `excite`: motion for a recording
//! - `interpret`: physical parameters

mod audit;
pub mod changes;
pub mod diagnose;
pub mod estimate;
pub mod excite;
mod figures;
pub mod interpret;
mod motion;
mod recording;
mod signal;
#[cfg(test)]
mod test_noise;
mod words;

pub use audit::{
    ChannelRegressor, DelayAudit, DelayEstimate, ForceAudit, ForceDelays, PositionFault, RobustFit,
    WiringFault, robust_fit,
};
pub use estimate::{
    LeastSquares, LeastSquaresError, NullDirection, ParameterUncertainty, RANK_TOLERANCE, RFactor,
    RegressionSolution,
};
pub use figures::{
    BandError, ChannelFigures, ErrorAccumulator, ErrorFigures, ErrorRegion, EstimatorOutput,
    FiguresError, FilteredChannelFigures, FilteredFigures, FitFault, FitFile, FitFileError,
    FitParameter, LocateOptions, ParameterInfo, ParameterStatus, TIME_COLUMN, TRIMMED_PART,
    add_filtered_forces, compare_forces, fit_parameters, locate_errors,
};
pub use motion::{
    DECIMATION_PASSBAND, DerivativeSource, PreparationChoices, PreparationRecord, PreparedRun,
    RunRepeatability, SmoothedCoordinate, SmoothingMethod, StatePreparation, decimate,
    decimate_columns, decimate_table, decimate_time, differentiate, filter_and_differentiate,
};
pub use recording::{
    ColumnInfo, ComputedColumn, NonFinitePolicy, NoteSeverity, ReadOptions, RecordingError,
    RecordingFault, RecordingFile, RecordingFiles, RecordingNote, SignalRecording, TableInfo,
    display_name_of_bytes, has_recording_extension, sample_place_word,
};
pub use signal::{FilterError, LowPass, MAX_FILTER_ORDER};
