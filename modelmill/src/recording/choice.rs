//! How a recording is smoothed where nobody says how: candidates go in, the one that leaves least of the forces on held-out
//! time comes out.
//!
//! Spectra of positions alone cannot tell noise of clocks and encoders from motion; forces can. For each cut-off of a ladder
//! the model's regressor, with friction and an offset of every drive beside, is fitted to the forces on four fifths of the
//! time, both through one low-pass at the band of the motion, and held against the last fifth. A cut-off that is too low leaves
//! of the forces what the model could explain, one that is too high hides it in noise. Octaves above the band count as far as
//! the model explains anything of them. The figure is the geometric mean over the drives of what is left: the likelihood of
//! errors whose size is not known, which knows no units. A motion that repeats itself may also be a Fourier series, whose
//! harmonics are tried in the same way: it averages over the periods what a low-pass lets through. Local polynomials are no
//! candidates: at the same cut-off they leave as much as the low-pass, on all recordings that were looked at.

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};
use modelmill_codegen::{ModelEvaluator, MotionStates};
use modelmill_identify::{
    DECIMATION_PASSBAND, LowPass, PreparationChoices, PreparedRun, RecordingNote,
    SignalRecording as Raw,
};
use nalgebra::{DMatrix, DVector};

use super::free;
use super::options::RecordingOptions;
use super::smoother::{SmootherCandidate, floor_to_count, series_up_to};
use crate::error::Outcome;
use crate::model::Model;
use crate::text::table::{percent, significant};

/// Ratio of neighbouring cut-offs.
const RATIO: f64 = 1.6;
/// The highest cut-off, in parts of the sampling rate: beyond, differences take more than the filter leaves.
const HIGHEST: f64 = 0.2;
/// The same in parts of the band of the forces: noise above says nothing of them, and makes the model's forces rough.
const FARTHEST: f64 = 8.0;
/// The lowest cut-off, in parts of the band of the forces.
const LOWEST: f64 = 0.15;
/// Parts of the time, each of which is held out once.
const FOLDS: usize = 5;
/// Octaves above the band of the motion that are looked at.
const OCTAVES: usize = 2;
/// Samples that are looked at for each candidate, at most; beyond, windows are spread over the recording.
const LOOKED_AT: usize = 12_000;
/// Samples in a period of the highest frequency that is looked at.
const FINE: f64 = 5.0;
/// Windows of a long recording.
const WINDOWS: usize = 10;
/// Periods of the band that are dropped at both ends of a stretch that is held out, and the part of it that may be dropped.
const DROPPED: (f64, f64) = (1.5, 0.2);
/// Bands of the parallel filter that are tried, in parts of the band of the forces.
const PARALLEL: [f64; 3] = [0.5, 1.0, 2.0];
/// Samples beside a window, of those that are looked at, beyond which its low-pass remembers nothing.
const BEYOND: usize = 60;
/// Fewest samples of a window.
const FEWEST: usize = 40;
/// What is left of a force below this part of it is rounding.
const ROUNDING: f64 = 1e-6;
/// A candidate must be better by this part of the error to be preferred to one that smooths more.
const BETTER: f64 = 0.005;
/// A cut-off that leaves so much more than the best ends the search downwards.
const HOPELESS: f64 = 1.5;

/// The preparation with what was open settled, and what was chosen; nothing where nothing is open, or where forces do not
/// tell.
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

/// What is left of the forces on held-out time.
#[derive(Clone, Copy)]
struct HeldOutResidual {
    /// The logarithm of the geometric mean over the drives of what is left, in units of the forces.
    figure: f64,
    /// The geometric mean over the drives of their relative errors below the band of the motion.
    relative: f64,
}

/// Smoothers of one kind that were tried, the one that passes most first.
struct SmootherTrials {
    all: Vec<(SmootherCandidate, HeldOutResidual)>,
    /// Which is the smoothest of those that leave nearly the least.
    best: usize,
}

impl SmootherTrials {
    fn best(&self) -> (SmootherCandidate, HeldOutResidual) {
        self.all[self.best]
    }

    /// What the neighbours of the best would cost, as words to be joined.
    fn neighbours(&self) -> impl Iterator<Item = String> {
        let beside = [self.best.checked_sub(1), Some(self.best + 1)];
        beside.into_iter().flatten().filter_map(|at| {
            let (smoother, other) = self.all.get(at)?;
            let cost = cost_text(other.figure - self.best().1.figure);
            Some(format!("{cost} at {}", smoother.frequency_text()))
        })
    }
}

/// How much more is left, of the difference of two figures.
fn cost_text(difference: f64) -> String {
    let more = difference.exp() - 1.0;
    if more.abs() < 1e-3 {
        "as much".to_owned()
    } else if more < 0.0 {
        format!("{} less", percent(Some(-more)))
    } else {
        format!("{} more", percent(Some(more)))
    }
}

struct SmootherSearch<'a> {
    model: &'a Model,
    raw: &'a Raw,
    reading: &'a RecordingOptions,
    open: PreparationChoices,
}

impl SmootherSearch<'_> {
    fn best_reading(&self) -> Option<(RecordingOptions, RecordingNote)> {
        let PreparationChoices {
            rate_hz,
            band_hz,
            cutoff_hz,
            period,
        } = self.open;
        let highest = (HIGHEST * rate_hz).min(FARTHEST * band_hz);
        let lowest = (LOWEST * band_hz).min(cutoff_hz);
        let mut ladder = vec![cutoff_hz.min(highest)];
        while ladder[0] * RATIO <= highest && ladder.len() < 3 {
            ladder.insert(0, ladder[0] * RATIO);
        }
        while ladder[ladder.len() - 1] / RATIO >= lowest {
            ladder.push(ladder[ladder.len() - 1] / RATIO);
        }
        let ladder: Vec<SmootherCandidate> = ladder
            .into_iter()
            .map(SmootherCandidate::low_pass)
            .collect();
        // The lowest cut-off drops most samples; what it leaves is looked at for all.
        let runs = self.runs(ladder[ladder.len() - 1])?;
        let looked_at = self.windows(&runs);
        let filtered = self.try_smoothers(&ladder, &looked_at)?;
        let series = period.and_then(|period| {
            let ladder = series_up_to(filtered.best().0.cutoff, period);
            self.try_smoothers(&ladder, &looked_at)
        });
        let (low_pass, by_filter) = filtered.best();
        let is_better =
            |series: &SmootherTrials| series.best().1.figure < by_filter.figure - BETTER;
        let (tried, other) = match series {
            Some(series) if is_better(&series) => {
                let more = cost_text(by_filter.figure - series.best().1.figure);
                (
                    series,
                    Some(format!(
                        "{more} by a low-pass at {}",
                        low_pass.frequency_text()
                    )),
                )
            }
            Some(series) => {
                let (smoother, left) = series.best();
                let more = cost_text(left.figure - by_filter.figure);
                (
                    filtered,
                    Some(format!(
                        "{more} by a Fourier series of {}",
                        smoother.frequency_text()
                    )),
                )
            }
            None => (filtered, None),
        };
        let (smoother, left) = tried.best();
        let (decimate, left) = self.decimation(smoother, &looked_at).unwrap_or((1, left));
        let mut reading = self.reading.clone();
        smoother.apply_to(&mut reading.preparation);
        reading.preparation.decimate = decimate;
        reading.preparation.chosen = true;
        let mut others = vec![String::new()];
        others.extend(tried.neighbours().chain(other));
        let others = others.join(", ");
        let every = if decimate > 1 {
            format!(
                ", and one in {decimate} samples kept after the parallel filter on forces and regressor"
            )
        } else {
            String::new()
        };
        let says = message!(
            "{} {}{every}, since that leaves least of the forces on held-out time: {} below {} Hz (geometric mean over the \
             drives){others}; {}, {} and {} say otherwise.",
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

    /// Smoothers that are tried one after the other, the one that passes most first, until nothing is to be hoped for.
    fn try_smoothers(
        &self,
        ladder: &[SmootherCandidate],
        looked_at: &[TimeWindow],
    ) -> Option<SmootherTrials> {
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
        let is_good =
            |(_, left): &(SmootherCandidate, HeldOutResidual)| left.figure <= least + BETTER;
        let best = all.iter().rposition(is_good)?;
        Some(SmootherTrials { all, best })
    }

    /// The factor of decimation, and what is left with it on held-out time.
    fn decimation(
        &self,
        smoother: SmootherCandidate,
        looked_at: &[TimeWindow],
    ) -> Option<(usize, HeldOutResidual)> {
        let mut best: Option<(usize, HeldOutResidual)> = None;
        for part in PARALLEL {
            let passed = part * self.open.band_hz;
            let factor = floor_to_count(DECIMATION_PASSBAND * self.open.rate_hz / passed).max(1);
            let passed = if factor == 1 { f64::INFINITY } else { passed };
            let left = self.held_out_residual(smoother, passed, looked_at)?;
            if best.is_none_or(|(_, least)| left.figure < least.figure - BETTER) {
                best = Some((factor, left));
            }
            if factor == 1 {
                break;
            }
        }
        best
    }

    /// The runs that a smoother gives.
    fn runs(&self, smoother: SmootherCandidate) -> Option<Vec<PreparedRun>> {
        let mut preparation = self.reading.preparation.clone();
        smoother.apply_to(&mut preparation);
        // Band and period were found already, and cost a look at all positions.
        preparation.band_hz = Some(self.open.band_hz);
        preparation.unexamined = true;
        let mut runs = free::runs(self.model, self.raw, &preparation).ok()?;
        let delay = self.model.derivation.mechanism.force_delay;
        if delay != 0.0 {
            for run in &mut runs {
                run.shift_states_by_delay(delay)?;
            }
        }
        Some(runs)
    }

    /// The stretches of time that all candidates have, or windows of them.
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

    /// The highest frequency that is looked at, Hz.
    fn highest_frequency(&self) -> f64 {
        let octaves = 2.0_f64.powi(i32::try_from(OCTAVES).unwrap_or(0));
        (octaves * self.open.band_hz).min(HIGHEST * self.open.rate_hz)
    }

    /// Samples per second at which the model is evaluated.
    fn evaluation_rate(&self) -> f64 {
        (FINE * self.highest_frequency()).min(self.open.rate_hz)
    }

    /// What is left on held-out time by a smoother, where rows below `passed`, Hz, are fitted.
    fn held_out_residual(
        &self,
        smoother: SmootherCandidate,
        passed: f64,
        windows: &[TimeWindow],
    ) -> Option<HeldOutResidual> {
        let runs = self.runs(smoother)?;
        let every = floor_to_count(self.open.rate_hz / self.evaluation_rate()).max(1);
        let rate = self.open.rate_hz / every as f64;
        let slack = 1.0 / self.open.rate_hz;
        let samples = windows
            .iter()
            .map(|window| {
                let run = runs.iter().find(|run| {
                    run.time[0] <= window.from + slack
                        && run.time[run.time.len() - 1] >= window.to - slack
                })?;
                self.samples(run, window, every)
            })
            .collect::<Option<Vec<WindowSamples>>>()?;
        let total: usize = samples.iter().map(|one| one.forces.nrows()).sum();
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
        let values = fit_folds(&folds)?;
        let drives = samples.first()?.forces.ncols();
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
                let mut below: [Option<Vec<f64>>; 2] = [None, None];
                for (octave, edge) in octaves.iter_mut().zip(&edges) {
                    let passed = LowPass::butterworth(4, *edge, rate).and_then(|low_pass| {
                        Ok([
                            low_pass.zero_phase(&measured)?,
                            low_pass.zero_phase(&model)?,
                        ])
                    });
                    // A part that is too short to be filtered is passed over.
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
        let mut figure = 0.0;
        let mut relative = 0.0;
        for octaves in &octaves {
            let size = octaves.first()?.measured;
            if size <= 0.0 {
                return None;
            }
            let rounding = ROUNDING * ROUNDING * size;
            let above: f64 = octaves[1..]
                .iter()
                .map(|octave| octave.residual_power(true))
                .sum();
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

    /// Regressor and forces at every so many samples of a window.
    fn samples(
        &self,
        run: &PreparedRun,
        window: &TimeWindow,
        every: usize,
    ) -> Option<WindowSamples> {
        let forces = run.force.as_deref()?;
        let start = run.time.partition_point(|t| *t < window.from);
        let end = run.time.partition_point(|t| *t <= window.to);
        let samples: Vec<usize> = (start..end).step_by(every).collect();
        if samples.len() < FEWEST {
            return None;
        }
        let regressor = self.regressor(run, &samples)?;
        let mut picked = DMatrix::zeros(samples.len(), forces.len());
        // What the filter feels beyond the window, with room to spare.
        let from = start.saturating_sub(BEYOND * every);
        for (d, force) in forces.iter().enumerate() {
            let around = &force[from..(end + BEYOND * every).min(force.len())];
            // The noise of the forces must not fold down.
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

    /// The model's regressor at some samples, with friction and an offset of every drive beside; row of sample and drive.
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

/// A stretch of time, s.
struct TimeWindow {
    from: f64,
    to: f64,
}

/// Rows of the regressor per sample and drive, and forces per sample.
struct WindowSamples {
    regressor: DMatrix<f64>,
    forces: DMatrix<f64>,
}

impl WindowSamples {
    /// The same below a frequency, Hz; `None` where there are too few samples.
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

/// Inner products of measured and model force in an octave.
#[derive(Clone, Default)]
struct OctavePower {
    measured: f64,
    product: f64,
    model: f64,
}

impl OctavePower {
    fn add(&mut self, measured: &[f64], model: &[f64]) {
        for (y, m) in measured.iter().zip(model) {
            self.measured += y * y;
            self.product += y * m;
            self.model += m * m;
        }
    }

    /// What the model leaves of the measured force. It may be damped where it says less than it adds, as a filter will do
    /// above the band of the motion: noise there costs nothing but what it hides.
    fn residual_power(&self, may_be_damped: bool) -> f64 {
        let scale = if may_be_damped && self.model > 0.0 {
            (self.product / self.model).clamp(0.0, 1.0)
        } else {
            1.0
        };
        self.measured - 2.0 * scale * self.product + scale * scale * self.model
    }
}

/// Samples at both ends of `n` that a low-pass at `band` spoils.
fn margin(n: usize, rate: f64, band: f64) -> usize {
    floor_to_count((DROPPED.0 * rate / band).min(DROPPED.1 * n as f64))
}

/// Inner products of the rows of one fold, drive by drive.
#[derive(Clone)]
struct FoldSums {
    drives: Vec<DriveNormalEquations>,
}

#[derive(Clone)]
struct DriveNormalEquations {
    normal: DMatrix<f64>,
    right: DVector<f64>,
    size: f64,
    rows: usize,
}

impl FoldSums {
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

/// For each fold the values that fit the others; `None` where there are too few rows, or nothing is measured.
fn fit_folds(folds: &[FoldSums]) -> Option<Vec<DVector<f64>>> {
    let n = folds.first()?.drives.len();
    let width = folds[0].drives[0].right.len();
    let total = |d: usize| -> f64 { folds.iter().map(|fold| fold.drives[d].size).sum() };
    let sizes: Vec<f64> = (0..n).map(total).collect();
    let rows: usize = folds.iter().map(|fold| fold.drives[0].rows).sum();
    if rows * n < 3 * width || sizes.iter().any(|size| *size <= 0.0) {
        return None;
    }
    // Drives count alike at first, then by what is left of them.
    let mut left = sizes.clone();
    let mut values = Vec::new();
    for _ in 0..2 {
        let weights: Vec<f64> = (left.iter().zip(&sizes))
            .map(|(left, size)| rows as f64 / left.max(ROUNDING * ROUNDING * size))
            .collect();
        left = vec![0.0; n];
        values.clear();
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
            for (left, one) in left.iter_mut().zip(&judged.drives) {
                let explained =
                    2.0 * one.right.dot(&found) - (symmetric(&one.normal) * &found).dot(&found);
                *left += (one.size - explained).max(0.0);
            }
            values.push(found);
        }
    }
    Some(values)
}

/// Values of scaled normal equations with a trace of a ridge, since columns may be the same.
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

/// The whole of a matrix of which the lower triangle is there.
fn symmetric(lower: &DMatrix<f64>) -> DMatrix<f64> {
    let mut whole = lower.clone();
    whole.fill_upper_triangle_with_lower_triangle();
    whole
}

fn duration(run: &PreparedRun) -> f64 {
    match run.time.as_slice() {
        [first, .., last] => last - first,
        _ => 0.0,
    }
}
