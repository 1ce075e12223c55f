//! The ladder of a sitting: what was done to the text, with the errors after each step.

use serde_json::{Value, json};

/// Steps of a sitting, each with the errors of the text that it led to. Errors come later than the step, if anybody waits for them
/// at all: what led to a text whose errors nobody knows has no rung, since those of another text are not its own.
pub(super) struct ErrorLadder {
    /// What was done since the last rung, and to which revision that led.
    done: Vec<(u64, String)>,
    /// The errors that were found last, and of which revision.
    compared: Option<(u64, Value)>,
    /// The revision of the last rung.
    last: Option<u64>,
    rungs: Vec<LadderStep>,
}

struct LadderStep {
    what: String,
    errors: Value,
}

impl ErrorLadder {
    /// Of a text that was opened with this revision.
    pub(super) fn new(opened: u64) -> Self {
        Self {
            done: vec![(opened, "as opened".to_owned())],
            compared: None,
            last: None,
            rungs: Vec::new(),
        }
    }

    /// The rungs, as pages read them.
    pub(super) fn view(&self) -> Value {
        let rungs = self.rungs.iter();
        rungs
            .map(|rung| json!({ "what": rung.what, "errors": rung.errors }))
            .collect()
    }

    /// Something was done that led to a revision of the text, and whose effect on the errors is to stand here.
    pub(super) fn record_step(&mut self, revision: u64, what: &str) {
        if (self.done.iter()).all(|(at, one)| *at != revision || one != what) {
            self.done.push((revision, what.to_owned()));
        }
        self.add_step_if_known(revision);
    }

    /// Takes the errors of a revision, and says whether a rung came of them.
    pub(super) fn add_errors(&mut self, revision: u64, errors: Value) -> bool {
        self.compared = Some((revision, errors));
        self.add_step_if_known(revision)
    }

    /// What was typed until a revision is a step of its own, before something else is done to the text.
    pub(super) fn end_typing(&mut self, revision: u64) {
        let Some(errors) = self.errors_of(revision) else {
            return;
        };
        let is_news = self.rungs.last().is_none_or(|rung| rung.errors != *errors);
        if is_news && self.last != Some(revision) {
            self.record_step(revision, "edited");
        }
    }

    fn errors_of(&self, revision: u64) -> Option<&Value> {
        let (_, errors) = self.compared.as_ref().filter(|(at, _)| *at == revision)?;
        Some(errors)
    }

    /// Puts what led to a revision on the ladder, if its errors are known.
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
        self.rungs.push(LadderStep {
            what: what.join(", "),
            errors,
        });
        true
    }
}
