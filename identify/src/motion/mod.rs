//! From recorded columns to states: positions go in; smooth positions, rates and accelerations come out, as a
//! [`Run`](run::Run) with its forces.

pub mod cutoff;
pub mod decimation;
mod delay;
pub mod derivatives;
pub mod filters;
pub mod local_polynomials;
pub mod periods;
pub(crate) mod prepare;
pub(crate) mod run;
pub mod series;
pub(crate) mod smoothing;
mod spectrum;
