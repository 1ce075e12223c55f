//! The completed model: the file of the given model with all effects found. Inputs are the findings of a diagnosis, outputs
//! are the entries to add and the text of the file.

use modelmill_boundary::message;
use modelmill_spec::edit::NewEffect;

use crate::error::{Error, Outcome};

use super::completion::ModelCompletion;
use super::findings::{DiagnosisFindings, MissingEffect};
use super::words;

impl DiagnosisFindings {
    /// The entries that should be added: none if a suspected mistake (exchanged columns, a wrong sign, unit or time
    /// unit, a wrong direction of gravity) could be the cause of the findings.
    pub fn entries_to_add(&self) -> &[NewEffect] {
        if words::has_suspicion(&self.diagnosis) {
            &[]
        } else {
            &self.entries
        }
    }

    /// The text of the completed model file, in which the effects found are added to the given one. It is the given file if
    /// no effect is missing.
    ///
    /// Fails if there is such a suspected mistake, even if a trial correction was made. Fails also if the effects
    /// contradict the model file.
    pub fn completed_model(&self) -> Outcome<&str> {
        let has_fault = !self.unresolved.is_empty() || !self.corrected.is_empty();
        if has_fault || words::has_suspicion(&self.diagnosis) {
            return Err(Error::input(
                "the model cannot be completed, because the recordings or the model may have a fault; correct first what the \
                 verdict names",
            ));
        }
        match (&self.edited, &self.after) {
            (Some(completed), _) => Ok(&completed.text),
            (None, ModelCompletion::Refused(reason)) => {
                Err(Error::input(message!("the model cannot be completed: {}", reason)))
            }
            _ => Ok(self.before.model.text()),
        }
    }

    /// Effects found that a model file cannot contain, such as the scale of a force signal.
    pub fn effects_without_entry(&self) -> Vec<&MissingEffect> {
        // Effects that share a place are split, so each place has an entry of the kind.
        let is_added = |kind: &str, place: &String| {
            let mut entries = self.entries.iter();
            entries.any(|entry| entry.kind == kind && entry.at.contains(place))
        };
        let has_entry = |one: &&MissingEffect| one.effect.at.iter().all(|place| is_added(&one.effect.kind, place));
        self.missing.iter().filter(|one| !has_entry(one)).collect()
    }

    /// Entries whose values are sums of several findings, since a model file has a kind once at a place.
    pub(crate) fn summed_entries(&self) -> Vec<&NewEffect> {
        let is_found = |entry: &&NewEffect| {
            let mut found = self.missing.iter();
            found.any(|one| one.effect.kind == entry.kind && one.effect.at == entry.at)
        };
        let is_found_once = |entry: &&NewEffect| {
            let found = self.missing.iter().filter(|one| one.effect.kind == entry.kind);
            found.filter(|one| one.effect.at.contains(&entry.at[0])).count() < 2
        };
        let entries = self.entries_to_add().iter();
        entries
            .filter(|entry| !is_found(entry) && !is_found_once(entry))
            .collect()
    }

    /// Advice if not all effects can be added to the model file: because of a suspected mistake, or of a delayed force
    /// signal.
    pub(crate) fn further_action(&self) -> Option<&'static str> {
        if self.missing.is_empty() || words::has_suspicion(&self.diagnosis) {
            return None;
        }
        let is_late = |one: &&MissingEffect| ["time_delay", "force_lag"].contains(&one.effect.kind.as_str());
        self.effects_without_entry()
            .iter()
            .any(is_late)
            .then_some("Correct the delayed force signal where it is recorded: a model file has no entry for it.")
    }
}
