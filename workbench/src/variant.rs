//! The variant that the text is held beside: the model as it was saved, or another model file, with what changed between both
//! and what it costs along the recordings.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use modelmill::model::Changes;
use modelmill::print::RemedySpelling;
use modelmill::recording::Recording;
use modelmill::variants::Variants;
use modelmill::{Error, Host, Model, Outcome};
use serde_json::{Value, json};

use crate::readings::{Read, Readings};

/// Longest model file that is held beside the text, bytes.
const LONGEST: u64 = 4 << 20;

/// What was read and derived of variants, kept while nothing changes on which it depends.
#[derive(Default)]
pub(crate) struct Variant {
    kept: Mutex<Option<Kept>>,
    readings: Readings,
}

/// The other model, with its files as they were.
#[derive(Clone)]
struct Kept {
    path: PathBuf,
    files: Vec<Option<Vec<u8>>>,
    model: Model,
}

impl Variant {
    /// A model file beside the text, derived anew when any file of it has changed.
    pub(crate) fn model(&self, host: &Host, path: &Path) -> Outcome<Model> {
        let known = self.kept().clone();
        if let Some(known) = known
            && known.path == path
            && known.files == contents(host, &known.model)
        {
            return Ok(known.model);
        }
        let model = host.model(path)?;
        let files = contents(host, &model);
        *self.kept() = Some(Kept {
            path: path.to_owned(),
            files,
            model: model.clone(),
        });
        Ok(model)
    }

    fn kept(&self) -> MutexGuard<'_, Option<Kept>> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What changes from `before` to `after`, and along recordings, if there are any: `read` reads them for `before`, `after`
    /// has read them. Where both cannot be held beside each other, `refused` says why.
    pub(crate) fn told(
        &self,
        before: &Model,
        after: &Model,
        spelling: &dyn RemedySpelling,
        read: impl FnOnce() -> Outcome<Read>,
        after_read: impl FnOnce() -> Outcome<Arc<Read>>,
    ) -> Outcome<Value> {
        let mut told = Changes::between(before, after).json(before, after);
        let along = (|| {
            Variants::check([before, after])?;
            let first = self.readings.of(before, false, read)?.0;
            let second = after_read()?;
            let runs =
                [&first, &second].map(|read| read.iter().flatten().collect::<Vec<&Recording>>());
            if runs[0].is_empty() {
                return Ok(Value::Null);
            }
            Ok(Variants::along([before, after], [&runs[0], &runs[1]])?.json(spelling))
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
pub(crate) fn models_near(host: &Host, model: &Path) -> Vec<String> {
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
fn contents(host: &Host, model: &Model) -> Vec<Option<Vec<u8>>> {
    let paths = model.files();
    paths
        .map(|path| host.files().read(path, LONGEST).ok())
        .collect()
}
