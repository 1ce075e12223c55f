//! Ways to smooth positions that are tried against each other: low-passes, and Fourier series where a motion repeats itself.

use modelmill_identify::{Preparation, Smoothing};

use crate::text::table::significant;

/// Ratio of neighbouring numbers of harmonics.
const FEWER: f64 = 1.35;
/// Harmonics of a series, at most.
const MOST_HARMONICS: usize = 100;

/// A way to smooth positions.
#[derive(Clone, Copy)]
pub(super) struct Smoother {
    /// Hz.
    pub(super) cutoff: f64,
    /// The period of a Fourier series, s; none of a low-pass.
    period: Option<f64>,
}

impl Smoother {
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
        Some(whole(self.cutoff * self.period?))
    }

    pub(super) fn goes_into(self, preparation: &mut Preparation) {
        preparation.cutoff_hz = Some(self.cutoff);
        if self.period.is_some() {
            preparation.smoothing = Smoothing::Fourier {
                period: self.period,
            };
        }
    }

    /// Where it is, beside others of its kind.
    pub(super) fn place(self) -> String {
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
                self.place()
            ),
            None => format!("is smoothed at {}", self.place()),
        }
    }
}

/// Series up to a frequency, Hz, of ever fewer harmonics.
pub(super) fn series_up_to(highest: f64, period: f64) -> Vec<Smoother> {
    let mut harmonics = whole(highest * period).clamp(1, MOST_HARMONICS);
    let mut ladder = Vec::new();
    while harmonics > 0 {
        ladder.push(Smoother::series(period, harmonics));
        harmonics = whole(harmonics as f64 / FEWER);
    }
    ladder
}

/// A count that was computed, rounded down.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a float becomes the nearest count there is"
)]
pub(super) fn whole(value: f64) -> usize {
    value as usize
}
