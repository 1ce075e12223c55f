//! Recordings compared with a model: measured columns and a regressor go in. Base parameters with their uncertainty,
//! error figures, and the places of large errors come out.
//!
//! The crate works on numbers only and does not know how a regressor is derived. The pipeline:
//!
//! 1. [`SignalRecording::read`] - CSV, Parquet, MATLAB, HDF5, MCAP or rosbag2 into named columns; every fault has its
//!    line and its remedy.
//! 2. [`SignalRecording::runs_with`] - coordinates with derivatives and forces, as a [`PreparedRun`] for each segment
//!    between gaps in time. The caller evaluates its regressor along it, rows interleaved per sample
//!    (`row = sample * n_channels + channel`), and applies [`decimate_table`] to regressor and force if the run
//!    requires it.
//! 3. [`SignalRecording::suspicious_columns`] and [`SignalRecording::position_faults`] - what is likely wrong with
//!    them.
//! 4. [`estimate`] - eq. (12) from a stream of rows ([`LeastSquares`]), weighted, robust, with
//!    instruments or nominal values, and the uncertainty of the result.
//! 5. [`ErrorAccumulator`] and [`locate_errors`] - size and place of the model error; [`FitFile`] - the result as a
//!    file.
//!
//! In addition, [`diagnose`] finds the effects that the model lacks, [`excite`] plans the motion that determines the
//! base parameters best within limits, and [`interpret`] computes physical parameters from identified base
//! parameters, with all real solutions.
//!
//! Folders, each of which uses only those above it:
//!
//! - `words`: words of messages
//! - `signal`: filters, spectra, statistics and normal equations of plain numbers
//! - `recording`: files to named columns
//! - `motion`: columns to states
//! - `audit`: checks of recordings
//! - `estimate`: rows to parameters
//! - `figures`: size and place of errors; the file of a fit
//! - `diagnose`: which effects are missing
//! - `changes`: differences between runs
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
    ChannelRegressor, DeadBand, DelayAudit, DelayEstimate, ForceDelays, PositionFault, RobustFit, robust_fit,
};
pub use estimate::{
    LeastSquares, LeastSquaresError, NullDirection, ParameterUncertainty, RANK_TOLERANCE, RFactor, RegressionSolution,
};
pub use figures::{
    BandError, ChannelFigures, DriveResidual, EquationSample, ErrorAccumulator, ErrorFigures, ErrorRegion,
    EstimatorOutput, FiguresError, FilteredChannelFigures, FilteredFigures, FitDelay, FitFault, FitFile, FitFileError,
    FitGain, FitParameter, LocateOptions, ParameterInfo, ParameterStatus, RateDependence, RateTerm, ResidualLevels,
    TIME_COLUMN, TRIMMED_PART, add_filtered_forces, compare_forces, find_rate_dependence, fit_parameters,
    locate_errors,
};
pub use motion::{
    DECIMATION_PASSBAND, DerivativeSource, PreparationChoices, PreparationRecord, PreparedRun, RunRepeatability,
    SmoothedCoordinate, SmoothingMethod, StatePreparation, decimate, decimate_columns, decimate_table, decimate_time,
    differentiate, differentiate_by_seven_points, filter_and_differentiate, is_even,
};
pub use recording::{
    ColumnInfo, ColumnScaling, ComputedColumn, NonFinitePolicy, NoteSeverity, ReadOptions, RecordingError,
    RecordingFault, RecordingFile, RecordingFiles, RecordingNote, SignalRecording, TableInfo, UnwrappedAngle,
    display_name_of_bytes, has_recording_extension, sample_place_word,
};
pub use signal::{FilterError, LowPass, MAX_FILTER_ORDER, ScaledNormalEquations, float_to_count, gram, median};
