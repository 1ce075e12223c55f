//! `runs`: reports changes between recordings of one machine.
//!
//! Each run is fitted alone, and all runs are fitted together. Every later run is compared with the first: a search
//! finds the physical changes that explain the difference. Possible changes are those of the load of a body, of the
//! friction of a drive, of the offset or scale of its force, of the clock, and of the zeros of encoders. The model file
//! needs no parameters for loads. For each body, the columns of a load with ten inertial parameters are derived from
//! the model.
//!
//! The clock is an exception if rates were recorded. Its error is then found by comparing recorded rates with positions,
//! and the motion is corrected first. A drive whose forces could not show a change gets no verdict.

mod changes;
mod columns;
mod differences;
mod layout;
pub(crate) mod payload;
mod payload_scale;
mod per_run;
mod plausible;
mod points;
mod rows;
mod standstill;
mod sums;
mod thresholds;
mod time_base;
mod verdict;

use std::borrow::Borrow;

use modelmill_boundary::message;
use modelmill_identify::changes::{
    ChangeHypotheses, NormalEquations, RunPair, SelectedChange, search_changes, search_sensitivity, within_run_spread,
};
use modelmill_identify::{ParameterInfo, RecordingNote};
use nalgebra::DVector;

use crate::audit::events::{self, ContactEvent};
use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::recording::PreparedRecording;
use crate::segment::RecordingSegment;

pub use changes::{ChangeEstimate, NamedEstimate, PhysicalChange, RunChange};
use changes::{ChangeHypothesis, ChangeKind, centre};
use columns::TimeScaling;
pub(crate) use differences::{RecordingDifference, differences};
use layout::RunColumnLayout;
use payload::PayloadColumns;
use payload_scale::{DriveScales, compare_drive_scales};
pub use per_run::{KnownLoad, PerRunSelection, RunValue, SharedFit};
use points::DriveDoubts;
pub use points::{ChangePoint, ParameterStep};
use rows::{MeasuredMoments, RunRows, UnexplainedShares, WhitenedRun};
pub use sums::{ReferenceFit, RunSums};
use thresholds::{CHANGE_LEAST_FORCE_SHARE, CHANGE_VALUE_SIGMAS, PARAMETER_CHANGE_SIGMAS, PUSH_LONGEST_GAP_S};
use time_base::{TimeBase, correct_clock, time_scaling};
use verdict::{RunKnowledge, undecided_reasons};
pub use verdict::{RunVerdict, UndecidedDrive, UndecidedReason};

/// A fitted value with its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittedValue {
    /// The value, in the unit of the parameter.
    pub value: f64,
    /// Its standard deviation, in the same unit; `None` if the run does not determine the parameter.
    pub std: Option<f64>,
}

impl FittedValue {
    /// The standard deviation of its difference from another value. An unknown standard deviation counts as 0.
    pub fn difference_std(self, other: Self) -> f64 {
        let [a, b] = [self, other].map(|one| one.std.unwrap_or(0.0));
        a.hypot(b)
    }
}

/// The result of one run.
#[derive(Clone, Debug)]
pub struct RunReport {
    /// Name of its recording in messages.
    pub file: String,
    /// Number of samples that were used, after decimation.
    pub samples: usize,
    /// Base parameters fitted to this run alone, with standard deviations that include the scatter between its parts.
    pub alone: Vec<FittedValue>,
    /// Indices of base parameters that differ from those of the first run by more than six standard deviations of
    /// [`RunReport::difference_std`].
    pub moved: Vec<usize>,
    /// Number of drives.
    pub drives: usize,
    /// Drives whose forces cannot show a change relative to the first run.
    pub undecided: Vec<UndecidedDrive>,
    /// Factor on the standard deviation of a difference of parameters. It is above 1 if the model needs different
    /// parameters for different parts of one run; otherwise it is 1.
    pub difference_factor: f64,
    /// Whether changes were found that are not reported: they explain less than the force that stays unexplained, or were
    /// found together with an impossible change.
    pub has_rejected_changes: bool,
    /// Changes relative to the first run, the largest first, and events within this run.
    pub changes: Vec<RunChange>,
}

impl RunReport {
    /// The standard deviation of the difference of a base parameter from that of the first run.
    pub fn difference_std(&self, first: &Self, parameter: usize) -> f64 {
        self.difference_factor * first.alone[parameter].difference_std(self.alone[parameter])
    }
}

/// A run without a result.
#[derive(Debug)]
pub struct UnreadRun {
    /// Name of its recording in messages.
    pub file: String,
    /// The reason.
    pub error: Error,
}

/// Requests in addition to the search of changes.
#[derive(Clone, Debug, Default)]
pub struct RunsOptions {
    /// Values that are fitted separately for each run, in one fit of all runs. If the list is empty, this fit is not
    /// made.
    pub per_run: Vec<PerRunSelection>,
    /// Loads of known mass, which determine the scales of all measured forces.
    pub loads: Vec<KnownLoad>,
}

/// The comparison of runs.
pub struct RunsComparison {
    /// Name of the model.
    pub model: String,
    /// The base parameters.
    pub parameters: Vec<ParameterInfo>,
    /// Base parameters fitted to all runs at once.
    pub together: Vec<FittedValue>,
    /// All runs with a result; the first is the reference of the others.
    pub runs: Vec<RunReport>,
    /// Runs without a result.
    pub unread: Vec<UnreadRun>,
    /// Change points, in the order of the runs: runs at which parameters changed permanently.
    pub points: Vec<ChangePoint>,
    /// The fit of all runs with separate values for each run, if it was requested.
    pub shared: Option<SharedFit>,
    /// Notes on the recordings.
    pub notes: Vec<RecordingNote>,
}

impl Model {
    /// Compares runs of one machine with the first of them and reports changes.
    ///
    /// The runs are processed one after the other. Of each run only its normal equations are kept, not its samples, so
    /// that there may be hundreds of runs. Runs that cannot be read or prepared are listed in the result.
    ///
    /// Fails with fewer than two runs, if the first or all later runs cannot be read, if no force was measured, or
    /// if `options` names something that the model does not have.
    ///
    /// ```no_run
    /// use modelmill::Model;
    /// use modelmill::recording::RecordingOptions;
    /// use modelmill::runs::{RunsOptions, UnreadRun};
    ///
    /// let model = Model::open("arm.toml")?;
    /// let runs = ["monday.csv", "tuesday.csv"].map(|file| {
    ///     let read = model.recording(file, &RecordingOptions::default());
    ///     read.map_err(|error| UnreadRun { file: file.to_owned(), error })
    /// });
    /// let compared = model.runs(runs, &RunsOptions::default())?;
    /// for change in &compared.runs[1].changes {
    ///     println!("{}", change.says);
    /// }
    /// # Ok::<(), modelmill::Error>(())
    /// ```
    pub fn runs<R: Borrow<PreparedRecording>>(
        &self,
        recordings: impl IntoIterator<Item = Result<R, UnreadRun>>,
        options: &RunsOptions,
    ) -> Outcome<RunsComparison> {
        // Columns and hypotheses are the same for all runs.
        let payloads = PayloadColumns::new(self)?;
        let bench = RunAnalyser::new(self, &payloads);
        let layout = bench.layout;
        let mut shared = per_run::SharedFitBuilder::new(self, &payloads, layout, options)?;
        let mut recordings = recordings.into_iter();
        let total = recordings.size_hint().0;
        self.host().run_job("comparing runs with the first", total, |job| {
            let Some(first) = recordings.next() else {
                return Err(Error::options("there is no recording; give two or more"));
            };
            // Stage 1: the first run is the reference. Its base parameters determine the columns of scales
            // and clocks.
            let first = first.map_err(|unread| unread.error)?;
            let first = first.borrow();
            let before = bench.analyse_run(first, None)?;
            let mut all = vec![bench.run_report(&before)];
            let mut notes: Vec<RecordingNote> = first.notes().cloned().collect();
            let mut wholes = vec![before.white.total()];
            let mut withins = vec![before.within];
            let mut doubts = DriveDoubts::new(&before);
            let mut unread = Vec::new();
            shared.add_run(&before.file, &before.white, &[]);
            job.step(1)?;
            // Stage 2: each later run is compared with it.
            for recording in recordings {
                let looked_at = recording.and_then(|recording| {
                    let recording = recording.borrow();
                    notes.extend(recording.notes().cloned());
                    let file = recording.file().to_owned();
                    let run = bench.analyse_run(recording, Some(before.reference()));
                    run.map_err(|error| UnreadRun { file, error })
                });
                job.step(1)?;
                match looked_at {
                    Ok(run) => {
                        let report = bench.compare_with_first(&before, &all[0], &run);
                        shared.add_run(&run.file, &run.white, &report.changes);
                        all.push(report);
                        doubts.add(&run);
                        wholes.push(run.white.total());
                        withins.push(run.within);
                    }
                    Err(UnreadRun {
                        error: Error::Cancelled,
                        ..
                    }) => return Err(Error::Cancelled),
                    Err(one) => unread.push(one),
                }
            }
            // A comparison needs a second run.
            if all.len() < 2 {
                return Err(too_few_runs_error(&before.file, &unread));
            }
            // Stage 3: permanent changes over the order of the runs, and the fit of all runs together.
            let base: Vec<usize> = (0..layout.base).collect();
            let alone: Vec<&[FittedValue]> = all.iter().map(|run| &run.alone[..]).collect();
            let mut points = points::find_change_points(&bench, &alone, &wholes, &withins, &before, &doubts);
            let mut together = NormalEquations::new(layout.base);
            for whole in &wholes {
                together.merge(&whole.select_columns(&base));
            }
            let shared = shared.answer()?;
            // Forces whose true scale is known weigh loads truly, and as uncertainly as their scale.
            let gains = shared.as_ref().map_or(&[][..], |fit| &fit.gains);
            if !gains.is_empty() {
                let changes: Vec<&[RunChange]> = all.iter().map(|run| &run.changes[..]).collect();
                points::adopt_drive_weights(&mut points, &changes);
                let of_runs = all.iter_mut().flat_map(|run| &mut run.changes);
                let of_points = points.iter_mut().flat_map(|point| &mut point.changes);
                for change in of_runs.chain(of_points) {
                    payload_scale::apply_gains(&mut change.change, &change.drive_weights, gains);
                    change.says = changes::change_text(self, &change.change);
                }
            }
            Ok(RunsComparison {
                model: self.name.clone(),
                parameters: self.parameter_infos(),
                together: fit_parameters(self, &together),
                points,
                runs: all,
                unread,
                shared,
                notes,
            })
        })?
    }
}

/// The error of a comparison without a second run.
fn too_few_runs_error(first: &str, unread: &[UnreadRun]) -> Error {
    match unread {
        [] => Error::options(format!(
            "{first} is the only recording; `runs` compares two or more recordings, the first of which is the reference"
        )),
        [one, ..] => Error::input(message!(
            "no recording except {first} could be analysed; {} of {} failed, such as {}: {}",
            unread.len(),
            unread.len() + 1,
            one.file,
            one.error.message()
        )),
    }
}

/// Everything that the analysis of all runs shares.
pub(crate) struct RunAnalyser<'a> {
    /// The model.
    model: &'a Model,
    /// Columns of loads.
    payloads: &'a PayloadColumns,
    /// Order of the columns.
    layout: RunColumnLayout,
    /// All hypotheses, in the order of the search.
    possible: Vec<ChangeHypothesis>,
    /// The hypotheses as the search needs them.
    search: ChangeHypotheses,
}

/// One run as additive statistics.
pub(crate) struct RunStatistics {
    /// Name of the recording in messages.
    file: String,
    /// Number of samples, after decimation.
    samples: usize,
    /// Contacts and pushes in the run.
    pub(crate) events: Vec<RunChange>,
    /// Base parameters of the first run.
    values: DVector<f64>,
    /// Sums over white rows.
    white: WhitenedRun,
    /// Difference between the parts of the run, the scale of what is no change.
    within: f64,
    /// Sums over the rows as measured.
    sizes: MeasuredMoments,
    /// Shares of the forces that the model leaves unexplained.
    unexplained: UnexplainedShares,
    /// Whether each drive stands nearly all the time.
    stands: Vec<bool>,
    /// Recorded rates compared with positions.
    time_base: TimeBase,
    /// The changed clock, if recorded rates show it. The motion is corrected by it.
    clock: Option<ChangeEstimate>,
}

/// What later runs need of the first.
#[derive(Clone, Copy)]
pub(crate) struct ReferenceRun<'a> {
    /// Its base parameters.
    values: &'a DVector<f64>,
    /// Its time base, if clocks are compared.
    time_base: Option<&'a TimeBase>,
}

impl RunStatistics {
    /// The run as the reference of later ones.
    fn reference(&self) -> ReferenceRun<'_> {
        ReferenceRun {
            values: &self.values,
            time_base: Some(&self.time_base),
        }
    }

    /// What is known of the run.
    fn knowledge(&self) -> RunKnowledge<'_> {
        RunKnowledge {
            unexplained: &self.unexplained,
            stands: &self.stands,
            equations: self.white.blocks.iter().map(|block| block.rows).sum(),
        }
    }
}

/// Events of measured forces; events that follow each other at once are merged.
fn merged_contact_events(events: Vec<ContactEvent>, stretch: &RecordingSegment) -> Vec<ContactEvent> {
    let mut all: Vec<ContactEvent> = Vec::new();
    for mut event in events {
        let (from, to) = (event.from, event.to);
        event.drives.retain(|(d, ..)| is_measured(stretch, *d, from, to));
        if event.drives.is_empty() {
            continue;
        }
        match all.last_mut() {
            Some(last) if from - last.to < PUSH_LONGEST_GAP_S => {
                last.is_confirmed |= event.is_confirmed;
                last.to = to;
                for (d, largest, usual) in event.drives {
                    match last.drives.iter_mut().find(|(other, ..)| *other == d) {
                        Some((_, most, _)) => *most = most.max(largest),
                        None => last.drives.push((d, largest, usual)),
                    }
                }
            }
            _ => all.push(event),
        }
    }
    all
}

/// Whether most forces of a drive between two times were measured; replaced values are no push.
fn is_measured(stretch: &RecordingSegment, drive: usize, from: f64, to: f64) -> bool {
    let Some(out) = stretch.run.left_out.get(drive) else {
        return true;
    };
    let all = stretch.run.time.iter().zip(out);
    let within = all.filter(|(time, _)| (from..=to).contains(*time));
    let [mut lost, mut n] = [0, 0];
    for (_, out) in within {
        lost += usize::from(*out);
        n += 1;
    }
    2 * lost < n
}

impl<'a> RunAnalyser<'a> {
    /// Prepares the columns and hypotheses.
    fn new(model: &'a Model, payloads: &'a PayloadColumns) -> Self {
        let layout = RunColumnLayout::new(model, payloads);
        let possible = changes::possible_changes(model, payloads, layout);
        let search = ChangeHypotheses {
            shared: (0..layout.total()).collect(),
            changes: possible.iter().map(|one| one.candidate.clone()).collect(),
        };
        Self {
            model,
            payloads,
            layout,
            possible,
            search,
        }
    }

    /// The sums of a run, without its contacts and pushes and without standstill. `reference` is the first run, `None`
    /// for the first run itself.
    fn analyse_run(
        &self,
        recording: &PreparedRecording,
        reference: Option<ReferenceRun<'_>>,
    ) -> Outcome<RunStatistics> {
        let mut stretches = recording.segments.clone();
        // Stage 1: the clock, where recorded rates show it.
        let mut scaling = time_scaling(self.model, recording);
        let time_base = TimeBase::of_recording(self.model, recording);
        let first = reference.map_or(Some(&time_base), |one| one.time_base);
        let (is_clock_known, clock) = first.map_or((false, None), |first| first.changed_clock(&time_base));
        if let Some(clock) = clock {
            correct_clock(&mut stretches, &scaling, clock.value);
        }
        if is_clock_known {
            scaling.fill(TimeScaling::KNOWN);
        }
        // Stage 2: contacts and standstill, whose forces show nothing of the machine.
        let contacts = self.exclude_contacts(&mut stretches);
        let stands = standstill::exclude_uncertain_friction(self.model, &mut stretches)?;
        // Stage 3: the sums.
        let values = reference.map(|one| one.values);
        let rows = RunRows::new(self.model, &stretches, self.payloads, &scaling, values)?;
        let white = rows.whitened_run()?;
        let values = rows.values.clone();
        let sizes = rows.sizes();
        Ok(RunStatistics {
            file: recording.file().to_owned(),
            samples: stretches
                .iter()
                .map(|one| one.samples().div_ceil(one.decimation()))
                .sum(),
            events: contacts,
            within: within_run_spread(&white.blocks, &self.search),
            white,
            values,
            unexplained: sizes.unexplained_shares(&self.layout.model_and_drives())?,
            sizes,
            stands,
            time_base,
            clock,
        })
    }

    /// Excludes contacts and pushes from the forces of a run, and returns those that last.
    fn exclude_contacts(&self, stretches: &mut [RecordingSegment]) -> Vec<RunChange> {
        let mut contacts = Vec::new();
        for stretch in stretches {
            let found = events::events(self.model, stretch);
            let found = merged_contact_events(found, stretch);
            events::leave_out_events(stretch, &found);
            // Events that are only possible are excluded, but not reported.
            let lasting = found.iter().filter(|event| event.is_confirmed);
            contacts.extend(lasting.map(|event| changes::event(self.model, event)));
        }
        contacts
    }

    /// The report of a run fitted alone: values and events.
    fn run_report(&self, run: &RunStatistics) -> RunReport {
        let fit = self.base_fit(run);
        RunReport {
            file: run.file.clone(),
            samples: run.samples,
            alone: merge_known(self.model, |i| FittedValue {
                value: fit.values[i],
                std: fit.std[i],
            }),
            moved: Vec::new(),
            drives: self.layout.drives,
            undecided: Vec::new(),
            difference_factor: 1.0,
            has_rejected_changes: false,
            changes: run.events.clone(),
        }
    }

    /// The report of a later run: its changes relative to the first, the parameters that moved, and the drives that
    /// could not show a change. `first` is the report of the first run.
    fn compare_with_first(&self, before: &RunStatistics, first: &RunReport, run: &RunStatistics) -> RunReport {
        let mut report = self.run_report(run);
        let PairFindings {
            found,
            scales,
            reasons,
            difference_factor,
            has_rejected,
        } = self.compare_pair(before, run);
        report.difference_factor = difference_factor;
        report.has_rejected_changes = has_rejected;
        report.undecided = (self.model.row_names().into_iter().zip(&reasons))
            .filter_map(|(drive, reason)| {
                Some(UndecidedDrive {
                    drive,
                    reason: (*reason)?,
                })
            })
            .collect();
        report.changes.extend(run.clock.map(changes::clock_change));
        let mut identified = self.identified_changes(&found, &before.values);
        for (one, scales) in identified.iter_mut().zip(scales) {
            one.drive_weights = scales.map_or_else(Vec::new, |scales| scales.weights);
        }
        report.changes.extend(identified);
        // Where no drive can show a change, there are no parameters to compare.
        if reasons.iter().any(Option::is_none) {
            // Only parameters that both runs determine can be compared.
            let differs = |k: &usize| {
                let (a, b) = (&report.alone[*k], &first.alone[*k]);
                let is_known = a.std.is_some() && b.std.is_some();
                is_known && (a.value - b.value).abs() > PARAMETER_CHANGE_SIGMAS * report.difference_std(first, *k)
            };
            report.moved = (0..report.alone.len()).filter(differs).collect();
        }
        report
    }

    /// Indices of the hypotheses that the scale of a drive changed, drive by drive.
    fn scale_hypotheses(&self) -> Vec<usize> {
        let is_scale = |one: &&(usize, &ChangeHypothesis)| matches!(one.1.kind, ChangeKind::Scale(_));
        let all: Vec<(usize, &ChangeHypothesis)> = self.possible.iter().enumerate().collect();
        all.iter().filter(is_scale).map(|(k, _)| *k).collect()
    }

    /// Changes of a run relative to the first, without those on drives whose forces show nothing.
    fn compare_pair(&self, before: &RunStatistics, run: &RunStatistics) -> PairFindings {
        let runs = RunPair {
            reference: before.white.blocks.clone(),
            later: run.white.blocks.clone(),
            within_run_spread: before.within.max(run.within),
        };
        let sensitivity = search_sensitivity(&runs, &self.search, &self.scale_hypotheses());
        let knowledge = [before.knowledge(), run.knowledge()];
        let reasons = undecided_reasons(knowledge.each_ref(), self.layout.base, &sensitivity);
        let believed = reasons
            .iter()
            .map(|one| !one.is_some_and(verdict::UndecidedReason::spoils_fit));
        let believed: Vec<bool> = believed.collect();
        let mut found = self.significant_changes(&runs, &run.sizes, &believed);
        self.drop_unknown_friction(&mut found, |d| before.stands[d] || run.stands[d]);
        let difference_factor = (sensitivity.min_gain / sensitivity.min_gain_of_noise).max(1.0).sqrt();
        let n_found = found.len();
        // Noise averages out over the samples; only an error of the model, which parts of one run show, stays.
        if difference_factor > 1.0 {
            self.drop_below_unexplained(&mut found, [before, run], &believed);
        }
        if found.iter().any(|one| self.is_implausible(one, before, &believed)) {
            found.clear();
        }
        let has_rejected = found.len() < n_found;
        let scales = self.widen_loads(&mut found, [&before.white.drives, &run.white.drives]);
        PairFindings {
            found,
            scales,
            reasons,
            difference_factor,
            has_rejected,
        }
    }

    /// Drops changes of the friction of drives that stand: it may have any value there.
    fn drop_unknown_friction(&self, found: &mut Vec<SelectedChange>, stands: impl Fn(usize) -> bool) {
        found.retain(|one| !matches!(self.possible[one.candidate].kind, ChangeKind::Friction(d) if stands(d)));
    }

    /// Adds to loads the uncertainty of scales of forces that disagree. `drives` are the sums of both runs drive by drive.
    fn widen_loads(&self, found: &mut [SelectedChange], drives: [&[NormalEquations]; 2]) -> Vec<Option<DriveScales>> {
        let columns = |one: &SelectedChange| self.possible[one.candidate].candidate.columns.clone();
        let all: Vec<Vec<usize>> = found.iter().map(columns).collect();
        let mut scales = Vec::new();
        for (k, one) in found.iter_mut().enumerate() {
            let is_load = matches!(self.possible[one.candidate].kind, ChangeKind::Payload(_));
            let others = all.iter().enumerate().filter(|(other, _)| *other != k);
            let others: Vec<usize> = others.flat_map(|(_, columns)| columns).copied().collect();
            scales.push(is_load.then(|| {
                let scales = compare_drive_scales(drives, self.layout, &all[k], &one.values, &others);
                payload_scale::widen_covariance(one, &scales);
                scales
            }));
        }
        scales
    }

    /// Changes that a search finds, without those that hardly move any drive whose force is `believed`, and those whose
    /// values are within their uncertainty.
    fn significant_changes(&self, runs: &RunPair, sizes: &MeasuredMoments, believed: &[bool]) -> Vec<SelectedChange> {
        let mut found = search_changes(runs, &self.search);
        found.retain(|one| {
            let columns = &self.possible[one.candidate].candidate.columns;
            let fractions = sizes.force_fractions(columns, &one.values);
            let mut moved = fractions.iter().zip(believed);
            moved.any(|(part, believed)| *believed && *part > CHANGE_LEAST_FORCE_SHARE) && has_certain_value(one)
        });
        found
    }

    /// Changes with their physical values and texts.
    fn identified_changes(&self, found: &[SelectedChange], values: &DVector<f64>) -> Vec<RunChange> {
        let each = found.iter();
        each.map(|one| changes::identified_change(self.model, &self.possible, one, values))
            .collect()
    }
}

/// A run compared with the first.
struct PairFindings {
    /// The changes, the largest first.
    found: Vec<SelectedChange>,
    /// For each of them that is a load, what the drives weigh.
    scales: Vec<Option<DriveScales>>,
    /// For each drive the reason why its forces cannot show a change.
    reasons: Vec<Option<UndecidedReason>>,
    /// As [`RunReport::difference_factor`].
    difference_factor: f64,
    /// As [`RunReport::has_rejected_changes`].
    has_rejected: bool,
}

/// Whether one of the values of a change is far from zero, or none is determined individually.
fn has_certain_value(one: &SelectedChange) -> bool {
    let mut known = (0..one.values.len()).filter(|i| one.determined[*i]).peekable();
    let is_certain = |i: usize| one.values[i].abs() > CHANGE_VALUE_SIGMAS * one.covariance[(i, i)].max(0.0).sqrt();
    known.peek().is_none() || known.any(is_certain)
}

/// Base parameters from normal equations of rows with variance 1; parameters known from the file keep their values.
fn fit_parameters(model: &Model, moments: &NormalEquations) -> Vec<FittedValue> {
    let solved = moments.solve();
    // If the rows scatter more than assumed, the standard deviations grow accordingly.
    let noise = (solved.residual_squares / (moments.rows as f64 - solved.rank as f64).max(1.0)).max(1.0);
    merge_known(model, |i| FittedValue {
        value: solved.values[i],
        std: solved.determined[i].then(|| (noise * solved.covariance[(i, i)]).sqrt()),
    })
}

/// All base parameters in the order of the model; `unknown` gives those that are not known, by their index among
/// themselves.
fn merge_known(model: &Model, unknown: impl Fn(usize) -> FittedValue) -> Vec<FittedValue> {
    let mut next = 0;
    let of = |k: usize| {
        if model.is_known(k) {
            return FittedValue {
                value: model.values[k],
                std: Some(0.0),
            };
        }
        let i = next;
        next += 1;
        unknown(i)
    };
    (0..model.base.len()).map(of).collect()
}
