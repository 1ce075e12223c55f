//! A session: the text of a model file, the model derived from it, and the jobs on it. Work is done outside of the
//! lock. A result is kept only if the text has not changed since the work started.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use modelmill::diagnose::{FixedParameters, ModelVersion};
use modelmill::files::FileError;
use modelmill::identify::EstimatorOptions;
use modelmill::model::PageFormat;
use modelmill::picture::{DrawingStyle, DriveArrow, ERROR_SHADES, PictureOptions};
use modelmill::recording::PreparedRecording;
use modelmill::segment::RecordingSegment;
use modelmill::{Error, Host, Model, Outcome, report};
use serde::Deserialize;
use serde_json::{Value, json};

mod diagnosis;
mod excitation;
mod session_steps;

use diagnosis::DiagnosisJob;
use excitation::ExcitationJob;
pub(crate) use excitation::KeepTrajectoryRequest;
use session_steps::SessionSteps;

use crate::document::EditedDocument;
use crate::options::{ExcitationSettings, Options, WorkbenchCommands, WorkbenchStep};
use crate::readings::{RecordingCache, SessionRecordings};
use crate::surrounding_files::SessionEnvironment;
use crate::variant::{self, VariantCache};
use crate::view;

/// Longest model file that is edited, bytes.
pub(crate) const LONGEST: u64 = 4 << 20;
/// Largest number of poses of a recording for the moving picture.
const POSES: usize = 600;

/// The session of one model file.
pub(crate) struct WorkbenchSession {
    /// Libraries, options of the derivation, and the source of files.
    host: Host,
    /// Files of the session and how recordings are read.
    options: Options,
    /// Wording of commands and advice.
    commands: Arc<dyn WorkbenchCommands>,
    /// Text, model and diagnosis.
    state: Mutex<SessionState>,
    /// The search for an excitation.
    planning: Mutex<ExcitationJob>,
    /// Files, clock and threads.
    surroundings: Arc<dyn SessionEnvironment>,
    /// Counts all changes of which pages are notified.
    version: AtomicU64,
    /// Recordings as the edited model reads them.
    readings: RecordingCache,
    /// The model that the text is compared with.
    variant: VariantCache,
}

/// The part of a session that the lock protects.
struct SessionState {
    /// The edited text and the text on disk.
    document: EditedDocument,
    /// The last derivation; its revision may be older than the text.
    derived: DerivedRevision,
    /// The model of the text as it was last read or saved; `None` if that text has faults.
    saved: Option<Model>,
    /// Contents of the other files that the saved model uses; `None` for a file that could not be read.
    other_files: Vec<Option<Vec<u8>>>,
    /// Why the file cannot be read any more.
    unreadable: Option<String>,
    /// Errors after each step of the session.
    steps: SessionSteps,
    /// The last diagnosis.
    diagnosis: DiagnosisJob,
}

/// The derivation of one revision of the text.
#[derive(Clone)]
struct DerivedRevision {
    /// The revision of the text.
    revision: u64,
    /// The model, or the faults of the text.
    found: Arc<Result<Model, Error>>,
    /// Time that the derivation took, s.
    seconds: f64,
}

/// Body of `picture`: pose, view and contents of the picture.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct PictureRequest {
    /// Values of active coordinates, rad or m; the others are nominal.
    at: Vec<(String, f64)>,
    /// Azimuth and elevation, degrees.
    from: Option<[f64; 2]>,
    /// Whether to draw names.
    names: bool,
    /// Whether to draw the axes of frames.
    frames: bool,
    /// Whether to draw the saved model below it as a shadow.
    shadow: bool,
    /// Another model to draw as the shadow, by its name in `models`.
    beside: Option<String>,
    /// Drives with their forces and errors, as shares of the largest force with the same unit.
    loads: Vec<(String, f64, f64)>,
}

impl WorkbenchSession {
    /// Reads the model file and derives it. Faults of the text are part of the session, not a failure.
    ///
    /// Fails if the file cannot be read.
    pub(crate) fn open(
        host: &Host,
        options: Options,
        commands: Arc<dyn WorkbenchCommands>,
        surroundings: Arc<dyn SessionEnvironment>,
    ) -> Outcome<Self> {
        let host = Host::new()
            .with_libraries(host.libraries().to_vec())
            .with_numeric_constants(host.has_numeric_constants())
            .with_files(surroundings.files());
        let text = read_model_text(&host, &options.model).map_err(Error::input)?;
        let document = EditedDocument::new(text, options.first + 1);
        let version = AtomicU64::new(options.first + 1);
        surroundings.notify_change(options.first + 1);
        let now = derive_revision(
            &host,
            &*surroundings,
            &options.model,
            document.text(),
            document.revision(),
        );
        let saved = now.found.as_ref().as_ref().ok().cloned();
        let state = SessionState {
            other_files: other_file_contents(&host, saved.as_ref()),
            document,
            derived: now,
            saved,
            unreadable: None,
            steps: SessionSteps::new(options.first + 1),
            diagnosis: DiagnosisJob::starting_from(options.first),
        };
        Ok(Self {
            host,
            planning: Mutex::new(ExcitationJob::new(options.first)),
            options,
            commands,
            state: Mutex::new(state),
            surroundings,
            version,
            readings: RecordingCache::default(),
            variant: VariantCache::default(),
        })
    }

    /// Path of the model file, for titles and messages.
    pub(crate) fn name(&self) -> String {
        self.options.model.display().to_string()
    }

    /// The state under its lock; a panic of another thread does not lose it.
    fn state(&self) -> MutexGuard<'_, SessionState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counts a change and notifies all pages.
    fn notify_pages(&self) {
        let version = 1 + self.version.fetch_add(1, Ordering::Relaxed);
        self.surroundings.notify_change(version);
    }

    /// The complete view: the text, its derivation, the steps of the session, and the commands of the panes.
    pub(crate) fn view(&self) -> Value {
        let state = self.state();
        let name = self.name();
        let now = &state.derived;
        let (model, saved) = (now.found.as_ref().as_ref().ok(), state.saved.as_ref());
        let mut view_json = view::derivation_view(&now.found, &name, &*self.commands);
        view_json["model"] = model.map_or(Value::Null, |model| view::equations(model, saved));
        view_json["version"] = json!(self.version.load(Ordering::Relaxed));
        view_json["revision"] = json!(state.document.revision());
        view_json["derived"] = json!(now.revision);
        view_json["seconds"] = json!(now.seconds);
        view_json["file"] = json!(name);
        view_json["text"] = json!(state.document.text());
        view_json["changed"] = json!(state.document.is_changed());
        view_json["conflict"] = json!(state.document.is_in_conflict());
        view_json["unreadable"] = json!(state.unreadable);
        view_json["data"] = json!(!self.options.data.is_empty());
        view_json["opened"] = json!(self.options.first);
        view_json["beside"] = json!(self.options.beside.is_some());
        view_json["session_steps"] = state.steps.view();
        view_json["commands"] = json!({
            "picture": self.commands.step_command(WorkbenchStep::Picture),
            "equations": self.commands.step_command(WorkbenchStep::Equations),
            "compare": self.commands.step_command(WorkbenchStep::Compare),
            "identify": self.commands.step_command(WorkbenchStep::Identify),
            "diagnose": self.commands.step_command(WorkbenchStep::Diagnose),
            "excite": self.commands.excite_command(&ExcitationSettings::default()),
        });
        view_json
    }

    /// Accepts an edit of revision `base` and derives the new text; `None` if the text has changed since. With `did`,
    /// the edit is listed as a step of the session under this name.
    pub(crate) fn edit(&self, base: u64, text: &str, did: Option<&str>) -> Option<Value> {
        {
            let mut state = self.state();
            let before = state.document.revision();
            if did.is_some() {
                state.steps.end_typing(before);
            }
            if !state.document.edit(base, text) {
                return None;
            }
            if state.document.revision() == before {
                drop(state);
                return Some(self.view());
            }
            if let Some(what) = did {
                state.record_step(what);
            }
        }
        self.derive();
        Some(self.view())
    }

    /// Derives the current text, and keeps the result if the text has not changed meanwhile.
    fn derive(&self) {
        let (text, revision) = {
            let state = self.state();
            (state.document.text().to_owned(), state.document.revision())
        };
        let now = derive_revision(&self.host, &*self.surroundings, &self.options.model, &text, revision);
        let mut state = self.state();
        if state.document.revision() == revision {
            if !state.document.is_changed() {
                state.saved = now.found.as_ref().as_ref().ok().cloned();
                state.other_files = other_file_contents(&self.host, state.saved.as_ref());
            }
            state.derived = now;
        }
        drop(state);
        self.notify_pages();
    }

    /// Writes the text to the file atomically. `base` is the revision that the page shows: another one is not saved,
    /// and the result is `None`.
    ///
    /// Fails with a sentence if another program changed the file meanwhile, or the file cannot be written.
    pub(crate) fn save(&self, base: Option<u64>) -> Result<Option<Value>, String> {
        let disk = read_model_text(&self.host, &self.options.model);
        let mut state = self.state();
        if base.is_some_and(|base| base != state.document.revision()) {
            return Ok(None);
        }
        if let Ok(disk) = disk {
            state.document.update_from_disk(&disk);
        }
        if state.document.is_in_conflict() {
            drop(state);
            self.notify_pages();
            return Err(format!(
                "{} was changed by another program; choose one of the two texts, then save",
                self.name()
            ));
        }
        if state.document.is_changed() {
            let bytes = state.document.text().as_bytes();
            (self.surroundings.write(&self.options.model, bytes))
                .map_err(|error| format!("nothing is saved: {error}"))?;
            state.document.mark_saved();
            if state.derived.revision == state.document.revision() {
                state.saved = state.derived.found.as_ref().as_ref().ok().cloned();
                state.other_files = other_file_contents(&self.host, state.saved.as_ref());
            }
            state.unreadable = None;
            state.record_step("edited and saved");
        }
        drop(state);
        self.notify_pages();
        Ok(Some(self.view()))
    }

    /// Resolves a conflict with another program: its text replaces that of the page, or may be overwritten by the next
    /// save.
    pub(crate) fn resolve_conflict(&self, take_theirs: bool) -> Value {
        {
            let mut state = self.state();
            if take_theirs {
                state.document.accept_outside_text();
                state.record_step("changed outside");
            } else {
                state.document.keep_own_text();
            }
        }
        self.derive();
        self.view()
    }

    /// Checks whether another program changed the model file or one that it uses; derives again if so.
    #[cfg(not(target_family = "wasm"))]
    pub(crate) fn check_disk(&self) {
        use crate::document::DiskChange;

        let disk = read_model_text(&self.host, &self.options.model);
        let mut state = self.state();
        let unreadable = disk.as_ref().err().map(ToString::to_string);
        let is_news = state.unreadable != unreadable;
        state.unreadable = unreadable;
        let seen = disk.map_or(DiskChange::Unchanged, |disk| state.document.update_from_disk(&disk));
        if seen == DiskChange::Reloaded {
            state.record_step("changed outside");
        }
        let saved = state.saved.clone();
        let before = state.other_files.clone();
        drop(state);
        let others_changed = other_file_contents(&self.host, saved.as_ref()) != before;
        if seen == DiskChange::Reloaded || others_changed {
            self.derive();
            let mut state = self.state();
            state.other_files = other_file_contents(&self.host, state.saved.as_ref());
        } else if seen == DiskChange::Conflict || is_news {
            self.notify_pages();
        }
    }

    /// The model of the last derivation, with its revision; fails if the text has faults.
    fn model(&self) -> Result<(Model, u64), String> {
        let now = self.state().derived.clone();
        match now.found.as_ref() {
            Ok(model) => Ok((model.clone(), now.revision)),
            Err(_) => Err("the text has faults; correct those that are listed below it".to_owned()),
        }
    }

    /// The mechanism as SVG, with another model below it as a shadow if requested and possible.
    pub(crate) fn picture(&self, seeing: &PictureRequest) -> Result<String, String> {
        let (model, _) = self.model()?;
        let drawing = PictureOptions {
            at: seeing.at.clone(),
            from: seeing.from.map(|from| from.map(f64::to_radians)),
            style: DrawingStyle {
                names: seeing.names,
                frames: seeing.frames,
                ..DrawingStyle::default()
            },
            loads: (seeing.loads.iter())
                .map(|(drive, force, error)| DriveArrow {
                    drive: drive.clone(),
                    force: *force,
                    error: *error,
                })
                .collect(),
        };
        let shadow = match &seeing.beside {
            Some(name) => Some(self.comparison_model(Some(name))?),
            None => {
                let saved = self.state().saved.clone();
                saved.filter(|saved| seeing.shadow && saved.text() != model.text())
            }
        };
        let to_text = |error| self.error_text(&error);
        match model.picture(&drawing, shadow.as_ref()) {
            // The other mechanism may have other coordinates, or may not reach this pose; then it is left out.
            Err(_) if shadow.is_some() => model.picture(&drawing, None).map_err(to_text),
            drawn => drawn.map_err(to_text),
        }
    }

    /// The page of equations as HTML.
    pub(crate) fn equations(&self) -> Result<String, String> {
        let (model, _) = self.model()?;
        let written = model.equations(PageFormat::Html).map_err(|e| self.error_text(&e))?;
        Ok(written.text)
    }

    /// Reads the recordings for fit and validation with a model.
    fn recordings(&self, model: &Model) -> Outcome<SessionRecordings> {
        let [fit, check] = [&self.options.data, &self.options.check].map(|runs| {
            let paths = runs.iter().map(|run| run.iter().map(PathBuf::as_path).collect());
            paths.collect::<Vec<Vec<&Path>>>()
        });
        let [fit, check] = model.prepare_recordings([&fit, &check], &self.options.reading);
        Ok([
            fit.into_iter().collect::<Outcome<_>>()?,
            check.into_iter().collect::<Outcome<_>>()?,
        ])
    }

    /// Errors along the recordings, with the values of the file and with identified ones. `with_places` adds the
    /// regions with the largest error, `is_afresh` reads the recordings again.
    pub(crate) fn compare(&self, with_places: bool, is_afresh: bool) -> Result<Value, String> {
        let (model, revision) = self.model()?;
        let mut view_json = (|| {
            let read = || self.recordings(&model);
            let (read, is_read) = self.readings.recordings_for(&model, is_afresh, read)?;
            let [fit, check] = read.each_ref().map(|all| all.iter().collect::<Vec<_>>());
            let identified = model.identify(&fit, &check, &EstimatorOptions::default())?;
            let mut view_json = view::errors(&identified, &read, &*self.commands);
            view_json["afresh"] = json!(is_read);
            if with_places {
                view_json["compared"] = model.compare(&fit, &model.values)?.json("nominal", &*self.commands)?;
            }
            Ok(view_json)
        })()
        .map_err(|error| self.error_text(&error))?;
        view_json["revision"] = json!(revision);
        let mut state = self.state();
        if state.document.revision() == revision {
            let errors = json!({ "nominal": relative_errors(&view_json["nominal"]), "identified": relative_errors(&view_json["identified"]) });
            if state.steps.add_errors(revision, errors) {
                drop(state);
                self.notify_pages();
            }
        }
        Ok(view_json)
    }

    /// Curves of forces and errors along the recordings, as HTML: of the text, and of the saved model if it differs.
    pub(crate) fn curves(&self, is_identified: bool) -> Result<String, String> {
        let (model, _) = self.model()?;
        let saved = self.state().saved.clone();
        let version = |model: Model| -> Outcome<ModelVersion> {
            let [fit, check] = self.recordings(&model)?;
            let stretches = |all: Vec<PreparedRecording>| all.into_iter().flat_map(|one| one.segments);
            let held = if is_identified {
                FixedParameters::Known
            } else {
                FixedParameters::All
            };
            ModelVersion::new(model, stretches(fit).collect(), stretches(check).collect(), held)
        };
        let to_text = |error| self.error_text(&error);
        // Curves of models with different drives cannot be compared.
        let other = saved.filter(|saved| saved.text() != model.text() && saved.row_names() == model.row_names());
        let edited = version(model).map_err(to_text)?;
        Ok(match other.map(version) {
            Some(Ok(saved)) => report::curves(&saved, Some(&edited), ["model as saved", "as edited"]),
            _ => report::curves(&edited, None, ["model", ""]),
        })
    }

    /// Models that the text can be compared with: those of the model's folder, and the one named at the start.
    pub(crate) fn models(&self) -> Value {
        let named = self.options.beside.as_ref().map(|path| path.display().to_string());
        let mut models = variant::models_in_folder(&self.host, &self.options.model);
        models.retain(|name| {
            let near = self.options.model.with_file_name(name);
            self.options.beside.as_ref() != Some(&near)
        });
        models.splice(0..0, named.clone());
        json!({ "models": models, "named": named })
    }

    /// The model to compare with, by its name in [`Self::models`]; without a name the saved one.
    fn comparison_model(&self, name: Option<&str>) -> Result<Model, String> {
        let Some(name) = name else {
            let saved = self.state().saved.clone();
            return saved.ok_or_else(|| "the saved file has faults, so there is nothing to compare with".to_owned());
        };
        let path = self.path_of(name);
        let found = self.variant.model(&self.host, &path);
        found.map_err(|error| self.error_text(&error))
    }

    /// The file of a model of [`Self::models`].
    fn path_of(&self, name: &str) -> PathBuf {
        match &self.options.beside {
            Some(path) if path.display().to_string() == name => path.clone(),
            _ => self.options.model.with_file_name(name),
        }
    }

    /// Changes from another model, or from the saved one, to the text, also along the recordings.
    pub(crate) fn variant(&self, beside: Option<&str>) -> Result<Value, String> {
        let (model, revision) = self.model()?;
        let other = self.comparison_model(beside)?;
        let view_json = self.variant.comparison_view(
            &other,
            &model,
            &*self.commands,
            || self.recordings(&other),
            || {
                let read = || self.recordings(&model);
                Ok(self.readings.recordings_for(&model, false, read)?.0)
            },
        );
        let mut view_json = view_json.map_err(|error| self.error_text(&error))?;
        view_json["revision"] = json!(revision);
        view_json["same"] = json!(other.text() == model.text());
        view_json["command"] = json!(beside.and_then(|name| self.commands.variant_command(&self.path_of(name))));
        Ok(view_json)
    }

    /// Poses along the recordings over time, with measured forces and the errors of the model if these can be computed.
    pub(crate) fn motion(&self) -> Result<Value, String> {
        let (model, _) = self.model()?;
        let [fit, check] = self.recordings(&model).map_err(|e| self.error_text(&e))?;
        let names = model.active_coordinates();
        let drives = model.row_names();
        let units: Vec<&str> = (0..drives.len()).map(|drive| model.force_unit(drive)).collect();
        let stretches = |all: Vec<PreparedRecording>| -> Vec<RecordingSegment> {
            all.into_iter().flat_map(|one| one.segments).collect()
        };
        let [fit, check] = [fit, check].map(stretches);
        let mut runs: Vec<Value> = (fit.iter().chain(&check))
            .map(|one| {
                let run = &one.run;
                let q: Vec<_> = run.q.iter().map(|q| thin_out(q)).collect();
                json!({ "file": run.file, "time": thin_out(&run.time), "q": q })
            })
            .collect();
        // Without forces the picture still moves, but has no arrows.
        if let Ok(version) = ModelVersion::new(model, fit, check, FixedParameters::All) {
            for (view_json, run) in runs.iter_mut().zip(&version.runs) {
                let all = 0..drives.len();
                view_json["forces"] = json!({
                    "time": thin_out(&run.time),
                    "measured": run.measured.iter().map(|f| thin_out(f)).collect::<Vec<_>>(),
                    "error": all.map(|d| thin_out(&run.error(d))).collect::<Vec<_>>(),
                });
            }
        }
        Ok(json!({ "names": names, "drives": drives, "units": units, "shades": ERROR_SHADES, "runs": runs }))
    }

    /// The text of an error, with commands in the wording of the user.
    fn error_text(&self, error: &Error) -> String {
        error.format_for(&*self.commands)
    }
}

impl SessionState {
    /// Records a step that led to the current text.
    fn record_step(&mut self, what: &str) {
        self.steps.record_step(self.document.revision(), what);
    }
}

/// Every n-th value, at most [`POSES`] of them.
fn thin_out(all: &[f64]) -> Vec<f64> {
    let step = all.len().div_ceil(POSES).max(1);
    all.iter().copied().step_by(step).collect()
}

/// The text of a model file, up to [`LONGEST`] bytes.
fn read_model_text(host: &Host, path: &Path) -> Result<String, FileError> {
    host.files().read_text(path, LONGEST)
}

/// Derives a text, and measures the time.
fn derive_revision(
    host: &Host,
    surroundings: &dyn SessionEnvironment,
    path: &Path,
    text: &str,
    revision: u64,
) -> DerivedRevision {
    let since = surroundings.seconds();
    let found = host
        .load_text(path, text)
        .and_then(|loaded| host.derive(&path.display().to_string(), loaded));
    DerivedRevision {
        revision,
        found: Arc::new(found),
        seconds: surroundings.seconds() - since,
    }
}

/// Contents of the other files that a model uses; `None` for a file that cannot be read.
fn other_file_contents(host: &Host, model: Option<&Model>) -> Vec<Option<Vec<u8>>> {
    let paths = model.into_iter().flat_map(|model| model.files().skip(1));
    paths.map(|path| host.files().read(path, LONGEST).ok()).collect()
}

/// The relative errors (nrms) of fit and validation.
fn relative_errors(figures: &Value) -> Value {
    json!({ "fit": figures["fit"]["nrms"], "check": figures["check"]["nrms"] })
}
