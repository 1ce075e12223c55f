//! What the library gets from its caller: files, libraries of effects, and a listener for progress.

pub(crate) mod kinds_of_files;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use modelmill_boundary::files::{DiskFiles, FileSource};
use modelmill_identify::{FitFile, RecordingNote};
use modelmill_spec::edit::{EditFailure, EditedModel, NewEffect, add_to_model};
use modelmill_spec::{EffectKind, LoadedModel};

use crate::error::{Error, Outcome};
use crate::progress::{JobHandle, ProgressListener, SilentProgress, run_job};

/// Source of files, libraries of effects in addition to the built-in one, and the listener for progress and notes.
///
/// Every model keeps the host that read it, so that later reads, such as those of a variant with one more effect, use
/// the same source.
#[derive(Clone)]
pub struct Host {
    /// Source of all files.
    files: Arc<dyn FileSource>,
    /// Paths of libraries of effects in addition to the built-in one.
    libraries: Vec<PathBuf>,
    /// Whether constants are replaced by their numbers before the derivation.
    is_at_values: bool,
    /// Receives progress and notes.
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
    /// A host that reads files from disk, with no further libraries and no listener.
    pub fn new() -> Self {
        Self::default()
    }

    /// The host with another source of files, such as memory.
    ///
    /// ```
    /// use std::sync::Arc;
    /// use modelmill::Host;
    /// use modelmill::files::MemoryFiles;
    ///
    /// let bytes = std::fs::read("../model-spec/models/two_link.toml").unwrap();
    /// let files = MemoryFiles::default().with_file("arm.toml", bytes);
    /// let arm = Host::new().with_files(Arc::new(files)).model("arm.toml")?;
    /// assert_eq!(arm.name, "arm");
    /// # Ok::<(), modelmill::Error>(())
    /// ```
    #[must_use]
    pub fn with_files(mut self, files: Arc<dyn FileSource>) -> Self {
        self.files = files;
        self
    }

    /// The source of files.
    pub fn files(&self) -> &dyn FileSource {
        &*self.files
    }

    /// The host with further libraries of effect kinds, for every model that it reads.
    #[must_use]
    pub fn with_libraries(mut self, paths: impl IntoIterator<Item = PathBuf>) -> Self {
        self.libraries.extend(paths);
        self
    }

    /// The host with a listener, which receives progress and notes and can stop jobs.
    ///
    /// ```
    /// use std::sync::Arc;
    /// use modelmill::Host;
    /// use modelmill::progress::{JobHandle, ProgressListener};
    ///
    /// struct PrintJobs;
    ///
    /// impl ProgressListener for PrintJobs {
    ///     fn on_job_start(&self, what: &str, _total: usize, _job: &Arc<JobHandle>) {
    ///         println!("{what}");
    ///     }
    /// }
    ///
    /// let host = Host::new().with_progress(Arc::new(PrintJobs));
    /// let arm = host.model("../model-spec/models/two_link.toml")?;
    /// # Ok::<(), modelmill::Error>(())
    /// ```
    #[must_use]
    pub fn with_progress(mut self, progress: Arc<dyn ProgressListener>) -> Self {
        self.progress = progress;
        self
    }

    /// Whether models are derived for the values of their files alone. Constants are then numbers
    /// ([`modelmill_spec::Mechanism::with_numeric_constants`]): special geometry leaves fewer base parameters, and
    /// emitted code has no geometry to change.
    #[must_use]
    pub fn at_values(mut self, is_wanted: bool) -> Self {
        self.is_at_values = is_wanted;
        self
    }

    /// Whether models are derived for the values of their files alone.
    pub fn is_at_values(&self) -> bool {
        self.is_at_values
    }

    /// Paths of the further libraries of effects.
    pub fn libraries(&self) -> &[PathBuf] {
        &self.libraries
    }

    /// The kinds of effects of the built-in library and of the host's libraries.
    ///
    /// Fails with every finding about the host's libraries, each with its place.
    ///
    /// ```
    /// let kinds = modelmill::Host::new().kinds()?;
    /// assert!(kinds.iter().any(|kind| kind.name == "coulomb_friction"));
    /// # Ok::<(), modelmill::Error>(())
    /// ```
    pub fn kinds(&self) -> Outcome<Vec<EffectKind>> {
        Ok(modelmill_spec::kinds_with(&self.libraries, self.files())?)
    }

    /// Reads a model file and validates it, without deriving it.
    ///
    /// Fails with every finding about the files, each with its place.
    pub fn load(&self, path: &Path) -> Outcome<LoadedModel> {
        run_job(&*self.progress, &format!("reading {}", path.display()), 0, |_| {
            modelmill_spec::load_file_with(path, &self.libraries, self.files())
        })?
        // A valid file of another kind gets a message that names the kind.
        .map_err(|failure| match kinds_of_files::file_kind(self, path) {
            Some(kind) => Error::input(format!(
                "{} is {kind}; a model file (TOML) is expected, such as those in model-spec/models{}",
                path.display(),
                if kind.contains("rig") {
                    ". `reduce` makes one from a rig and a plan"
                } else {
                    ""
                }
            )),
            None => failure.into(),
        })
    }

    /// Validates the text of a model file; `path` is its name in messages, and paths in the text are relative to it.
    ///
    /// Fails with every finding about the files, each with its place.
    pub fn load_text(&self, path: &Path, text: &str) -> Outcome<LoadedModel> {
        let name = path.to_string_lossy();
        Ok(modelmill_spec::load_with(&name, text, &self.libraries, self.files())?)
    }

    /// Adds an effect to the text of a model file, keeping its comments and layout; the result is validated.
    ///
    /// Fails when the edited file is invalid: unknown kind or place, a missing value, or an effect given twice.
    pub fn edit(&self, path: &str, text: &str, effect: &NewEffect) -> Outcome<EditedModel> {
        add_to_model(path, text, effect, &self.libraries, self.files()).map_err(|failure| match failure {
            EditFailure::Effect(says) => Error::input(format!("{path}: {says}")),
            EditFailure::Model(failure) => (*failure).into(),
        })
    }

    /// Runs a job whose progress the listener receives and which it can stop. `total` is the number of steps, 0 if
    /// unknown.
    ///
    /// Fails with [`Error::Cancelled`] if it was requested to stop.
    pub fn run_job<T>(&self, what: &str, total: usize, work: impl FnOnce(&JobHandle) -> T) -> Outcome<T> {
        run_job(&*self.progress, what, total, work)
    }

    /// Reads a fit file, as `identify` writes it.
    ///
    /// Fails with the place of what is wrong with the file.
    pub fn fit(&self, path: &Path) -> Outcome<FitFile> {
        Ok(FitFile::read_from(self.files(), path)?)
    }

    /// Reads a fit from its text; `file` is its name in messages.
    ///
    /// Fails with the place of what is wrong with it.
    pub fn fit_of_text(&self, text: &str, file: &str) -> Outcome<FitFile> {
        Ok(FitFile::parse(text, file)?)
    }

    /// Passes a note to the listener.
    pub(crate) fn note(&self, note: &RecordingNote) {
        self.progress.on_note(note);
    }
}
