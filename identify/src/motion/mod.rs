//! From recorded columns to states: positions go in; smooth positions, rates and accelerations come out, as a [`Run`] with
//! its forces.

mod cutoff;
mod decimation;
mod delay;
mod derivatives;
mod local_polynomials;
mod options;
mod periods;
mod prepare;
mod prepared_as;
mod remarks;
mod run;
mod series;
mod smooth;

pub use decimation::{decimate, decimate_columns, decimate_table, decimate_time};
pub use derivatives::{Smoothed, differentiate, filter_and_differentiate};
pub use options::{DerivativeSource, Preparation, Smoothing};
pub use periods::Repeats;
pub use prepared_as::PreparedAs;
pub use run::Run;
