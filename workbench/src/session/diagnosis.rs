//! The diagnosis of a session: its start, its progress, its findings, and effects that are added to the text.

use std::sync::Arc;

use modelmill::diagnose::DiagnosisOptions;
use modelmill::edit::NewEffect;
use modelmill::{Error, Host, Outcome};
use serde_json::{Value, json};

use super::WorkbenchSession;
use crate::view;
use crate::watch::JobWatch;

/// A diagnosis, or the result of the last one.
#[derive(Default)]
pub(super) struct DiagnosisJob {
    /// Counts the diagnoses of the session.
    number: u64,
    /// The revision of the text that is diagnosed.
    revision: u64,
    /// Progress and start time in s, while it runs.
    running: Option<(Arc<JobWatch>, f64)>,
    /// The findings as JSON, or why there are none.
    answer: Option<Result<Value, String>>,
    /// Whether the user cancelled it.
    was_cancelled: bool,
    /// The effects that can be added to the text.
    entries: Vec<NewEffect>,
}

impl DiagnosisJob {
    /// No diagnosis yet; the next one has the number after this one.
    pub(super) fn starting_from(number: u64) -> Self {
        Self {
            number,
            ..Self::default()
        }
    }
}

impl WorkbenchSession {
    /// Starts a diagnosis of the current text.
    ///
    /// Fails with a sentence if one is running, the text has faults, or there is no recording.
    pub(crate) fn diagnose(self: &Arc<Self>) -> Result<Value, String> {
        if self.options.data.is_empty() {
            return Err("there is no recording; a diagnosis needs at least one".to_owned());
        }
        self.model()?;
        let watch = Arc::new(JobWatch::new(Arc::clone(&self.surroundings)));
        let (text, number) = {
            let mut state = self.state();
            if state.diagnosis.running.is_some() {
                return Err("a diagnosis is running; wait until it ends, or cancel it".to_owned());
            }
            state.diagnosis = DiagnosisJob {
                number: state.diagnosis.number + 1,
                revision: state.document.revision(),
                running: Some((Arc::clone(&watch), self.surroundings.seconds())),
                ..DiagnosisJob::default()
            };
            (state.document.text().to_owned(), state.diagnosis.number)
        };
        let session = Arc::clone(self);
        let host = self.host.clone().with_progress(Arc::clone(&watch) as _);
        let work = move || {
            // After a panic the page would wait forever; it gets an error instead.
            let asked = std::panic::AssertUnwindSafe(|| session.run_diagnosis(&host, &text));
            let found = std::panic::catch_unwind(asked).unwrap_or_else(|_| {
                Err(Error::input(
                    "the diagnosis ended with an internal error of the program, not of your input",
                ))
            });
            session.finish_diagnosis(number, found);
        };
        if let Err(error) = self.surroundings.spawn_work(Box::new(work)) {
            self.state().diagnosis.running = None;
            return Err(format!("the diagnosis cannot be started: {error}"));
        }
        Ok(self.diagnosis())
    }

    /// Derives the text and diagnoses it, on the thread of the job. Returns the view and the effects to add.
    fn run_diagnosis(&self, host: &Host, text: &str) -> Outcome<(Value, Vec<NewEffect>)> {
        let path = &self.options.model;
        let model = host.derive(&self.name(), host.load_text(path, text)?)?;
        let [fit, check] = self.recordings(&model)?;
        let [fit, check] = [&fit, &check].map(|all| all.iter().collect::<Vec<_>>());
        let findings = model.diagnose(&fit, &check, &DiagnosisOptions::default())?;
        Ok((
            view::findings(&findings, &*self.commands),
            findings.entries_to_add().to_vec(),
        ))
    }

    /// Stores the result of diagnosis `number`, unless a newer one was started.
    fn finish_diagnosis(&self, number: u64, found: Outcome<(Value, Vec<NewEffect>)>) {
        let mut state = self.state();
        let diagnosis = &mut state.diagnosis;
        if diagnosis.number != number {
            return;
        }
        diagnosis.running = None;
        match found {
            Ok((view_json, entries)) => {
                diagnosis.answer = Some(Ok(view_json));
                diagnosis.entries = entries;
            }
            Err(Error::Cancelled) => diagnosis.was_cancelled = true,
            Err(error) => diagnosis.answer = Some(Err(self.error_text(&error))),
        }
        drop(state);
        self.notify_pages();
    }

    /// Cancels the running diagnosis; returns its view.
    pub(crate) fn cancel(&self) -> Value {
        if let Some((watch, _)) = &self.state().diagnosis.running {
            watch.cancel();
        }
        self.diagnosis()
    }

    /// View of the diagnosis: its progress, or its findings.
    pub(crate) fn diagnosis(&self) -> Value {
        let state = self.state();
        let diagnosis = &state.diagnosis;
        let going = diagnosis.running.as_ref().map(|(watch, since)| {
            let mut view_json = watch.progress_view();
            view_json["seconds"] = json!(self.surroundings.seconds() - since);
            view_json
        });
        json!({
            "number": diagnosis.number,
            "going": going,
            "cancelled": diagnosis.was_cancelled,
            "found": diagnosis.answer.as_ref().and_then(|answer| answer.as_ref().ok()),
            "failed": diagnosis.answer.as_ref().and_then(|answer| answer.as_ref().err()),
            "of_this_text": diagnosis.revision == state.document.revision(),
        })
    }

    /// Adds an effect that the last diagnosis found to the text, as the command `add` does.
    ///
    /// Fails with a sentence if there is no such effect, or the text with it has faults.
    pub(crate) fn add(&self, entry: usize) -> Result<Value, String> {
        let (text, revision, effect) = {
            let state = self.state();
            let effect = state.diagnosis.entries.get(entry).cloned();
            let effect = effect.ok_or("there is no such finding; run the diagnosis again")?;
            (state.document.text().to_owned(), state.document.revision(), effect)
        };
        let edited = self.host.edit(&self.name(), &text, &effect);
        let edited = edited.map_err(|error| self.error_text(&error))?;
        {
            let mut state = self.state();
            let now = state.document.revision();
            state.steps.end_typing(now);
            if !state.document.edit(revision, &edited.text) {
                return Err("the text was changed meanwhile; add the effect again".to_owned());
            }
            let what = format!("+ {} ({})", effect.kind.replace('_', " "), effect.at.join(", "));
            state.record_step(&what);
        }
        self.derive();
        Ok(self.view())
    }
}
