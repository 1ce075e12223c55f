//! Ways to smooth positions that are tried against each other: low-passes, and Fourier series where a motion repeats itself.

use modelmill_identify::{SmoothingMethod, StatePreparation};

use crate::text::table::significant;

/// Ratio of neighbouring numbers of harmonics.
const FEWER: f64 = 1.35;
/// Harmonics of a series, at most.
const MOST_HARMONICS: usize = 100;

/// A way to smooth positions.
#[derive(Clone, Copy)]
pub(super) struct SmootherCandidate {
    /// Hz.
    pub(super) cutoff: f64,
    /// The period of a Fourier series, s; none of a low-pass.
    period: Option<f64>,
}

impl SmootherCandidate {
    pub(super) fn low_pass(cutoff: f64) -> Self {
        Self {
            cutoff,
            period: None,
        }
    }

    pub(super) fn series(period: f64, harmonics: usize) -> Self {
        Self {
            // Rounding must not take the last one.
            cutoff: (harmonics as f64 + 1e-6) / period,
            period: Some(period),
        }
    }

    pub(super) fn harmonics(self) -> Option<usize> {
        Some(floor_to_count(self.cutoff * self.period?))
    }

    pub(super) fn apply_to(self, preparation: &mut StatePreparation) {
        preparation.cutoff_hz = Some(self.cutoff);
        if self.period.is_some() {
            preparation.smoothing = SmoothingMethod::Fourier {
                period: self.period,
            };
        }
    }

    /// Where it is, beside others of its kind.
    pub(super) fn frequency_text(self) -> String {
        match self.harmonics() {
            Some(1) => "1 harmonic".to_owned(),
            Some(n) => format!("{n} harmonics"),
            None => format!("{} Hz", significant(self.cutoff, 3)),
        }
    }

    pub(super) fn describe(self) -> String {
        match self.period {
            Some(period) => format!(
                "is taken for a Fourier series of period {} s with {}",
                significant(period, 5),
                self.frequency_text()
            ),
            None => format!("is smoothed at {}", self.frequency_text()),
        }
    }
}

/// Series up to a frequency, Hz, of ever fewer harmonics.
pub(super) fn series_up_to(highest: f64, period: f64) -> Vec<SmootherCandidate> {
    let mut harmonics = floor_to_count(highest * period).clamp(1, MOST_HARMONICS);
    let mut ladder = Vec::new();
    while harmonics > 0 {
        ladder.push(SmootherCandidate::series(period, harmonics));
        harmonics = floor_to_count(harmonics as f64 / FEWER);
    }
    ladder
}

/// A count that was computed, rounded down.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a float becomes the nearest count there is"
)]
pub(super) fn floor_to_count(value: f64) -> usize {
    value as usize
}
