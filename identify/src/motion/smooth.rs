//! From the recorded columns of a coordinate to its position, rate and acceleration, with one of the smoothing
//! filters.

use crate::motion::cutoff::DifferentiatedSignal;
use crate::motion::derivatives::{SmoothedCoordinate, filter_and_differentiate};
use crate::motion::even::{CubicSpline, SampleSpacing, even_times, sample_spacing, spread_times};
use crate::motion::thresholds::SERIES_SAMPLES_PER_COLUMN;
use crate::motion::{local_polynomials, series};
use crate::words::{count_of, seven_digits};

/// The recorded columns of a coordinate.
pub(crate) struct RecordedCoordinate<'a> {
    /// Name of the coordinate.
    pub(crate) name: String,
    /// Positions, rad or m.
    pub(crate) q: &'a [f64],
    /// Rates, rad/s or m/s, if they are recorded and used.
    pub(crate) qd: Option<&'a [f64]>,
    /// Accelerations, rad/s^2 or m/s^2, if they are recorded and used.
    pub(crate) qdd: Option<&'a [f64]>,
}

impl RecordedCoordinate<'_> {
    /// Whether both derivatives are recorded, so that nothing must be prepared.
    pub(crate) fn is_complete(&self) -> bool {
        self.qd.is_some() && self.qdd.is_some()
    }

    /// Positions, rates and accelerations as recorded; `None` if any is missing.
    pub(crate) fn recorded_states(&self) -> Option<[Vec<f64>; 3]> {
        Some([self.q.to_vec(), self.qd?.to_vec(), self.qdd?.to_vec()])
    }

    /// The signal that is differentiated if something is missing: the rates if they are recorded, otherwise the
    /// positions.
    pub(crate) fn signal_to_differentiate(&self) -> DifferentiatedSignal<'_> {
        match self.qd {
            Some(values) => DifferentiatedSignal {
                values,
                derivative_order: 1,
            },
            None => DifferentiatedSignal {
                values: self.q,
                derivative_order: 2,
            },
        }
    }

    /// Prepares missing derivatives from the highest one that is recorded. Positions and rates then pass the same
    /// filter, so that all states belong to one motion. A recorded acceleration is kept. `None` if there are
    /// too few samples.
    ///
    /// Fails when the filter does not fit the sampling rate.
    pub(crate) fn prepare(
        &self,
        time: &[f64],
        cutoff: f64,
        way: SmoothingFilter,
    ) -> Result<Option<[Vec<f64>; 3]>, crate::FilterError> {
        if let Some(complete) = self.recorded_states() {
            return Ok(Some(complete));
        }
        // A constant coordinate has rates of zero. Filters would leave rounding errors, whose sign would be friction.
        if is_constant(self.q) && self.qd.is_none_or(is_constant) {
            let zero = vec![0.0; time.len()];
            let recorded = |values: Option<&[f64]>| values.map_or_else(|| zero.clone(), <[f64]>::to_vec);
            return Ok(Some([self.q.to_vec(), recorded(self.qd), recorded(self.qdd)]));
        }
        // The selected filter on one column.
        let smooth = |values: &[f64]| match way {
            SmoothingFilter::Butterworth { order } => smooth_at_true_times(time, values, cutoff, order).map(Some),
            SmoothingFilter::Polynomials { half_width } => {
                Ok(local_polynomials::smooth_by_polynomials(time, values, half_width))
            }
            SmoothingFilter::Series { period, harmonics } => {
                Ok(series::project_on_series(time, values, period, harmonics))
            }
        };
        // Recorded rates are smoothed, too, and give the accelerations.
        if let Some(qd) = self.qd {
            let (Some(q), Some(rate)) = (smooth(self.q)?, smooth(qd)?) else {
                return Ok(None);
            };
            return Ok(Some([q.q, rate.q, rate.qd]));
        }
        let qdd = self.qdd.map(<[f64]>::to_vec);
        Ok(smooth(self.q)?.map(|all| [all.q, all.qd, qdd.unwrap_or(all.qdd)]))
    }
}

/// [`filter_and_differentiate`] for samples at any times. Uneven samples are interpolated to even times by a spline,
/// and the results are interpolated back to the recorded times.
fn smooth_at_true_times(
    time: &[f64],
    values: &[f64],
    cutoff: f64,
    order: usize,
) -> Result<SmoothedCoordinate, crate::FilterError> {
    match sample_spacing(time) {
        SampleSpacing::Even => return filter_and_differentiate(time, values, cutoff, order),
        // Rounded times are replaced by the even ones that they were rounded from.
        SampleSpacing::Rounded => {
            return filter_and_differentiate(&even_times(time), values, cutoff, order);
        }
        SampleSpacing::Uneven => {}
    }
    let even = spread_times(time);
    let values = CubicSpline::new(time, values).evaluate_at(&even);
    let smooth = filter_and_differentiate(&even, &values, cutoff, order)?;
    let back = |values: &[f64]| CubicSpline::new(&even, values).evaluate_at(time);
    Ok(SmoothedCoordinate {
        q: back(&smooth.q),
        qd: back(&smooth.qd),
        qdd: back(&smooth.qdd),
    })
}

/// Whether all values are equal.
fn is_constant(values: &[f64]) -> bool {
    values.iter().all(|v| v.total_cmp(&values[0]).is_eq())
}

/// A smoothing filter with all of its numbers.
#[derive(Clone, Copy)]
pub(crate) enum SmoothingFilter {
    /// Butterworth's low-pass of this order, zero phase.
    Butterworth { order: usize },
    /// Local polynomials over `2 half_width + 1` samples.
    Polynomials { half_width: usize },
    /// A Fourier series with this period, s, and number of harmonics.
    Series { period: f64, harmonics: usize },
}

impl SmoothingFilter {
    /// Description for notes; `is_chosen` states whether the cut-off was chosen from the signal.
    pub(crate) fn describe(self, cutoff: f64, is_chosen: bool) -> String {
        let chosen = if is_chosen { " (chosen from the signal)" } else { "" };
        match self {
            Self::Butterworth { order } => {
                format!("Butterworth of order {order} at {cutoff:.4} Hz{chosen}, zero phase, then central differences")
            }
            Self::Polynomials { half_width } => format!(
                "polynomials of degree {} over {} samples each (Savitzky-Golay), which corresponds to a cut-off of \
                 {cutoff:.4} Hz{chosen}",
                local_polynomials::DEGREE,
                2 * half_width + 1
            ),
            Self::Series { period, harmonics } => format!(
                "a Fourier series of period {} s with {}, up to {cutoff:.4} Hz{chosen}",
                seven_digits(period),
                count_of(harmonics, "harmonic", "harmonics")
            ),
        }
    }

    /// Least number of samples for the filter.
    pub(crate) fn min_samples(self) -> usize {
        match self {
            Self::Butterworth { order } => 3 * (order + 1) + 1,
            Self::Polynomials { half_width } => 2 * half_width + 1,
            Self::Series { harmonics, .. } => SERIES_SAMPLES_PER_COLUMN * (2 * harmonics + 1),
        }
    }
}
