//! Measured and model force after the same low-pass: both forces go in, the figures of what is left in the band come out.
//!
//! A force is noisier than a motion, and no model explains its noise. Both forces pass the field's filter, Butterworth's of
//! order 4 run both ways, and the same part of the samples is dropped at both ends, so that neither the decimation nor the
//! smoothing of a preparation changes what the figures mean.

use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use super::{ErrorAccumulator, ErrorFigures};
use crate::motion::{is_even, mean_rate, resample_evenly};
use crate::signal::{FilterError, LowPass, float_to_count};

/// Order of the low-pass in one direction.
const ORDER: usize = 4;
/// The part of the samples that is dropped at each end, where the filter starts and stops.
pub const TRIMMED_PART: f64 = 0.05;

/// Relative error and its size where both forces passed one low-pass.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FilteredFigures {
    /// Cut-off of the low-pass, Hz.
    pub cutoff_hz: f64,
    /// Relative error over all channels stacked; absent as that of [`Figures`] is.
    pub nrms: Option<f64>,
    /// Root mean square of the error over all channels; absent where channels have different units.
    pub rms: Option<f64>,
    /// Samples that count.
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
    /// What figures of filtered forces say.
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

/// Adds one recording to a comparison of filtered forces: `measured[channel][sample]` and `model[channel][sample]` at the
/// times, s, pass Butterworth's filter of order 4 at `cutoff_hz`, both ways, and lose 5 % of their samples at each end.
/// Uneven samples are taken to even times first, both forces alike.
/// Fails when there are too few samples, the cut-off is not below half the rate, or a value is not finite.
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
    /// The filter does not suit the samples.
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
