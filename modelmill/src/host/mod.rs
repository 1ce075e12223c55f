//! What verbs get from outside: files, libraries of effects, and somebody who watches.

pub(crate) mod kinds_of_files;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use modelmill_boundary::files::{DiskFiles, FileSource};
use modelmill_identify::{FitFile, RecordingNote};
use modelmill_spec::edit::{EditFailure, EditedModel, NewEffect, add_to_model};
use modelmill_spec::{EffectKind, LoadedModel};

use crate::error::{Error, Outcome};
use crate::progress::{JobHandle, ProgressListener, SilentProgress, run_job};

/// Where files come from, which kinds of effects there are besides the library's, and who hears what goes on.
///
/// Every model keeps the host that it was read by, so that what a verb reads later, such as a variant with one more effect,
/// comes from the same place.
#[derive(Clone)]
pub struct Host {
    files: Arc<dyn FileSource>,
    libraries: Vec<PathBuf>,
    is_at_values: bool,
    progress: Arc<dyn ProgressListener>,
}

impl Default for Host {
    fn default() -> Self {
        Self {
            files: Arc::new(DiskFiles::default()),
            libraries: Vec::new(),
            is_at_values: false,
            progress: Arc::new(SilentProgress),
        }
    }
}

impl Host {
    /// Files come from disk, there are no further libraries, and nobody listens.
    pub fn new() -> Self {
        Self::default()
    }

    /// With files from elsewhere, such as memory.
    #[must_use]
    pub fn with_files(mut self, files: Arc<dyn FileSource>) -> Self {
        self.files = files;
        self
    }

    /// Where files come from.
    pub fn files(&self) -> &dyn FileSource {
        &*self.files
    }

    /// With further libraries of kinds of effects, for every model that is read.
    #[must_use]
    pub fn with_libraries(mut self, paths: impl IntoIterator<Item = PathBuf>) -> Self {
        self.libraries.extend(paths);
        self
    }

    /// With somebody who hears what goes on and may stop it.
    #[must_use]
    pub fn with_progress(mut self, progress: Arc<dyn ProgressListener>) -> Self {
        self.progress = progress;
        self
    }

    /// Whether models are derived for their files' values alone: constants stand as numbers ([`modelmill_spec::Mechanism::at_values`]),
    /// so that fewer base parameters remain where geometry is special, and emitted code has no geometry to change.
    #[must_use]
    pub fn at_values(mut self, is_wanted: bool) -> Self {
        self.is_at_values = is_wanted;
        self
    }

    /// Whether models are derived for their files' values alone.
    pub fn is_at_values(&self) -> bool {
        self.is_at_values
    }

    /// The libraries that every model may use.
    pub fn libraries(&self) -> &[PathBuf] {
        &self.libraries
    }

    /// The kinds of effects of the program's library and of the host's.
    ///
    /// Fails with every finding about the host's libraries, each with its place.
    pub fn kinds(&self) -> Outcome<Vec<EffectKind>> {
        Ok(modelmill_spec::kinds_with(&self.libraries, self.files())?)
    }

    /// Reads a model file and validates it, without deriving it.
    ///
    /// Fails with every finding about the files, each with its place.
    pub fn load(&self, path: &Path) -> Outcome<LoadedModel> {
        run_job(
            &*self.progress,
            &format!("reading {}", path.display()),
            0,
            |_| modelmill_spec::load_file_with(path, &self.libraries, self.files()),
        )?
        .map_err(|failure| match kinds_of_files::file_kind(self, path) {
            Some(kind) => Error::input(format!(
                "{} is {kind}; a model file (TOML) is expected, such as those in model-spec/models{}",
                path.display(),
                if kind.contains("rig") {
                    ". `reduce` makes one of a rig and a plan"
                } else {
                    ""
                }
            )),
            None => failure.into(),
        })
    }

    /// Validates the text of a model file; `path` is what messages call it, and where the paths in it start.
    ///
    /// Fails with every finding about the files, each with its place.
    pub fn load_text(&self, path: &Path, text: &str) -> Outcome<LoadedModel> {
        let name = path.to_string_lossy();
        Ok(modelmill_spec::load_with(
            &name,
            text,
            &self.libraries,
            self.files(),
        )?)
    }

    /// Adds an effect to the text of a model file, keeping its comments and layout; the result is validated.
    ///
    /// Fails when the file with the effect has no meaning: unknown kind or place, a value that is missing, an effect twice.
    pub fn edit(&self, path: &str, text: &str, effect: &NewEffect) -> Outcome<EditedModel> {
        add_to_model(path, text, effect, &self.libraries, self.files()).map_err(|failure| {
            match failure {
                EditFailure::Effect(says) => Error::input(format!("{path}: {says}")),
                EditFailure::Model(failure) => (*failure).into(),
            }
        })
    }

    /// Runs a job that somebody may watch and stop.
    ///
    /// Fails with [`Error::Cancelled`] if somebody asked it to stop.
    pub fn run_job<T>(
        &self,
        what: &str,
        total: usize,
        work: impl FnOnce(&JobHandle) -> T,
    ) -> Outcome<T> {
        run_job(&*self.progress, what, total, work)
    }

    /// Reads a fit, as [`crate::identify::Identification::json`] wrote it.
    ///
    /// Fails with the place of what is wrong with the file.
    pub fn fit(&self, path: &Path) -> Outcome<FitFile> {
        Ok(FitFile::read_from(self.files(), path)?)
    }

    /// Reads a fit from its text; `file` is what messages call it.
    ///
    /// Fails with the place of what is wrong with it.
    pub fn fit_of_text(&self, text: &str, file: &str) -> Outcome<FitFile> {
        Ok(FitFile::parse(text, file)?)
    }

    /// Passes a remark on to whoever watches.
    pub(crate) fn note(&self, note: &RecordingNote) {
        self.progress.on_note(note);
    }
}
