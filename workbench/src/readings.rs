//! Recordings as a model reads them, kept while the text changes nothing on which reading depends: that is all of the mechanism
//! but the values of its parameters. States and regressors are the same then; only remarks on a recording may know values, so
//! who wants these reads afresh.
//!
//! Decision: reading and checking a recording takes four times as long as everything else between a keystroke and
//! the error. It is repeated when typing stops, because remarks on a recording may depend on values.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use modelmill::recording::Recording;
use modelmill::{Model, Outcome};

/// Recordings of fit and check.
pub(crate) type Read = [Vec<Recording>; 2];

/// The recordings as they were last read.
#[derive(Default)]
pub(crate) struct Readings {
    kept: Mutex<Option<(String, Arc<Read>)>>,
}

impl Readings {
    /// Recordings as `model` reads them, and whether they were read for this model itself; `read` does it.
    pub(crate) fn of(
        &self,
        model: &Model,
        is_afresh: bool,
        read: impl FnOnce() -> Outcome<Read>,
    ) -> Outcome<(Arc<Read>, bool)> {
        let mechanism = but_for_values(model);
        let known = self.kept().clone();
        match known {
            Some((same, kept)) if same == mechanism && !is_afresh => Ok((kept, false)),
            _ => {
                let read = Arc::new(read()?);
                *self.kept() = Some((mechanism, Arc::clone(&read)));
                Ok((read, true))
            }
        }
    }

    fn kept(&self) -> MutexGuard<'_, Option<(String, Arc<Read>)>> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A mechanism in words, complete but for the values of its parameters.
fn but_for_values(model: &Model) -> String {
    let mut mechanism = model.derivation.mechanism.clone();
    for parameter in &mut mechanism.parameters {
        parameter.nominal = 0.0;
    }
    mechanism.identified_base.clear();
    format!("{mechanism:?}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_values_of_parameters_leave_a_reading_as_it_is() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../model-spec/models/");
        let text = std::fs::read_to_string(format!("{folder}spidermill.toml")).unwrap();
        let readings = Readings::default();
        let is_new = |from: &str, to: &str| {
            assert!(text.contains(from), "{from}");
            let model = Model::from_text("a.toml", &text.replace(from, to)).unwrap();
            let read = || Ok([Vec::new(), Vec::new()]);
            readings.of(&model, false, read).unwrap().1
        };
        assert!(is_new("schema", "schema"));
        assert!(!is_new("12.4560", "22.4560") && !is_new("0.565", "0.6"));
        // Geometry, names and effects do not.
        assert!(is_new("d1 = { value = 1.13", "d1 = { value = 1.14"));
        assert!(is_new("spindle_left", "left"));
        let model = Model::from_text("a.toml", &text).unwrap();
        let read = || Ok([Vec::new(), Vec::new()]);
        assert!(readings.of(&model, false, read).unwrap().1);
        assert!(!readings.of(&model, false, read).unwrap().1);
        assert!(readings.of(&model, true, read).unwrap().1);
    }
}
