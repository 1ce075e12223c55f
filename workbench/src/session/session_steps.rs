//! The steps of a session (pane *Steps*): edits of the text with the errors after each.

use serde_json::{Value, json};

/// Steps of a session, each with the errors of the resulting text. Errors arrive later than the step, if they are
/// computed at all. A step without errors of its own revision is not listed.
pub(super) struct SessionSteps {
    /// Edits since the last listed step, with the revisions that they led to.
    done: Vec<(u64, String)>,
    /// The last errors, with their revision.
    compared: Option<(u64, Value)>,
    /// The revision of the last listed step.
    last: Option<u64>,
    /// The listed steps, oldest first.
    listed: Vec<SessionStep>,
}

/// One listed step.
struct SessionStep {
    /// What was done, in words.
    what: String,
    /// Relative errors with nominal and identified values, as JSON.
    errors: Value,
}

impl SessionSteps {
    /// The steps of a text that was opened with this revision.
    pub(super) fn new(opened: u64) -> Self {
        Self {
            done: vec![(opened, "as opened".to_owned())],
            compared: None,
            last: None,
            listed: Vec::new(),
        }
    }

    /// The steps as JSON for the page.
    pub(super) fn view(&self) -> Value {
        let listed = self.listed.iter();
        listed
            .map(|step| json!({ "what": step.what, "errors": step.errors }))
            .collect()
    }

    /// Records an edit that led to a revision. It is listed once the errors of this revision are known.
    pub(super) fn record_step(&mut self, revision: u64, what: &str) {
        if (self.done.iter()).all(|(at, one)| *at != revision || one != what) {
            self.done.push((revision, what.to_owned()));
        }
        self.add_step_if_known(revision);
    }

    /// Records the errors of a revision; returns whether a step was listed.
    pub(super) fn add_errors(&mut self, revision: u64, errors: Value) -> bool {
        self.compared = Some((revision, errors));
        self.add_step_if_known(revision)
    }

    /// Lists the typing until a revision as a separate step, before another kind of edit follows.
    pub(super) fn end_typing(&mut self, revision: u64) {
        let Some(errors) = self.errors_of(revision) else {
            return;
        };
        let is_news = self.listed.last().is_none_or(|step| step.errors != *errors);
        if is_news && self.last != Some(revision) {
            self.record_step(revision, "edited");
        }
    }

    /// The errors of a revision, if these are the last ones.
    fn errors_of(&self, revision: u64) -> Option<&Value> {
        let (_, errors) = self.compared.as_ref().filter(|(at, _)| *at == revision)?;
        Some(errors)
    }

    /// Lists the edits that led to a revision, if its errors are known. Edits of older revisions are dropped.
    fn add_step_if_known(&mut self, revision: u64) -> bool {
        let Some(errors) = self.errors_of(revision).cloned() else {
            return false;
        };
        let done = std::mem::take(&mut self.done).into_iter();
        let here = done.filter(|(at, _)| *at == revision);
        let what: Vec<String> = here.map(|(_, what)| what).collect();
        if what.is_empty() {
            return false;
        }
        self.last = Some(revision);
        self.listed.push(SessionStep {
            what: what.join(", "),
            errors,
        });
        true
    }
}
