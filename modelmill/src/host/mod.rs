//! The interface between the library and its caller: files, libraries of effects, and a listener for progress.

pub(crate) mod kinds_of_files;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use modelmill_boundary::files::{DiskFiles, FileSource};
use modelmill_identify::{FitFile, RecordingNote};
use modelmill_spec::edit::{EditFailure, EditedModel, NewEffect, add_to_model};
use modelmill_spec::{EffectKind, LoadedModel};

use crate::error::{Error, Outcome};
use crate::progress::{JobHandle, ProgressListener, ProgressWithoutNotes, SilentProgress, run_job};

/// Reads files, provides libraries of effects, and passes progress and notes to a listener. The built-in library of
/// effects is always available.
///
/// Every model keeps the host with which it was read. Files that are read for it later, such as recordings, come from
/// the same source.
#[derive(Clone)]
pub struct Host {
    /// Source of all files.
    files: Arc<dyn FileSource>,
    /// Paths of libraries of effects in addition to the built-in one.
    libraries: Vec<PathBuf>,
    /// Whether constants are replaced by their numeric values before the derivation.
    has_numeric_constants: bool,
    /// Receives progress and notes.
    progress: Arc<dyn ProgressListener>,
    /// When all jobs end.
    deadline: Option<Instant>,
}

impl Default for Host {
    fn default() -> Self {
        Self {
            files: Arc::new(DiskFiles::default()),
            libraries: Vec::new(),
            has_numeric_constants: false,
            progress: Arc::new(SilentProgress),
            deadline: None,
        }
    }
}

impl Host {
    /// A host that reads files from disk, uses only the built-in library of effects, and has no listener.
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

    /// The host with further libraries of effects. All models that this host reads can use them.
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

    /// The host with a listener that receives no notes, only jobs. Use it for a second model if its notes would repeat those
    /// of the first one.
    #[must_use]
    pub fn without_notes(mut self) -> Self {
        self.progress = Arc::new(ProgressWithoutNotes(self.progress));
        self
    }

    /// The host with a time limit, counted from this call: all jobs fail with [`Error::Cancelled`] once it is over.
    /// Derivations, searches and jobs that count their steps stop at the next step. All other jobs run to their end and
    /// then fail.
    ///
    /// ```
    /// use std::time::Duration;
    /// use modelmill::{Error, Host};
    ///
    /// let host = Host::new().with_time_limit(Duration::ZERO);
    /// let found = host.model("../model-spec/models/two_link.toml");
    /// assert!(matches!(found, Err(Error::Cancelled)));
    /// ```
    #[must_use]
    pub fn with_time_limit(mut self, limit: Duration) -> Self {
        self.deadline = Instant::now().checked_add(limit);
        self
    }

    /// Sets whether constants are replaced by their numeric values before the derivation
    /// ([`modelmill_spec::Mechanism::with_numeric_constants`]).
    ///
    /// If they are replaced, the model is valid only for the values of its file. Fewer base parameters may remain, for
    /// example if lengths are zero or equal. Generated code then has no inputs for lengths and angles of the geometry.
    #[must_use]
    pub fn with_numeric_constants(mut self, is_wanted: bool) -> Self {
        self.has_numeric_constants = is_wanted;
        self
    }

    /// Whether constants are replaced by their numeric values before the derivation.
    pub fn has_numeric_constants(&self) -> bool {
        self.has_numeric_constants
    }

    /// Paths of the further libraries of effects.
    pub fn libraries(&self) -> &[PathBuf] {
        &self.libraries
    }

    /// The kinds of effects of the built-in library and of the host's libraries.
    ///
    /// Fails with all errors and warnings of the host's libraries, each with its line and column.
    ///
    /// ```
    /// let kinds = modelmill::Host::new().kinds()?;
    /// assert!(kinds.iter().any(|kind| kind.name == "coulomb_friction"));
    /// # Ok::<(), modelmill::Error>(())
    /// ```
    pub fn kinds(&self) -> Outcome<Vec<EffectKind>> {
        Ok(modelmill_spec::kinds_with(&self.libraries, self.files())?)
    }

    /// Reads a model file and validates it, without deriving its equations.
    ///
    /// Fails with all errors and warnings of the files, each with its line and column.
    pub fn load(&self, path: &Path) -> Outcome<LoadedModel> {
        run_job(
            &*self.progress,
            self.deadline,
            &format!("reading {}", path.display()),
            0,
            |_| modelmill_spec::load_file_with(path, &self.libraries, self.files()),
        )?
        // A valid file of another kind gets a message that names the kind.
        .map_err(|failure| match kinds_of_files::file_kind(self, path) {
            // The file itself may be readable a moment later, or without a file that it extends.
            Some(kind) if kind != kinds_of_files::MODEL_FILE => Error::input(format!(
                "{} is {kind}; a model file (TOML) is expected, such as those in model-spec/models{}",
                path.display(),
                if kind.contains("rig") {
                    ". `reduce` makes one from a rig and a plan"
                } else {
                    ""
                }
            )),
            _ => failure.into(),
        })
    }

    /// Validates the text of a model file. The file is not read from `path`: the path is its name in messages, and
    /// paths in the text are relative to it.
    ///
    /// Fails with all errors and warnings of the files, each with its line and column.
    pub fn load_text(&self, path: &Path, text: &str) -> Outcome<LoadedModel> {
        let name = path.to_string_lossy();
        Ok(modelmill_spec::load_with(&name, text, &self.libraries, self.files())?)
    }

    /// Adds an effect to the text of a model file, keeping its comments and layout; the result is validated.
    ///
    /// Fails when the edited file is invalid: for example, a kind or place is unknown, a value is missing, or the file
    /// already has the effect.
    pub fn edit(&self, path: &str, text: &str, effect: &NewEffect) -> Outcome<EditedModel> {
        add_to_model(path, text, effect, &self.libraries, self.files()).map_err(|failure| match failure {
            EditFailure::Effect(says) => Error::input(format!("{path}: {says}")),
            EditFailure::Model(failure) => (*failure).into(),
        })
    }

    /// Runs a job. The listener receives its progress and can cancel it. `what` is the name of the job, and `total` its
    /// number of steps, 0 if unknown.
    ///
    /// Fails with [`Error::Cancelled`] if the job was cancelled, or the host's time limit is over.
    pub fn run_job<T>(&self, what: &str, total: usize, work: impl FnOnce(&JobHandle) -> T) -> Outcome<T> {
        run_job(&*self.progress, self.deadline, what, total, work)
    }

    /// Reads a fit file: the JSON that `identify` writes.
    ///
    /// Fails if the file cannot be read or is not such a file; the error states the place of the fault.
    pub fn fit(&self, path: &Path) -> Outcome<FitFile> {
        Ok(FitFile::read_from(self.files(), path)?)
    }

    /// Reads a fit from the text of its file. `file` is only used in messages, as the name of the fit.
    ///
    /// Fails as [`Host::fit`] does.
    pub fn fit_of_text(&self, text: &str, file: &str) -> Outcome<FitFile> {
        Ok(FitFile::parse(text, file)?)
    }

    /// Passes a note to the listener.
    pub(crate) fn note(&self, note: &RecordingNote) {
        self.progress.on_note(note);
    }
}
