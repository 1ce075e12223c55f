//! From recorded columns to states: positions go in; smooth positions, rates and accelerations come out, as a [`Run`] with
//! its forces.

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

pub use decimation::{
    PASSED_BY_DECIMATION, decimate, decimate_columns, decimate_table, decimate_time,
};
pub(crate) use derivatives::mean_rate;
pub use derivatives::{Smoothed, differentiate, filter_and_differentiate};
pub(crate) use even::{is_even, on_even_times};
pub use options::{DerivativeSource, Preparation, Smoothing};
pub use periods::Repeats;
pub use prepare::Open;
pub use prepared_as::PreparedAs;
pub use run::Run;
