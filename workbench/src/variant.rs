//! The variant that the text is held beside: the model as it was saved, or another model file, with what changed between both
//! and what it costs along the recordings.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use modelmill::model::ModelChanges;
use modelmill::print::RemedySpelling;
use modelmill::recording::PreparedRecording;
use modelmill::variants::VariantComparison;
use modelmill::{Error, Host, Model, Outcome};
use serde_json::{Value, json};

use crate::readings::{RecordingCache, SessionRecordings};

/// Longest model file that is held beside the text, bytes.
const LONGEST: u64 = 4 << 20;

/// What was read and derived of variants, kept while nothing changes on which it depends.
#[derive(Default)]
pub(crate) struct VariantCache {
    kept: Mutex<Option<CachedVariant>>,
    readings: RecordingCache,
}

/// The other model, with its files as they were.
#[derive(Clone)]
struct CachedVariant {
    path: PathBuf,
    files: Vec<Option<Vec<u8>>>,
    model: Model,
}

impl VariantCache {
    /// A model file beside the text, derived anew when any file of it has changed.
    pub(crate) fn model(&self, host: &Host, path: &Path) -> Outcome<Model> {
        let known = self.lock_cache().clone();
        if let Some(known) = known
            && known.path == path
            && known.files == file_contents(host, &known.model)
        {
            return Ok(known.model);
        }
        let model = host.model(path)?;
        let files = file_contents(host, &model);
        *self.lock_cache() = Some(CachedVariant {
            path: path.to_owned(),
            files,
            model: model.clone(),
        });
        Ok(model)
    }

    fn lock_cache(&self) -> MutexGuard<'_, Option<CachedVariant>> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What changes from `before` to `after`, and along recordings, if there are any: `read` reads them for `before`, `after`
    /// has read them. Where both cannot be held beside each other, `refused` says why.
    pub(crate) fn comparison_view(
        &self,
        before: &Model,
        after: &Model,
        spelling: &dyn RemedySpelling,
        read: impl FnOnce() -> Outcome<SessionRecordings>,
        after_read: impl FnOnce() -> Outcome<Arc<SessionRecordings>>,
    ) -> Outcome<Value> {
        let mut told = ModelChanges::from_models(before, after).json(before, after);
        let along = (|| {
            VariantComparison::check([before, after])?;
            let first = self.readings.recordings_for(before, false, read)?.0;
            let second = after_read()?;
            let runs = [&first, &second]
                .map(|read| read.iter().flatten().collect::<Vec<&PreparedRecording>>());
            if runs[0].is_empty() {
                return Ok(Value::Null);
            }
            Ok(
                VariantComparison::along_recordings([before, after], [&runs[0], &runs[1]])?
                    .json(spelling),
            )
        })();
        match along {
            Ok(along) => told["along"] = along,
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            Err(error) => told["refused"] = json!(error.spell(spelling)),
        }
        Ok(told)
    }
}

/// Names of the model files in the folder of a model, without its own.
pub(crate) fn models_in_folder(host: &Host, model: &Path) -> Vec<String> {
    let folder = match model.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    };
    let files = host.files().list(folder).unwrap_or_default();
    let names = files.iter().filter_map(|path| path.file_name());
    names
        .filter(|name| Some(*name) != model.file_name())
        .filter(|name| Path::new(name).extension().is_some_and(|e| e == "toml"))
        .filter(|name| host.load(&model.with_file_name(name)).is_ok())
        .map(|name| name.to_string_lossy().into_owned())
        .collect()
}

/// What stands in the files that a model is made of.
fn file_contents(host: &Host, model: &Model) -> Vec<Option<Vec<u8>>> {
    let paths = model.files();
    paths
        .map(|path| host.files().read(path, LONGEST).ok())
        .collect()
}
