//! Choice of the smoothing of a recording if the user gave none: candidates are tested, and the one with the smallest
//! force residual on held-out parts of the run is taken.
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

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};
use modelmill_codegen::{ModelEvaluator, MotionStates};
use modelmill_identify::{
    DECIMATION_PASSBAND, LowPass, PreparationChoices, PreparedRun, RecordingNote, SignalRecording as Raw,
};
use nalgebra::{DMatrix, DVector};

use super::free;
use super::options::RecordingOptions;
use super::smoother::{SmootherCandidate, floor_to_count, series_up_to};
use super::thresholds::{
    SAME_RESIDUAL_TOLERANCE, SMOOTHING_LEAST_GAIN, SMOOTHING_ROWS_PER_COLUMN, WINDOW_FEWEST_SAMPLES,
};
use crate::error::Outcome;
use crate::model::Model;
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
/// Number of parts of the time, each of which is held out once.
const FOLDS: usize = 5;
/// Number of octaves above the band of the motion that are evaluated.
const OCTAVES: usize = 2;
/// Largest number of samples for each candidate; longer recordings are evaluated in windows.
const LOOKED_AT: usize = 12_000;
/// Samples per period of the highest frequency that is evaluated.
const FINE: f64 = 5.0;
/// Number of windows of a long recording.
const WINDOWS: usize = 10;
/// Periods of the band that are dropped at both ends of a held-out part, and the largest share of it that may be
/// dropped.
const DROPPED: (f64, f64) = (1.5, 0.2);
/// Passbands of the decimation that are tested, relative to the band of the forces.
const PARALLEL: [f64; 3] = [0.5, 1.0, 2.0];
/// Samples next to a window, at the rate of the evaluation, beyond which the low-pass has no influence.
const BEYOND: usize = 60;
/// A residual below this fraction of the force is rounding.
const ROUNDING: f64 = 1e-6;
/// A cut-off whose residual exceeds the smallest by this factor ends the search downwards.
const HOPELESS: f64 = 1.5;

/// The reading options with all open choices of the preparation made, and a note on them; `None` if nothing is open,
/// or if the recording has no forces to decide it.
pub(super) fn choose_preparation(
    model: &Model,
    raw: &Raw,
    reading: &RecordingOptions,
) -> Outcome<Option<(RecordingOptions, RecordingNote)>> {
    let drives = model.drives();
    let has_forces = !drives.is_empty() && drives.iter().all(|drive| raw.has_column(drive));
    if !has_forces || model.base.is_empty() {
        return Ok(None);
    }
    let open = raw.find_open_choices(&model.active_coordinates(), &drives, &reading.preparation)?;
    Ok(open.and_then(|open| {
        let search = SmootherSearch {
            model,
            raw,
            reading,
            open,
        };
        search.best_reading()
    }))
}

/// Force residual on held-out parts.
#[derive(Clone, Copy)]
struct HeldOutResidual {
    /// The logarithm of the geometric mean of the residual over the drives, in units of the forces.
    figure: f64,
    /// The geometric mean of the relative residuals below the band of the motion over the drives.
    relative: f64,
}

/// Smoothers of one kind that were tested, in the order of decreasing bandwidth.
struct SmootherTrials {
    /// Each smoother with its residual.
    all: Vec<(SmootherCandidate, HeldOutResidual)>,
    /// Index of the smoothest of those with nearly the smallest residual.
    best: usize,
}

impl SmootherTrials {
    /// The chosen smoother with its residual.
    fn best(&self) -> (SmootherCandidate, HeldOutResidual) {
        self.all[self.best]
    }

    /// How the residual grows with the neighbours of the best, one phrase each.
    fn neighbours(&self) -> impl Iterator<Item = String> {
        let beside = [self.best.checked_sub(1), Some(self.best + 1)];
        beside.into_iter().flatten().filter_map(|at| {
            let (smoother, other) = self.all.get(at)?;
            let cost = cost_text(other.figure - self.best().1.figure);
            Some(format!("{cost} at {}", smoother.frequency_text()))
        })
    }
}

/// The change of the residual in per cent, from the difference of two figures.
fn cost_text(difference: f64) -> String {
    let more = difference.exp() - 1.0;
    if more.abs() < SAME_RESIDUAL_TOLERANCE {
        "as much".to_owned()
    } else if more < 0.0 {
        format!("{} less", percent(Some(-more)))
    } else {
        format!("{} more", percent(Some(more)))
    }
}

/// The search for the best smoother of one recording.
struct SmootherSearch<'a> {
    /// The model that is fitted.
    model: &'a Model,
    /// The recording before preparation.
    raw: &'a Raw,
    /// The options of the user.
    reading: &'a RecordingOptions,
    /// The choices that are open, with rate, band and period of the motion.
    open: PreparationChoices,
}

impl SmootherSearch<'_> {
    /// The options with the best smoother and decimation, and the note that states the choice.
    fn best_reading(&self) -> Option<(RecordingOptions, RecordingNote)> {
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
        let ladder: Vec<SmootherCandidate> = ladder.into_iter().map(SmootherCandidate::low_pass).collect();
        // The lowest cut-off loses the most samples at the ends, so that its windows exist for all candidates.
        let runs = self.runs(ladder[ladder.len() - 1])?;
        let looked_at = self.windows(&runs);
        let filtered = self.try_smoothers(&ladder, &looked_at)?;
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
        let (decimate, left) = self.decimation(smoother, &looked_at).unwrap_or((1, left));
        let mut reading = self.reading.clone();
        smoother.apply_to(&mut reading.preparation);
        reading.preparation.decimate = decimate;
        reading.preparation.chosen = true;
        // The note states how the residual changes with the alternatives.
        let mut others = vec![String::new()];
        others.extend(tried.neighbours().chain(other));
        let others = others.join(", ");
        let every = if decimate > 1 {
            format!(", and decimated by {decimate} after a low-pass on forces and regressor")
        } else {
            String::new()
        };
        let says = message!(
            "{} {}{every}. This was chosen automatically, since it predicts held-out parts of the run best. The error there is {} \
             (below {} Hz, geometric mean over the drives){others}. Set it yourself with {}, {} and {}.",
            self.raw.file(),
            smoother.describe(),
            percent(Some(left.relative)),
            significant(band_hz, 3),
            Remedy::option(OptionName::CutoffHz),
            Remedy::option(OptionName::Smoothing),
            Remedy::option(OptionName::Decimate),
        );
        Some((reading, RecordingNote::info(says)))
    }

    /// Tests smoothers in the order of decreasing bandwidth, until the residual is clearly too large.
    fn try_smoothers(&self, ladder: &[SmootherCandidate], looked_at: &[TimeWindow]) -> Option<SmootherTrials> {
        let mut all: Vec<(SmootherCandidate, HeldOutResidual)> = Vec::new();
        let mut least = f64::INFINITY;
        for smoother in ladder {
            let Some(left) = self.held_out_residual(*smoother, self.open.band_hz, looked_at) else {
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

    /// The factor of decimation, with the residual on held-out parts; `None` if it cannot be evaluated.
    fn decimation(&self, smoother: SmootherCandidate, looked_at: &[TimeWindow]) -> Option<(usize, HeldOutResidual)> {
        let mut best: Option<(usize, HeldOutResidual)> = None;
        // Passbands increase, so that the strongest decimation is tested first.
        for part in PARALLEL {
            let passed = part * self.open.band_hz;
            let factor = floor_to_count(DECIMATION_PASSBAND * self.open.rate_hz / passed).max(1);
            let passed = if factor == 1 { f64::INFINITY } else { passed };
            let left = self.held_out_residual(smoother, passed, looked_at)?;
            if best.is_none_or(|(_, least)| left.figure < least.figure - SMOOTHING_LEAST_GAIN) {
                best = Some((factor, left));
            }
            if factor == 1 {
                break;
            }
        }
        best
    }

    /// The recording prepared with a smoother; `None` if that fails.
    fn runs(&self, smoother: SmootherCandidate) -> Option<Vec<PreparedRun>> {
        let mut preparation = self.reading.preparation.clone();
        smoother.apply_to(&mut preparation);
        // Band and period are known already; finding them again would need all positions.
        preparation.band_hz = Some(self.open.band_hz);
        preparation.unexamined = true;
        let mut runs = free::runs(self.model, self.raw, &preparation).ok()?;
        // Forces of a model with delay belong to earlier states.
        let delay = self.model.derivation.mechanism.force_delay;
        if delay != 0.0 {
            for run in &mut runs {
                run.shift_states_by_delay(delay)?;
            }
        }
        Some(runs)
    }

    /// The intervals of time that all candidates have, or windows of them in a long recording.
    fn windows(&self, runs: &[PreparedRun]) -> Vec<TimeWindow> {
        let total: f64 = runs.iter().map(duration).sum();
        let step = self.evaluation_rate().recip();
        let most = step * LOOKED_AT as f64;
        let share = if total > most { most / total } else { 1.0 };
        let mut windows = Vec::new();
        for run in runs {
            let (Some(first), Some(last)) = (run.time.first(), run.time.last()) else {
                continue;
            };
            let parts = if share < 1.0 { WINDOWS } else { 1 };
            let length = (last - first) / parts as f64;
            for part in 0..parts {
                let from = first + length * part as f64;
                windows.push(TimeWindow {
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

    /// The residual of a smoother on held-out parts, fitted to rows below `passed`, Hz; `None` if there are too few
    /// samples.
    fn held_out_residual(
        &self,
        smoother: SmootherCandidate,
        passed: f64,
        windows: &[TimeWindow],
    ) -> Option<HeldOutResidual> {
        let runs = self.runs(smoother)?;
        let every = floor_to_count(self.open.rate_hz / self.evaluation_rate()).max(1);
        let rate = self.open.rate_hz / every as f64;
        // Windows are found again in each run by their times, with one sample of tolerance.
        let slack = 1.0 / self.open.rate_hz;
        let samples = windows
            .iter()
            .map(|window| {
                let run = runs.iter().find(|run| {
                    run.time[0] <= window.from + slack && run.time[run.time.len() - 1] >= window.to - slack
                })?;
                self.samples(run, window, every)
            })
            .collect::<Option<Vec<WindowSamples>>>()?;
        let total: usize = samples.iter().map(|one| one.forces.nrows()).sum();
        // Stage 1: sums of each fold, and the parts of windows that belong to it.
        let mut before = 0;
        let mut folds: Vec<FoldSums> = Vec::new();
        let mut parts: Vec<(usize, usize, usize, usize)> = Vec::new();
        for (window, one) in samples.iter().enumerate() {
            let n = one.forces.nrows();
            let filtered = one.low_passed(passed, rate)?;
            let margin = margin(n, rate, self.open.band_hz);
            let thin = floor_to_count(rate / (4.0 * passed.min(self.open.band_hz * 4.0))).max(1);
            if folds.is_empty() {
                folds = vec![FoldSums::new(one.forces.ncols(), one.regressor.ncols()); FOLDS];
            }
            let fold_of = |i: usize| ((before + i) * FOLDS / total).min(FOLDS - 1);
            // Filtered rows are correlated, so that only some of them are added.
            for i in (margin..n - margin).step_by(thin) {
                folds[fold_of(i)].add(&filtered, i);
            }
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
            .map(|k| self.open.band_hz * 2.0_f64.powi(i32::try_from(k).unwrap_or(0)))
            .filter(|edge| *edge < 0.45 * rate)
            .collect();
        let mut octaves = vec![vec![OctavePower::default(); edges.len()]; drives];
        for (window, fold, start, end) in parts {
            let one = &samples[window];
            let margin = margin(end - start, rate, self.open.band_hz);
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
        for octaves in &octaves {
            let size = octaves.first()?.measured;
            if size <= 0.0 {
                return None;
            }
            let rounding = ROUNDING * ROUNDING * size;
            let above: f64 = octaves[1..].iter().map(|octave| octave.residual_power(true)).sum();
            let within = octaves[0].residual_power(false).max(rounding);
            figure += 0.5 * (within + above).ln();
            relative += 0.5 * (within / size).ln();
        }
        let n = drives as f64;
        Some(HeldOutResidual {
            figure: figure / n,
            relative: (relative / n).exp(),
        })
    }

    /// Regressor and forces at every `every`-th sample of a window; `None` if there are too few samples.
    fn samples(&self, run: &PreparedRun, window: &TimeWindow, every: usize) -> Option<WindowSamples> {
        let forces = run.force.as_deref()?;
        let start = run.time.partition_point(|t| *t < window.from);
        let end = run.time.partition_point(|t| *t <= window.to);
        let samples: Vec<usize> = (start..end).step_by(every).collect();
        if samples.len() < WINDOW_FEWEST_SAMPLES {
            return None;
        }
        let regressor = self.regressor(run, &samples)?;
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
        }
        Some(WindowSamples {
            regressor,
            forces: picked,
        })
    }

    /// The model's regressor at given samples, with friction and an offset of every drive added; one row per sample
    /// and drive.
    fn regressor(&self, run: &PreparedRun, samples: &[usize]) -> Option<DMatrix<f64>> {
        let pick = |columns: &[Vec<f64>]| -> Vec<Vec<f64>> {
            let pick = |column: &Vec<f64>| samples.iter().map(|k| column[*k]).collect();
            columns.iter().map(pick).collect()
        };
        let states = [&run.q, &run.qd, &run.qdd].map(|columns| pick(columns));
        let load = pick(run.force.as_deref().unwrap_or(&[]));
        let states = MotionStates {
            q: states[0].iter().map(Vec::as_slice).collect(),
            qd: states[1].iter().map(Vec::as_slice).collect(),
            qdd: states[2].iter().map(Vec::as_slice).collect(),
            load: load.iter().map(Vec::as_slice).collect(),
        };
        let evaluator = ModelEvaluator::new(&self.model.derivation);
        let regressor = evaluator.regressor(&states).ok()?;
        let n = self.model.drives().len();
        let rates = evaluator.drive_motion(&states).ok()?;
        let rates = rates.get(n..2 * n)?;
        let width = regressor.ncols();
        // Three more columns for each drive: rate, its sign, and a constant.
        let mut more = regressor.resize_horizontally(width + 3 * n, 0.0);
        for (d, rate) in rates.iter().enumerate() {
            for (i, rate) in rate.iter().enumerate() {
                let sign = if *rate == 0.0 { 0.0 } else { rate.signum() };
                for (k, value) in [*rate, sign, 1.0].into_iter().enumerate() {
                    more[(i * n + d, width + 3 * d + k)] = value;
                }
            }
        }
        more.iter().all(|x| x.is_finite()).then_some(more)
    }
}

/// An interval of time, s.
struct TimeWindow {
    /// First time.
    from: f64,
    /// Last time.
    to: f64,
}

/// Rows of the regressor, one per sample and drive, and forces, one row per sample and one column per drive.
struct WindowSamples {
    /// Row `sample * n_drives + drive`, with the columns of friction and offset behind those of the model.
    regressor: DMatrix<f64>,
    /// `[sample, drive]`.
    forces: DMatrix<f64>,
}

impl WindowSamples {
    /// The same rows after a low-pass, Hz; `None` if there are too few samples. `rate` is that of the rows, Hz.
    fn low_passed(&self, passed: f64, rate: f64) -> Option<Self> {
        let mut filtered = Self {
            regressor: self.regressor.clone(),
            forces: self.forces.clone(),
        };
        if passed >= 0.45 * rate {
            return Some(filtered);
        }
        let low_pass = LowPass::butterworth(4, passed, rate).ok()?;
        let (n, drives) = self.forces.shape();
        for d in 0..drives {
            let force: Vec<f64> = self.forces.column(d).iter().copied().collect();
            let force = low_pass.zero_phase(&force).ok()?;
            filtered.forces.column_mut(d).copy_from_slice(&force);
            for mut column in filtered.regressor.column_iter_mut() {
                let values: Vec<f64> = (0..n).map(|i| column[i * drives + d]).collect();
                if values.iter().all(|x| *x == 0.0) {
                    continue;
                }
                for (i, value) in low_pass.zero_phase(&values).ok()?.into_iter().enumerate() {
                    column[i * drives + d] = value;
                }
            }
        }
        Some(filtered)
    }
}

/// Inner products of measured force and model force in one octave of one drive.
#[derive(Clone, Default)]
struct OctavePower {
    /// Sum of squares of the measured force.
    measured: f64,
    /// Inner product of both forces.
    product: f64,
    /// Sum of squares of the model force.
    model: f64,
}

impl OctavePower {
    /// Adds samples of both forces.
    fn add(&mut self, measured: &[f64], model: &[f64]) {
        for (y, m) in measured.iter().zip(model) {
            self.measured += y * y;
            self.product += y * m;
            self.model += m * m;
        }
    }

    /// Residual power of the measured force. Where the model overestimates an octave, its force may be damped, as a
    /// filter does above the band of the motion: noise there costs only what it hides.
    fn residual_power(&self, may_be_damped: bool) -> f64 {
        let scale = if may_be_damped && self.model > 0.0 {
            (self.product / self.model).clamp(0.0, 1.0)
        } else {
            1.0
        };
        self.measured - 2.0 * scale * self.product + scale * scale * self.model
    }
}

/// Number of samples at both ends of `n` that a low-pass at `band`, Hz, distorts.
fn margin(n: usize, rate: f64, band: f64) -> usize {
    floor_to_count((DROPPED.0 * rate / band).min(DROPPED.1 * n as f64))
}

/// Sums over the rows of one fold, drive by drive.
#[derive(Clone)]
struct FoldSums {
    drives: Vec<DriveNormalEquations>,
}

/// Normal equations of one drive.
#[derive(Clone)]
struct DriveNormalEquations {
    /// Gram matrix of the columns, lower triangle.
    normal: DMatrix<f64>,
    /// Inner products of columns and force.
    right: DVector<f64>,
    /// Sum of squares of the force.
    size: f64,
    /// Number of rows.
    rows: usize,
}

impl FoldSums {
    /// Sums without rows.
    fn new(drives: usize, width: usize) -> Self {
        let products = DriveNormalEquations {
            normal: DMatrix::zeros(width, width),
            right: DVector::zeros(width),
            size: 0.0,
            rows: 0,
        };
        Self {
            drives: vec![products; drives],
        }
    }

    /// Adds the rows of all drives at a sample.
    fn add(&mut self, samples: &WindowSamples, i: usize) {
        let drives = self.drives.len();
        for (d, one) in self.drives.iter_mut().enumerate() {
            let row = samples.regressor.row(i * drives + d).transpose();
            let force = samples.forces[(i, d)];
            one.normal.syger(1.0, &row, &row, 1.0);
            one.right.axpy(force, &row, 1.0);
            one.size += force * force;
            one.rows += 1;
        }
    }
}

/// For each fold the values that fit the others; `None` if there are too few rows, or a force is zero.
fn fit_folds(folds: &[FoldSums]) -> Option<Vec<DVector<f64>>> {
    let n = folds.first()?.drives.len();
    let width = folds[0].drives[0].right.len();
    let total = |d: usize| -> f64 { folds.iter().map(|fold| fold.drives[d].size).sum() };
    let sizes: Vec<f64> = (0..n).map(total).collect();
    let rows: usize = folds.iter().map(|fold| fold.drives[0].rows).sum();
    if rows * n < SMOOTHING_ROWS_PER_COLUMN * width || sizes.iter().any(|size| *size <= 0.0) {
        return None;
    }
    // All drives have equal relative weights first, then weights from their residuals.
    let mut left = sizes.clone();
    let mut values = Vec::new();
    for _ in 0..2 {
        let weights: Vec<f64> = (left.iter().zip(&sizes))
            .map(|(left, size)| rows as f64 / left.max(ROUNDING * ROUNDING * size))
            .collect();
        left = vec![0.0; n];
        values.clear();
        // All folds except the one that is held out.
        for (out, judged) in folds.iter().enumerate() {
            let mut normal = DMatrix::zeros(width, width);
            let mut right = DVector::zeros(width);
            for (_, fold) in folds.iter().enumerate().filter(|(k, _)| *k != out) {
                for (one, weight) in fold.drives.iter().zip(&weights) {
                    normal += &one.normal * *weight;
                    right += &one.right * *weight;
                }
            }
            let found = solve_scaled(&normal, &right)?;
            // The sum of squares of the residual follows from the sums of the fold.
            for (left, one) in left.iter_mut().zip(&judged.drives) {
                let explained = 2.0 * one.right.dot(&found) - (symmetric(&one.normal) * &found).dot(&found);
                *left += (one.size - explained).max(0.0);
            }
            values.push(found);
        }
    }
    Some(values)
}

/// Solves scaled normal equations with a small ridge, since columns may be equal.
fn solve_scaled(normal: &DMatrix<f64>, right: &DVector<f64>) -> Option<DVector<f64>> {
    let mut normal = symmetric(normal);
    let n = right.len();
    let scale: Vec<f64> = (0..n)
        .map(|i| normal[(i, i)].max(0.0).sqrt())
        .map(|norm| if norm > 0.0 { norm.recip() } else { 0.0 })
        .collect();
    for i in 0..n {
        for j in 0..n {
            normal[(i, j)] *= scale[i] * scale[j];
        }
        normal[(i, i)] += 1e-9;
    }
    let scale = DVector::from_vec(scale);
    let scaled = right.component_mul(&scale);
    Some(normal.cholesky()?.solve(&scaled).component_mul(&scale))
}

/// The symmetric matrix of a lower triangle.
fn symmetric(lower: &DMatrix<f64>) -> DMatrix<f64> {
    let mut whole = lower.clone();
    whole.fill_upper_triangle_with_lower_triangle();
    whole
}

/// Duration of a run, s.
fn duration(run: &PreparedRun) -> f64 {
    match run.time.as_slice() {
        [first, .., last] => last - first,
        _ => 0.0,
    }
}
