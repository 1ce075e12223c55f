//! How a recording is smoothed where nobody says how: candidates go in, the one that leaves least of the forces on held-out
//! time comes out.
//!
//! Spectra of positions alone cannot tell noise of clocks and encoders from motion; forces can. For each cut-off of a ladder
//! the model's regressor, with friction and an offset of every drive beside, is fitted to the forces on four fifths of the
//! time and held against the last one, both sides through one low-pass at the band of the motion, so that all candidates are
//! judged by the same forces on the same samples. The figure is the geometric mean of the drives' relative errors: the
//! likelihood of errors whose size is not known, which knows no units.

use modelmill_codegen::{Evaluator, States};
use modelmill_identify::{LowPass, Note, Open, PASSED_BY_DECIMATION, Recording as Raw, Run};
use nalgebra::{DMatrix, DVector};

use super::options::Reading;
use crate::error::Outcome;
use crate::model::Model;
use crate::text::table::{percent, significant};

/// Ratio of neighbouring cut-offs.
const RATIO: f64 = 1.6;
/// The highest cut-off, in parts of the sampling rate: beyond, differences take more than the filter leaves.
const HIGHEST: f64 = 0.2;
/// The lowest cut-off, in parts of the band of the forces.
const LOWEST: f64 = 0.3;
/// Parts of the time, each of which is held out once.
const FOLDS: usize = 5;
/// Samples that are looked at for each candidate, at most; beyond, windows are spread over the recording.
const LOOKED_AT: usize = 12_000;
/// Windows of a long recording.
const WINDOWS: usize = 10;
/// Periods of the band that are dropped at both ends of a window.
const DROPPED: f64 = 1.5;
/// Bands of the parallel filter that are tried, in parts of the band of the forces.
const PARALLEL: [f64; 3] = [1.0, 2.0, 4.0];
/// A candidate must be better by this part of the error to be preferred to one that smooths less.
const BETTER: f64 = 0.005;
/// A cut-off that leaves so much more than the best ends the search downwards.
const HOPELESS: f64 = 1.5;

/// The preparation with what was open settled, and what was chosen; nothing where nothing is open, or where forces do not
/// tell.
pub(super) fn choose(
    model: &Model,
    raw: &Raw,
    reading: &Reading,
) -> Outcome<Option<(Reading, Note)>> {
    let drives = model.drives();
    let has_forces = !drives.is_empty() && drives.iter().all(|drive| raw.has(drive));
    if !has_forces || model.base.is_empty() {
        return Ok(None);
    }
    let open = raw.open(&model.active(), &drives, &reading.preparation)?;
    Ok(open.and_then(|open| {
        let search = Search {
            model,
            raw,
            reading,
            open,
        };
        search.chosen()
    }))
}

/// A candidate with what it leaves: the logarithm of the geometric mean of the drives' relative errors.
type Judged = (f64, f64);

struct Search<'a> {
    model: &'a Model,
    raw: &'a Raw,
    reading: &'a Reading,
    open: Open,
}

impl Search<'_> {
    fn chosen(&self) -> Option<(Reading, Note)> {
        let Open {
            rate_hz,
            band_hz,
            cutoff_hz,
        } = self.open;
        let highest = HIGHEST * rate_hz;
        let lowest = (LOWEST * band_hz).min(cutoff_hz);
        let mut ladder = vec![cutoff_hz.min(highest)];
        while ladder[0] * RATIO <= highest && ladder.len() < 3 {
            ladder.insert(0, ladder[0] * RATIO);
        }
        while ladder[ladder.len() - 1] / RATIO >= lowest {
            ladder.push(ladder[ladder.len() - 1] / RATIO);
        }
        // The lowest cut-off drops most samples; what it leaves is looked at for all.
        let runs = self.runs(ladder[ladder.len() - 1])?;
        let looked_at = self.windows(&runs);
        let mut judged: Vec<Judged> = Vec::new();
        let mut least = f64::INFINITY;
        for cutoff in ladder {
            let Some(rows) = self.rows(cutoff, &looked_at) else {
                continue;
            };
            let Some(left) = held_out(&rows, &rows) else {
                continue;
            };
            judged.push((cutoff, left));
            least = least.min(left);
            if left > least + HOPELESS.ln() && judged.len() > 3 {
                break;
            }
        }
        let best = judged
            .iter()
            .position(|(_, left)| *left <= least + BETTER)?;
        let (cutoff, left) = judged[best];
        let (decimate, left) = self.decimation(cutoff, &looked_at).unwrap_or((1, left));
        let mut reading = self.reading.clone();
        reading.preparation.cutoff_hz = Some(cutoff);
        reading.preparation.decimate = decimate;
        reading.preparation.chosen = true;
        let shown = |left: f64| percent(Some(left.exp()));
        let neighbours: Vec<String> = [best.checked_sub(1), Some(best + 1)]
            .into_iter()
            .filter_map(|at| {
                let (cutoff, left) = judged.get(at?)?;
                Some(format!(
                    "{} at {} Hz",
                    shown(*left),
                    significant(*cutoff, 3)
                ))
            })
            .collect();
        let neighbours = if neighbours.is_empty() {
            String::new()
        } else {
            format!(" ({})", neighbours.join(", "))
        };
        let every = if decimate > 1 {
            format!(
                ", and every {decimate}th sample after the parallel filter on forces and regressor"
            )
        } else {
            String::new()
        };
        let says = format!(
            "{} is smoothed at {} Hz{every}: chosen by what is left of the forces below {} Hz on held-out time, {} (geometric \
             mean over the drives){neighbours}; options `cutoff_hz` and `decimate` say otherwise.",
            self.raw.file(),
            significant(cutoff, 3),
            significant(band_hz, 3),
            shown(left),
        );
        Some((reading, Note::info(says)))
    }

    /// The factor of decimation, and what is left with it on held-out time.
    fn decimation(&self, cutoff: f64, looked_at: &[Window]) -> Option<(usize, f64)> {
        let rows = self.rows(cutoff, looked_at)?;
        let mut best: Option<(usize, f64)> = None;
        for part in PARALLEL {
            let passed = part * self.open.band_hz;
            let factor = whole(PASSED_BY_DECIMATION * self.open.rate_hz / passed).max(1);
            let passed = if factor == 1 { f64::INFINITY } else { passed };
            let fitted = self.rows_in(cutoff, looked_at, passed)?;
            let left = held_out(&fitted, &rows)?;
            if best.is_none_or(|(_, least)| left < least - BETTER) {
                best = Some((factor, left));
            }
            if factor == 1 {
                break;
            }
        }
        best
    }

    /// The runs that a cut-off gives.
    fn runs(&self, cutoff: f64) -> Option<Vec<Run>> {
        let mut preparation = self.reading.preparation.clone();
        preparation.cutoff_hz = Some(cutoff);
        let (active, drives) = (self.model.active(), self.model.drives());
        let mut runs = self.raw.runs_with(&active, &drives, &preparation).ok()?;
        let delay = self.model.derivation.mechanism.force_delay;
        if delay != 0.0 {
            for run in &mut runs {
                run.pair_with_earlier_states(delay)?;
            }
        }
        Some(runs)
    }

    /// The stretches of time that all candidates have, or windows of them.
    fn windows(&self, runs: &[Run]) -> Vec<Window> {
        let total: f64 = runs.iter().map(duration).sum();
        let step = self.open.band_hz.recip() / 12.0;
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
                windows.push(Window {
                    from,
                    to: from + share * length,
                });
            }
        }
        windows
    }

    fn rows(&self, cutoff: f64, windows: &[Window]) -> Option<Vec<Rows>> {
        self.rows_in(cutoff, windows, self.open.band_hz)
    }

    /// Rows of regressor and forces below `passed`, Hz, of all windows, by folds.
    fn rows_in(&self, cutoff: f64, windows: &[Window], passed: f64) -> Option<Vec<Rows>> {
        let runs = self.runs(cutoff)?;
        let n_drives = self.model.drives().len();
        let total: f64 = windows.iter().map(|w| w.to - w.from).sum();
        let mut folds: Vec<Rows> = Vec::new();
        let mut before = 0.0;
        for window in windows {
            let run = runs.iter().find(|run| {
                let slack = 1.0 / self.open.rate_hz;
                run.time[0] <= window.from + slack
                    && run.time[run.time.len() - 1] >= window.to - slack
            })?;
            let part = self.window(run, window, passed, cutoff)?;
            for (time, row) in part.time.iter().zip(part.rows.chunks_exact(n_drives)) {
                let at = (before + time - window.from) / total;
                let fold = whole(at * FOLDS as f64).min(FOLDS - 1);
                for (drive, (row, force)) in row.iter().enumerate() {
                    if folds.is_empty() {
                        folds = vec![Rows::new(n_drives, row.len()); FOLDS];
                    }
                    folds[fold].add(drive, row, *force);
                }
            }
            before += window.to - window.from;
        }
        (!folds.is_empty()).then_some(folds)
    }

    /// Filtered rows along one window.
    fn window(&self, run: &Run, window: &Window, passed: f64, cutoff: f64) -> Option<Filtered> {
        let band = self.open.band_hz;
        let rate = self.open.rate_hz;
        let every = whole(rate / (12.0 * band).max(4.0 * cutoff.min(3.0 * band))).max(1);
        let forces = run.force.as_deref()?;
        let start = run.time.partition_point(|t| *t < window.from);
        let end = run.time.partition_point(|t| *t <= window.to);
        let samples: Vec<usize> = (start..end).step_by(every).collect();
        if samples.len() < 40 {
            return None;
        }
        let mut columns = self.regressor(run, &samples)?;
        let width = columns.ncols();
        let n = forces.len();
        // Row of sample and drive: forces stand behind the regressor, filtered at the full rate, so that their noise does not
        // fold down.
        columns = columns.resize_horizontally(width + 1, 0.0);
        for (d, force) in forces.iter().enumerate() {
            let even = if passed.is_finite() {
                LowPass::butterworth(4, passed, rate)
                    .ok()?
                    .zero_phase(force)
                    .ok()?
            } else {
                force.clone()
            };
            for (i, sample) in samples.iter().enumerate() {
                columns[(i * n + d, width)] = even[*sample];
            }
        }
        let coarse = rate / every as f64;
        let low_pass = (passed < 0.45 * coarse)
            .then(|| LowPass::butterworth(4, passed, coarse).ok())
            .flatten();
        let mut filtered = DMatrix::zeros(columns.nrows(), width + 1);
        for k in 0..=width {
            for d in 0..n {
                let column: Vec<f64> = (0..samples.len())
                    .map(|i| columns[(i * n + d, k)])
                    .collect();
                let column = match &low_pass {
                    Some(low_pass) if k < width && column.iter().any(|x| *x != 0.0) => {
                        low_pass.zero_phase(&column).ok()?
                    }
                    _ => column,
                };
                for (i, value) in column.into_iter().enumerate() {
                    filtered[(i * n + d, k)] = value;
                }
            }
        }
        let margin = whole(DROPPED * coarse / band);
        // Filtered rows resemble their neighbours: four in a period of the band tell all.
        let thin = if passed.is_finite() {
            whole(coarse / (4.0 * passed)).max(1)
        } else {
            1
        };
        let kept = (margin..samples.len().saturating_sub(margin)).step_by(thin);
        let mut found = Filtered {
            time: Vec::new(),
            rows: Vec::new(),
        };
        for i in kept {
            found.time.push(run.time[samples[i]]);
            for d in 0..n {
                let row = filtered.row(i * n + d);
                let regressor = row.columns(0, width).transpose();
                found.rows.push((regressor, row[width]));
            }
        }
        Some(found)
    }

    /// The model's regressor at some samples, with friction and an offset of every drive beside; row of sample and drive.
    fn regressor(&self, run: &Run, samples: &[usize]) -> Option<DMatrix<f64>> {
        let pick = |columns: &[Vec<f64>]| -> Vec<Vec<f64>> {
            let pick = |column: &Vec<f64>| samples.iter().map(|k| column[*k]).collect();
            columns.iter().map(pick).collect()
        };
        let states = [&run.q, &run.qd, &run.qdd].map(|columns| pick(columns));
        let load = pick(run.force.as_deref().unwrap_or(&[]));
        let states = States {
            q: states[0].iter().map(Vec::as_slice).collect(),
            qd: states[1].iter().map(Vec::as_slice).collect(),
            qdd: states[2].iter().map(Vec::as_slice).collect(),
            load: load.iter().map(Vec::as_slice).collect(),
        };
        let evaluator = Evaluator::new(&self.model.derivation);
        let regressor = evaluator.regressor(&states).ok()?;
        let n = self.model.drives().len();
        let rates = evaluator.drives(&states).ok()?;
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
struct Window {
    from: f64,
    to: f64,
}

/// Filtered rows of a window: times, and per sample and drive a row with its force.
struct Filtered {
    time: Vec<f64>,
    rows: Vec<(DVector<f64>, f64)>,
}

/// Inner products of the rows of one fold, drive by drive.
#[derive(Clone)]
struct Rows {
    drives: Vec<Products>,
}

#[derive(Clone)]
struct Products {
    normal: DMatrix<f64>,
    right: DVector<f64>,
    size: f64,
    rows: usize,
}

impl Rows {
    fn new(drives: usize, width: usize) -> Self {
        let products = Products {
            normal: DMatrix::zeros(width, width),
            right: DVector::zeros(width),
            size: 0.0,
            rows: 0,
        };
        Self {
            drives: vec![products; drives],
        }
    }

    fn add(&mut self, drive: usize, row: &DVector<f64>, force: f64) {
        let one = &mut self.drives[drive];
        one.normal.syger(1.0, row, row, 1.0);
        one.right.axpy(force, row, 1.0);
        one.size += force * force;
        one.rows += 1;
    }
}

/// What is left of the forces of each fold of `judge` when the others of `fit` are fitted; `None` where there are too few
/// rows, or nothing is measured.
fn held_out(fit: &[Rows], judge: &[Rows]) -> Option<f64> {
    let n = fit.first()?.drives.len();
    let width = fit[0].drives[0].right.len();
    let sizes: Vec<f64> = (0..n)
        .map(|d| judge.iter().map(|fold| fold.drives[d].size).sum())
        .collect();
    let mut weights: Vec<f64> = (0..n)
        .map(|d| {
            let size: f64 = fit.iter().map(|fold| fold.drives[d].size).sum();
            let rows: usize = fit.iter().map(|fold| fold.drives[d].rows).sum();
            (size > 0.0).then(|| rows as f64 / size)
        })
        .collect::<Option<_>>()?;
    let rows: usize = fit
        .iter()
        .flat_map(|fold| &fold.drives)
        .map(|one| one.rows)
        .sum();
    if rows < 3 * width || sizes.iter().any(|size| *size <= 0.0) {
        return None;
    }
    let mut left = vec![0.0; n];
    // Drives count alike at first, then by what is left of them.
    for _ in 0..2 {
        left = vec![0.0; n];
        for (out, judged) in judge.iter().enumerate() {
            let mut normal = DMatrix::zeros(width, width);
            let mut right = DVector::zeros(width);
            for (_, fold) in fit.iter().enumerate().filter(|(k, _)| *k != out) {
                for (one, weight) in fold.drives.iter().zip(&weights) {
                    normal += &one.normal * *weight;
                    right += &one.right * *weight;
                }
            }
            let values = solved(normal, &right)?;
            for (left, one) in left.iter_mut().zip(&judged.drives) {
                let explained =
                    2.0 * one.right.dot(&values) - (symmetric(&one.normal) * &values).dot(&values);
                *left += (one.size - explained).max(0.0);
            }
        }
        for ((weight, left), size) in weights.iter_mut().zip(&left).zip(&sizes) {
            *weight = rows as f64 / left.max(1e-12 * size);
        }
    }
    let relative = left.iter().zip(&sizes);
    let logarithms = relative.map(|(left, size)| 0.5 * (left / size).max(1e-24).ln());
    Some(logarithms.sum::<f64>() / n as f64)
}

/// Values of scaled normal equations with a trace of a ridge, since columns may be the same.
fn solved(normal: DMatrix<f64>, right: &DVector<f64>) -> Option<DVector<f64>> {
    let mut normal = symmetric(&normal);
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

fn duration(run: &Run) -> f64 {
    match run.time.as_slice() {
        [first, .., last] => last - first,
        _ => 0.0,
    }
}

/// A count that was computed, rounded down.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a float becomes the nearest count there is"
)]
fn whole(value: f64) -> usize {
    value as usize
}
