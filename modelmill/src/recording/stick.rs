//! Stick phases: intervals in which a drive with dry friction sticks or reverses. Prepared runs go in; intervals come
//! out.
//!
//! While a drive sticks, dry friction balances whatever acts and may have any value between plus and minus the dry
//! friction of motion. About a reversal of a smoothed motion the sign of the rate is that of the noise, or comes too
//! early. An equation there with friction of the full size is wrong, and least squares pays with all other parameters.
//!
//! Decision: the forces decide whether there are such phases, not a fixed rate. The model, with friction and an offset
//! of every drive, is fitted to the samples of clear motion. If friction at low rates falls short of the fitted one, up
//! to a small rate and not beyond it, the drive sticks there. If it falls short beyond that rate, too, it is a law of
//! friction, which a diagnosis has to find.

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};
use modelmill_identify::{PreparedRun, RecordingNote};
use nalgebra::{DMatrix, DVector};

use super::friction_rows::{rates_of_drives, regressor_with_friction, solve_scaled};
use super::options::StandstillRule;
use super::thresholds::{
    BLUR_LEAST_SLOW_SHARE, BLUR_MOST_SHARE, DRY_FRICTION_LEAST_SHARE, DRY_FRICTION_LEAST_SIGMAS,
    STICK_BIN_FEWEST_SAMPLES, STICK_BLUR_PERIODS, STICK_CLEAR_MOTION, STICK_FAINT_SHORTFALL, STICK_LEAST_SHORTFALL,
    STICK_LOWEST_SHORTFALL, STICK_MOST_SHARE, STICK_NOISE_RATIO, STICK_RATE_SHARES, STICK_SHORTFALL_SIGMAS,
};
use crate::model::Model;
use crate::segment::RecordingSegment;
use crate::segment::picked_states::{PickedStates, rate_sign};
use crate::text::table::{percent, significant};

/// Largest number of samples of all runs that are evaluated for the fit.
const LOOKED_AT: usize = 4000;
/// Largest number of slow samples of a run that are evaluated.
const SLOW_LOOKED_AT: usize = 8000;
/// Number of states at which the size of dry friction is computed.
const FRICTION_STATES: usize = 40;
/// Samples on either side of a stick phase that give the residual there.
const EDGE: usize = 8;
/// Factor of the rates at these states: viscous friction vanishes and dry friction stays.
const SLOW: f64 = 1e-9;

/// The bound of the rate below which a drive counts as sticking.
#[derive(Clone, Copy, Debug, PartialEq)]
struct StickBound {
    /// The rate, rad/s or m/s.
    rate: f64,
    /// Size of the dry friction, N or N m; `None` if the user gave the bound.
    friction: Option<f64>,
}

/// The stick phases of some recordings of one machine.
#[derive(Default)]
pub(super) struct StickPhases {
    /// The bound of each drive; `None` for a drive that does not stick.
    bounds: Vec<Option<StickBound>>,
    /// `[recording][drive]`: intervals, s, in order of time.
    intervals: Vec<Vec<Vec<[f64; 2]>>>,
    /// `[recording][drive]`: forces without sticking at the times in these intervals, s and N or N m, in order of time.
    fills: Vec<Vec<Vec<(f64, f64)>>>,
    /// Drives whose forces are kept, because what would be left out is mostly the blur of reversals.
    blurred: Vec<usize>,
}

impl StickPhases {
    /// The stick phases of recordings, of which each has one or several runs. Without forces or without a rule there
    /// are none.
    pub(super) fn find(model: &Model, recordings: &[Vec<PreparedRun>], rule: StandstillRule) -> Self {
        if rule == StandstillRule::KeepAll {
            return Self::default();
        }
        let Some(fastest) = fastest_rates(model, recordings) else {
            return Self::default();
        };
        let fit = FrictionFit::new(model, recordings, &fastest);
        let bounds: Vec<Option<StickBound>> = match (rule, &fit) {
            (StandstillRule::Below(part), _) => {
                let bound = |fastest: &f64| StickBound {
                    rate: part * fastest,
                    friction: None,
                };
                let bounds = fastest.iter().map(|fastest| (*fastest > 0.0).then(|| bound(fastest)));
                bounds.collect()
            }
            (_, Some(fit)) => fit.bounds(model, recordings, &fastest),
            (_, None) => Vec::new(),
        };
        if bounds.iter().all(Option::is_none) {
            return Self::default();
        }
        let mut counts = vec![SlowCounts::default(); bounds.len()];
        let mut found = Self {
            bounds,
            ..Self::default()
        };
        for runs in recordings {
            let n = found.bounds.len();
            let (mut intervals, mut fills) = (vec![Vec::new(); n], vec![Vec::new(); n]);
            for run in runs {
                let every: Vec<usize> = (0..run.samples()).collect();
                let rates = rates_of_drives(model, &PickedStates::new(run, &every)).unwrap_or_default();
                for (d, rates) in rates.iter().enumerate() {
                    let Some(bound) = found.bounds[d] else { continue };
                    let first = intervals[d].len();
                    add_slow_intervals(run, rates, bound.rate, &mut intervals[d]);
                    if let Some(fit) = &fit {
                        let before = first.saturating_sub(1);
                        let within = fit.fill_forces(model, run, d, &intervals[d][before..]);
                        fills[d].extend(within.unwrap_or_default());
                    }
                    counts[d].add(run, rates, bound.rate, &intervals[d]);
                }
            }
            found.intervals.push(intervals);
            found.fills.push(fills);
        }
        if rule == StandstillRule::Automatic {
            found.keep_blurred(&counts);
        }
        found
    }

    /// Keeps the forces of drives that hardly stand: what is left out of them is mostly the blur of reversals, and too
    /// much for what remains to represent the motion.
    fn keep_blurred(&mut self, counts: &[SlowCounts]) {
        for (d, counts) in counts.iter().enumerate() {
            if !counts.is_blur() {
                continue;
            }
            self.bounds[d] = None;
            self.blurred.push(d);
            for (intervals, fills) in self.intervals.iter_mut().zip(&mut self.fills) {
                intervals[d].clear();
                fills[d].clear();
            }
        }
    }

    /// Whether there are no stick phases at all.
    pub(super) fn is_empty(&self) -> bool {
        self.intervals.iter().flatten().all(Vec::is_empty)
    }

    /// For each time, in increasing order, whether a drive sticks in a recording.
    pub(super) fn is_stuck(&self, recording: usize, drive: usize, time: impl Iterator<Item = f64>) -> Vec<bool> {
        let none = Vec::new();
        let intervals = self
            .intervals
            .get(recording)
            .and_then(|all| all.get(drive))
            .unwrap_or(&none);
        let mut next = 0;
        time.map(|t| {
            while next < intervals.len() && intervals[next][1] < t {
                next += 1;
            }
            intervals.get(next).is_some_and(|[from, _]| *from <= t)
        })
        .collect()
    }

    /// Leaves the forces during stick phases of one recording out. Returns their number for each drive.
    ///
    /// The values of these forces are replaced by those of the fit without sticking. They count nowhere, but a filter
    /// of all forces would carry the real ones into the samples around.
    pub(super) fn mark(&self, recording: usize, data: &mut [RecordingSegment]) -> Vec<usize> {
        let mut counts = vec![0; self.bounds.len()];
        for run in data.iter_mut().map(|one| &mut one.run).filter(|_| !self.is_empty()) {
            if run.left_out.is_empty() {
                run.left_out = vec![vec![false; run.time.len()]; counts.len()];
            }
            for (d, all) in run.left_out.iter_mut().enumerate() {
                let stuck = self.is_stuck(recording, d, run.time.iter().copied());
                counts[d] += stuck.iter().filter(|stuck| **stuck).count();
                for (all, stuck) in all.iter_mut().zip(&stuck) {
                    *all |= stuck;
                }
                if let Some(force) = run.force.as_mut().and_then(|force| force.get_mut(d)) {
                    self.fill(recording, d, &run.time, &stuck, force);
                }
            }
        }
        counts
    }

    /// Replaces the forces of a drive at the samples that stick.
    fn fill(&self, recording: usize, drive: usize, time: &[f64], stuck: &[bool], force: &mut [f64]) {
        let Some(values) = self.fills.get(recording).and_then(|all| all.get(drive)) else {
            return;
        };
        for (i, t) in time.iter().enumerate().filter(|(i, _)| stuck[*i]) {
            let at = values.partition_point(|(other, _)| other < t);
            if let Some((other, value)) = values.get(at)
                && other.total_cmp(t).is_eq()
            {
                force[i] = *value;
            }
        }
    }

    /// As [`Self::mark`], with a note on what is left out.
    pub(super) fn leave_out(&self, model: &Model, recording: usize, data: &mut [RecordingSegment]) {
        let drives = model.row_names();
        let out = self.mark(recording, data);
        // One note for all recordings: the decision is common to them.
        if let (0, Some(first)) = (recording, data.first_mut()) {
            self.note_kept_forces(model, first);
        }
        let samples: usize = data.iter().map(RecordingSegment::samples).sum();
        // One note for all drives of the recording.
        let each: Vec<String> = (drives.iter().zip(&self.bounds).zip(&out).enumerate())
            .filter(|(_, (_, out))| **out > 0)
            .filter_map(|(d, ((drive, bound), out))| {
                let bound = bound.as_ref()?;
                let friction = bound.friction.map_or_else(String::new, |friction| {
                    format!(", dry friction {} {}", significant(friction, 3), model.force_unit(d))
                });
                let unit = if model.force_unit(d) == "N" { "m/s" } else { "rad/s" };
                Some(format!(
                    "`{drive}` {} (velocity below {} {unit}{friction})",
                    percent(Some(*out as f64 / samples as f64)),
                    significant(bound.rate, 3)
                ))
            })
            .collect();
        let Some(first) = data.first_mut().filter(|_| !each.is_empty()) else {
            return;
        };
        let says = message!(
            "In {} these drives stick or reverse for a part of the time: {}. Dry friction takes any value up to its \
             size there, so these forces are left out of fits and error figures. {} sets the bound, as a fraction of the \
             largest velocity; 0 keeps all.",
            first.run.file,
            each.join(", "),
            Remedy::option(OptionName::Standstill)
        );
        first.note(model, RecordingNote::info(says));
    }
}

impl StickPhases {
    /// Adds a note on drives whose forces are kept at reversals.
    fn note_kept_forces(&self, model: &Model, first: &mut RecordingSegment) {
        if self.blurred.is_empty() {
            return;
        }
        let drives = model.row_names();
        let names: Vec<String> = self.blurred.iter().map(|d| format!("`{}`", drives[*d])).collect();
        let says = message!(
            "Forces about reversals of {} are kept in all recordings: most of what would be left out is the blur of the \
             smoothing, and the rest would not represent the motion. Dry friction is less accurate for that reason. {} \
             leaves them out.",
            names.join(", "),
            Remedy::option(OptionName::Standstill)
        );
        first.note(model, RecordingNote::info(says));
    }
}

/// Adds the intervals in which a run is slower than a bound, widened by the blur of its smoothing.
fn add_slow_intervals(run: &PreparedRun, rates: &[f64], bound: f64, all: &mut Vec<[f64; 2]>) {
    let blur = match run.prepared.cutoff_hz {
        // A series chosen automatically represents the motion up to noise: it blurs nothing.
        Some(cutoff) if run.prepared.period.is_none() => STICK_BLUR_PERIODS / cutoff,
        _ => 0.0,
    };
    let n = rates.len();
    // A change of sign between two samples is a reversal, too, however fast.
    let is_slow = |i: usize| {
        let turns = i + 1 < n && rates[i] * rates[i + 1] < 0.0;
        rates[i].abs() <= bound || turns
    };
    for i in (0..n).filter(|i| is_slow(*i)) {
        let [from, to] = [run.time[i] - blur, run.time[(i + 1).min(n - 1)] + blur];
        let to = if rates[i].abs() <= bound {
            run.time[i] + blur
        } else {
            to
        };
        match all.last_mut() {
            Some(last) if from <= last[1] => last[1] = last[1].max(to),
            _ => all.push([from, to]),
        }
    }
}

/// Samples of a drive in all recordings.
#[derive(Clone, Copy, Default)]
struct SlowCounts {
    /// All samples.
    all: usize,
    /// Samples slower than the bound.
    slow: usize,
    /// Samples in the intervals to leave out.
    left_out: usize,
}

impl SlowCounts {
    /// Adds the samples of a run, of which those in the intervals would be left out.
    fn add(&mut self, run: &PreparedRun, rates: &[f64], bound: f64, intervals: &[[f64; 2]]) {
        self.all += rates.len();
        self.slow += rates.iter().filter(|rate| rate.abs() <= bound).count();
        let of = |[from, to]: &[f64; 2]| {
            let end = run.time.partition_point(|t| t <= to);
            end - run.time.partition_point(|t| t < from).min(end)
        };
        self.left_out += intervals.iter().map(of).sum::<usize>();
    }

    /// Whether the intervals cover a large part of the samples, of which the drive is slow in a small part only.
    fn is_blur(&self) -> bool {
        let left_out = self.left_out as f64;
        left_out > BLUR_MOST_SHARE * self.all as f64 && (self.slow as f64) < BLUR_LEAST_SLOW_SHARE * left_out
    }
}

/// The largest rate of each drive over all recordings, rad/s or m/s.
fn fastest_rates(model: &Model, recordings: &[Vec<PreparedRun>]) -> Option<Vec<f64>> {
    let mut fastest = vec![0.0_f64; model.row_names().len()];
    for run in recordings.iter().flatten() {
        let every: Vec<usize> = (0..run.samples()).collect();
        let rates = rates_of_drives(model, &PickedStates::new(run, &every))?;
        for (fastest, rates) in fastest.iter_mut().zip(rates) {
            *fastest = rates.into_iter().fold(*fastest, |most, rate| most.max(rate.abs()));
        }
    }
    Some(fastest)
}

/// Rows of all recordings at selected samples.
struct FrictionRows {
    /// Number of drives.
    drives: usize,
    /// Regressor with friction, row `sample * drives + drive`.
    regressor: DMatrix<f64>,
    /// Measured forces, one per row.
    forces: DVector<f64>,
    /// Whether a force was measured, one per row.
    is_measured: Vec<bool>,
    /// Rates, `[drive][sample]`, rad/s or m/s.
    rates: Vec<Vec<f64>>,
}

impl FrictionRows {
    /// Evaluates the rows at the samples that `select` returns for a run; `None` without forces or samples, or at a
    /// pose without solution.
    fn new(
        model: &Model,
        recordings: &[Vec<PreparedRun>],
        select: &dyn Fn(&PreparedRun) -> Option<Vec<usize>>,
    ) -> Option<Self> {
        let drives = model.row_names().len();
        let mut blocks = Vec::new();
        let (mut forces, mut is_measured) = (Vec::new(), Vec::new());
        let mut rates = vec![Vec::new(); drives];
        for run in recordings.iter().flatten() {
            let measured = run.force.as_deref()?;
            let samples = select(run)?;
            if samples.is_empty() {
                continue;
            }
            let states = PickedStates::new(run, &samples);
            blocks.push(regressor_with_friction(model, &states)?);
            for (all, more) in rates.iter_mut().zip(rates_of_drives(model, &states)?) {
                all.extend(more);
            }
            for k in samples {
                for (d, force) in measured.iter().enumerate() {
                    forces.push(force[k]);
                    is_measured.push(run.is_force_measured(d, k));
                }
            }
        }
        let width = blocks.first()?.ncols();
        let mut regressor = DMatrix::zeros(forces.len(), width);
        let mut start = 0;
        for block in &blocks {
            regressor.rows_mut(start, block.nrows()).copy_from(block);
            start += block.nrows();
        }
        Some(Self {
            drives,
            regressor,
            forces: DVector::from_vec(forces),
            is_measured,
            rates,
        })
    }

    /// The rms value of the measured force of a drive, N or N m.
    fn force_rms(&self, drive: usize) -> f64 {
        let rows = (drive..self.forces.len())
            .step_by(self.drives)
            .filter(|row| self.is_measured[*row]);
        let squares: Vec<f64> = rows.map(|row| self.forces[row].powi(2)).collect();
        (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
    }

    /// How much the friction of a drive falls short of that of motion, relative to it, at the rates that `wanted`
    /// selects.
    fn shortfall(&self, values: &DVector<f64>, d: usize, friction: f64, wanted: impl Fn(f64) -> bool) -> ShortfallBin {
        let mut bin = ShortfallBin::default();
        for (i, rate) in self.rates[d].iter().enumerate().filter(|(_, rate)| wanted(rate.abs())) {
            let row = i * self.drives + d;
            if !self.is_measured[row] {
                continue;
            }
            let residual = self.forces[row] - (self.regressor.row(row) * values)[(0, 0)];
            let shortfall = -residual * rate_sign(*rate) / friction;
            bin.samples += 1;
            bin.sum += shortfall;
            bin.squares += shortfall * shortfall;
        }
        bin
    }

    /// Values that fit the rows in which the drives move clearly; drives are weighted by their residuals.
    fn fit(&self, fastest: &[f64]) -> Option<DVector<f64>> {
        let n = self.drives;
        let width = self.regressor.ncols();
        let moves = |row: usize| self.rates[row % n][row / n].abs() > STICK_CLEAR_MOTION * fastest[row % n];
        let mut sums = vec![(DMatrix::zeros(width, width), DVector::zeros(width), 0.0, 0_usize); n];
        for row in (0..self.forces.len()).filter(|row| self.is_measured[*row] && moves(*row)) {
            let entries = self.regressor.row(row).transpose();
            let force = self.forces[row];
            let (normal, right, size, rows) = &mut sums[row % n];
            normal.syger(1.0, &entries, &entries, 1.0);
            right.axpy(force, &entries, 1.0);
            *size += force * force;
            *rows += 1;
        }
        // A row without forces, such as that of an undriven joint, has the scale of the others.
        let largest = sums.iter().map(|(_, _, size, _)| *size).fold(0.0, f64::max);
        let mut left: Vec<f64> = sums
            .iter()
            .map(|(_, _, size, _)| if *size > 0.0 { *size } else { largest })
            .collect();
        let mut values = None;
        for _ in 0..2 {
            let mut normal = DMatrix::zeros(width, width);
            let mut right = DVector::zeros(width);
            for ((one, product, _, rows), left) in sums.iter().zip(&left).filter(|(_, left)| **left > 0.0) {
                let weight = *rows as f64 / left;
                normal += one * weight;
                right += product * weight;
            }
            let found = solve_scaled(normal, &right)?;
            let residual = &self.forces - &self.regressor * &found;
            for (d, left) in left.iter_mut().enumerate() {
                let of_drive = (d..residual.len())
                    .step_by(n)
                    .filter(|row| self.is_measured[*row] && moves(*row));
                let squares: f64 = of_drive.map(|row| residual[row].powi(2)).sum();
                *left = squares.max(1e-12 * *left);
            }
            values = Some(found);
        }
        values
    }
}

/// The model with friction, fitted to the samples of clear motion.
struct FrictionFit {
    /// The rows to which it was fitted, and all others.
    rows: FrictionRows,
    /// Values of the columns.
    values: DVector<f64>,
    /// Dry friction of each drive, N or N m.
    frictions: Vec<f64>,
}

impl FrictionFit {
    /// Fits the model; `None` without forces, with too few samples, or at a pose without solution.
    fn new(model: &Model, recordings: &[Vec<PreparedRun>], fastest: &[f64]) -> Option<Self> {
        let total: usize = recordings.iter().flatten().map(PreparedRun::samples).sum();
        let every = total.div_ceil(LOOKED_AT).max(1);
        let rows = FrictionRows::new(model, recordings, &|run| {
            Some((0..run.samples()).step_by(every).collect())
        })?;
        if rows.forces.len() < 2 * rows.regressor.ncols() {
            return None;
        }
        let values = rows.fit(fastest)?;
        let frictions = dry_frictions(model, recordings, &values, rows.drives)?;
        Some(Self {
            rows,
            values,
            frictions,
        })
    }

    /// The bound of the rate of each drive; `None` for a drive that does not stick. `fastest` are the largest rates.
    fn bounds(&self, model: &Model, recordings: &[Vec<PreparedRun>], fastest: &[f64]) -> Vec<Option<StickBound>> {
        // Reversals are short, so that every slow sample is needed.
        let slow = |run: &PreparedRun| -> Option<Vec<usize>> {
            let every: Vec<usize> = (0..run.samples()).collect();
            let rates = rates_of_drives(model, &PickedStates::new(run, &every))?;
            let is_slow =
                |k: &usize| (rates.iter().zip(fastest)).any(|(rate, most)| rate[*k].abs() <= STICK_CLEAR_MOTION * most);
            let slow: Vec<usize> = every.into_iter().filter(is_slow).collect();
            let step = slow.len().div_ceil(SLOW_LOOKED_AT).max(1);
            Some(slow.into_iter().step_by(step).collect())
        };
        let Some(slow) = FrictionRows::new(model, recordings, &slow) else {
            return vec![None; self.rows.drives];
        };
        let bound = |d: usize| {
            let friction = self.frictions[d];
            let motion = self
                .rows
                .shortfall(&self.values, d, friction, |rate| rate > STICK_CLEAR_MOTION * fastest[d]);
            // Dry friction itself must be certain, and more than rounding.
            let (_, std) = motion.mean();
            let least = DRY_FRICTION_LEAST_SHARE * self.rows.force_rms(d);
            let is_certain = friction > least && friction.is_finite() && std * DRY_FRICTION_LEAST_SIGMAS < 1.0;
            if !is_certain || motion.samples < STICK_BIN_FEWEST_SAMPLES {
                return None;
            }
            let mut from = -1.0;
            let bins = STICK_RATE_SHARES.map(|share| {
                let (low, high) = (from, share * fastest[d]);
                from = high;
                slow.shortfall(&self.values, d, friction, |rate| rate > low && rate <= high)
            });
            Some(StickBound {
                rate: stick_share(&bins, &motion)? * fastest[d],
                friction: Some(friction),
            })
        };
        let bounds = (0..self.rows.drives).map(bound).collect();
        self.without_idle_drives(bounds, fastest)
    }

    /// The bounds of drives that move clearly for a part of the time.
    fn without_idle_drives(&self, mut bounds: Vec<Option<StickBound>>, fastest: &[f64]) -> Vec<Option<StickBound>> {
        for ((bound, rates), fastest) in bounds.iter_mut().zip(&self.rows.rates).zip(fastest) {
            let moves = rates
                .iter()
                .filter(|rate| rate.abs() > STICK_CLEAR_MOTION * fastest)
                .count();
            if (moves as f64) < (1.0 - STICK_MOST_SHARE) * rates.len() as f64 {
                *bound = None;
            }
        }
        bounds
    }

    /// Forces of a drive within intervals as the fit predicts them, with the residual of the samples around them; times
    /// and values. `None` at a pose without solution.
    fn fill_forces(
        &self,
        model: &Model,
        run: &PreparedRun,
        drive: usize,
        intervals: &[[f64; 2]],
    ) -> Option<Vec<(f64, f64)>> {
        let force = run.force.as_deref()?.get(drive)?;
        let n = run.time.len();
        let mut filled = Vec::new();
        for [from, to] in intervals {
            let start = run.time.partition_point(|t| t < from);
            let end = run.time.partition_point(|t| t <= to);
            if start >= end {
                continue;
            }
            let around = start.saturating_sub(EDGE)..(end + EDGE).min(n);
            let samples: Vec<usize> = around.clone().collect();
            let rows = regressor_with_friction(model, &PickedStates::new(run, &samples))?;
            let drives = self.rows.drives;
            let predicted = |k: usize| (rows.row((k - around.start) * drives + drive) * &self.values)[(0, 0)];
            let mean_residual = |range: std::ops::Range<usize>| {
                let count = range.len();
                (count > 0).then(|| range.map(|k| force[k] - predicted(k)).sum::<f64>() / count as f64)
            };
            let before = mean_residual(around.start..start);
            let after = mean_residual(end..around.end);
            let [before, after] = [before.or(after), after.or(before)].map(|rest| rest.unwrap_or(0.0));
            for k in start..end {
                let part = (k - start) as f64 / (end - start) as f64;
                let rest = before + part * (after - before);
                filled.push((run.time[k], predicted(k) + rest));
            }
        }
        Some(filled)
    }
}

/// The dry friction of each drive, N or N m: half the change of its force when all rates change their sign at a rate
/// near zero; the median over some states.
fn dry_frictions(
    model: &Model,
    recordings: &[Vec<PreparedRun>],
    values: &DVector<f64>,
    drives: usize,
) -> Option<Vec<f64>> {
    let mut all = vec![Vec::new(); drives];
    for run in recordings.iter().flatten() {
        let samples: Vec<usize> = (0..run.samples())
            .step_by((run.samples() / FRICTION_STATES).max(1))
            .collect();
        let rates = rates_of_drives(model, &PickedStates::new(run, &samples))?;
        let [with, against] = [SLOW, -SLOW].map(|factor| {
            let states = PickedStates::new(run, &samples).with_scaled_rates(factor);
            regressor_with_friction(model, &states).map(|rows| rows * values)
        });
        let change = with? - against?;
        for (d, all) in all.iter_mut().enumerate() {
            all.extend((0..samples.len()).map(|i| 0.5 * change[i * drives + d] * rate_sign(rates[d][i])));
        }
    }
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied()
    };
    all.into_iter().map(median).collect()
}

/// Numbers that fall into one bin of rates.
#[derive(Clone, Copy, Default)]
struct ShortfallBin {
    /// Number of samples.
    samples: usize,
    /// Sum of the shortfalls, relative to the dry friction.
    sum: f64,
    /// Sum of their squares.
    squares: f64,
}

impl ShortfallBin {
    /// Mean square of the shortfalls.
    fn mean_square(&self) -> f64 {
        self.squares / self.samples.max(1) as f64
    }

    /// Mean shortfall and its standard deviation; neighbouring samples are taken to be correlated in fours.
    fn mean(&self) -> (f64, f64) {
        let n = self.samples as f64;
        let mean = self.sum / n;
        let variance = (self.squares / n - mean * mean).max(0.0);
        (mean, 2.0 * (variance / n).sqrt())
    }
}

/// The rate below which a drive sticks, as a share of its fastest; `None` if it does not stick.
///
/// The shortfall of friction is compared bin by bin of rates, from low to high: it must be large at the lowest rates,
/// and gone at the bound. `bins` are those of [`STICK_RATE_SHARES`], `motion` is that of clear motion.
fn stick_share(bins: &[ShortfallBin], motion: &ShortfallBin) -> Option<f64> {
    let shares = STICK_RATE_SHARES;
    // Bins with too few samples are joined with the next ones.
    let mut joined = ShortfallBin::default();
    let (mut reached, mut faintly): (Option<usize>, Option<usize>) = (None, None);
    for (k, bin) in bins.iter().enumerate() {
        joined.samples += bin.samples;
        joined.sum += bin.sum;
        joined.squares += bin.squares;
        if joined.samples < STICK_BIN_FEWEST_SAMPLES {
            continue;
        }
        let (mean, std) = joined.mean();
        // A few fast reversals reach further than the others: they are seen by their size.
        let stands_out = joined.mean_square() > STICK_NOISE_RATIO.powi(2) * motion.mean_square();
        joined = ShortfallBin::default();
        let is_certain = mean > STICK_SHORTFALL_SIGMAS * std;
        let least = if reached.is_none() {
            STICK_LOWEST_SHORTFALL
        } else {
            STICK_LEAST_SHORTFALL
        };
        if is_certain && mean > least && faintly.is_none() {
            reached = Some(k);
        } else if (is_certain || stands_out) && mean > STICK_FAINT_SHORTFALL && reached.is_some() {
            // What is left of a stick phase widens it, but does not decide whether there is one.
            faintly = Some(k);
        } else {
            break;
        }
    }
    // A large shortfall in the last bin is no stick phase, but a law of friction.
    let reached = reached.filter(|reached| reached + 1 < shares.len())?;
    let last = faintly.filter(|faintly| faintly + 1 < shares.len()).unwrap_or(reached);
    shares.get(last + 1).copied()
}
