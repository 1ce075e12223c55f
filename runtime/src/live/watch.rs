//! The watch: samples in, a verdict out.
//!
//! Decision: names come from samples after the alarm only, because a change that covers part of a window looks like
//! a change of other parameters.

use super::averages::{Averages, Row};
use super::comparison::{Comparison, Single};
use super::estimator::{Estimator, Prior};
use super::options::{Options, Plan};
use super::scatter::Scatter;
use crate::Real;

/// A change that another one explains this many times less likely (as twice the logarithm) is no rival: 1 to 10000.
const RIVALRY: f64 = 18.42;
/// How much of a window's usual information the reference has in [`Watch::estimate`].
const PULL: f64 = 0.01;
/// The same of the reference on its own column, while it learns the noise.
const RIDGE: f64 = 1e-6;

/// What a watch says after a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict<T, const NB: usize> {
    /// It still learns noise and scatter.
    Learning,
    /// Nothing has changed by more than windows differ anyway.
    Quiet,
    /// Something has changed; stays until [`Watch::accept`], and is refined while the window shows the change. At first
    /// the window holds samples from before too, and another parameter may seem to have changed: see [`Change::is_told`].
    Changed(Change<T, NB>),
}

/// A change, as that of one parameter alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change<T, const NB: usize> {
    /// The parameter whose change alone explains most, in the order of the columns of `H_min`.
    pub parameter: usize,
    /// By how much it changed, in its unit; too little while the window still holds samples from before.
    pub by: T,
    /// Standard deviation of that.
    pub deviation: T,
    /// Square of the change in deviations, as windows scatter.
    pub gain: T,
    /// Share of all that the window holds against the reference, noise included, that this change alone explains.
    pub share: T,
    /// A second parameter that changed too: together they explain more than the first alone, and more than chance.
    pub besides: Option<usize>,
    /// Parameters whose change alone would explain nearly as much along this motion: it may as well be one of these.
    pub rivals: [bool; NB],
    /// Whether the same parameter has come out for as long as a window, of samples from after the alarm alone.
    pub steady: bool,
}

impl<T, const NB: usize> Change<T, NB> {
    /// Whether the parameter is the one: it comes out steadily, and no other one's change explains nearly as much.
    #[must_use]
    pub fn is_told(&self) -> bool {
        self.steady && !self.rivals.contains(&true)
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    Noise,
    Scatter,
    Watching,
}

/// A watch over `NB` base parameters by the forces of `NQ` drives.
///
/// It has room for some `5 NB^2` numbers.
#[derive(Clone, Copy, Debug)]
pub struct Watch<T, const NB: usize, const NQ: usize> {
    nominal: [T; NB],
    plan: Plan<T>,
    stage: Stage,
    drives: [Averages<T, NB>; NQ],
    /// Blocks that wait to be turned into the triangles, a few drives in each step.
    waiting: [Option<Row<T, NB>>; NQ],
    next: usize,
    window: Estimator<T, NB>,
    reference: Estimator<T, NB>,
    comparison: Comparison<T, NB>,
    scatter: Scatter<T, NB>,
    /// Nominal values plus this is the reference, while noise is learned.
    correction: [T; NB],
    /// Samples in this block.
    samples: u32,
    /// Blocks since the last comparison, with any drive in them: a window that stands is compared once.
    since: u32,
    /// Blocks in this stage: of each drive, and with any drive in them.
    counted: [u32; NQ],
    blocks: u32,
    watched: [bool; NQ],
    left_out: u64,
    verdict: Verdict<T, NB>,
    /// In how many comparisons the parameter of the verdict came out, one after the other.
    same: u32,
}

impl<T: Real, const NB: usize, const NQ: usize> Watch<T, NB, NQ> {
    /// A watch that begins to learn; `nominal` are base parameters near the true ones, such as those that are in use.
    ///
    /// Options that make no sense are taken for the nearest that do.
    #[must_use]
    pub fn new(nominal: &[T; NB], options: &Options) -> Self {
        let plan = Plan::new(options, NB);
        let zero = T::from_f64(0.0);
        Self {
            nominal: *nominal,
            plan,
            stage: Stage::Noise,
            drives: [Averages::new(); NQ],
            waiting: [None; NQ],
            next: NQ,
            window: Estimator::new(),
            reference: Estimator::new(),
            comparison: Comparison::idle(),
            scatter: Scatter::new(plan.per_comparison),
            correction: [zero; NB],
            samples: 0,
            since: 0,
            counted: [0; NQ],
            blocks: 0,
            watched: [true; NQ],
            left_out: 0,
            verdict: Verdict::Learning,
            same: 0,
        }
    }

    /// Takes a sample: the rows of `H_min`, one per drive, and the forces that the drives had at that time.
    ///
    /// A force that is no number (`NAN`) leaves its drive's block out, and so do rows; for drives that stand still, where
    /// friction may be anything, and for forces that are not measured.
    pub fn step(&mut self, rows: &[[T; NB]; NQ], forces: &[T; NQ]) -> &Verdict<T, NB> {
        for ((drive, row), force) in self.drives.iter_mut().zip(rows).zip(forces) {
            drive.take(row, *force);
        }
        // As many per step as are done before the block ends.
        self.turn_in(NQ.div_ceil(self.plan.block as usize));
        if self.comparison.is_busy() && self.comparison.advance() {
            self.conclude();
        }
        self.samples += 1;
        if self.samples >= self.plan.block {
            self.samples = 0;
            self.turn_in(NQ);
            self.end_block();
        }
        &self.verdict
    }

    /// What was said last.
    pub fn verdict(&self) -> &Verdict<T, NB> {
        &self.verdict
    }

    /// Takes what is now as right: the reference is learned anew, noise and scatter stay known.
    pub fn accept(&mut self) {
        if self.stage == Stage::Noise {
            return;
        }
        self.stage = Stage::Scatter;
        self.blocks = 0;
        self.window = Estimator::new();
        self.reference = Estimator::new();
        self.comparison = Comparison::idle();
        self.verdict = Verdict::Learning;
    }

    /// Base parameters as the window has them now; where it says nothing, those of the reference.
    ///
    /// Takes two copies of a triangle and `2 NB` rotations of rows: not for every cycle.
    #[must_use]
    pub fn estimate(&self) -> [T; NB] {
        let reference = self.reference.information();
        let ridge = |share: T| reference.map(|x| (share * x).sqrt());
        let values = self.reference.solve(&Prior {
            values: [T::from_f64(0.0); NB],
            weights: ridge(T::from_f64(RIDGE)),
        });
        let mut estimate = self.window.solve(&Prior {
            values,
            weights: ridge(T::from_f64(PULL) / self.plan.windows),
        });
        for (sum, nominal) in estimate.iter_mut().zip(&self.nominal) {
            *sum = *sum + *nominal;
        }
        estimate
    }

    /// Drives that are watched. Those that were hardly measured while the watch learned have no noise to hold a change
    /// against; they are left out until a new watch is made.
    pub fn watched(&self) -> [bool; NQ] {
        self.watched
    }

    /// Blocks of a drive that were left out because something in them was no number.
    pub fn left_out(&self) -> u64 {
        self.left_out
    }

    /// Turns the blocks of so many drives that wait into the triangles.
    fn turn_in(&mut self, most: usize) {
        let changed = matches!(self.verdict, Verdict::Changed(_));
        for waiting in self.waiting.iter_mut().skip(self.next).take(most) {
            self.next += 1;
            let Some(block) = waiting.take() else {
                continue;
            };
            // Blocks are finite.
            _ = self.window.add(block.row, block.value);
            // What has changed is no reference.
            if !changed {
                _ = self.reference.add(block.row, block.value);
            }
        }
    }

    /// Takes the means of the block that ends, and looks whether it is time for a comparison or for the next stage.
    fn end_block(&mut self) {
        self.look();
        let share = self.plan.per_sample;
        let means = {
            let nominal = &self.nominal;
            let mut drives = self.drives.iter_mut();
            [(); NQ].map(|()| drives.next().and_then(|drive| drive.end(share, nominal)))
        };
        let n_counted = means.iter().flatten().count();
        self.left_out += (NQ - n_counted) as u64;
        // Time stands still where nothing is measured.
        if n_counted == 0 {
            return;
        }
        self.blocks = self.blocks.saturating_add(1);
        self.since = self.since.saturating_add(1);
        self.window.scale(self.plan.window_root);
        let changed = matches!(self.verdict, Verdict::Changed(_));
        if !changed && self.stage != Stage::Noise {
            self.reference.scale(self.plan.memory_root);
        }
        let drives = self.drives.iter_mut().zip(&mut self.waiting);
        let drives = drives.zip(&mut self.counted).zip(&self.watched).zip(means);
        for ((((drive, waiting), counted), watched), mean) in drives {
            let Some(mean) = mean.filter(|_| *watched) else {
                continue;
            };
            *counted = counted.saturating_add(1);
            *waiting = if self.stage == Stage::Noise {
                // The first half is for the fit alone.
                if *counted > self.plan.noise / 2 {
                    drive.learn(mean.residual(&self.correction));
                }
                Some(mean)
            } else {
                drive.whitened(&mean)
            };
        }
        self.next = 0;
    }

    /// Whether the noise is known: of all drives, or after twice the time of those that were measured.
    fn has_noise(&self) -> bool {
        let mut known = self.counted.iter().map(|n| *n >= self.plan.noise);
        if self.blocks >= self.plan.noise.saturating_mul(2) {
            known.any(|is| is)
        } else {
            known.all(|is| is)
        }
    }

    /// Goes on to the next stage, or begins a comparison, where it is time for it.
    fn look(&mut self) {
        match self.stage {
            Stage::Noise if self.has_noise() => {
                for ((drive, counted), watched) in self
                    .drives
                    .iter_mut()
                    .zip(&self.counted)
                    .zip(&mut self.watched)
                {
                    *watched = *counted >= self.plan.noise;
                    drive.settle();
                }
                self.window = Estimator::new();
                self.reference = Estimator::new();
                self.blocks = 0;
                self.stage = Stage::Scatter;
            }
            Stage::Scatter if self.blocks >= self.plan.scatter => {
                self.stage = Stage::Watching;
                self.verdict = Verdict::Quiet;
            }
            _ => {}
        }
        if self.since < self.plan.interval || self.comparison.is_busy() {
            return;
        }
        self.since = 0;
        if self.stage == Stage::Noise {
            let information = self.reference.information();
            self.correction = self.reference.solve(&Prior {
                values: [T::from_f64(0.0); NB],
                weights: information.map(|x| (T::from_f64(RIDGE) * x).sqrt()),
            });
        } else {
            self.comparison.start(&self.reference, &self.window);
        }
    }

    /// Judges what a comparison has found.
    fn conclude(&mut self) {
        let singles = self.comparison.singles(&self.window.information());
        let found = match self.stage {
            Stage::Watching => self.judge(&singles),
            _ => None,
        };
        match (&self.verdict, found) {
            (Verdict::Changed(before), Some(mut change)) => {
                let is_same = change.parameter == before.parameter;
                self.same = if is_same {
                    self.same.saturating_add(1)
                } else {
                    0
                };
                change.steady = self.same >= self.plan.steady;
                self.verdict = Verdict::Changed(change);
            }
            (Verdict::Changed(_), None) => self.same = 0,
            (_, Some(change)) => {
                self.verdict = Verdict::Changed(change);
                // A change that holds for part of a window only looks like one of other parameters.
                self.window = Estimator::new();
                self.same = 0;
            }
            (_, None) => self.scatter.take(&singles, self.plan.scatter_share),
        }
    }

    /// The parameter whose change alone explains most, among those that changed by more than chance; none if none did.
    fn judge(&self, singles: &[Single<T>; NB]) -> Option<Change<T, NB>> {
        let (parameter, single) = self.largest(singles)?;
        let gain = single.gain();
        let measure = self.scatter.measure(parameter, single.information);
        let near = gain - T::from_f64(RIVALRY) * measure.dispersion;
        let mut rivals = [false; NB];
        for ((k, rival), other) in rivals.iter_mut().enumerate().zip(singles) {
            *rival = k != parameter && other.information > T::from_f64(0.0) && other.gain() > near;
        }
        let rest = self.comparison.besides(parameter, singles);
        Some(Change {
            parameter,
            by: single.score / single.information,
            deviation: (measure.dispersion / single.information).sqrt(),
            gain: gain / measure.dispersion,
            share: gain / self.comparison.all(),
            besides: self.largest(&rest).map(|(second, _)| second),
            rivals,
            steady: false,
        })
    }

    /// The largest gain of those that exceed what chance reaches.
    fn largest(&self, singles: &[Single<T>; NB]) -> Option<(usize, Single<T>)> {
        let mut found: Option<(usize, Single<T>)> = None;
        for (k, single) in singles.iter().enumerate() {
            let (gain, best) = (single.gain(), found.map(|(_, best)| best.gain()));
            let measure = self.scatter.measure(k, single.information);
            if best.is_none_or(|best| gain > best) && measure.is_exceeded(gain, self.plan.limit) {
                found = Some((k, *single));
            }
        }
        found
    }
}
