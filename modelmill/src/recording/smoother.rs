//! Candidates for the smoothing of positions: low-pass filters, and Fourier series if a motion is periodic.

use modelmill_identify::{SmoothingMethod, StatePreparation, float_to_count};

use crate::text::table::significant;

/// Ratio of successive numbers of harmonics.
const FEWER: f64 = 1.35;
/// Largest number of harmonics of a series.
const MOST_HARMONICS: usize = 100;

/// A candidate for the smoothing of positions.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct SmootherCandidate {
    /// Cut-off frequency of the low-pass, or highest frequency of the series, Hz.
    pub(super) cutoff: f64,
    /// The period of a Fourier series, s; `None` for a low-pass.
    period: Option<f64>,
}

impl SmootherCandidate {
    /// A low-pass with a cut-off frequency, Hz.
    pub(super) fn low_pass(cutoff: f64) -> Self {
        Self { cutoff, period: None }
    }

    /// A Fourier series with a period, s, and a number of harmonics.
    pub(super) fn series(period: f64, harmonics: usize) -> Self {
        Self {
            // The margin keeps the last harmonic when the number is rounded down.
            cutoff: (harmonics as f64 + 1e-6) / period,
            period: Some(period),
        }
    }

    /// Number of harmonics; `None` for a low-pass.
    pub(super) fn harmonics(self) -> Option<usize> {
        Some(float_to_count(self.cutoff * self.period?))
    }

    /// Sets the candidate in the options of a preparation of a motion with the given period, s.
    pub(super) fn apply_to(self, preparation: &mut StatePreparation, period: Option<f64>) {
        preparation.cutoff_hz = Some(self.cutoff);
        if self.period.is_some() {
            preparation.smoothing = SmoothingMethod::Fourier { period };
        }
    }

    /// The candidate with at least this cut-off, Hz; a series stays as it is.
    pub(super) fn at_least(self, cutoff: f64) -> Self {
        match self.period {
            Some(_) => self,
            None => Self::low_pass(self.cutoff.max(cutoff)),
        }
    }

    /// The cut-off or the number of harmonics as text.
    pub(super) fn frequency_text(self) -> String {
        match self.harmonics() {
            Some(1) => "1 harmonic".to_owned(),
            Some(n) => format!("{n} harmonics"),
            None => format!("{} Hz", significant(self.cutoff, 3)),
        }
    }

    /// The candidate as a predicate about one recording, or about several.
    pub(super) fn describe(self, are_several: bool) -> String {
        let is = if are_several { "are" } else { "is" };
        match self.period {
            Some(period) => format!(
                "{is} fitted by a Fourier series of period {} s with {}",
                significant(period, 5),
                self.frequency_text()
            ),
            None => format!("{is} smoothed by a low-pass at {}", self.frequency_text()),
        }
    }
}

/// Fourier series up to a frequency, Hz, with decreasing numbers of harmonics.
pub(super) fn series_up_to(highest: f64, period: f64) -> Vec<SmootherCandidate> {
    let mut harmonics = float_to_count(highest * period).clamp(1, MOST_HARMONICS);
    let mut ladder = Vec::new();
    while harmonics > 0 {
        ladder.push(SmootherCandidate::series(period, harmonics));
        harmonics = float_to_count(harmonics as f64 / FEWER);
    }
    ladder
}
