//! From what a file holds of a coordinate to its position, rate and acceleration, by one of the ways of smoothing.

use crate::motion::cutoff::Signal;
use crate::motion::derivatives::{Smoothed, filter_and_differentiate};
use crate::motion::even::{Spline, Steps, even_times, spread_times, steps};
use crate::motion::{local_polynomials, series};
use crate::words::{count_of, seven_digits};

/// What the file holds of a coordinate.
pub(crate) struct Recorded<'a> {
    pub(crate) name: String,
    pub(crate) q: &'a [f64],
    pub(crate) qd: Option<&'a [f64]>,
    pub(crate) qdd: Option<&'a [f64]>,
}

impl Recorded<'_> {
    pub(crate) fn is_complete(&self) -> bool {
        self.qd.is_some() && self.qdd.is_some()
    }

    pub(crate) fn complete(&self) -> Option<[Vec<f64>; 3]> {
        Some([self.q.to_vec(), self.qd?.to_vec(), self.qdd?.to_vec()])
    }

    /// What is differentiated where something is missing: the rates if they are recorded, else the positions.
    pub(crate) fn source(&self) -> Signal<'_> {
        match self.qd {
            Some(values) => Signal { values, times: 1 },
            None => Signal {
                values: self.q,
                times: 2,
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
        way: Way,
    ) -> Result<Option<[Vec<f64>; 3]>, crate::FilterError> {
        if let Some(complete) = self.complete() {
            return Ok(Some(complete));
        }
        // What stands still has no rate; filters would leave rounding, whose sign is friction.
        if is_still(self.q) && self.qd.is_none_or(is_still) {
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
            Way::Butterworth { order } => on_true_times(time, values, cutoff, order).map(Some),
            Way::Polynomials { half_width } => {
                Ok(local_polynomials::smooth(time, values, half_width))
            }
            Way::Series { period, harmonics } => {
                Ok(series::project(time, values, period, harmonics))
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
fn on_true_times(
    time: &[f64],
    values: &[f64],
    cutoff: f64,
    order: usize,
) -> Result<Smoothed, crate::FilterError> {
    match steps(time) {
        Steps::Even => return filter_and_differentiate(time, values, cutoff, order),
        Steps::Rounded => {
            return filter_and_differentiate(&even_times(time), values, cutoff, order);
        }
        Steps::Uneven => {}
    }
    let even = spread_times(time);
    let values = Spline::new(time, values).at_all(&even);
    let smooth = filter_and_differentiate(&even, &values, cutoff, order)?;
    let back = |values: &[f64]| Spline::new(&even, values).at_all(time);
    Ok(Smoothed {
        q: back(&smooth.q),
        qd: back(&smooth.qd),
        qdd: back(&smooth.qdd),
    })
}

/// Whether all values are the same.
fn is_still(values: &[f64]) -> bool {
    values.iter().all(|v| v.total_cmp(&values[0]).is_eq())
}

/// How positions are smoothed, with all that was left open settled.
#[derive(Clone, Copy)]
pub(crate) enum Way {
    Butterworth { order: usize },
    Polynomials { half_width: usize },
    Series { period: f64, harmonics: usize },
}

impl Way {
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
                "polynomials of degree {} over {} samples each (Savitzky-Golay), which suits a cut-off of \
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
    pub(crate) fn need(self) -> usize {
        match self {
            Self::Butterworth { order } => 3 * (order + 1) + 1,
            Self::Polynomials { half_width } => 2 * half_width + 1,
            Self::Series { harmonics, .. } => 2 * (2 * harmonics + 1),
        }
    }
}
