//! Error figures after a low-pass on both forces. Input: measured and model force; output: the error within the band.
//!
//! A force is noisier than a motion, and no model explains its noise. Both forces are filtered by a Butterworth
//! low-pass of order 4, run forward and backward, and the same share of the samples is dropped at both ends. So neither
//! the decimation nor the smoothing of a preparation changes the meaning of the figures.

use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use super::thresholds::TRIMMED_PART;
use super::{ErrorAccumulator, ErrorFigures};
use crate::motion::{is_even, mean_rate, resample_evenly};
use crate::signal::{FilterError, LowPass, float_to_count};

/// Order of the low-pass in one direction.
const ORDER: usize = 4;

/// Error figures after both forces passed the same low-pass.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FilteredFigures {
    /// Cut-off of the low-pass, Hz.
    pub cutoff_hz: f64,
    /// Relative error over all channels stacked; absent in the same cases as that of [`ErrorFigures`].
    pub nrms: Option<f64>,
    /// Rms error over all channels, N or N m; absent if channels have different units.
    pub rms: Option<f64>,
    /// Number of samples that count.
    pub samples: usize,
    /// The figures of each channel.
    pub channels: IndexMap<String, FilteredChannelFigures>,
}

/// The figures of one channel after a low-pass.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FilteredChannelFigures {
    /// Relative error; absent when nothing but zero was measured.
    pub nrms: Option<f64>,
    /// Root mean square of the error, in the unit of the force.
    pub rms: f64,
}

impl FilteredFigures {
    /// Extracts the figures of filtered forces.
    pub fn new(cutoff_hz: f64, figures: &ErrorFigures) -> Self {
        let channels = figures.channels.iter().map(|(name, one)| {
            let figures = FilteredChannelFigures {
                nrms: one.nrms,
                rms: one.rms,
            };
            (name.clone(), figures)
        });
        Self {
            cutoff_hz,
            nrms: figures.nrms,
            rms: figures.rms,
            samples: figures.samples,
            channels: channels.collect(),
        }
    }
}

/// Adds one recording to a comparison of filtered forces. `measured[channel][sample]` and `model[channel][sample]` at
/// the times, s, pass a Butterworth low-pass of order 4 at `cutoff_hz`, forward and backward, and lose 5 % of their
/// samples at each end.
/// Uneven samples are first interpolated to even times, both forces equally.
/// Fails if there are too few samples, the cut-off is not below half the rate, or a value is not finite.
pub fn add_filtered_forces(
    comparison: &mut ErrorAccumulator,
    time: &[f64],
    measured: &[Vec<f64>],
    model: &[Vec<f64>],
    cutoff_hz: f64,
) -> Result<(), BandError> {
    let filter = LowPass::butterworth(ORDER, cutoff_hz, mean_rate(time))?;
    let passed = |columns: &[Vec<f64>]| -> Result<Vec<Vec<f64>>, FilterError> {
        let even = |column: &Vec<f64>| {
            if is_even(time) {
                filter.zero_phase(column)
            } else {
                filter.zero_phase(&resample_evenly(time, column))
            }
        };
        columns.iter().map(even).collect()
    };
    let (measured, model) = (passed(measured)?, passed(model)?);
    let n = time.len();
    let trim = float_to_count(TRIMMED_PART * n as f64);
    let interleaved = |columns: &[Vec<f64>]| -> Vec<f64> {
        let samples = trim..n - trim;
        samples
            .flat_map(|k| columns.iter().map(move |column| column[k]))
            .collect()
    };
    comparison.add(&interleaved(&measured), &interleaved(&model))?;
    Ok(())
}

/// Why forces cannot be compared after a low-pass.
#[derive(Debug, Clone, PartialEq)]
pub enum BandError {
    /// The filter cannot be applied to the samples.
    Filter(FilterError),
    /// The values cannot be compared.
    Figures(super::FiguresError),
}

impl From<FilterError> for BandError {
    fn from(error: FilterError) -> Self {
        Self::Filter(error)
    }
}

impl From<super::FiguresError> for BandError {
    fn from(error: super::FiguresError) -> Self {
        Self::Figures(error)
    }
}
