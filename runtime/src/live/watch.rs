//! The watch: samples in, a verdict out.
//!
//! Decision: the parameter is identified from samples after the alarm only, because a change that covers part of a
//! window looks like a change of other parameters.

use super::averages::{DriveAverages, WatchRow};
use super::comparison::{ChangeScore, WindowComparison};
use super::estimator::{EstimatorPrior, RecursiveEstimator};
use super::options::{Options, WatchSchedule};
use super::scatter::WindowScatter;
use crate::Real;

/// A change that explains the data this much worse (twice the log likelihood ratio) is no rival: odds of 1 to 10000.
const RIVAL_LOG_RATIO: f64 = 18.42;
/// Information of the reference in [`ParameterWatch::estimate`], as a share of the usual information of a window.
const REFERENCE_WEIGHT: f64 = 0.01;
/// Ridge of the reference: a share of its own information on each parameter.
const RIDGE: f64 = 1e-6;

/// State of a watch after a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WatchVerdict<T, const NB: usize> {
    /// It still learns noise and scatter.
    Learning,
    /// No change exceeds the usual differences between windows.
    Quiet,
    /// A parameter has changed. This state remains until [`ParameterWatch::accept`] and is refined while the window
    /// shows the change. At first the window also contains samples from before, and another parameter may seem to have
    /// changed: see [`WatchChange::is_identified`].
    Changed(WatchChange<T, NB>),
}

/// A change, as that of one parameter alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WatchChange<T, const NB: usize> {
    /// The parameter whose change alone explains most, in the order of the columns of `H_min`.
    pub parameter: usize,
    /// By how much it changed, in its unit; too small while the window still contains samples from before.
    pub amount: T,
    /// Standard deviation of `amount`, in its unit.
    pub deviation: T,
    /// Square of the change over its variance, which includes the scatter of windows.
    pub gain: T,
    /// Share of the differences between window and reference, noise included, that this change alone explains, 0 to 1.
    pub share: T,
    /// A second parameter that changed too: together they explain more than the first alone, and more than chance.
    pub second_change: Option<usize>,
    /// Parameters whose change alone would explain nearly as much along this motion: each may be the one that changed.
    pub rivals: [bool; NB],
    /// Whether the same parameter has changed most for the length of a window, in samples from after the alarm only.
    pub steady: bool,
}

impl<T, const NB: usize> WatchChange<T, NB> {
    /// Whether the parameter is identified: `steady`, and no change of another one explains nearly as much.
    #[must_use]
    pub fn is_identified(&self) -> bool {
        self.steady && !self.rivals.contains(&true)
    }

    /// The name of [`WatchChange::is_identified`] in earlier versions.
    #[deprecated(note = "renamed to `is_identified`")]
    #[must_use]
    pub fn is_told(&self) -> bool {
        self.is_identified()
    }
}

/// Stages of a watch, in this order; [`ParameterWatch::accept`] returns to `Scatter`.
#[derive(Clone, Copy, Debug, PartialEq)]
enum WatchStage {
    Noise,
    Scatter,
    Watching,
}

/// A watch over `NB` base parameters by the forces of `NQ` drives.
///
/// It consists of about `5 NB^2` numbers.
#[derive(Clone, Copy, Debug)]
pub struct ParameterWatch<T, const NB: usize, const NQ: usize> {
    nominal: [T; NB],
    plan: WatchSchedule<T>,
    stage: WatchStage,
    drives: [DriveAverages<T, NB>; NQ],
    /// Blocks to be added to the estimators, a few drives in each step; whitened once the noise is known.
    waiting: [Option<WatchRow<T, NB>>; NQ],
    next: usize,
    window: RecursiveEstimator<T, NB>,
    reference: RecursiveEstimator<T, NB>,
    comparison: WindowComparison<T, NB>,
    scatter: WindowScatter<T, NB>,
    /// Reference minus nominal values, while the noise is learned.
    correction: [T; NB],
    /// Samples of the current block so far.
    samples: u32,
    /// Blocks with at least one drive since the last comparison, so that an unchanged window is compared only once.
    since: u32,
    /// Blocks of each drive in total, and blocks with at least one drive in this stage.
    counted: [u32; NQ],
    blocks: u32,
    watched: [bool; NQ],
    left_out: u64,
    verdict: WatchVerdict<T, NB>,
    /// Number of successive comparisons in which the parameter of the verdict changed most.
    same: u32,
}

impl<T: Real, const NB: usize, const NQ: usize> ParameterWatch<T, NB, NQ> {
    /// A watch that starts to learn; `nominal` are base parameters near the true ones, such as those in use.
    ///
    /// Options out of range are replaced by the nearest ones that are possible.
    #[must_use]
    pub fn new(nominal: &[T; NB], options: &Options) -> Self {
        let plan = WatchSchedule::new(options, NB);
        let zero = T::from_f64(0.0);
        Self {
            nominal: *nominal,
            plan,
            stage: WatchStage::Noise,
            drives: [DriveAverages::new(); NQ],
            waiting: [None; NQ],
            next: NQ,
            window: RecursiveEstimator::new(),
            reference: RecursiveEstimator::new(),
            comparison: WindowComparison::new_idle(),
            scatter: WindowScatter::new(plan.per_comparison),
            correction: [zero; NB],
            samples: 0,
            since: 0,
            counted: [0; NQ],
            blocks: 0,
            watched: [true; NQ],
            left_out: 0,
            verdict: WatchVerdict::Learning,
            same: 0,
        }
    }

    /// Adds a sample: the rows of `H_min`, one per drive, and the forces of the drives at that time.
    ///
    /// A force of `NAN` excludes the drive's block, as do rows with `NAN`. Use it for drives at standstill, where
    /// friction is not determined, and for forces that are not measured.
    pub fn step(&mut self, rows: &[[T; NB]; NQ], forces: &[T; NQ]) -> &WatchVerdict<T, NB> {
        for ((drive, row), force) in self.drives.iter_mut().zip(rows).zip(forces) {
            drive.add_sample(row, *force);
        }
        // So many per step that all are added before the block ends.
        self.update_estimators(NQ.div_ceil(self.plan.block as usize));
        if self.comparison.is_busy() && self.comparison.advance() {
            self.finish_comparison();
        }
        self.samples += 1;
        if self.samples >= self.plan.block {
            self.samples = 0;
            self.update_estimators(NQ);
            self.end_block();
        }
        &self.verdict
    }

    /// The verdict after the last sample.
    pub fn verdict(&self) -> &WatchVerdict<T, NB> {
        &self.verdict
    }

    /// Accepts the present state as correct: the reference is learned again, while noise and scatter stay known.
    pub fn accept(&mut self) {
        if self.stage == WatchStage::Noise {
            return;
        }
        self.stage = WatchStage::Scatter;
        self.blocks = 0;
        self.window = RecursiveEstimator::new();
        self.reference = RecursiveEstimator::new();
        self.comparison = WindowComparison::new_idle();
        self.verdict = WatchVerdict::Learning;
    }

    /// Base parameters estimated from the window; where it has no information, those of the reference.
    ///
    /// Works on two copies of an R factor and takes `2 NB` rotations of rows, so it is not meant for every cycle.
    #[must_use]
    pub fn estimate(&self) -> [T; NB] {
        let reference = self.reference.information();
        let ridge = |share: T| reference.map(|x| (share * x).sqrt());
        // First the reference alone, as differences from the nominal values.
        let values = self.reference.solve(&EstimatorPrior {
            values: [T::from_f64(0.0); NB],
            weights: ridge(T::from_f64(RIDGE)),
        });
        // The reference is then a weak prior for the window.
        let mut estimate = self.window.solve(&EstimatorPrior {
            values,
            weights: ridge(T::from_f64(REFERENCE_WEIGHT) / self.plan.windows),
        });
        for (sum, nominal) in estimate.iter_mut().zip(&self.nominal) {
            *sum = *sum + *nominal;
        }
        estimate
    }

    /// Drives that are watched. A drive that was rarely measured while the watch learned has no known noise; it is
    /// excluded until a new watch is made.
    pub fn watched_drives(&self) -> [bool; NQ] {
        self.watched
    }

    /// The name of [`ParameterWatch::watched_drives`] in earlier versions.
    #[deprecated(note = "renamed to `watched_drives`")]
    pub fn watched(&self) -> [bool; NQ] {
        self.watched_drives()
    }

    /// Number of blocks of a drive that were excluded because a number in them was NaN or too large.
    pub fn n_skipped_blocks(&self) -> u64 {
        self.left_out
    }

    /// The name of [`ParameterWatch::n_skipped_blocks`] in earlier versions.
    #[deprecated(note = "renamed to `n_skipped_blocks`")]
    pub fn left_out(&self) -> u64 {
        self.n_skipped_blocks()
    }

    /// Adds the waiting blocks of at most so many drives to the estimators.
    fn update_estimators(&mut self, most: usize) {
        let changed = matches!(self.verdict, WatchVerdict::Changed(_));
        for waiting in self.waiting.iter_mut().skip(self.next).take(most) {
            self.next += 1;
            let Some(block) = waiting.take() else {
                continue;
            };
            // `add` can only reject numbers that are not finite, and blocks are finite.
            _ = self.window.add(block.row, block.value);
            // After a change the reference stays as it was.
            if !changed {
                _ = self.reference.add(block.row, block.value);
            }
        }
    }

    /// Ends a block: takes its means, and checks whether the next comparison or stage is due.
    fn end_block(&mut self) {
        self.advance_stage();
        let share = self.plan.per_sample;
        let means = {
            let nominal = &self.nominal;
            let mut drives = self.drives.iter_mut();
            [(); NQ].map(|()| drives.next().and_then(|drive| drive.end_block(share, nominal)))
        };
        let n_counted = means.iter().flatten().count();
        self.left_out += (NQ - n_counted) as u64;
        // Nothing is forgotten while nothing is measured.
        if n_counted == 0 {
            return;
        }
        self.blocks = self.blocks.saturating_add(1);
        self.since = self.since.saturating_add(1);
        self.window.scale_information(self.plan.window_root);
        let changed = matches!(self.verdict, WatchVerdict::Changed(_));
        if !changed && self.stage != WatchStage::Noise {
            self.reference.scale_information(self.plan.memory_root);
        }
        let drives = self.drives.iter_mut().zip(&mut self.waiting);
        let drives = drives.zip(&mut self.counted).zip(&self.watched).zip(means);
        for ((((drive, waiting), counted), watched), mean) in drives {
            let Some(mean) = mean.filter(|_| *watched) else {
                continue;
            };
            *counted = counted.saturating_add(1);
            *waiting = if self.stage == WatchStage::Noise {
                // Residuals count from the second half on; the first half only fits the parameters.
                if *counted > self.plan.noise / 2 {
                    drive.add_residual(mean.residual(&self.correction));
                }
                Some(mean)
            } else {
                drive.whiten(&mean)
            };
        }
        self.next = 0;
    }

    /// Whether the noise of all drives is known; after twice the time, that of at least one.
    fn has_noise(&self) -> bool {
        let mut known = self.counted.iter().map(|n| *n >= self.plan.noise);
        if self.blocks >= self.plan.noise.saturating_mul(2) {
            known.any(|is| is)
        } else {
            known.all(|is| is)
        }
    }

    /// Enters the next stage, or starts a comparison, if it is due.
    fn advance_stage(&mut self) {
        match self.stage {
            WatchStage::Noise if self.has_noise() => {
                for ((drive, counted), watched) in self.drives.iter_mut().zip(&self.counted).zip(&mut self.watched) {
                    *watched = *counted >= self.plan.noise;
                    drive.update_noise_model();
                }
                self.window = RecursiveEstimator::new();
                self.reference = RecursiveEstimator::new();
                self.blocks = 0;
                self.stage = WatchStage::Scatter;
            }
            WatchStage::Scatter if self.blocks >= self.plan.scatter => {
                self.stage = WatchStage::Watching;
                self.verdict = WatchVerdict::Quiet;
            }
            _ => {}
        }
        if self.since < self.plan.interval || self.comparison.is_busy() {
            return;
        }
        self.since = 0;
        if self.stage == WatchStage::Noise {
            // While the noise is learned, the reference is fitted instead of compared.
            let information = self.reference.information();
            self.correction = self.reference.solve(&EstimatorPrior {
                values: [T::from_f64(0.0); NB],
                weights: information.map(|x| (T::from_f64(RIDGE) * x).sqrt()),
            });
        } else {
            self.comparison.start(&self.reference, &self.window);
        }
    }

    /// Updates the verdict with the result of a comparison.
    fn finish_comparison(&mut self) {
        let singles = self.comparison.single_changes(&self.window.information());
        let found = match self.stage {
            WatchStage::Watching => self.detect_change(&singles),
            _ => None,
        };
        match (&self.verdict, found) {
            (WatchVerdict::Changed(before), Some(mut change)) => {
                let is_same = change.parameter == before.parameter;
                self.same = if is_same { self.same.saturating_add(1) } else { 0 };
                change.steady = self.same >= self.plan.steady;
                self.verdict = WatchVerdict::Changed(change);
            }
            (WatchVerdict::Changed(_), None) => self.same = 0,
            (_, Some(change)) => {
                self.verdict = WatchVerdict::Changed(change);
                // A change during part of a window looks like one of other parameters, so the window starts again.
                self.window = RecursiveEstimator::new();
                self.same = 0;
            }
            (_, None) => self.scatter.add_window(&singles, self.plan.scatter_share),
        }
    }

    /// The parameter whose change alone explains most, among those above their threshold; `None` if there is none.
    fn detect_change(&self, singles: &[ChangeScore<T>; NB]) -> Option<WatchChange<T, NB>> {
        let (parameter, single) = self.largest_change(singles)?;
        let gain = single.gain();
        let measure = self.scatter.estimate(parameter, single.information);
        let near = gain - T::from_f64(RIVAL_LOG_RATIO) * measure.dispersion;
        let mut rivals = [false; NB];
        for ((k, rival), other) in rivals.iter_mut().enumerate().zip(singles) {
            *rival = k != parameter && other.information > T::from_f64(0.0) && other.gain() > near;
        }
        let rest = self.comparison.second_changes(parameter, singles);
        Some(WatchChange {
            parameter,
            amount: single.score / single.information,
            deviation: (measure.dispersion / single.information).sqrt(),
            gain: gain / measure.dispersion,
            share: gain / self.comparison.total_gain(),
            second_change: self.largest_change(&rest).map(|(second, _)| second),
            rivals,
            steady: false,
        })
    }

    /// The largest gain above the threshold of its parameter.
    fn largest_change(&self, singles: &[ChangeScore<T>; NB]) -> Option<(usize, ChangeScore<T>)> {
        let mut found: Option<(usize, ChangeScore<T>)> = None;
        for (k, single) in singles.iter().enumerate() {
            let (gain, best) = (single.gain(), found.map(|(_, best)| best.gain()));
            let measure = self.scatter.estimate(k, single.information);
            if best.is_none_or(|best| gain > best) && measure.is_exceeded(gain, self.plan.limit) {
                found = Some((k, *single));
            }
        }
        found
    }
}
