//! Error figures. Input: measured and model forces; output: the numbers of a comparison as `identify` and `compare`
//! print them.
//!
//! `nrms` is `|measured - model| / |measured|` in the 2-norm over the samples, all channels stacked for the total.
//! `mean_relative` is the paper's mean of `|error| / |measured|`; it has peaks where the measured force passes through
//! zero, so `nrms` is given too.
//! `abs_ratio` is `sum |error| / sum |measured|`, as Volkmann et al. (IEEE ICMA 2020) give it.
//! Figures are of every recorded sample, however the fit was computed. In addition there are figures after one low-pass
//! on both forces ([`FilteredFigures`]), which exclude the noise of the force above the motion.

mod equation_sample;
mod filtered;
mod fit_error;
mod fit_file;
mod locate;
mod residual_by_rate;
mod thresholds;

use std::fmt;

use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

pub use equation_sample::EquationSample;
pub use filtered::{BandError, FilteredChannelFigures, FilteredFigures, add_filtered_forces};
pub use fit_error::{FitFault, FitFileError};
pub use fit_file::{
    EstimatorOutput, FitDelay, FitFile, FitGain, FitParameter, ParameterInfo, ParameterStatus, fit_parameters,
};
pub use locate::{ErrorRegion, LocateOptions, TIME_COLUMN, locate_errors};
pub use residual_by_rate::{DriveResidual, RateDependence, RateTerm, ResidualLevels, find_rate_dependence};
pub use thresholds::TRIMMED_PART;

/// Error figures of a comparison.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ErrorFigures {
    /// Relative error over all channels stacked; absent if all measured values are zero, and if channels have different
    /// units, whose squares cannot be added.
    pub nrms: Option<f64>,
    /// Rms error over all channels, in the unit of the forces; absent if channels have different units.
    #[serde(default)]
    pub rms: Option<f64>,
    /// Number of samples, each of all channels.
    pub samples: usize,
    /// The figures of each channel, in the order of the drives.
    pub channels: IndexMap<String, ChannelFigures>,
    /// Figures after the same low-pass on measured and model force.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub band: Option<FilteredFigures>,
    /// Figures of the equations (rows) that the fit used, if these are not all samples: after the low-pass on regressor
    /// and forces, and after decimation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rows: Option<FilteredFigures>,
}

/// Error figures of one channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChannelFigures {
    /// Relative error; absent if all measured values are zero.
    pub nrms: Option<f64>,
    /// Mean of `|error| / |measured|` over samples with a measured value other than zero; absent if there are none.
    pub mean_relative: Option<f64>,
    /// `sum |error| / sum |measured|`; absent if all measured values are zero.
    #[serde(default)]
    pub abs_ratio: Option<f64>,
    /// Largest `|error|`, in the unit of the force.
    pub max_abs: f64,
    /// Rms error, in the unit of the force.
    pub rms: f64,
    /// The unit of the force; empty if it is not known.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub unit: String,
    /// Number of samples whose force was not measured or is a detected sensor fault; no figure includes them.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub not_counted: usize,
    /// Number of samples that `mean_relative` leaves out because exactly zero was measured.
    pub zero_measured: usize,
}

/// Why figures cannot be computed.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum FiguresError {
    /// Measured and model values differ in number, or are not complete samples of the channels.
    Shape {
        /// Number of measured values.
        measured: usize,
        /// Number of model values.
        model: usize,
        /// Number of channels.
        channels: usize,
    },
    /// A value is NaN or infinite.
    NotFinite {
        /// Name of the channel.
        channel: String,
        /// Index of the sample, from 0.
        sample: usize,
    },
    /// No samples were given.
    NoSamples,
}

impl fmt::Display for FiguresError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Shape {
                measured,
                model,
                channels,
            } => write!(
                f,
                "{measured} measured and {model} model values differ in number, or are not complete samples of {channels} channels"
            ),
            Self::NotFinite { channel, sample } => write!(
                f,
                "the measured or the model force of `{channel}` is not finite in sample {sample}; \
                 check whether the mechanism is out of reach or singular there"
            ),
            Self::NoSamples => f.write_str("there are no samples to compare"),
        }
    }
}

impl std::error::Error for FiguresError {}

/// Accumulates errors block by block; its memory does not depend on the number of samples.
///
/// ```
/// use modelmill_identify::ErrorAccumulator;
/// let mut comparison = ErrorAccumulator::new(["left".to_owned(), "right".to_owned()]);
/// comparison.add(&[3.0, 4.0], &[3.0, 5.0])?;
/// let figures = comparison.finish()?;
/// assert_eq!(figures.nrms, Some(0.2));
/// assert_eq!(figures.channels["right"].mean_relative, Some(0.25));
/// # Ok::<(), modelmill_identify::FiguresError>(())
/// ```
#[derive(Debug, Clone)]
pub struct ErrorAccumulator {
    channels: IndexMap<String, ChannelErrorSums>,
    samples: usize,
}

/// Sums over the samples of one channel.
#[derive(Debug, Clone, Default)]
struct ChannelErrorSums {
    unit: String,
    /// Samples that do not count.
    not_counted: usize,
    /// Sum of squared errors.
    error: f64,
    /// Sum of squared measured values.
    measured: f64,
    /// Sum of `|error| / |measured|`.
    relative: f64,
    /// Sum of `|error|`.
    abs_error: f64,
    /// Sum of `|measured|`.
    abs_measured: f64,
    max_abs: f64,
    zero_measured: usize,
}

impl ErrorAccumulator {
    /// A comparison of the named channels, without samples yet.
    pub fn new(channels: impl IntoIterator<Item = String>) -> Self {
        Self {
            channels: channels
                .into_iter()
                .map(|name| (name, ChannelErrorSums::default()))
                .collect(),
            samples: 0,
        }
    }

    /// The same with the units of the channels, in their order.
    #[must_use]
    pub fn with_units(mut self, units: impl IntoIterator<Item = String>) -> Self {
        for (sums, unit) in self.channels.values_mut().zip(units) {
            sums.unit = unit;
        }
        self
    }

    /// Adds complete samples, interleaved `[sample * n_channels + channel]`. Fails if the lengths do not match or a
    /// value is not finite.
    pub fn add(&mut self, measured: &[f64], model: &[f64]) -> Result<(), FiguresError> {
        self.add_counted(measured, model, |_, _| true)
    }

    /// The same, but only values for which `counts(sample, channel)` is true are included.
    pub fn add_counted(
        &mut self,
        measured: &[f64],
        model: &[f64],
        counts: impl Fn(usize, usize) -> bool,
    ) -> Result<(), FiguresError> {
        let channels = self.channels.len();
        if channels == 0 || measured.len() != model.len() || !measured.len().is_multiple_of(channels) {
            return Err(FiguresError::Shape {
                measured: measured.len(),
                model: model.len(),
                channels,
            });
        }
        let samples = measured.chunks_exact(channels);
        for (sample, (measured, model)) in samples.zip(model.chunks_exact(channels)).enumerate() {
            let values = measured.iter().zip(model).enumerate();
            for ((name, sums), (channel, (y, m))) in self.channels.iter_mut().zip(values) {
                if !counts(sample, channel) {
                    sums.not_counted += 1;
                    continue;
                }
                let error = (y - m).abs();
                if !error.is_finite() {
                    return Err(FiguresError::NotFinite {
                        channel: name.clone(),
                        sample: self.samples,
                    });
                }
                sums.error += error * error;
                sums.measured += y * y;
                sums.abs_error += error;
                sums.abs_measured += y.abs();
                sums.max_abs = sums.max_abs.max(error);
                if *y == 0.0 {
                    sums.zero_measured += 1;
                } else {
                    sums.relative += error / y.abs();
                }
            }
            self.samples += 1;
        }
        Ok(())
    }

    /// The figures of all added samples; fails if there are none.
    pub fn finish(&self) -> Result<ErrorFigures, FiguresError> {
        if self.samples == 0 {
            return Err(FiguresError::NoSamples);
        }
        let ratio = |error: f64, measured: f64| (measured > 0.0).then(|| (error / measured).sqrt());
        let total = |of: fn(&ChannelErrorSums) -> f64| self.channels.values().map(of).sum::<f64>();
        let (error, measured) = (total(|sums| sums.error), total(|sums| sums.measured));
        let counted = |sums: &ChannelErrorSums| self.samples - sums.not_counted;
        let all: usize = self.channels.values().map(counted).sum();
        let mut units = self.channels.values().map(|sums| &sums.unit);
        let is_one_unit = units.next().is_some_and(|first| units.all(|unit| unit == first));
        let channels = self.channels.iter().map(|(name, sums)| {
            let samples = counted(sums);
            let counted = samples - sums.zero_measured;
            let figures = ChannelFigures {
                nrms: ratio(sums.error, sums.measured),
                mean_relative: (counted > 0).then(|| sums.relative / counted as f64),
                abs_ratio: (sums.abs_measured > 0.0).then(|| sums.abs_error / sums.abs_measured),
                max_abs: sums.max_abs,
                rms: (sums.error / samples.max(1) as f64).sqrt(),
                unit: sums.unit.clone(),
                not_counted: sums.not_counted,
                zero_measured: sums.zero_measured,
            };
            (name.clone(), figures)
        });
        Ok(ErrorFigures {
            nrms: is_one_unit.then(|| ratio(error, measured)).flatten(),
            rms: is_one_unit.then(|| (error / all.max(1) as f64).sqrt()),
            samples: self.samples,
            channels: channels.collect(),
            band: None,
            rows: None,
        })
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde requires it")]
fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// Figures of complete columns, `measured[channel][sample]` and `model[channel][sample]`. Fails if the shapes differ, a
/// value is not finite or there are no samples.
pub fn compare_forces(
    channels: &[String],
    measured: &[Vec<f64>],
    model: &[Vec<f64>],
) -> Result<ErrorFigures, FiguresError> {
    let samples = measured.first().map_or(0, Vec::len);
    let fits =
        |columns: &[Vec<f64>]| columns.len() == channels.len() && columns.iter().all(|column| column.len() == samples);
    if !fits(measured) || !fits(model) {
        let count = |columns: &[Vec<f64>]| columns.iter().map(Vec::len).sum();
        return Err(FiguresError::Shape {
            measured: count(measured),
            model: count(model),
            channels: channels.len(),
        });
    }
    let mut comparison = ErrorAccumulator::new(channels.iter().cloned());
    let (mut y, mut m) = (Vec::new(), Vec::new());
    for sample in 0..samples {
        y.clear();
        m.clear();
        y.extend(measured.iter().map(|column| column[sample]));
        m.extend(model.iter().map(|column| column[sample]));
        comparison.add(&y, &m)?;
    }
    comparison.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_what_they_say() {
        let names = ["a".to_owned(), "b".to_owned()];
        let measured = [vec![1.0, -2.0, 0.0, 2.0], vec![4.0, 0.0, 0.0, 0.0]];
        let model = [vec![1.5, -2.0, 1.0, 2.0], vec![4.0, 0.0, 0.0, -1.0]];
        let figures = compare_forces(&names, &measured, &model).unwrap();
        let a = &figures.channels["a"];
        assert!((a.nrms.unwrap() - (1.25_f64 / 9.0).sqrt()).abs() < 1e-15);
        assert!((a.mean_relative.unwrap() - 0.5 / 3.0).abs() < 1e-15);
        assert!((a.abs_ratio.unwrap() - 1.5 / 5.0).abs() < 1e-15);
        assert_eq!((a.max_abs.to_bits(), a.zero_measured), (1.0_f64.to_bits(), 1));
        assert!((figures.nrms.unwrap() - (2.25_f64 / 25.0).sqrt()).abs() < 1e-15);
        assert!((figures.rms.unwrap() - (2.25_f64 / 8.0).sqrt()).abs() < 1e-15);
        let json = serde_json::to_value(&figures).unwrap();
        assert!(json["channels"]["b"]["mean_relative"].is_number());
        assert_eq!(serde_json::from_value::<ErrorFigures>(json).unwrap(), figures);
    }

    /// Squares of newtons and of newton metres have no sum.
    #[test]
    fn different_units_have_no_total_and_some_samples_do_not_count() {
        let names = ["a".to_owned(), "b".to_owned()];
        let mut comparison = ErrorAccumulator::new(names).with_units(["N".to_owned(), "N m".to_owned()]);
        let (measured, model) = ([3.0, 1.0, 9e9, 1.0, 4.0, 1.0], [3.0, 1.5, 0.0, 1.0, 5.0, 1.0]);
        let counts = |sample, channel| (sample, channel) != (1, 0);
        comparison.add_counted(&measured, &model, counts).unwrap();
        let figures = comparison.finish().unwrap();
        assert_eq!((figures.nrms, figures.rms), (None, None));
        let a = &figures.channels["a"];
        assert_eq!((a.nrms, a.not_counted), (Some(0.2), 1));
        assert_eq!((a.rms, a.unit.as_str()), (0.5_f64.sqrt(), "N"));
    }

    #[test]
    fn nothing_measured_gives_no_ratio_and_bad_values_are_refused() {
        let names = ["a".to_owned()];
        let silent = compare_forces(&names, &[vec![0.0, 0.0]], &[vec![1.0, 0.0]]).unwrap();
        assert_eq!((silent.nrms, silent.channels["a"].mean_relative), (None, None));
        let error = compare_forces(&names, &[vec![0.0, 1.0]], &[vec![0.0, f64::NAN]]).unwrap_err();
        assert_eq!(
            error,
            FiguresError::NotFinite {
                channel: "a".to_owned(),
                sample: 1
            }
        );
        assert_eq!(
            compare_forces(&names, &[vec![]], &[vec![]]).unwrap_err(),
            FiguresError::NoSamples
        );
        assert!(compare_forces(&names, &[vec![1.0]], &[vec![]]).is_err());
    }
}
