//! The list of cut-offs: lower ones where the residual falls to its end, and a higher one for validation runs that move
//! faster than the fit.

use super::{RATIO, SmootherSearch};
use crate::recording::held_out::TimeWindow;
use crate::recording::smoother::SmootherCandidate;
use crate::recording::smoother_trials::SmootherTrials;
use crate::recording::thresholds::FOLLOWERS_LEAST_GAIN;

/// How often the list of cut-offs is extended by two lower ones if the residual falls to its end.
const MOST_EXTENSIONS: usize = 3;

impl SmootherSearch<'_> {
    /// Tests low-passes with the given cut-offs in decreasing order, and lower ones as long as the residual clearly falls:
    /// vibrations and noise can make the band of the motion appear too wide. Also returns the windows of the tests.
    pub(super) fn try_low_passes(&self, mut cutoffs: Vec<f64>) -> Option<(Vec<Vec<TimeWindow>>, SmootherTrials)> {
        let mut last: Option<(Vec<Vec<TimeWindow>>, SmootherTrials)> = None;
        for _ in 0..=MOST_EXTENSIONS {
            let ladder: Vec<SmootherCandidate> = cutoffs.iter().copied().map(SmootherCandidate::low_pass).collect();
            // The lowest cut-off loses the most samples at the ends, so that its windows exist for all candidates. If
            // none are left, the cut-off is too low for the recording.
            let tried = self.runs(ladder[ladder.len() - 1]).and_then(|runs| {
                let looked_at = self.window_groups(&runs, ladder[0]);
                let trials = self.try_smoothers(&ladder, &looked_at)?;
                Some((looked_at, trials))
            });
            let Some((looked_at, trials)) = tried else { break };
            let still_falls = trials.falls_to_the_end();
            last = Some((looked_at, trials));
            if !still_falls {
                break;
            }
            let lowest = cutoffs[cutoffs.len() - 1];
            cutoffs.extend([lowest / RATIO, lowest / (RATIO * RATIO)]);
        }
        last
    }

    /// Index of the smoother for all recordings: the best one of the fit, or one with a higher cut-off as long as the
    /// residual of the other recordings falls by more than that of the fit rises. Their motion may be faster.
    pub(super) fn raised_for_followers(&self, trials: &SmootherTrials) -> usize {
        let mut best = trials.best;
        if self.followers.is_empty() || best == 0 {
            return best;
        }
        let followers = Self {
            recordings: self.followers.clone(),
            followers: Vec::new(),
            open: self.open.clone(),
            model: self.model,
            reading: self.reading,
            sticks: self.sticks,
        };
        let Some(runs) = followers.runs(trials.best().0) else {
            return best;
        };
        let looked_at = followers.window_groups(&runs, trials.best().0);
        let total = |index: usize| {
            let (smoother, of_fit) = trials.all[index];
            let band = self.open.band_hz;
            let of_others = followers.held_out_residual(smoother, band, band, &looked_at)?;
            Some(of_fit.figure + of_others.figure)
        };
        let Some(mut least) = total(best) else { return best };
        while let Some(higher) = best.checked_sub(1)
            && let Some(sum) = total(higher)
            && sum < least - FOLLOWERS_LEAST_GAIN
        {
            (best, least) = (higher, sum);
        }
        best
    }
}
