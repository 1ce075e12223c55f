//! The comparison of the text with a variant: the saved model, or another model file. Two models go in; the changes
//! between them come out, with forces, power and errors along the recordings.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use modelmill::model::ModelChanges;
use modelmill::print::RemedyWording;
use modelmill::recording::PreparedRecording;
use modelmill::variants::VariantComparison;
use modelmill::{Error, Host, Model, Outcome};
use serde_json::{Value, json};

use crate::readings::{RecordingCache, SessionRecordings};

/// Longest model file that is compared with the text, bytes.
const LONGEST: u64 = 4 << 20;

/// A cache of the other model and of its recordings, valid while the files do not change.
#[derive(Default)]
pub(crate) struct VariantCache {
    /// The last other model.
    kept: Mutex<Option<CachedVariant>>,
    /// Recordings as the other model reads them.
    readings: RecordingCache,
}

/// A derived model, with the contents of its files at that time.
#[derive(Clone)]
struct CachedVariant {
    /// Path of the model file.
    path: PathBuf,
    /// Contents of all files of the model; `None` for a file that could not be read.
    files: Vec<Option<Vec<u8>>>,
    /// The derived model.
    model: Model,
}

impl VariantCache {
    /// The model of another file, derived again if any of its files has changed.
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

    /// The contents of the cache; a panic of another thread does not lose them.
    fn lock_cache(&self) -> MutexGuard<'_, Option<CachedVariant>> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// View of the changes from `before` to `after`, also along recordings if there are any. `read` reads recordings
    /// for `before`, `after_read` gives those of `after`. If the models cannot be compared along recordings, `refused`
    /// has the reason.
    pub(crate) fn comparison_view(
        &self,
        before: &Model,
        after: &Model,
        wording: &dyn RemedyWording,
        read: impl FnOnce() -> Outcome<SessionRecordings>,
        after_read: impl FnOnce() -> Outcome<Arc<SessionRecordings>>,
    ) -> Outcome<Value> {
        let mut view_json = ModelChanges::from_models(before, after).json(before, after);
        let along = (|| {
            VariantComparison::check([before, after])?;
            let first = self.readings.recordings_for(before, false, read)?.0;
            let second = after_read()?;
            let runs = [&first, &second].map(|read| read.iter().flatten().collect::<Vec<&PreparedRecording>>());
            if runs[0].is_empty() {
                return Ok(Value::Null);
            }
            Ok(VariantComparison::along_recordings([before, after], [&runs[0], &runs[1]])?.json(wording))
        })();
        match along {
            Ok(along) => view_json["along"] = along,
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            Err(error) => view_json["refused"] = json!(error.format_for(wording)),
        }
        Ok(view_json)
    }
}

/// Names of the other model files in the folder of a model, those that can be loaded.
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

/// Contents of all files of a model; `None` for a file that cannot be read.
fn file_contents(host: &Host, model: &Model) -> Vec<Option<Vec<u8>>> {
    let paths = model.files();
    paths.map(|path| host.files().read(path, LONGEST).ok()).collect()
}
