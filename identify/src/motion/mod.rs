//! From recorded columns to states: positions go in; smooth positions, rates and accelerations come out, as a
//! [`PreparedRun`] with its forces.
//!
//! `run` reads the columns, `prepare` selects the smoothing, `smooth` applies it, and `remarks` reports what was
//! found.
//! Low-pass: `derivatives` with `cutoff`; polynomials: `local_polynomials`; periodic motions: `periods` and `series`.

mod band;
mod cutoff;
mod decimation;
mod delay;
mod derivatives;
mod even;
mod local_polynomials;
mod options;
mod periods;
mod prepare;
mod prepared_as;
mod remarks;
mod run;
mod series;
mod smooth;
mod thresholds;

pub use decimation::{DECIMATION_PASSBAND, decimate, decimate_columns, decimate_table, decimate_time};
pub(crate) use derivatives::mean_rate;
pub use derivatives::{SmoothedCoordinate, differentiate, differentiate_by_seven_points, filter_and_differentiate};
pub use even::is_even;
pub(crate) use even::resample_evenly;
pub use options::{DerivativeSource, SmoothingMethod, StatePreparation};
pub use periods::RunRepeatability;
pub use prepare::PreparationChoices;
pub use prepared_as::PreparationRecord;
pub use run::PreparedRun;
