//! From what a file holds of a coordinate to its position, rate and acceleration, by one of the ways of smoothing.

use crate::motion::cutoff::DifferentiatedSignal;
use crate::motion::derivatives::{SmoothedCoordinate, filter_and_differentiate};
use crate::motion::even::{CubicSpline, SampleSpacing, even_times, sample_spacing, spread_times};
use crate::motion::{local_polynomials, series};
use crate::words::{count_of, seven_digits};

/// What the file holds of a coordinate.
pub(crate) struct RecordedCoordinate<'a> {
    pub(crate) name: String,
    pub(crate) q: &'a [f64],
    pub(crate) qd: Option<&'a [f64]>,
    pub(crate) qdd: Option<&'a [f64]>,
}

impl RecordedCoordinate<'_> {
    pub(crate) fn is_complete(&self) -> bool {
        self.qd.is_some() && self.qdd.is_some()
    }

    pub(crate) fn recorded_states(&self) -> Option<[Vec<f64>; 3]> {
        Some([self.q.to_vec(), self.qd?.to_vec(), self.qdd?.to_vec()])
    }

    /// What is differentiated where something is missing: the rates if they are recorded, else the positions.
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

    /// What is missing is derived from the nearest that is there; positions and rates pass the same filter then, so that all
    /// states are those of one motion. A recorded acceleration is kept.
    /// `None` if there are too few samples.
    pub(crate) fn prepare(
        &self,
        time: &[f64],
        cutoff: f64,
        way: SmoothingFilter,
    ) -> Result<Option<[Vec<f64>; 3]>, crate::FilterError> {
        if let Some(complete) = self.recorded_states() {
            return Ok(Some(complete));
        }
        // What stands still has no rate; filters would leave rounding, whose sign is friction.
        if is_constant(self.q) && self.qd.is_none_or(is_constant) {
            let zero = vec![0.0; time.len()];
            let recorded =
                |values: Option<&[f64]>| values.map_or_else(|| zero.clone(), <[f64]>::to_vec);
            return Ok(Some([
                self.q.to_vec(),
                recorded(self.qd),
                recorded(self.qdd),
            ]));
        }
        let smooth = |values: &[f64]| match way {
            SmoothingFilter::Butterworth { order } => {
                smooth_at_true_times(time, values, cutoff, order).map(Some)
            }
            SmoothingFilter::Polynomials { half_width } => Ok(
                local_polynomials::smooth_by_polynomials(time, values, half_width),
            ),
            SmoothingFilter::Series { period, harmonics } => {
                Ok(series::project_on_series(time, values, period, harmonics))
            }
        };
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

/// [`filter_and_differentiate`] of samples at any times: what is uneven is put on even times first, by the spline through
/// the samples, and what comes out is read off at the true times again.
fn smooth_at_true_times(
    time: &[f64],
    values: &[f64],
    cutoff: f64,
    order: usize,
) -> Result<SmoothedCoordinate, crate::FilterError> {
    match sample_spacing(time) {
        SampleSpacing::Even => return filter_and_differentiate(time, values, cutoff, order),
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

/// Whether all values are the same.
fn is_constant(values: &[f64]) -> bool {
    values.iter().all(|v| v.total_cmp(&values[0]).is_eq())
}

/// How positions are smoothed, with all that was left open settled.
#[derive(Clone, Copy)]
pub(crate) enum SmoothingFilter {
    Butterworth { order: usize },
    Polynomials { half_width: usize },
    Series { period: f64, harmonics: usize },
}

impl SmoothingFilter {
    pub(crate) fn describe(self, cutoff: f64, is_chosen: bool) -> String {
        let chosen = if is_chosen {
            " (chosen from the signal)"
        } else {
            ""
        };
        match self {
            Self::Butterworth { order } => format!(
                "Butterworth of order {order} at {cutoff:.4} Hz{chosen}, zero phase, then central differences"
            ),
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

    /// Samples that it needs.
    pub(crate) fn min_samples(self) -> usize {
        match self {
            Self::Butterworth { order } => 3 * (order + 1) + 1,
            Self::Polynomials { half_width } => 2 * half_width + 1,
            Self::Series { harmonics, .. } => 2 * (2 * harmonics + 1),
        }
    }
}
