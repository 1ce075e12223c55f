//! A cache of prepared recordings. They depend on the mechanism but not on the values of its parameters, so they are
//! kept while only values change: states and regressors are then the same. Remarks on a recording may depend on values;
//! a caller that needs these reads afresh.
//!
//! Decision: reading and checking a recording takes four times as long as everything else between a keystroke and the
//! error. It is repeated when typing stops, because remarks on a recording may depend on values.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use modelmill::recording::PreparedRecording;
use modelmill::{Model, Outcome};

/// Recordings for the fit and for validation, in this order.
pub(crate) type SessionRecordings = [Vec<PreparedRecording>; 2];

/// The recordings as they were last read.
#[derive(Default)]
pub(crate) struct RecordingCache {
    /// Key of the mechanism for which they were read, and the recordings.
    kept: Mutex<Option<(String, Arc<SessionRecordings>)>>,
}

impl RecordingCache {
    /// Recordings for `model`, and whether they were read now. `read` reads them if the cache has none or `is_afresh`
    /// is set.
    pub(crate) fn recordings_for(
        &self,
        model: &Model,
        is_afresh: bool,
        read: impl FnOnce() -> Outcome<SessionRecordings>,
    ) -> Outcome<(Arc<SessionRecordings>, bool)> {
        let mechanism = mechanism_key(model);
        let known = self.lock_cache().clone();
        match known {
            Some((same, kept)) if same == mechanism && !is_afresh => Ok((kept, false)),
            _ => {
                let read = Arc::new(read()?);
                *self.lock_cache() = Some((mechanism, Arc::clone(&read)));
                Ok((read, true))
            }
        }
    }

    /// The contents of the cache; a panic of another thread does not lose them.
    fn lock_cache(&self) -> MutexGuard<'_, Option<(String, Arc<SessionRecordings>)>> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A text that is equal for two models if they differ in values of parameters only.
fn mechanism_key(model: &Model) -> String {
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
        let readings = RecordingCache::default();
        let is_new = |from: &str, to: &str| {
            assert!(text.contains(from), "{from}");
            let model = Model::from_text("a.toml", &text.replace(from, to)).unwrap();
            let read = || Ok([Vec::new(), Vec::new()]);
            readings.recordings_for(&model, false, read).unwrap().1
        };
        assert!(is_new("schema", "schema"));
        assert!(!is_new("12.4560", "22.4560") && !is_new("0.565", "0.6"));
        // Geometry, names and effects do not.
        assert!(is_new("d1 = { value = 1.13", "d1 = { value = 1.14"));
        assert!(is_new("spindle_left", "left"));
        let model = Model::from_text("a.toml", &text).unwrap();
        let read = || Ok([Vec::new(), Vec::new()]);
        assert!(readings.recordings_for(&model, false, read).unwrap().1);
        assert!(!readings.recordings_for(&model, false, read).unwrap().1);
        assert!(readings.recordings_for(&model, true, read).unwrap().1);
    }
}
