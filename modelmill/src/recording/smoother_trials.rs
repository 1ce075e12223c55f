//! Smoothers that were tested on held-out parts of recordings, with their residuals.

use super::held_out::HeldOutResidual;
use super::smoother::SmootherCandidate;
use super::thresholds::{EXTENSION_LEAST_GAIN, EXTENSION_LEAST_RESIDUAL, SAME_RESIDUAL_TOLERANCE};
use crate::text::table::percent;

/// Smoothers of one kind that were tested, in the order of decreasing bandwidth.
pub(super) struct SmootherTrials {
    /// Each smoother with its residual.
    pub(super) all: Vec<(SmootherCandidate, HeldOutResidual)>,
    /// Index of the smoothest of those with nearly the smallest residual.
    pub(super) best: usize,
}

impl SmootherTrials {
    /// The chosen smoother with its residual.
    pub(super) fn best(&self) -> (SmootherCandidate, HeldOutResidual) {
        self.all[self.best]
    }

    /// Whether the last smoother is the best one, clearly better than the one before, and leaves much: a smoother one may be
    /// better still.
    pub(super) fn falls_to_the_end(&self) -> bool {
        match self.all.as_slice() {
            [.., (_, before), (_, last)] => {
                self.best + 1 == self.all.len()
                    && last.figure < before.figure - EXTENSION_LEAST_GAIN
                    && last.relative > EXTENSION_LEAST_RESIDUAL
            }
            _ => false,
        }
    }

    /// How the residual grows with the neighbours of the best, one phrase each.
    pub(super) fn neighbours(&self) -> impl Iterator<Item = String> {
        let beside = [self.best.checked_sub(1), Some(self.best + 1)];
        beside.into_iter().flatten().filter_map(|at| {
            let (smoother, other) = self.all.get(at)?;
            let cost = cost_text(other.figure - self.best().1.figure);
            Some(format!("{cost} at {}", smoother.frequency_text()))
        })
    }
}

/// The change of the residual in per cent, from the difference of two figures.
pub(super) fn cost_text(difference: f64) -> String {
    let more = difference.exp() - 1.0;
    if more.abs() < SAME_RESIDUAL_TOLERANCE {
        "the same".to_owned()
    } else if more < 0.0 {
        format!("{} less", percent(Some(-more)))
    } else {
        format!("{} more", percent(Some(more)))
    }
}
