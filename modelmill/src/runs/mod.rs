//! `runs`: reports changes between recordings of one machine.
//!
//! Each run is fitted alone, and all runs are fitted together. Every later run is compared with the first: physical
//! changes are searched that explain what the two do not share. Possible changes are another load on any body,
//! other friction of a drive, an offset or another scale of its force, another clock, and other zeros of encoders.
//! Payloads have columns of their own, ten for each body, derived from the model with such a body added, so that
//! the model file needs no parameters for them.

mod changes;
mod columns;
mod layout;
pub(crate) mod payload;
mod per_run;
mod points;
mod rows;
mod sums;
mod thresholds;

use std::borrow::Borrow;

use modelmill_boundary::message;
use modelmill_identify::changes::{
    ChangeHypotheses, NormalEquations, RunPair, SelectedChange, search_changes, within_run_spread,
};
use modelmill_identify::diagnose::ForceColumn;
use modelmill_identify::{ParameterInfo, RecordingNote};
use nalgebra::DVector;

use crate::audit::events::{self, ContactEvent};
use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::recording::PreparedRecording;
use crate::segment::RecordingSegment;

pub use changes::{ChangeEstimate, NamedEstimate, PhysicalChange, RunChange};
use changes::{ChangeHypothesis, centre};
use layout::RunColumnLayout;
use payload::PayloadColumns;
pub use per_run::{KnownLoad, PerRunSelection, RunValue, SharedFit};
pub use points::{ChangePoint, ParameterStep};
use rows::{MeasuredMoments, RunRows, WhitenedRun};
pub use sums::{ReferenceFit, RunSums};
use thresholds::{CHANGE_LEAST_FORCE_SHARE, PARAMETER_CHANGE_SIGMAS, PUSH_LONGEST_GAP_S, PUSH_MARGIN_SHARE};

/// A fitted value with its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittedValue {
    /// The value, in the unit of the parameter.
    pub value: f64,
    /// Its standard deviation, in the same unit; `None` if the run does not determine the parameter.
    pub deviation: Option<f64>,
}

impl FittedValue {
    /// The standard deviation of its difference from another value.
    pub fn difference_deviation(self, other: Self) -> f64 {
        let [a, b] = [self, other].map(|one| one.deviation.unwrap_or(0.0));
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
    /// Base parameters fitted to this run alone.
    pub alone: Vec<FittedValue>,
    /// Indices of base parameters that differ from those of the first run by more than four standard deviations.
    pub moved: Vec<usize>,
    /// Changes relative to the first run, the largest first, and events within this run.
    pub changes: Vec<RunChange>,
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
    /// Values that each run has separately in one fit of all runs; without any there is no such fit.
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
    /// Runs from which on parameters have changed permanently, in the order of the runs.
    pub points: Vec<ChangePoint>,
    /// The fit of all runs with separate values for each run, if it was requested.
    pub shared: Option<SharedFit>,
    /// Notes on the recordings.
    pub notes: Vec<RecordingNote>,
}

impl Model {
    /// Compares runs of one machine with the first of them and reports changes.
    ///
    /// The runs are processed one after the other, and only their sums are kept, so that there may be hundreds.
    /// Runs that cannot be read or prepared are listed in the result.
    ///
    /// Fails with fewer than two runs, if the first or all later runs cannot be read, if no force was measured, or
    /// if `asked` names something that the model does not have.
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
        asked: &RunsOptions,
    ) -> Outcome<RunsComparison> {
        // Columns and hypotheses are the same for all runs.
        let payloads = PayloadColumns::new(self)?;
        let bench = RunAnalyser::new(self, &payloads);
        let layout = bench.layout;
        let mut shared = per_run::SharedFitBuilder::new(self, &payloads, layout, asked)?;
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
            let mut all = vec![bench.run_report(&before, &before)];
            let mut notes: Vec<RecordingNote> = first.notes().cloned().collect();
            let mut wholes = vec![before.white.total()];
            let mut withins = vec![before.within];
            let mut unread = Vec::new();
            shared.add_run(&before.file, &before.white);
            job.step(1)?;
            // Stage 2: each later run is compared with it.
            for recording in recordings {
                let looked_at = recording.and_then(|recording| {
                    let recording = recording.borrow();
                    notes.extend(recording.notes().cloned());
                    let file = recording.file().to_owned();
                    let run = bench.analyse_run(recording, Some(&before.values));
                    run.map_err(|error| UnreadRun { file, error })
                });
                job.step(1)?;
                match looked_at {
                    Ok(run) => {
                        let mut one = bench.run_report(&run, &before);
                        one.changes.extend(bench.changes(&before, &run));
                        all.push(one);
                        wholes.push(run.white.total());
                        withins.push(run.within);
                        shared.add_run(&run.file, &run.white);
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
            let points = points::find_change_points(&bench, &alone, &wholes, &withins, &before.sizes, &before.values);
            let mut together = NormalEquations::new(layout.base);
            for whole in &wholes {
                together.merge(&whole.select_columns(&base));
            }
            Ok(RunsComparison {
                model: self.name.clone(),
                parameters: self.parameter_infos(),
                together: fit_parameters(self, &together),
                points,
                runs: all,
                unread,
                shared: shared.answer()?,
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

    /// The sums of a run, without its contacts and pushes. `values` are the base parameters of the first run,
    /// `None` for the first run itself.
    fn analyse_run(&self, recording: &PreparedRecording, values: Option<&DVector<f64>>) -> Outcome<RunStatistics> {
        let mut stretches = recording.segments.clone();
        let mut told = Vec::new();
        for stretch in &mut stretches {
            let found = events::events(self.model, stretch);
            let found = merged_contact_events(found, stretch);
            // The start and the end of a push hardly exceed the usual residual, so that its interval is widened.
            let wide = found.iter().map(|event| {
                let room = PUSH_MARGIN_SHARE * (event.to - event.from);
                ContactEvent {
                    from: event.from - room,
                    to: event.to + room,
                    drives: Vec::new(),
                    is_confirmed: event.is_confirmed,
                }
            });
            events::leave_out_events(stretch, &wide.collect::<Vec<_>>());
            // Events that are only possible are excluded, but not reported.
            let lasting = found.iter().filter(|event| event.is_confirmed);
            told.extend(lasting.map(|event| changes::event(self.model, event)));
        }
        let rows = RunRows::new(self.model, &stretches, self.payloads, values)?;
        let white = rows.whitened_run()?;
        Ok(RunStatistics {
            file: recording.file().to_owned(),
            samples: stretches
                .iter()
                .map(|one| one.samples().div_ceil(one.decimation()))
                .sum(),
            events: told,
            within: within_run_spread(&white.blocks, &self.search),
            white,
            values: rows.values.clone(),
            sizes: rows.sizes(),
        })
    }

    /// The report of a run fitted alone: values, changed parameters and events. `before` is the first run.
    fn run_report(&self, run: &RunStatistics, before: &RunStatistics) -> RunReport {
        let base: Vec<usize> = (0..self.layout.base).collect();
        let of = |run: &RunStatistics| fit_parameters(self.model, &run.white.total().select_columns(&base));
        let (alone, reference) = (of(run), of(before));
        // Only parameters that both runs determine can be compared.
        let differs = |(a, b): (&FittedValue, &FittedValue)| {
            let is_known = a.deviation.is_some() && b.deviation.is_some();
            is_known && (a.value - b.value).abs() > PARAMETER_CHANGE_SIGMAS * a.difference_deviation(*b)
        };
        let pairs = alone.iter().zip(&reference).map(differs);
        let moved = pairs.enumerate().filter_map(|(k, d)| d.then_some(k)).collect();
        RunReport {
            file: run.file.clone(),
            samples: run.samples,
            alone,
            moved,
            changes: run.events.clone(),
        }
    }

    /// Changes of a run relative to the first, the largest first; those that hardly move any drive are left out.
    fn changes(&self, before: &RunStatistics, run: &RunStatistics) -> Vec<RunChange> {
        self.identified_changes(&self.find_changes(before, run), &before.values)
    }

    /// The same before they are described.
    fn find_changes(&self, before: &RunStatistics, run: &RunStatistics) -> Vec<SelectedChange> {
        let runs = RunPair {
            reference: before.white.blocks.clone(),
            later: run.white.blocks.clone(),
            within_run_spread: before.within.max(run.within),
        };
        self.significant_changes(&runs, &run.sizes)
    }

    /// Changes that a search finds, without those that hardly move any drive.
    fn significant_changes(&self, runs: &RunPair, sizes: &MeasuredMoments) -> Vec<SelectedChange> {
        let mut found = search_changes(runs, &self.search);
        found.retain(|one| {
            let columns = &self.possible[one.candidate].candidate.columns;
            sizes.force_fraction(columns, &one.values) > CHANGE_LEAST_FORCE_SHARE
        });
        found
    }

    /// Changes with their physical values and texts.
    fn identified_changes(&self, found: &[SelectedChange], values: &DVector<f64>) -> Vec<RunChange> {
        let told = found.iter();
        told.map(|one| changes::identified_change(self.model, &self.possible, one, values))
            .collect()
    }
}

/// A change between two recordings, with its force.
pub(crate) struct RecordingDifference {
    /// The recording of the reference.
    pub(crate) first: String,
    /// The later one.
    pub(crate) later: String,
    /// The change.
    pub(crate) changed: RunChange,
    /// The force of the change along all recordings, zero except in the later one.
    pub(crate) force: ForceColumn,
}

/// Changes of later recordings relative to the first, with the forces that they cause.
pub(crate) fn differences(model: &Model, recordings: &[&PreparedRecording]) -> Outcome<Vec<RecordingDifference>> {
    let [first, later @ ..] = recordings else {
        return Ok(Vec::new());
    };
    let payloads = PayloadColumns::new(model)?;
    let bench = RunAnalyser::new(model, &payloads);
    let before = bench.analyse_run(first, None)?;
    // Forces are placed within the samples of all recordings.
    let samples = |one: &PreparedRecording| -> usize { one.segments.iter().map(|one| one.time().len()).sum() };
    let total: usize = recordings.iter().map(|one| samples(one)).sum();
    let mut start = samples(first);
    let mut differences = Vec::new();
    for recording in later {
        let run = bench.analyse_run(recording, Some(&before.values))?;
        let end = start + samples(recording);
        let found = bench.find_changes(&before, &run);
        let rows = match found[..] {
            [] => None,
            _ => Some(RunRows::new(
                model,
                &recording.segments,
                &payloads,
                Some(&before.values),
            )?),
        };
        for (one, changed) in found.iter().zip(bench.identified_changes(&found, &before.values)) {
            let Some(rows) = &rows else { continue };
            let own = rows.force(&bench.possible[one.candidate].candidate.columns, &one.values)?;
            let along_all = |values: Vec<f64>| {
                let mut all = vec![0.0; total];
                if values.len() == end - start {
                    all[start..end].copy_from_slice(&values);
                }
                all
            };
            differences.push(RecordingDifference {
                first: first.file().to_owned(),
                later: recording.file().to_owned(),
                changed,
                force: ForceColumn::new(own.into_iter().map(along_all).collect()),
            });
        }
        start = end;
    }
    Ok(differences)
}

/// Base parameters from normal equations of rows with variance 1; parameters known from the file keep their values.
fn fit_parameters(model: &Model, moments: &NormalEquations) -> Vec<FittedValue> {
    let solved = moments.solve();
    // If the rows scatter more than assumed, the standard deviations grow accordingly.
    let noise = (solved.residual_squares / (moments.rows as f64 - solved.rank as f64).max(1.0)).max(1.0);
    merge_known(model, |i| FittedValue {
        value: solved.values[i],
        deviation: solved.determined[i].then(|| (noise * solved.covariance[(i, i)]).sqrt()),
    })
}

/// All base parameters in the order of the model; `unknown` gives those that are not known, by their index among
/// themselves.
fn merge_known(model: &Model, unknown: impl Fn(usize) -> FittedValue) -> Vec<FittedValue> {
    let mut next = 0;
    let of = |k: usize| {
        if model.is_known(k) {
            return FittedValue {
                value: model.nominal[k],
                deviation: Some(0.0),
            };
        }
        let i = next;
        next += 1;
        unknown(i)
    };
    (0..model.base.len()).map(of).collect()
}
