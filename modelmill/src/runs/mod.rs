//! `runs`: what is different between recordings of one machine.
//!
//! Each run is fitted alone and all are fitted together. Every run after the first is then held against the first: which
//! changes, said in physics, explain what the two do not share. Possible are another load on any body, other friction of a
//! drive, an offset or another scale of its force, and another clock. Payloads are columns of their own, ten for each body,
//! derived from the model with such a body besides, so that they need no parameter of the model file.

mod changes;
mod columns;
mod layout;
pub(crate) mod payload;
mod per_run;
mod points;
mod rows;
mod sums;

use std::borrow::Borrow;

use modelmill_boundary::message;
use modelmill_identify::changes::{Change, Moments, Runs, Search, search, within};
use modelmill_identify::diagnose::Column;
use modelmill_identify::{Note, ParameterInfo};
use nalgebra::DVector;

use crate::audit::events::{self, Event};
use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::recording::Recording;
use crate::stretch::Stretch;

pub use changes::{Changed, Estimate, Named, What};
use changes::{Possible, centre};
use layout::Layout;
use payload::Payloads;
pub use per_run::{KnownLoad, PerRun, SharedFit, Valued};
pub use points::{ChangePoint, Step};
use rows::{Rows, Sizes, White};
pub use sums::{CommonGround, RunSums};

/// A difference of a base parameter counts as moved from this many standard deviations on.
const MOVED: f64 = 4.0;

/// A change must move one of the drives by this part of its effective force: less is within what no model knows.
const LEAST: f64 = 4e-3;

/// What is shorter, in s, is left out but not told as a push: the error of a model rises for so long as well.
const SHORTEST_PUSH: f64 = 0.25;

/// Before and after an event so much of its length is left out as well.
const AROUND: f64 = 0.2;

/// A value with its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fitted {
    /// The value, in the unit of the parameter.
    pub value: f64,
    /// Its standard deviation; `None` where the run does not determine the parameter.
    pub deviation: Option<f64>,
}

impl Fitted {
    /// The standard deviation of its difference from another one.
    pub fn beside(self, other: Self) -> f64 {
        let [a, b] = [self, other].map(|one| one.deviation.unwrap_or(0.0));
        a.hypot(b)
    }
}

/// One run.
#[derive(Clone, Debug)]
pub struct OneRun {
    /// What messages call its recording.
    pub file: String,
    /// Samples that were used.
    pub samples: usize,
    /// Base parameters fitted to this run alone.
    pub alone: Vec<Fitted>,
    /// Base parameters, by position, that differ from those of the first run by more than four deviations.
    pub moved: Vec<usize>,
    /// What changed against the first run, the largest first, and events within this run.
    pub changes: Vec<Changed>,
}

/// A run that gave no answer.
#[derive(Debug)]
pub struct Unread {
    /// What messages call its recording.
    pub file: String,
    /// Why.
    pub error: Error,
}

/// What is asked of runs beside what changed.
#[derive(Clone, Debug, Default)]
pub struct Asked {
    /// What each run has of its own in one fit of all runs; no such fit without any.
    pub per_run: Vec<PerRun>,
    /// Loads of known mass, from which the scales of all measured forces follow.
    pub loads: Vec<KnownLoad>,
}

/// What differs between runs.
pub struct Compared {
    /// Name of the model.
    pub model: String,
    /// The base parameters.
    pub parameters: Vec<ParameterInfo>,
    /// Base parameters fitted to all runs at once.
    pub together: Vec<Fitted>,
    /// All runs that gave an answer; the first is the one that the others are held against.
    pub runs: Vec<OneRun>,
    /// Runs that gave none.
    pub unread: Vec<Unread>,
    /// When parameters changed and stayed changed, in the order of the runs.
    pub points: Vec<ChangePoint>,
    /// The fit of all runs in which some values are each run's own, if one was asked for.
    pub shared: Option<SharedFit>,
    /// Remarks on the recordings.
    pub notes: Vec<Note>,
}

impl Model {
    /// Holds runs of one machine against the first of them and says what changed.
    ///
    /// The runs are taken one after the other and nothing is kept of them but sums, so that there may be hundreds. Runs that cannot
    /// be read or prepared are named in the result.
    ///
    /// Fails with fewer than two runs, where the first cannot be read or no later one can, where no force was measured, or where
    /// `asked` names what the model does not have.
    pub fn runs<R: Borrow<Recording>>(
        &self,
        recordings: impl IntoIterator<Item = Result<R, Unread>>,
        asked: &Asked,
    ) -> Outcome<Compared> {
        let payloads = Payloads::new(self)?;
        let bench = Bench::new(self, &payloads);
        let layout = bench.layout;
        let mut shared = per_run::Asking::new(self, &payloads, layout, asked)?;
        let mut recordings = recordings.into_iter();
        let total = recordings.size_hint().0;
        self.host()
            .watched("holding runs against the first", total, |job| {
                let Some(first) = recordings.next() else {
                    return Err(Error::options("there is no recording; give two or more"));
                };
                let first = first.map_err(|unread| unread.error)?;
                let first = first.borrow();
                let before = bench.looked_at(first, None)?;
                let mut all = vec![bench.one(&before, &before)];
                let mut notes: Vec<Note> = first.notes().cloned().collect();
                let mut wholes = vec![before.white.whole()];
                let mut withins = vec![before.within];
                let mut unread = Vec::new();
                shared.take(&before.file, &before.white);
                job.step(1)?;
                for recording in recordings {
                    let looked_at = recording.and_then(|recording| {
                        let recording = recording.borrow();
                        notes.extend(recording.notes().cloned());
                        let file = recording.file().to_owned();
                        let run = bench.looked_at(recording, Some(&before.values));
                        run.map_err(|error| Unread { file, error })
                    });
                    job.step(1)?;
                    match looked_at {
                        Ok(run) => {
                            let mut one = bench.one(&run, &before);
                            one.changes.extend(bench.changes(&before, &run));
                            all.push(one);
                            wholes.push(run.white.whole());
                            withins.push(run.within);
                            shared.take(&run.file, &run.white);
                        }
                        Err(Unread {
                            error: Error::Cancelled,
                            ..
                        }) => return Err(Error::Cancelled),
                        Err(one) => unread.push(one),
                    }
                }
                if all.len() < 2 {
                    return Err(alone(&before.file, &unread));
                }
                let base: Vec<usize> = (0..layout.base).collect();
                let alone: Vec<&[Fitted]> = all.iter().map(|run| &run.alone[..]).collect();
                let points = points::found(
                    &bench,
                    &alone,
                    &wholes,
                    &withins,
                    &before.sizes,
                    &before.values,
                );
                let mut together = Moments::new(layout.base);
                for whole in &wholes {
                    together.merge(&whole.of(&base));
                }
                Ok(Compared {
                    model: self.name.clone(),
                    parameters: self.infos(),
                    together: fitted(self, &together),
                    points,
                    runs: all,
                    unread,
                    shared: shared.answer()?,
                    notes,
                })
            })?
    }
}

/// There is nothing to hold the first run against.
fn alone(first: &str, unread: &[Unread]) -> Error {
    match unread {
        [] => Error::options(format!(
            "{first} is the only recording; what changed is told between two or more, the first of which is how things were"
        )),
        [one, ..] => Error::input(message!(
            "no recording but {first} gave an answer; {} of {} did not, as {}: {}",
            unread.len(),
            unread.len() + 1,
            one.file,
            one.error.message()
        )),
    }
}

/// What all runs are looked at with.
pub(crate) struct Bench<'a> {
    model: &'a Model,
    payloads: &'a Payloads,
    layout: Layout,
    possible: Vec<Possible>,
    search: Search,
}

/// One run as sums.
pub(crate) struct LookedAt {
    file: String,
    samples: usize,
    pub(crate) events: Vec<Changed>,
    /// Base parameters of the first run.
    values: DVector<f64>,
    white: White,
    /// By what its parts differ among themselves.
    within: f64,
    /// Its rows as they were measured.
    sizes: Sizes,
}

/// Events of forces that were measured; those that follow each other at once are one.
fn pushes(events: Vec<Event>, stretch: &Stretch) -> Vec<Event> {
    let mut all: Vec<Event> = Vec::new();
    for mut event in events {
        let (from, to) = (event.from, event.to);
        event
            .drives
            .retain(|(d, ..)| was_measured(stretch, *d, from, to));
        if event.drives.is_empty() {
            continue;
        }
        match all.last_mut() {
            Some(last) if from - last.to < SHORTEST_PUSH => {
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

/// Whether most forces of a drive between two times were measured: what stands in the place of others is no push.
fn was_measured(stretch: &Stretch, drive: usize, from: f64, to: f64) -> bool {
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

impl<'a> Bench<'a> {
    fn new(model: &'a Model, payloads: &'a Payloads) -> Self {
        let layout = Layout::new(model, payloads);
        let possible = changes::possible(model, payloads, layout);
        let search = Search {
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

    fn looked_at(&self, recording: &Recording, values: Option<&DVector<f64>>) -> Outcome<LookedAt> {
        let mut stretches = recording.stretches.clone();
        let mut told = Vec::new();
        for stretch in &mut stretches {
            let found = events::events(self.model, stretch).unwrap_or_default();
            let found = pushes(found, stretch);
            // The beginning and the end of a push hardly rise above what is usual.
            let wide = found.iter().map(|event| {
                let room = AROUND * (event.to - event.from);
                Event {
                    from: event.from - room,
                    to: event.to + room,
                    drives: Vec::new(),
                }
            });
            events::leave_out_events(stretch, &wide.collect::<Vec<_>>());
            let lasting = found
                .iter()
                .filter(|event| event.to - event.from >= SHORTEST_PUSH);
            told.extend(lasting.map(|event| changes::event(self.model, event)));
        }
        let rows = Rows::new(self.model, &stretches, self.payloads, values)?;
        let white = rows.white()?;
        Ok(LookedAt {
            file: recording.file().to_owned(),
            samples: stretches
                .iter()
                .map(|one| one.samples().div_ceil(one.decimation()))
                .sum(),
            events: told,
            within: within(&white.blocks, &self.search),
            white,
            values: rows.values.clone(),
            sizes: rows.sizes(),
        })
    }

    /// A run fitted alone.
    fn one(&self, run: &LookedAt, before: &LookedAt) -> OneRun {
        let base: Vec<usize> = (0..self.layout.base).collect();
        let of = |run: &LookedAt| fitted(self.model, &run.white.whole().of(&base));
        let (alone, reference) = (of(run), of(before));
        let differs = |(a, b): (&Fitted, &Fitted)| {
            let is_known = a.deviation.is_some() && b.deviation.is_some();
            is_known && (a.value - b.value).abs() > MOVED * a.beside(*b)
        };
        let pairs = alone.iter().zip(&reference).map(differs);
        let moved = pairs
            .enumerate()
            .filter_map(|(k, d)| d.then_some(k))
            .collect();
        OneRun {
            file: run.file.clone(),
            samples: run.samples,
            alone,
            moved,
            changes: run.events.clone(),
        }
    }

    /// What changed in a run, the largest first; what hardly moves any drive is left out.
    fn changes(&self, before: &LookedAt, run: &LookedAt) -> Vec<Changed> {
        self.told(&self.found(before, run), &before.values)
    }

    fn found(&self, before: &LookedAt, run: &LookedAt) -> Vec<Change> {
        let runs = Runs {
            reference: before.white.blocks.clone(),
            later: run.white.blocks.clone(),
            within: before.within.max(run.within),
        };
        self.large(&runs, &run.sizes)
    }

    /// What a search finds, without what hardly moves any drive.
    fn large(&self, runs: &Runs, sizes: &Sizes) -> Vec<Change> {
        let mut found = search(runs, &self.search);
        found.retain(|one| {
            let columns = &self.possible[one.which].candidate.columns;
            sizes.part(columns, &one.values) > LEAST
        });
        found
    }

    fn told(&self, found: &[Change], values: &DVector<f64>) -> Vec<Changed> {
        let told = found.iter();
        told.map(|one| changes::told(self.model, &self.possible, one, values))
            .collect()
    }
}

/// A change between two recordings, with the force that it is.
pub(crate) struct Difference {
    /// The recording before.
    pub(crate) first: String,
    /// The later one.
    pub(crate) later: String,
    /// What changed.
    pub(crate) changed: Changed,
    /// What the forces of the later one have besides, along all recordings.
    pub(crate) force: Column,
}

/// What later recordings do not share with the first, with the forces that that makes.
pub(crate) fn differences(model: &Model, recordings: &[&Recording]) -> Outcome<Vec<Difference>> {
    let [first, later @ ..] = recordings else {
        return Ok(Vec::new());
    };
    let payloads = Payloads::new(model)?;
    let bench = Bench::new(model, &payloads);
    let before = bench.looked_at(first, None)?;
    let samples =
        |one: &Recording| -> usize { one.stretches.iter().map(|one| one.time().len()).sum() };
    let total: usize = recordings.iter().map(|one| samples(one)).sum();
    let mut start = samples(first);
    let mut differences = Vec::new();
    for recording in later {
        let run = bench.looked_at(recording, Some(&before.values))?;
        let end = start + samples(recording);
        let found = bench.found(&before, &run);
        let rows = match found[..] {
            [] => None,
            _ => Some(Rows::new(
                model,
                &recording.stretches,
                &payloads,
                Some(&before.values),
            )?),
        };
        for (one, changed) in found.iter().zip(bench.told(&found, &before.values)) {
            let Some(rows) = &rows else { continue };
            let own = rows.force(&bench.possible[one.which].candidate.columns, &one.values)?;
            let along_all = |values: Vec<f64>| {
                let mut all = vec![0.0; total];
                if values.len() == end - start {
                    all[start..end].copy_from_slice(&values);
                }
                all
            };
            differences.push(Difference {
                first: first.file().to_owned(),
                later: recording.file().to_owned(),
                changed,
                force: Column::new(own.into_iter().map(along_all).collect()),
            });
        }
        start = end;
    }
    Ok(differences)
}

/// The base parameters that some rows of variance 1 give; those that are numbers of the file keep them.
fn fitted(model: &Model, moments: &Moments) -> Vec<Fitted> {
    let solved = moments.solve();
    let noise = (solved.rest / (moments.rows as f64 - solved.rank as f64).max(1.0)).max(1.0);
    beside_known(model, |i| Fitted {
        value: solved.values[i],
        deviation: solved.determined[i].then(|| (noise * solved.covariance[(i, i)]).sqrt()),
    })
}

/// All base parameters, of which those that are no numbers of the file are asked for by their place among themselves.
fn beside_known(model: &Model, unknown: impl Fn(usize) -> Fitted) -> Vec<Fitted> {
    let mut next = 0;
    let of = |k: usize| {
        if model.is_known(k) {
            return Fitted {
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
