//! The page that tells what a diagnosis found: a model and its recordings go in, one self-contained page comes out.
//!
//! `ask` (what the command line names) -> `diagnosis` -> `added` (the model file with what was found) -> `versions` (both models identified, along all recordings)
//! -> `words`, `tables`, and pictures (`ladder`, `curves`, `maps`, `regions`, `spectrum`) -> `page`. The pictures stand by
//! themselves; `page.js` makes curves that can be zoomed and tables that can be sorted out of them.

pub(crate) mod added;
mod ask;
mod curves;
mod draw;
mod ladder;
mod maps;
mod page;
mod regions;
mod spectrum;
mod tables;
mod units;
mod versions;
pub(crate) mod words;

use std::path::{Path, PathBuf};

use modelmill_identify::Note;
use modelmill_spec::Loaded;
use modelmill_spec::edit::NewEffect;

use crate::along::{self, Places};
use crate::data::Data;
use crate::diagnosis::{self, Answer, Held};
use crate::failure::{Failure, Outcome};
use crate::model::{self, Model};
use crate::progress::watched;

use added::Added;
pub(crate) use ask::ask;
use maps::Variable;
pub(crate) use page::render;
pub(crate) use versions::Version;
use words::Judged;

/// Reads the recordings of fit and check for a model: with a delay its forces belong to earlier states.
pub(crate) type Again<'a> = dyn Fn(&Model) -> Outcome<[Vec<Data>; 2]> + 'a;

/// What is to be told.
pub(crate) struct Question<'a> {
    /// Path of the model file.
    pub(crate) path: &'a Path,
    /// What it says.
    pub(crate) loaded: &'a Loaded,
    /// Libraries of kinds of effects.
    pub(crate) libraries: &'a [PathBuf],
    /// The model, derived.
    pub(crate) model: Model,
    /// Recordings of the fit.
    pub(crate) fit: Vec<Data>,
    /// Recordings of the check.
    pub(crate) check: Vec<Data>,
    /// Which parameters are held.
    pub(crate) held: Held,
    /// Reads the recordings once more.
    pub(crate) again: &'a Again<'a>,
    /// How the recordings are given on the command line.
    pub(crate) recordings: String,
}

/// All that the page tells.
pub(crate) struct Study {
    /// The diagnosis.
    pub(crate) answer: Answer,
    /// The model as it is.
    pub(crate) before: Version,
    /// The model with what was found, or why there is none.
    pub(crate) after: Result<Version, String>,
    /// What was found, as entries of a model file.
    pub(crate) entries: Vec<NewEffect>,
    /// The model file with them.
    pub(crate) edited: Option<Added>,
    /// Where the error of the model as it is lives.
    pub(crate) places: Places,
    /// Where what is left in the end lives.
    pub(crate) left: Option<Places>,
    /// Where errors are judged.
    pub(crate) judged: Judged,
    /// Variables on which errors may depend, along the recordings that are judged.
    variables: Vec<Variable>,
    /// Remarks on the recordings.
    notes: Vec<Note>,
    /// How the recordings are given on the command line.
    recordings: String,
}

impl Study {
    /// Remarks on the recordings.
    pub(crate) fn notes(&self) -> &[Note] {
        &self.notes
    }
}

/// Diagnoses a model, adds what was found in memory, and identifies both.
pub(crate) fn study(question: Question<'_>) -> Outcome<Study> {
    let Question {
        path,
        loaded,
        libraries,
        model,
        fit,
        check,
        held,
        again,
        recordings,
    } = question;
    let answer = diagnosis::find(path, loaded, libraries, &model, &fit, &check, held)?;
    let judged = if check.is_empty() {
        Judged::CrossValidation
    } else {
        Judged::Check
    };
    let notes = fit.iter().chain(&check).flat_map(Data::notes).cloned();
    let notes = notes.collect();
    let delay = model.derivation.mechanism.force_delay;
    let entries = added::entries(&answer);
    let (edited, after) = if entries.is_empty() {
        (None, Err(String::new()))
    } else {
        match added::add(path, libraries, &entries) {
            Ok(added) => {
                let after = with_effects(&added, path, delay, [&fit, &check], held, again);
                (Some(added), after.map_err(|failure| says(&failure)))
            }
            Err(says) => (None, Err(says)),
        }
    };
    let before = Version::new(model, fit, check, held)?;
    let places = places(&before)?;
    let left = after.as_ref().ok().map(self::places).transpose()?;
    let variables = variables(&before)?;
    Ok(Study {
        answer,
        before,
        after,
        entries,
        edited,
        places,
        left,
        judged,
        variables,
        notes,
        recordings,
    })
}

fn with_effects(
    added: &Added,
    path: &Path,
    delay: f64,
    recordings: [&[Data]; 2],
    held: Held,
    again: &Again<'_>,
) -> Outcome<Version> {
    let model = model::derive_loaded(&path.display().to_string(), &added.loaded)?;
    let is_later = model.derivation.mechanism.force_delay.to_bits() != delay.to_bits();
    let [fit, check] = if is_later {
        again(&model)?
    } else {
        recordings.map(<[Data]>::to_vec)
    };
    watched("identifying with what was found", 0, |_| {
        Version::new(model, fit, check, held)
    })
}

fn says(failure: &Failure) -> String {
    match failure {
        Failure::Input(says) | Failure::Usage(says) | Failure::Rendered(says) => says.clone(),
        Failure::BrokenPipe => String::new(),
    }
}

/// Where the error of a model lives on the recordings that are judged.
fn places(version: &Version) -> Outcome<Places> {
    let judged = version.judged();
    let (first, last) = (
        judged.first().copied().unwrap_or(0),
        judged.last().map_or(0, |k| k + 1),
    );
    let runs = &version.runs[first..last];
    let measured: Vec<_> = runs.iter().map(|run| run.measured.clone()).collect();
    let forces: Vec<_> = runs.iter().map(|run| run.forces.clone()).collect();
    along::places(
        &version.model,
        &version.data[first..last],
        &measured,
        &forces,
    )
}

/// Variables along the recordings that are judged, one after the other.
fn variables(version: &Version) -> Outcome<Vec<Variable>> {
    let mut joined: Vec<Variable> = Vec::new();
    for k in version.judged() {
        let variables = along::variables(&version.model, &version.data[k])?;
        if joined.is_empty() {
            joined = variables;
        } else {
            for ((_, all), (_, more)) in joined.iter_mut().zip(variables) {
                all.extend(more);
            }
        }
    }
    Ok(joined)
}

/// Which colour is which model.
fn keys(with_after: bool) -> &'static str {
    if with_after {
        "<span class=\"key c-before\">as it is</span> <span class=\"key c-after\">with the effects</span>"
    } else {
        "<span class=\"key c-before\">as it is</span>"
    }
}
