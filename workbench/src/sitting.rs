//! A sitting: the text of a model file, what was derived of it, and what was asked about it. Work is done outside of the lock;
//! what comes back is kept only if the text is still the one that was asked about.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use modelmill::diagnose::{DiagnosisOptions, FixedParameters, ModelVersion};
use modelmill::edit::NewEffect;
use modelmill::files::FileError;
use modelmill::identify::EstimatorOptions;
use modelmill::model::PageFormat;
use modelmill::picture::{DrawingStyle, DriveArrow, PictureOptions};
use modelmill::recording::PreparedRecording;
use modelmill::stretch::RecordingSegment;
use modelmill::{Error, Host, Model, Outcome, report};
use serde::Deserialize;
use serde_json::{Value, json};

mod excitation;
mod ladder;

use excitation::ExcitationJob;
pub(crate) use excitation::KeepTrajectoryRequest;
use ladder::ErrorLadder;

use crate::draft::EditedDocument;
use crate::options::{ExcitationSettings, Options, WorkbenchCommands, WorkbenchStep};
use crate::readings::{RecordingCache, SessionRecordings};
use crate::surroundings::SessionEnvironment;
use crate::told;
use crate::variant::{self, VariantCache};
use crate::watch::JobWatch;

/// Longest model file that is edited, bytes.
pub(crate) const LONGEST: u64 = 4 << 20;
/// Poses of a recording along which the picture moves.
const POSES: usize = 600;

/// A model file on the workbench.
pub(crate) struct WorkbenchSession {
    host: Host,
    options: Options,
    commands: Arc<dyn WorkbenchCommands>,
    state: Mutex<SessionState>,
    planning: Mutex<ExcitationJob>,
    surroundings: Arc<dyn SessionEnvironment>,
    /// Counts everything that pages should hear of.
    version: AtomicU64,
    readings: RecordingCache,
    variant: VariantCache,
}

struct SessionState {
    draft: EditedDocument,
    derived: DerivedRevision,
    /// The model as it was last read or saved, if it has a meaning.
    saved: Option<Model>,
    /// Other files that the model is made of, as they were.
    other_files: Vec<Option<Vec<u8>>>,
    /// Why the file cannot be read any more.
    unreadable: Option<String>,
    ladder: ErrorLadder,
    diagnosis: DiagnosisJob,
}

/// What was derived of a revision of the text.
#[derive(Clone)]
struct DerivedRevision {
    revision: u64,
    found: Arc<Result<Model, Error>>,
    seconds: f64,
}

#[derive(Default)]
struct DiagnosisJob {
    /// Counts the diagnoses of the sitting.
    number: u64,
    /// The text that is asked about.
    revision: u64,
    running: Option<(Arc<JobWatch>, f64)>,
    /// What came of the last one.
    answer: Option<Result<Value, String>>,
    was_cancelled: bool,
    entries: Vec<NewEffect>,
}

/// What a page wants to see of the mechanism.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct PictureRequest {
    at: Vec<(String, f64)>,
    /// Azimuth and elevation, degrees.
    from: Option<[f64; 2]>,
    names: bool,
    frames: bool,
    /// The saved model below it as a shadow.
    shadow: bool,
    /// Another model as the shadow, as `models` names it.
    beside: Option<String>,
    /// Drives with their forces and errors, as shares of the largest.
    loads: Vec<(String, f64, f64)>,
}

impl WorkbenchSession {
    /// Reads the model file and derives it, if it has a meaning.
    ///
    /// Fails when it cannot be read.
    pub(crate) fn open(
        host: &Host,
        options: Options,
        commands: Arc<dyn WorkbenchCommands>,
        surroundings: Arc<dyn SessionEnvironment>,
    ) -> Outcome<Self> {
        let host = Host::new()
            .with_libraries(host.libraries().to_vec())
            .at_values(host.is_at_values())
            .with_files(surroundings.files());
        let text = read_model_text(&host, &options.model).map_err(Error::input)?;
        let draft = EditedDocument::new(text, options.first + 1);
        let version = AtomicU64::new(options.first + 1);
        surroundings.notify_change(options.first + 1);
        let now = derive_revision(
            &host,
            &*surroundings,
            &options.model,
            draft.text(),
            draft.revision(),
        );
        let saved = now.found.as_ref().as_ref().ok().cloned();
        let state = SessionState {
            other_files: other_file_contents(&host, saved.as_ref()),
            draft,
            derived: now,
            saved,
            unreadable: None,
            ladder: ErrorLadder::new(options.first + 1),
            diagnosis: DiagnosisJob {
                number: options.first,
                ..DiagnosisJob::default()
            },
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

    /// What the workbench calls the file.
    pub(crate) fn name(&self) -> String {
        self.options.model.display().to_string()
    }

    fn state(&self) -> MutexGuard<'_, SessionState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn notify_pages(&self) {
        let version = 1 + self.version.fetch_add(1, Ordering::Relaxed);
        self.surroundings.notify_change(version);
    }

    /// All that stands at once: the text, what it means, the ladder.
    pub(crate) fn view(&self) -> Value {
        let state = self.state();
        let name = self.name();
        let now = &state.derived;
        let (model, saved) = (now.found.as_ref().as_ref().ok(), state.saved.as_ref());
        let mut told = told::derivation_view(&now.found, &name, &*self.commands);
        told["model"] = model.map_or(Value::Null, |model| told::equations(model, saved));
        told["version"] = json!(self.version.load(Ordering::Relaxed));
        told["revision"] = json!(state.draft.revision());
        told["derived"] = json!(now.revision);
        told["seconds"] = json!(now.seconds);
        told["file"] = json!(name);
        told["text"] = json!(state.draft.text());
        told["changed"] = json!(state.draft.is_changed());
        told["conflict"] = json!(state.draft.is_in_conflict());
        told["unreadable"] = json!(state.unreadable);
        told["data"] = json!(!self.options.data.is_empty());
        told["opened"] = json!(self.options.first);
        told["ladder"] = state.ladder.view();
        told["commands"] = json!({
            "picture": self.commands.step_command(WorkbenchStep::Picture),
            "equations": self.commands.step_command(WorkbenchStep::Equations),
            "compare": self.commands.step_command(WorkbenchStep::Compare),
            "identify": self.commands.step_command(WorkbenchStep::Identify),
            "diagnose": self.commands.step_command(WorkbenchStep::Diagnose),
            "excite": self.commands.excite_command(&ExcitationSettings::default()),
        });
        told
    }

    /// Takes an edit that a page made of revision `base`, and derives it; `None` if the text has changed since. What it did, if
    /// anything is said of it, is to stand on the ladder.
    pub(crate) fn edit(&self, base: u64, text: &str, did: Option<&str>) -> Option<Value> {
        {
            let mut state = self.state();
            let before = state.draft.revision();
            if did.is_some() {
                state.ladder.end_typing(before);
            }
            if !state.draft.edit(base, text) {
                return None;
            }
            if state.draft.revision() == before {
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

    /// Derives the text as it stands.
    fn derive(&self) {
        let (text, revision) = {
            let state = self.state();
            (state.draft.text().to_owned(), state.draft.revision())
        };
        let now = derive_revision(
            &self.host,
            &*self.surroundings,
            &self.options.model,
            &text,
            revision,
        );
        let mut state = self.state();
        if state.draft.revision() == revision {
            if !state.draft.is_changed() {
                state.saved = now.found.as_ref().as_ref().ok().cloned();
                state.other_files = other_file_contents(&self.host, state.saved.as_ref());
            }
            state.derived = now;
        }
        drop(state);
        self.notify_pages();
    }

    /// Writes the text to the file as a whole, unless another program wrote something else there.
    ///
    /// Fails with a sentence when that is so, or the file cannot be written.
    pub(crate) fn save(&self) -> Result<Value, String> {
        let disk = read_model_text(&self.host, &self.options.model);
        let mut state = self.state();
        if let Ok(disk) = disk {
            state.draft.update_from_disk(&disk);
        }
        if state.draft.is_in_conflict() {
            drop(state);
            self.notify_pages();
            return Err(format!(
                "{} was changed by another program; choose which text stays before it is saved",
                self.name()
            ));
        }
        if state.draft.is_changed() {
            let bytes = state.draft.text().as_bytes();
            (self.surroundings.write(&self.options.model, bytes))
                .map_err(|error| format!("nothing is saved: {error}"))?;
            state.draft.mark_saved();
            if state.derived.revision == state.draft.revision() {
                state.saved = state.derived.found.as_ref().as_ref().ok().cloned();
                state.other_files = other_file_contents(&self.host, state.saved.as_ref());
            }
            state.unreadable = None;
            state.record_step("edited and saved");
        }
        drop(state);
        self.notify_pages();
        Ok(self.view())
    }

    /// Ends a conflict with another program: its text is taken, or the text of the page may be saved over it.
    pub(crate) fn resolve_conflict(&self, take_theirs: bool) -> Value {
        {
            let mut state = self.state();
            if take_theirs {
                state.draft.accept_outside_text();
                state.record_step("changed outside");
            } else {
                state.draft.keep_own_text();
            }
        }
        self.derive();
        self.view()
    }

    /// Looks whether another program changed the files.
    #[cfg(not(target_family = "wasm"))]
    pub(crate) fn check_disk(&self) {
        use crate::draft::DiskChange;

        let disk = read_model_text(&self.host, &self.options.model);
        let mut state = self.state();
        let unreadable = disk.as_ref().err().map(ToString::to_string);
        let is_news = state.unreadable != unreadable;
        state.unreadable = unreadable;
        let seen = disk.map_or(DiskChange::Unchanged, |disk| {
            state.draft.update_from_disk(&disk)
        });
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

    /// The model of the text as it stands, with its revision.
    fn model(&self) -> Result<(Model, u64), String> {
        let now = self.state().derived.clone();
        match now.found.as_ref() {
            Ok(model) => Ok((model.clone(), now.revision)),
            Err(_) => Err("the text has no meaning yet; mend what is said beside it".to_owned()),
        }
    }

    /// The mechanism as SVG.
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
        let told = |error| self.error_text(&error);
        match model.picture(&drawing, shadow.as_ref()) {
            // The other mechanism may have other coordinates, or not reach that pose.
            Err(_) if shadow.is_some() => model.picture(&drawing, None).map_err(told),
            drawn => drawn.map_err(told),
        }
    }

    /// The page of equations.
    pub(crate) fn equations(&self) -> Result<String, String> {
        let (model, _) = self.model()?;
        let written = model
            .equations(PageFormat::Html)
            .map_err(|e| self.error_text(&e))?;
        Ok(written.text)
    }

    /// Recordings of fit and check as a model reads them.
    fn recordings(&self, model: &Model) -> Outcome<SessionRecordings> {
        let read = |all: &[Vec<PathBuf>]| -> Outcome<Vec<PreparedRecording>> {
            let one = |run: &Vec<PathBuf>| {
                let paths: Vec<&Path> = run.iter().map(PathBuf::as_path).collect();
                model.recording_of(&paths, &self.options.reading)
            };
            all.iter().map(one).collect()
        };
        Ok([read(&self.options.data)?, read(&self.options.check)?])
    }

    /// Errors along the recordings, with the values of the file and identified; `with_places` says where they live as well,
    /// `is_afresh` has the recordings read again.
    pub(crate) fn compare(&self, with_places: bool, is_afresh: bool) -> Result<Value, String> {
        let (model, revision) = self.model()?;
        let mut told = (|| {
            let read = || self.recordings(&model);
            let (read, is_read) = self.readings.recordings_for(&model, is_afresh, read)?;
            let [fit, check] = read.each_ref().map(|all| all.iter().collect::<Vec<_>>());
            let identified = model.identify(&fit, &check, &EstimatorOptions::default())?;
            let mut told = told::errors(&identified, &read, &*self.commands);
            told["afresh"] = json!(is_read);
            if with_places {
                told["compared"] = model
                    .compare(&fit, &model.nominal)?
                    .json("nominal", &*self.commands)?;
            }
            Ok(told)
        })()
        .map_err(|error| self.error_text(&error))?;
        told["revision"] = json!(revision);
        let mut state = self.state();
        if state.draft.revision() == revision {
            let errors = json!({ "nominal": relative_errors(&told["nominal"]), "identified": relative_errors(&told["identified"]) });
            if state.ladder.add_errors(revision, errors) {
                drop(state);
                self.notify_pages();
            }
        }
        Ok(told)
    }

    /// Curves of forces and errors along the recordings: of the text, and of the saved model where it is another one.
    pub(crate) fn curves(&self, is_identified: bool) -> Result<String, String> {
        let (model, _) = self.model()?;
        let saved = self.state().saved.clone();
        let version = |model: Model| -> Outcome<ModelVersion> {
            let [fit, check] = self.recordings(&model)?;
            let stretches =
                |all: Vec<PreparedRecording>| all.into_iter().flat_map(|one| one.segments);
            let held = if is_identified {
                FixedParameters::Known
            } else {
                FixedParameters::All
            };
            ModelVersion::new(
                model,
                stretches(fit).collect(),
                stretches(check).collect(),
                held,
            )
        };
        let told = |error| self.error_text(&error);
        // A model whose drives are others has other curves.
        let other =
            saved.filter(|saved| saved.text() != model.text() && saved.drives() == model.drives());
        let edited = version(model).map_err(told)?;
        Ok(match other.map(version) {
            Some(Ok(saved)) => {
                report::curves(&saved, Some(&edited), ["model as saved", "as edited"])
            }
            _ => report::curves(&edited, None, ["model", ""]),
        })
    }

    /// Models that the text can be held beside: those of the model's folder, and the one that was named when the workbench
    /// began.
    pub(crate) fn models(&self) -> Value {
        let named = self
            .options
            .beside
            .as_ref()
            .map(|path| path.display().to_string());
        let mut models = variant::models_in_folder(&self.host, &self.options.model);
        models.retain(|name| {
            let near = self.options.model.with_file_name(name);
            self.options.beside.as_ref() != Some(&near)
        });
        models.splice(0..0, named.clone());
        json!({ "models": models, "named": named })
    }

    /// The model that the text is held beside, by its name of [`Self::models`]; the saved one without a name.
    fn comparison_model(&self, name: Option<&str>) -> Result<Model, String> {
        let Some(name) = name else {
            let saved = self.state().saved.clone();
            return saved.ok_or_else(|| "the file as it was saved has no meaning".to_owned());
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

    /// What changes from another model, or from the saved one, to the text, and what it costs along the recordings.
    pub(crate) fn variant(&self, beside: Option<&str>) -> Result<Value, String> {
        let (model, revision) = self.model()?;
        let other = self.comparison_model(beside)?;
        let told = self.variant.comparison_view(
            &other,
            &model,
            &*self.commands,
            || self.recordings(&other),
            || {
                let read = || self.recordings(&model);
                Ok(self.readings.recordings_for(&model, false, read)?.0)
            },
        );
        let mut told = told.map_err(|error| self.error_text(&error))?;
        told["revision"] = json!(revision);
        told["same"] = json!(other.text() == model.text());
        told["command"] =
            json!(beside.and_then(|name| self.commands.variant_command(&self.path_of(name))));
        Ok(told)
    }

    /// Poses along the recordings, in time, with measured forces and what the model misses of them where it can be run.
    pub(crate) fn motion(&self) -> Result<Value, String> {
        let (model, _) = self.model()?;
        let [fit, check] = self.recordings(&model).map_err(|e| self.error_text(&e))?;
        let names = model.active_coordinates();
        let drives = model.drives();
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
        // A picture without arrows is better than none.
        if let Ok(version) = ModelVersion::new(model, fit, check, FixedParameters::All) {
            for (told, run) in runs.iter_mut().zip(&version.runs) {
                let all = 0..drives.len();
                told["forces"] = json!({
                    "time": thin_out(&run.time),
                    "measured": run.measured.iter().map(|f| thin_out(f)).collect::<Vec<_>>(),
                    "error": all.map(|d| thin_out(&run.error(d))).collect::<Vec<_>>(),
                });
            }
        }
        Ok(json!({ "names": names, "drives": drives, "runs": runs }))
    }

    /// Begins a diagnosis of the text as it stands.
    ///
    /// Fails with a sentence when one goes on, or there is nothing to ask about.
    pub(crate) fn diagnose(self: &Arc<Self>) -> Result<Value, String> {
        if self.options.data.is_empty() {
            return Err("there is no recording to find anything in".to_owned());
        }
        self.model()?;
        let watch = Arc::new(JobWatch::new(Arc::clone(&self.surroundings)));
        let (text, number) = {
            let mut state = self.state();
            if state.diagnosis.running.is_some() {
                return Err("a diagnosis goes on; wait for it, or cancel it".to_owned());
            }
            state.diagnosis = DiagnosisJob {
                number: state.diagnosis.number + 1,
                revision: state.draft.revision(),
                running: Some((Arc::clone(&watch), self.surroundings.seconds())),
                ..DiagnosisJob::default()
            };
            (state.draft.text().to_owned(), state.diagnosis.number)
        };
        let sitting = Arc::clone(self);
        let host = self.host.clone().with_progress(Arc::clone(&watch) as _);
        let work = move || {
            // A panic must not leave the page waiting for ever.
            let asked = std::panic::AssertUnwindSafe(|| sitting.run_diagnosis(&host, &text));
            let found = std::panic::catch_unwind(asked).unwrap_or_else(|_| {
                Err(Error::input(
                    "the diagnosis ended by a fault of the program, which is none of yours",
                ))
            });
            sitting.finish_diagnosis(number, found);
        };
        if let Err(error) = self.surroundings.spawn_work(Box::new(work)) {
            self.state().diagnosis.running = None;
            return Err(format!("the diagnosis cannot begin: {error}"));
        }
        Ok(self.diagnosis())
    }

    fn run_diagnosis(&self, host: &Host, text: &str) -> Outcome<(Value, Vec<NewEffect>)> {
        let path = &self.options.model;
        let model = host.derive(&self.name(), host.load_text(path, text)?)?;
        let [fit, check] = self.recordings(&model)?;
        let [fit, check] = [&fit, &check].map(|all| all.iter().collect::<Vec<_>>());
        let findings = model.diagnose(&fit, &check, &DiagnosisOptions::default())?;
        Ok((
            told::findings(&findings, &*self.commands),
            findings.entries_to_add().to_vec(),
        ))
    }

    fn finish_diagnosis(&self, number: u64, found: Outcome<(Value, Vec<NewEffect>)>) {
        let mut state = self.state();
        let diagnosis = &mut state.diagnosis;
        if diagnosis.number != number {
            return;
        }
        diagnosis.running = None;
        match found {
            Ok((told, entries)) => {
                diagnosis.answer = Some(Ok(told));
                diagnosis.entries = entries;
            }
            Err(Error::Cancelled) => diagnosis.was_cancelled = true,
            Err(error) => diagnosis.answer = Some(Err(self.error_text(&error))),
        }
        drop(state);
        self.notify_pages();
    }

    /// Asks the diagnosis that goes on to stop.
    pub(crate) fn cancel(&self) -> Value {
        if let Some((watch, _)) = &self.state().diagnosis.running {
            watch.cancel();
        }
        self.diagnosis()
    }

    /// How far the diagnosis is, or what it found.
    pub(crate) fn diagnosis(&self) -> Value {
        let state = self.state();
        let diagnosis = &state.diagnosis;
        let going = diagnosis.running.as_ref().map(|(watch, since)| {
            let mut told = watch.progress_view();
            told["seconds"] = json!(self.surroundings.seconds() - since);
            told
        });
        json!({
            "number": diagnosis.number,
            "going": going,
            "cancelled": diagnosis.was_cancelled,
            "found": diagnosis.answer.as_ref().and_then(|answer| answer.as_ref().ok()),
            "failed": diagnosis.answer.as_ref().and_then(|answer| answer.as_ref().err()),
            "of_this_text": diagnosis.revision == state.draft.revision(),
        })
    }

    /// Adds an effect that the last diagnosis found to the text, as `add` does to the file.
    ///
    /// Fails with a sentence when there is none, or the text with it has no meaning.
    pub(crate) fn add(&self, entry: usize) -> Result<Value, String> {
        let (text, revision, effect) = {
            let state = self.state();
            let effect = state.diagnosis.entries.get(entry).cloned();
            let effect = effect.ok_or("there is no such finding; diagnose again")?;
            (
                state.draft.text().to_owned(),
                state.draft.revision(),
                effect,
            )
        };
        let edited = self.host.edit(&self.name(), &text, &effect);
        let edited = edited.map_err(|error| self.error_text(&error))?;
        {
            let mut state = self.state();
            let now = state.draft.revision();
            state.ladder.end_typing(now);
            if !state.draft.edit(revision, &edited.text) {
                return Err("the text was changed meanwhile; add it again".to_owned());
            }
            let what = format!(
                "+ {} ({})",
                effect.kind.replace('_', " "),
                effect.at.join(", ")
            );
            state.record_step(&what);
        }
        self.derive();
        Ok(self.view())
    }

    /// What an error says, in the words of the reader.
    fn error_text(&self, error: &Error) -> String {
        error.spell(&*self.commands)
    }
}

impl SessionState {
    /// Something was done to the text as it stands.
    fn record_step(&mut self, what: &str) {
        self.ladder.record_step(self.draft.revision(), what);
    }
}

/// As many values as a moving picture needs.
fn thin_out(all: &[f64]) -> Vec<f64> {
    let step = all.len().div_ceil(POSES).max(1);
    all.iter().copied().step_by(step).collect()
}

fn read_model_text(host: &Host, path: &Path) -> Result<String, FileError> {
    host.files().read_text(path, LONGEST)
}

/// Derives a text, and measures how long that takes.
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

/// What stands in the other files that a model is made of.
fn other_file_contents(host: &Host, model: Option<&Model>) -> Vec<Option<Vec<u8>>> {
    let paths = model.into_iter().flat_map(|model| model.files().skip(1));
    paths
        .map(|path| host.files().read(path, LONGEST).ok())
        .collect()
}

/// Relative errors of fit and check alone.
fn relative_errors(figures: &Value) -> Value {
    json!({ "fit": figures["fit"]["nrms"], "check": figures["check"]["nrms"] })
}
