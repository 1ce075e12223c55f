//! `runs`: what is different between recordings of one machine.
//!
//! Each run is fitted alone and all are fitted together. Every run after the first is then held against the first: which
//! changes, said in physics, explain what the two do not share. Possible are another load on any body, other friction of a
//! drive, an offset or another scale of its force, and another clock. Payloads are columns of their own, ten for each body,
//! derived from the model with such a body besides, so that they need no parameter of the model file.

mod changes;
mod columns;
mod payload;

use modelmill_identify::changes::{Change, Moments, Runs, Search, search};
use modelmill_identify::diagnose::Column;
use modelmill_identify::{Note, ParameterInfo};

use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::recording::Recording;

use changes::Possible;
pub use changes::{Changed, Estimate, What};
use columns::{Rows, White};
use payload::Payloads;

/// A difference of a base parameter counts as moved from this many standard deviations on.
const MOVED: f64 = 4.0;

/// A change must move one of the drives by this part of its effective force: less is within what no model knows.
const LEAST: f64 = 4e-3;

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
    /// What changed against the first run, the largest first.
    pub changes: Vec<Changed>,
}

/// What differs between runs.
pub struct Compared {
    /// Name of the model.
    pub model: String,
    /// The base parameters.
    pub parameters: Vec<ParameterInfo>,
    /// Base parameters fitted to all runs at once.
    pub together: Vec<Fitted>,
    /// All runs; the first is the one that the others are held against.
    pub runs: Vec<OneRun>,
    /// Remarks on the recordings.
    pub notes: Vec<Note>,
}

impl Model {
    /// Holds runs of one machine against the first of them and says what changed.
    ///
    /// Fails with fewer than two runs, where no force was measured, or where a recording leads where the mechanism cannot
    /// stand.
    pub fn runs(&self, recordings: &[&Recording]) -> Outcome<Compared> {
        let [first, later @ ..] = recordings else {
            return Err(Error::options("there is no recording; give two or more"));
        };
        if later.is_empty() {
            return Err(Error::options(format!(
                "{} is the only recording; what changed is told between two or more, the first of which is how things were",
                first.file()
            )));
        }
        let payloads = Payloads::new(self)?;
        let job = "holding runs against the first";
        self.host().watched(job, recordings.len(), |job| {
            let reference = Rows::new(self, first, &payloads, None)?;
            job.step(1)?;
            let before = reference.white()?;
            let mut together = before.base();
            let mut runs = vec![one(self, first, &before.base(), &before.base())];
            for recording in later {
                let rows = Rows::new(self, recording, &payloads, Some(&reference.values))?;
                let run = rows.white()?;
                together.merge(&run.base());
                let mut found = one(self, recording, &run.base(), &before.base());
                found.changes = changes(self, &payloads, &rows, &before, &run);
                runs.push(found);
                job.step(1)?;
            }
            Ok(Compared {
                model: self.name.clone(),
                parameters: self.infos(),
                together: fitted(self, &together),
                runs,
                notes: recordings
                    .iter()
                    .flat_map(|one| one.notes())
                    .cloned()
                    .collect(),
            })
        })?
    }
}

/// A run fitted alone.
fn one(model: &Model, recording: &Recording, own: &Moments, before: &Moments) -> OneRun {
    let [alone, reference] = [own, before].map(|moments| fitted(model, moments));
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
        file: recording.file().to_owned(),
        samples: own.rows / model.drives().len().max(1),
        alone,
        moved,
        changes: Vec::new(),
    }
}

/// The base parameters that some rows of variance 1 give; those that are numbers of the file keep them.
fn fitted(model: &Model, moments: &Moments) -> Vec<Fitted> {
    let solved = moments.solve();
    let noise = (solved.rest / (moments.rows as f64 - solved.rank as f64).max(1.0)).max(1.0);
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
        Fitted {
            value: solved.values[i],
            deviation: solved.determined[i].then(|| (noise * solved.covariance[(i, i)]).sqrt()),
        }
    };
    (0..model.base.len()).map(of).collect()
}

/// What changed in a run, the largest first; what hardly moves any drive is left out.
fn changes(
    model: &Model,
    payloads: &Payloads,
    rows: &Rows,
    before: &White,
    run: &White,
) -> Vec<Changed> {
    let possible = changes::possible(model, payloads, run.layout);
    let found = found(&possible, rows, before, run);
    let told = found.iter();
    told.map(|one| changes::told(model, &possible, one, &rows.values))
        .collect()
}

fn found(possible: &[Possible], rows: &Rows, before: &White, run: &White) -> Vec<Change> {
    let columns = possible.iter().map(|one| one.columns.clone()).collect();
    let mut found = search(
        &Runs {
            reference: before.blocks.clone(),
            later: run.blocks.clone(),
        },
        &Search {
            shared: (0..run.layout.total()).collect(),
            changes: columns,
        },
    );
    found.retain(|one| rows.part(&possible[one.which].columns, &one.values) > LEAST);
    found
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
    let reference = Rows::new(model, first, &payloads, None)?;
    let before = reference.white()?;
    let samples =
        |one: &Recording| -> usize { one.stretches.iter().map(|one| one.time().len()).sum() };
    let total: usize = recordings.iter().map(|one| samples(one)).sum();
    let mut start = samples(first);
    let mut differences = Vec::new();
    for recording in later {
        let rows = Rows::new(model, recording, &payloads, Some(&reference.values))?;
        let run = rows.white()?;
        let possible = changes::possible(model, &payloads, run.layout);
        let end = start + samples(recording);
        for one in found(&possible, &rows, &before, &run) {
            let own = rows.force(&possible[one.which].columns, &one.values);
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
                changed: changes::told(model, &possible, &one, &rows.values),
                force: Column(own.0.into_iter().map(|v| v.map(along_all)).collect()),
            });
        }
        start = end;
    }
    Ok(differences)
}
