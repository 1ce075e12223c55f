//! Choice of the smoothing of recordings of one machine if the user gave none: candidates are tested, and the one with
//! the smallest force residual on held-out parts of the runs is taken. All recordings with one sampling rate get the
//! same choice; those of the fit decide.
//!
//! Spectra of positions alone cannot distinguish noise of clocks and encoders from motion; forces can. For each
//! cut-off on a list, the model's regressor, with friction and an offset of every drive added, is fitted to the
//! forces on four fifths of the time. Both sides pass one low-pass at the band of the motion, and the fit is compared
//! with the last fifth. A cut-off that is too low leaves a residual that the model could explain; one that is too
//! high hides it in noise. Octaves above the band count as far as the model explains part of them. The figure is the
//! geometric mean of the residual over the drives: the likelihood of errors of unknown size, which does not depend on
//! units. A periodic motion may also be fitted by a Fourier series, whose harmonics are tested in the same way: it
//! averages over the periods what a low-pass lets through. Local polynomials are no candidates: at the same cut-off
//! their residual equals that of the low-pass on all recordings that were examined.
//!
//! Decimation is chosen last. Then the cut-off is raised as far as the decimation needs it and noise permits.

mod cutoffs;

use modelmill_boundary::message;
use modelmill_boundary::text::{Message, OptionName, Remedy};
use modelmill_identify::diagnose::white_noise;
use modelmill_identify::{
    DECIMATION_PASSBAND, LowPass, PreparationChoices, PreparedRun, RecordingNote, SignalRecording as Raw,
    float_to_count,
};
use nalgebra::DMatrix;

use super::free;
use super::friction_rows::regressor_with_friction;
use super::held_out::{
    FOLDS, FoldSums, HeldOutResidual, OctavePower, ROUNDING, TimeWindow, WindowSamples, add_to_folds, fit_folds, margin,
};
use super::options::RecordingOptions;
use super::raised_cutoff::{ComparedBand, RaisedWindow, is_harmless};
use super::smoother::{SmootherCandidate, series_up_to};
use super::smoother_trials::{SmootherTrials, cost_text};
use super::stick::StickPhases;
use super::thresholds::{
    DECIMATION_FEWEST_KEPT, SAME_RATE_TOLERANCE, SMOOTHING_LEAST_GAIN, SUITED_CUTOFF_PASSBANDS, SUITED_MOST_GROWTH,
    WINDOW_FEWEST_SAMPLES,
};
use crate::error::Outcome;
use crate::model::Model;
use crate::segment::picked_states::PickedStates;
use crate::text::table::{percent, significant};

/// Ratio of successive cut-offs.
const RATIO: f64 = 1.6;
/// The highest cut-off relative to the sampling rate: above it, differentiation amplifies more noise than the filter
/// removes.
const HIGHEST: f64 = 0.2;
/// The highest cut-off relative to the band of the forces: noise above it says nothing about them, and roughens the
/// model's forces.
const FARTHEST: f64 = 8.0;
/// The lowest cut-off, relative to the band of the forces.
const LOWEST: f64 = 0.15;
/// Number of octaves above the band of the motion that are evaluated.
const OCTAVES: usize = 2;
/// Largest number of samples for each candidate; longer recordings are evaluated in windows.
const LOOKED_AT: usize = 12_000;
/// Samples per period of the highest frequency that is evaluated.
const FINE: f64 = 5.0;
/// Number of windows of a long recording.
const WINDOWS: usize = 10;
/// Passbands of the decimation that are tested, relative to the band of the forces.
const PARALLEL: [f64; 3] = [0.5, 1.0, 2.0];
/// Samples next to a window, at the rate of the evaluation, beyond which the low-pass has no influence.
const BEYOND: usize = 60;
/// A cut-off whose residual exceeds the smallest by this factor ends the search downwards.
const HOPELESS: f64 = 1.5;

/// One recording whose preparation is chosen.
#[derive(Clone, Copy)]
pub(super) struct OpenRecording<'a> {
    /// The recording before preparation.
    pub(super) raw: &'a Raw,
    /// Its index among the recordings of the stick phases.
    pub(super) index: usize,
    /// The period of its motion, s, if it is periodic.
    period: Option<f64>,
    /// Whether it belongs to the fit.
    is_fitted: bool,
}

/// A choice for some recordings together.
pub(super) struct PreparationChoice {
    /// Index of each recording, with its reading options.
    pub(super) readings: Vec<(usize, RecordingOptions)>,
    /// What was chosen, and why.
    pub(super) note: RecordingNote,
}

/// The choices of the preparation that are open for recordings of one machine. All recordings with the same sampling
/// rate get the same cut-off, smoothing and decimation: otherwise the same parameters would be fitted to one motion and
/// compared with another that was smoothed differently.
///
/// Recordings in which nothing is open, or without forces to decide it, have no choice.
pub(super) fn choose_preparation(
    model: &Model,
    recordings: &[&Raw],
    fitted: usize,
    reading: &RecordingOptions,
    sticks: &StickPhases,
) -> Outcome<Vec<PreparationChoice>> {
    let drives = model.row_names();
    let coordinates = model.active_coordinates();
    let mut groups: Vec<Vec<(OpenRecording<'_>, PreparationChoices)>> = Vec::new();
    for (index, raw) in recordings.iter().enumerate() {
        let has_forces = !drives.is_empty() && drives.iter().all(|drive| raw.has_column(drive));
        if !has_forces || model.base.is_empty() {
            continue;
        }
        let Some(open) = raw.find_open_choices(&coordinates, &drives, &reading.preparation)? else {
            continue;
        };
        let one = OpenRecording {
            raw,
            index,
            period: open.period,
            is_fitted: index < fitted,
        };
        // A decimation counts samples, so it is common to equal rates only.
        let is_alike = |(_, other): &(OpenRecording<'_>, PreparationChoices)| {
            (open.rate_hz / other.rate_hz - 1.0).abs() < SAME_RATE_TOLERANCE
        };
        match groups.iter_mut().find(|group| group.iter().all(is_alike)) {
            Some(group) => group.push((one, open)),
            None => groups.push(vec![(one, open)]),
        }
    }
    Ok(groups
        .into_iter()
        .filter_map(|group| SmootherSearch::new(model, reading, sticks, group)?.best_choice())
        .collect())
}

/// The search for the best smoother of some recordings with one sampling rate.
struct SmootherSearch<'a> {
    /// The model that is fitted.
    model: &'a Model,
    /// The recordings.
    recordings: Vec<OpenRecording<'a>>,
    /// Recordings that get the same choice. They decide only whether a higher cut-off is needed.
    followers: Vec<OpenRecording<'a>>,
    /// The options of the user.
    reading: &'a RecordingOptions,
    /// Intervals in which drives stick, whose forces do not count.
    sticks: &'a StickPhases,
    /// The choices that are open, with rate, band and period of the motions.
    open: PreparationChoices,
}

impl<'a> SmootherSearch<'a> {
    /// The search for a group of recordings: those of the fit decide if there are any, and the fastest of their motions
    /// determines the band. The others may raise the cut-off. `None` without recordings.
    fn new(
        model: &'a Model,
        reading: &'a RecordingOptions,
        sticks: &'a StickPhases,
        group: Vec<(OpenRecording<'a>, PreparationChoices)>,
    ) -> Option<Self> {
        // A series needs a period in every recording; the longest has the most harmonics.
        let periods = group.iter().map(|(one, _)| one.period);
        let period = periods.reduce(|a, b| Some(a?.max(b?))).flatten();
        let has_fit = group.iter().any(|(one, _)| one.is_fitted);
        let (deciding, following): (Vec<_>, Vec<_>) = group.into_iter().partition(|(one, _)| one.is_fitted || !has_fit);
        let all = || deciding.iter().map(|(_, open)| open);
        let open = PreparationChoices {
            rate_hz: all().map(|open| open.rate_hz).reduce(f64::min)?,
            band_hz: all().map(|open| open.band_hz).reduce(f64::max)?,
            cutoff_hz: all().map(|open| open.cutoff_hz).reduce(f64::max)?,
            period,
        };
        Some(Self {
            model,
            recordings: deciding.into_iter().map(|(one, _)| one).collect(),
            followers: following.into_iter().map(|(one, _)| one).collect(),
            reading,
            sticks,
            open,
        })
    }

    /// The options with the best smoother and decimation for each recording, and the note that states the choice.
    fn best_choice(&self) -> Option<PreparationChoice> {
        let PreparationChoices {
            rate_hz,
            band_hz,
            cutoff_hz,
            period,
        } = self.open;
        // The list of cut-offs goes up to three steps above the default, and down to the lowest.
        let highest = (HIGHEST * rate_hz).min(FARTHEST * band_hz);
        let lowest = (LOWEST * band_hz).min(cutoff_hz);
        let mut ladder = vec![cutoff_hz.min(highest)];
        while ladder[0] * RATIO <= highest && ladder.len() < 3 {
            ladder.insert(0, ladder[0] * RATIO);
        }
        while ladder[ladder.len() - 1] / RATIO >= lowest {
            ladder.push(ladder[ladder.len() - 1] / RATIO);
        }
        let (looked_at, mut filtered) = self.try_low_passes(ladder)?;
        let best_of_fit = filtered.best;
        filtered.best = self.raised_for_followers(&filtered);
        let is_raised = filtered.best < best_of_fit;
        let series = period.and_then(|period| {
            let ladder = series_up_to(filtered.best().0.cutoff, period);
            self.try_smoothers(&ladder, &looked_at)
        });
        let (low_pass, by_filter) = filtered.best();
        // A series must be clearly better than the low-pass to be preferred.
        let is_better = |series: &SmootherTrials| series.best().1.figure < by_filter.figure - SMOOTHING_LEAST_GAIN;
        let (tried, other) = match series {
            Some(series) if is_better(&series) => {
                let more = cost_text(by_filter.figure - series.best().1.figure);
                (
                    series,
                    Some(format!("{more} by a low-pass at {}", low_pass.frequency_text())),
                )
            }
            Some(series) => {
                let (smoother, left) = series.best();
                let more = cost_text(left.figure - by_filter.figure);
                (
                    filtered,
                    Some(format!("{more} by a Fourier series of {}", smoother.frequency_text())),
                )
            }
            None => (filtered, None),
        };
        // Decimation is chosen last, for the smoother that was found.
        let (smoother, left) = tried.best();
        let (smoother, decimate, left) = self.decimation(smoother, &looked_at).unwrap_or((smoother, 1, left));
        let readings = self.recordings.iter().chain(&self.followers).map(|one| {
            let mut reading = self.reading.clone();
            smoother.apply_to(&mut reading.preparation, one.period);
            reading.preparation.decimate = decimate;
            reading.preparation.chosen = true;
            (one.index, reading)
        });
        // The note states how the residual changes with the alternatives.
        let others: Vec<String> = tried.neighbours().chain(other).collect();
        let says = self.choice_text(smoother, decimate, left, &others.join(", "), is_raised);
        Some(PreparationChoice {
            readings: readings.collect(),
            note: RecordingNote::info(says),
        })
    }

    /// The note on a choice; `others` are the costs of the alternatives.
    fn choice_text(
        &self,
        smoother: SmootherCandidate,
        decimate: usize,
        left: HeldOutResidual,
        others: &str,
        is_raised: bool,
    ) -> Message {
        let raised = if is_raised {
            " It was raised for the validation runs, whose motion is faster."
        } else {
            ""
        };
        let every = if decimate > 1 {
            format!(", and decimated by {decimate} after a low-pass on forces and regressor")
        } else {
            String::new()
        };
        let others = if others.is_empty() {
            String::new()
        } else {
            format!(" Compared with this, the error is {others}.")
        };
        let all = self.recordings.iter().chain(&self.followers);
        let files: Vec<&str> = all.map(|one| one.raw.file()).collect();
        let what = match files.as_slice() {
            [one] => format!("{one} {}", smoother.describe(false)),
            all => format!("{} {}", all.join(", "), smoother.describe(true)),
        };
        message!(
            "{what}{every}. This was chosen automatically by cross-validation: it smooths most among those whose error on held-out \
             parts of the run is close to the smallest.{raised} Its error there is {} of the force (below {} Hz, geometric mean over the \
             drives).{others} Set it yourself with {}, {} and {}.",
            percent(Some(left.relative)),
            significant(self.open.band_hz, 3),
            Remedy::option(OptionName::CutoffHz),
            Remedy::option(OptionName::Smoothing),
            Remedy::option(OptionName::Decimate),
        )
    }

    /// Tests smoothers in the order of decreasing bandwidth, until the residual is clearly too large.
    fn try_smoothers(&self, ladder: &[SmootherCandidate], looked_at: &[Vec<TimeWindow>]) -> Option<SmootherTrials> {
        let mut all: Vec<(SmootherCandidate, HeldOutResidual)> = Vec::new();
        let mut least = f64::INFINITY;
        for smoother in ladder {
            let Some(left) = self.held_out_residual(*smoother, self.open.band_hz, self.open.band_hz, looked_at) else {
                continue;
            };
            all.push((*smoother, left));
            least = least.min(left.figure);
            if left.figure > least + HOPELESS.ln() && all.len() > 3 {
                break;
            }
        }
        // Of all that are nearly as good, the last one smooths most.
        let is_good = |(_, left): &(SmootherCandidate, HeldOutResidual)| left.figure <= least + SMOOTHING_LEAST_GAIN;
        let best = all.iter().rposition(is_good)?;
        Some(SmootherTrials { all, best })
    }

    /// The factor of decimation and the smoother that suits it, with the residual on held-out parts; `None` if it
    /// cannot be evaluated.
    fn decimation(
        &self,
        smoother: SmootherCandidate,
        looked_at: &[Vec<TimeWindow>],
    ) -> Option<(SmootherCandidate, usize, HeldOutResidual)> {
        let mut best: Option<(usize, f64, HeldOutResidual)> = None;
        let all = self.recordings.iter().chain(&self.followers);
        let most = all.map(|one| one.raw.samples() / DECIMATION_FEWEST_KEPT).min()?;
        // Passbands increase, so that the strongest decimation is tested first.
        for part in PARALLEL {
            let factor = float_to_count(DECIMATION_PASSBAND * self.open.rate_hz / (part * self.open.band_hz));
            let factor = factor.min(most).max(1);
            let passed = if factor == 1 {
                f64::INFINITY
            } else {
                DECIMATION_PASSBAND * self.open.rate_hz / factor as f64
            };
            let left = self.held_out_residual(smoother, passed, self.open.band_hz, looked_at)?;
            if best.is_none_or(|(_, _, least)| left.figure < least.figure - SMOOTHING_LEAST_GAIN) {
                best = Some((factor, passed, left));
            }
            if factor == 1 {
                break;
            }
        }
        let (factor, passed, left) = best?;
        Some(if factor == 1 {
            (smoother, 1, left)
        } else {
            let (suited, left) = self
                .suited_smoother(smoother, passed, looked_at)
                .unwrap_or((smoother, left));
            (suited, factor, left)
        })
    }

    /// A smoother that passes what the decimation passes, Hz; `None` if that would let in too much noise.
    ///
    /// Otherwise forces have frequencies that the smoothed accelerations lack, and inertias become too large. What a
    /// smoother lets through above the passband costs nothing, since the decimation removes it.
    fn suited_smoother(
        &self,
        smoother: SmootherCandidate,
        passed: f64,
        looked_at: &[Vec<TimeWindow>],
    ) -> Option<(SmootherCandidate, HeldOutResidual)> {
        let judged = |smoother| self.held_out_residual(smoother, passed, passed.min(self.open.band_hz), looked_at);
        let plain = judged(smoother)?;
        for ratio in SUITED_CUTOFF_PASSBANDS {
            let suited = smoother.at_least((ratio * passed).min(HIGHEST * self.open.rate_hz));
            if suited == smoother {
                break;
            }
            let left = judged(suited)?;
            let is_small = left.relative <= (1.0 + SUITED_MOST_GROWTH) * plain.relative;
            if is_small && self.is_harmless([smoother, suited], passed, looked_at).unwrap_or(true) {
                let left = self.held_out_residual(suited, passed, self.open.band_hz, looked_at)?;
                return Some((suited, left));
            }
        }
        None
    }

    /// Whether a smoother with a higher cut-off lets in motion, or little noise, within a passband, Hz; `None` if there
    /// are too few samples.
    fn is_harmless(
        &self,
        [lower, higher]: [SmootherCandidate; 2],
        passed: f64,
        groups: &[Vec<TimeWindow>],
    ) -> Option<bool> {
        let runs = [self.runs(lower)?, self.runs(higher)?];
        let every = self.evaluation_step();
        let band = ComparedBand {
            passed,
            rate: self.open.rate_hz / every as f64,
        };
        for windows in groups {
            let rows = windows.iter().map(|window| {
                let [lower, higher] = [&runs[0], &runs[1]].map(|runs| {
                    let run = self.run_of_window(runs, window)?;
                    self.samples(run, window, every)
                });
                Some(RaisedWindow {
                    lower: lower?,
                    higher: higher?,
                })
            });
            let rows: Vec<RaisedWindow> = rows.collect::<Option<_>>()?;
            let run = self.run_of_window(&runs[0], windows.first()?)?;
            let noise: Vec<f64> = run.force.as_ref()?.iter().map(|force| white_noise(force)).collect();
            if !is_harmless(&rows, band, &noise, self.open.rate_hz)? {
                return Some(false);
            }
        }
        Some(true)
    }

    /// The run that contains a window; its times have one sample of tolerance.
    fn run_of_window<'r>(&self, runs: &'r [Vec<PreparedRun>], window: &TimeWindow) -> Option<&'r PreparedRun> {
        let slack = 1.0 / self.open.rate_hz;
        (runs[window.recording].iter())
            .find(|run| run.time[0] <= window.from + slack && run.time[run.time.len() - 1] >= window.to - slack)
    }

    /// Number of samples per sample at which the model is evaluated.
    fn evaluation_step(&self) -> usize {
        float_to_count(self.open.rate_hz / self.evaluation_rate()).max(1)
    }

    /// The runs of each recording prepared with a smoother; `None` if that fails.
    fn runs(&self, smoother: SmootherCandidate) -> Option<Vec<Vec<PreparedRun>>> {
        let delay = self.model.derivation.mechanism.force_delay;
        let prepare = |one: &OpenRecording<'_>| {
            let mut preparation = self.reading.preparation.clone();
            smoother.apply_to(&mut preparation, one.period);
            // Band and period are known already; finding them again would need all positions.
            preparation.band_hz = Some(self.open.band_hz);
            preparation.unexamined = true;
            let mut runs = free::runs(self.model, one.raw, &preparation).ok()?;
            // Forces of a model with delay belong to earlier states.
            if delay != 0.0 {
                for run in &mut runs {
                    run.shift_states_by_delay(delay)?;
                }
            }
            Some(runs)
        };
        self.recordings.iter().map(prepare).collect()
    }

    /// The intervals of time that all candidates have, or windows of them in a long recording.
    fn windows(&self, runs: &[Vec<PreparedRun>]) -> Vec<TimeWindow> {
        let total: f64 = runs.iter().flatten().map(duration).sum();
        let step = self.evaluation_rate().recip();
        let most = step * LOOKED_AT as f64;
        let share = if total > most { most / total } else { 1.0 };
        let mut windows = Vec::new();
        let each = runs.iter().enumerate();
        for (recording, run) in each.flat_map(|(recording, runs)| runs.iter().map(move |run| (recording, run))) {
            let (Some(first), Some(last)) = (run.time.first(), run.time.last()) else {
                continue;
            };
            let parts = if share < 1.0 { WINDOWS } else { 1 };
            let length = (last - first) / parts as f64;
            for part in 0..parts {
                let from = first + length * part as f64;
                windows.push(TimeWindow {
                    recording,
                    from,
                    to: from + share * length,
                });
            }
        }
        windows
    }

    /// The highest frequency that is evaluated, Hz.
    fn highest_frequency(&self) -> f64 {
        let octaves = 2.0_f64.powi(i32::try_from(OCTAVES).unwrap_or(0));
        (octaves * self.open.band_hz).min(HIGHEST * self.open.rate_hz)
    }

    /// Rate at which the model is evaluated, Hz.
    fn evaluation_rate(&self) -> f64 {
        (FINE * self.highest_frequency()).min(self.open.rate_hz)
    }

    /// The windows in groups, of which each has a fit of its own: one group for each recording, or one for all if a
    /// recording is too short for a fit.
    ///
    /// Recordings of one machine differ in noise and in what the model lacks. A common fit would judge a smoother by
    /// the loudest of them.
    fn window_groups(&self, runs: &[Vec<PreparedRun>], smoother: SmootherCandidate) -> Vec<Vec<TimeWindow>> {
        let windows = self.windows(runs);
        let of_recording = |k: usize| windows.iter().filter(|one| one.recording == k).copied().collect();
        let groups: Vec<Vec<TimeWindow>> = (0..self.recordings.len()).map(of_recording).collect();
        let band = self.open.band_hz;
        if self.held_out_residual(smoother, band, band, &groups).is_some() {
            groups
        } else {
            vec![windows]
        }
    }

    /// The residual of a smoother on held-out parts, the mean over groups of windows. The fit is to rows below
    /// `passed`, and octaves from `band` on are judged, Hz. `None` if there are too few samples.
    fn held_out_residual(
        &self,
        smoother: SmootherCandidate,
        passed: f64,
        band: f64,
        groups: &[Vec<TimeWindow>],
    ) -> Option<HeldOutResidual> {
        let runs = self.runs(smoother)?;
        let (mut figure, mut relative) = (0.0, 0.0);
        for windows in groups {
            let one = self.residual_of_windows(&runs, passed, band, windows)?;
            figure += one.figure;
            relative += one.relative.ln();
        }
        let n = groups.len() as f64;
        Some(HeldOutResidual {
            figure: figure / n,
            relative: (relative / n).exp(),
        })
    }

    /// The residual on held-out parts of one group of windows.
    fn residual_of_windows(
        &self,
        runs: &[Vec<PreparedRun>],
        passed: f64,
        band: f64,
        windows: &[TimeWindow],
    ) -> Option<HeldOutResidual> {
        let every = self.evaluation_step();
        let rate = self.open.rate_hz / every as f64;
        // Windows are found again in each run by their times.
        let samples = windows
            .iter()
            .map(|window| self.samples(self.run_of_window(runs, window)?, window, every))
            .collect::<Option<Vec<WindowSamples>>>()?;
        let total: usize = samples.iter().map(|one| one.forces.nrows()).sum();
        // Stage 1: sums of each fold, and the parts of windows that belong to it.
        let mut before = 0;
        let mut folds: Vec<FoldSums> = Vec::new();
        let mut parts: Vec<(usize, usize, usize, usize)> = Vec::new();
        for (window, one) in samples.iter().enumerate() {
            let n = one.forces.nrows();
            let filtered = one.low_passed(passed, rate)?;
            let margin = margin(n, rate, band);
            let thin = float_to_count(rate / (4.0 * passed.min(self.open.band_hz * 4.0))).max(1);
            if folds.is_empty() {
                folds = vec![FoldSums::new(one.forces.ncols(), one.regressor.ncols()); FOLDS];
            }
            let fold_of = |i: usize| ((before + i) * FOLDS / total).min(FOLDS - 1);
            // Filtered rows are correlated, so that only some of them are added.
            let added = (margin..n - margin).step_by(thin);
            add_to_folds(&mut folds, &filtered, added.map(|i| (fold_of(i), i)));
            let mut start = 0;
            while start < n {
                let fold = fold_of(start);
                let end = (start + 1..n).find(|i| fold_of(*i) != fold).unwrap_or(n);
                parts.push((window, fold, start, end));
                start = end;
            }
            before += n;
        }
        // Stage 2: each fold is predicted by values that were fitted to the others.
        let values = fit_folds(&folds)?;
        let drives = samples.first()?.forces.ncols();
        // Octaves start at the band and are bounded by the rate of the evaluation.
        let edges: Vec<f64> = (0..=OCTAVES)
            .map(|k| band * 2.0_f64.powi(i32::try_from(k).unwrap_or(0)))
            .filter(|edge| *edge < 0.45 * rate)
            .collect();
        let mut octaves = vec![vec![OctavePower::default(); edges.len()]; drives];
        for (window, fold, start, end) in parts {
            let one = &samples[window];
            let margin = margin(end - start, rate, band);
            for (d, octaves) in octaves.iter_mut().enumerate() {
                let (measured, model): (Vec<f64>, Vec<f64>) = (start..end)
                    .map(|i| {
                        let row = one.regressor.row(i * drives + d);
                        let products = row.iter().zip(values[fold].iter()).map(|(h, p)| h * p);
                        (one.forces[(i, d)], products.sum::<f64>())
                    })
                    .unzip();
                // Differences of successive low-passes are the octaves.
                let mut below: [Option<Vec<f64>>; 2] = [None, None];
                for (octave, edge) in octaves.iter_mut().zip(&edges) {
                    let passed = LowPass::butterworth(4, *edge, rate)
                        .and_then(|low_pass| Ok([low_pass.zero_phase(&measured)?, low_pass.zero_phase(&model)?]));
                    // A part that is too short to be filtered is skipped.
                    let Ok(passed) = passed else { continue };
                    let [y, m] = [0, 1].map(|k| match &below[k] {
                        Some(below) => passed[k].iter().zip(below).map(|(a, b)| a - b).collect(),
                        None => passed[k].clone(),
                    });
                    octave.add(&y[margin..y.len() - margin], &m[margin..m.len() - margin]);
                    below = passed.map(Some);
                }
            }
        }
        // Stage 3: the figure over the drives.
        let mut figure = 0.0;
        let mut relative = 0.0;
        let mut counted = 0;
        for octaves in &octaves {
            // A drive without a force, as in the row of an undriven joint, has no relative residual.
            let size = octaves.first()?.measured;
            if size <= 0.0 {
                continue;
            }
            counted += 1;
            let rounding = ROUNDING * ROUNDING * size;
            let above: f64 = octaves[1..].iter().map(|octave| octave.residual_power(true)).sum();
            let within = octaves[0].residual_power(false).max(rounding);
            figure += 0.5 * (within + above).ln();
            relative += 0.5 * (within / size).ln();
        }
        let n = f64::from(counted);
        (counted > 0).then(|| HeldOutResidual {
            figure: figure / n,
            relative: (relative / n).exp(),
        })
    }

    /// Regressor and forces at every `every`-th sample of a window; `None` if there are too few samples.
    fn samples(&self, run: &PreparedRun, window: &TimeWindow, every: usize) -> Option<WindowSamples> {
        let forces = run.force.as_deref()?;
        let recording = self.recordings[window.recording].index;
        let start = run.time.partition_point(|t| *t < window.from);
        let end = run.time.partition_point(|t| *t <= window.to);
        let samples: Vec<usize> = (start..end).step_by(every).collect();
        if samples.len() < WINDOW_FEWEST_SAMPLES {
            return None;
        }
        let mut regressor = regressor_with_friction(self.model, &PickedStates::new(run, &samples))?;
        let mut picked = DMatrix::zeros(samples.len(), forces.len());
        // The filter also depends on samples outside the window.
        let from = start.saturating_sub(BEYOND * every);
        for (d, force) in forces.iter().enumerate() {
            let around = &force[from..(end + BEYOND * every).min(force.len())];
            // A low-pass before thinning prevents aliasing of the force noise.
            let smooth = if every > 1 {
                let rate = self.open.rate_hz;
                let low_pass = LowPass::butterworth(4, 0.4 * rate / every as f64, rate).ok()?;
                low_pass.zero_phase(around).ok()?
            } else {
                around.to_vec()
            };
            for (i, sample) in samples.iter().enumerate() {
                picked[(i, d)] = smooth[*sample - from];
            }
            // Both sides of an equation are zero where the drive sticks.
            let stuck = self
                .sticks
                .is_stuck(recording, d, samples.iter().map(|sample| run.time[*sample]));
            for i in (0..samples.len()).filter(|i| stuck[*i]) {
                picked[(i, d)] = 0.0;
                regressor.row_mut(i * forces.len() + d).fill(0.0);
            }
        }
        Some(WindowSamples {
            regressor,
            forces: picked,
        })
    }
}

/// Duration of a run, s.
fn duration(run: &PreparedRun) -> f64 {
    match run.time.as_slice() {
        [first, .., last] => last - first,
        _ => 0.0,
    }
}
