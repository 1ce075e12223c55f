//! Operations on numbers, independent of their meaning: filters, spectra, statistics, normal equations.

mod filters;
mod products;
mod scaled_normal_equations;
mod spectrum;
mod statistics;

pub use filters::{FilterError, LowPass, MAX_FILTER_ORDER};
pub use products::gram;
pub(crate) use products::{LANES, add_multiples, dot};
pub use scaled_normal_equations::ScaledNormalEquations;
pub(crate) use spectrum::hann_power;
pub use statistics::{float_to_count, median, white_noise};
