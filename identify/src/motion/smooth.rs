//! From what a file holds of a coordinate to its position, rate and acceleration, by one of the ways of smoothing.

use crate::motion::cutoff::Signal;
use crate::motion::derivatives::{differentiate, filter_and_differentiate, mean_rate};
use crate::motion::{local_polynomials, series};
use crate::signal::LowPass;
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

    /// What is recorded is kept; what is missing is derived from the nearest that is there.
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
            Way::Butterworth { order } => {
                filter_and_differentiate(time, values, cutoff, order).map(Some)
            }
            Way::Polynomials { half_width } => {
                Ok(local_polynomials::smooth(time, values, half_width))
            }
            Way::Series { period, harmonics } => {
                Ok(series::project(time, values, period, harmonics))
            }
        };
        if let Some(qd) = self.qd {
            if let Way::Butterworth { order } = way {
                let smooth =
                    LowPass::butterworth(order, cutoff, mean_rate(time))?.zero_phase(qd)?;
                let qdd = differentiate(time, &smooth);
                return Ok(Some([self.q.to_vec(), qd.to_vec(), qdd]));
            }
            return Ok(smooth(qd)?.map(|all| [self.q.to_vec(), qd.to_vec(), all.qd]));
        }
        let qdd = self.qdd.map(<[f64]>::to_vec);
        Ok(smooth(self.q)?.map(|all| [all.q, all.qd, qdd.unwrap_or(all.qdd)]))
    }
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
