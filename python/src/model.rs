//! A model with its methods: arguments from Python go to the library; results come back as JSON, text, pages and
//! arrays.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use modelmill::add::{EffectSetting, SettingValue, new_effect};
use modelmill::diagnose::{DiagnosisOptions, FixedParameters};
use modelmill::generate::{CodeLanguage, CodeOptions};
use modelmill::identify::{EstimatorOptions, Instruments};
use modelmill::model::{ModelChanges, PageFormat};
use modelmill::picture::PictureOptions;
use modelmill::recording::{PreparedRecording, RecordingOptions};
use modelmill::report::{page, runs_page};
use modelmill::runs::UnreadRun;
use modelmill::states::{ModelFunction, ModelFunctions, StateSamples};
use modelmill::text::style::TerminalStyle;
use modelmill::variants::VariantComparison;
use modelmill::{Error, FitFile, Host, Model, Outcome, export, import};
use numpy::{PyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::arrays::state_matrix;
use crate::errors::{input_error, library_error};
use crate::inputs::{PassedRecording, PythonInput, RecordingOrError};
use crate::options::{self, ExcitationOptions, Keywords, OptionResult};
use crate::results::{PythonExcitation, PythonRecording, PythonResult, RemarkList, remarks};
use crate::wording::PythonWording;
use crate::work::{JobListener, run_blocking, run_interruptible};

/// Largest number of states for which a function is computed in this thread, without a check for interrupts.
const FEW: usize = 256;
/// Largest robot description that is read, bytes.
const LARGEST_DESCRIPTION: u64 = 16 << 20;

/// A function of Python that is called with name, steps done and number of steps of a job.
pub(crate) type ProgressCallback<'a, 'py> = Option<&'a Bound<'py, PyAny>>;

/// A host, and a listener for its jobs.
pub(crate) fn new_host(libraries: Vec<PathBuf>, at_values: bool) -> (Host, Arc<JobListener>) {
    let listener = Arc::new(JobListener::default());
    let host = Host::new()
        .with_libraries(libraries)
        .with_numeric_constants(at_values)
        .with_progress(Arc::clone(&listener) as Arc<_>);
    (host, listener)
}

/// Valid options, or an exception.
fn valid_options<T>(py: Python<'_>, says: OptionResult<T>) -> PyResult<T> {
    says.map_err(|says| input_error(py, &says))
}

/// Reads a model file.
#[pyfunction]
pub(crate) fn load(
    py: Python<'_>,
    path: PathBuf,
    libraries: Vec<PathBuf>,
    at_values: bool,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<CoreModel> {
    let (host, listener) = new_host(libraries, at_values);
    let model = run_interruptible(py, &listener, progress.as_ref(), || host.model(&path))?;
    Ok(CoreModel::new(model, listener))
}

/// Derives a model from the text of a model file.
#[pyfunction]
pub(crate) fn load_text(
    py: Python<'_>,
    name: &str,
    text: &str,
    libraries: Vec<PathBuf>,
    at_values: bool,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<CoreModel> {
    let (host, listener) = new_host(libraries, at_values);
    let model = run_interruptible(py, &listener, progress.as_ref(), || {
        host.derive(name, host.load_text(Path::new(name), text)?)
    })?;
    Ok(CoreModel::new(model, listener))
}

/// Converts a robot description, given as text or as a file, into the text of a model file; also returns the remarks.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "each is a keyword of Python")]
pub(crate) fn import_text(
    py: Python<'_>,
    name: &str,
    text: Option<String>,
    floating: bool,
    round_angles: bool,
    known_bodies: bool,
    closures: Option<PathBuf>,
    pose: Vec<(String, f64)>,
    locked: Vec<(String, f64)>,
    kept: Option<Vec<String>>,
) -> PyResult<(String, RemarkList)> {
    let (host, listener) = new_host(Vec::new(), false);
    // Text of a file of limited size.
    let read = |path: &Path| {
        let read = host.files().read_text(path, LARGEST_DESCRIPTION);
        read.map_err(|error| Error::input(format!("{} cannot be read: {}", path.display(), error.fault)))
    };
    let imported = run_interruptible(py, &listener, None, || {
        let (text, path) = match text {
            Some(text) => (text, None),
            None => (read(Path::new(name))?, Some(Path::new(name))),
        };
        // Without a given file, the closures of a URDF are those of a `robot.yaml` in the same folder.
        let beside = path.filter(|path| path.extension().is_some_and(|e| e == "urdf"));
        let beside = beside.map(|path| path.with_file_name("robot.yaml"));
        let closures = closures.or(beside.filter(|path| path.is_file()));
        let closures = closures.map(|path| read(&path)).transpose()?;
        let options = import::Options {
            floating,
            round_angles,
            known_bodies,
            closures: closures.as_deref(),
            pose: &pose,
            locked: &locked,
            kept: kept.as_deref(),
            meshes: None,
        };
        host.import(name, &text, &options)
    })?;
    Ok((imported.model, remarks(&imported.notes)))
}

/// A model that was read and derived.
#[pyclass(frozen, name = "Model")]
#[derive(Clone)]
pub(crate) struct CoreModel {
    /// The derived model.
    pub(crate) model: Model,
    /// Its functions at states, shared by all copies.
    pub(crate) functions: Arc<ModelFunctions>,
    /// Number of active coordinates.
    pub(crate) n_active: usize,
    /// Number of drives.
    pub(crate) n_drives: usize,
    /// Listener for the jobs of its host.
    listener: Arc<JobListener>,
}

impl CoreModel {
    /// A model with the listener of its host.
    fn new(model: Model, listener: Arc<JobListener>) -> Self {
        Self {
            functions: Arc::new(model.functions()),
            n_active: model.active_coordinates().len(),
            n_drives: model.row_names().len(),
            model,
            listener,
        }
    }

    /// Reads a fit from a text with a name, or from a file.
    pub(crate) fn fit(&self, text: Option<&str>, name: &str) -> Outcome<FitFile> {
        let host = self.model.host();
        match text {
            Some(text) => host.fit_of_text(text, name),
            None => host.fit(Path::new(name)),
        }
    }

    /// Reads recordings and prepares them together. Forces that a recording lacks are computed from the signals of the
    /// actuators if the model has some.
    fn prepare_inputs(
        &self,
        py: Python<'_>,
        runs: [Vec<PassedRecording>; 2],
        progress: ProgressCallback<'_, '_>,
    ) -> PyResult<[Vec<Outcome<Arc<PreparedRecording>>>; 2]> {
        let model = &self.model;
        let prepared = self.run_interruptible(py, progress, || {
            let read = runs.map(|run| run.into_iter().map(|one| one.read(model)).collect());
            Ok(model.prepare_together(model.add_actuator_forces(read)))
        })?;
        Ok(prepared.map(|run| run.into_iter().map(|one| one.map(Arc::new)).collect()))
    }

    /// Another model of the same host.
    pub(crate) fn with_same_host(&self, model: Model) -> Self {
        Self::new(model, Arc::clone(&self.listener))
    }

    /// Runs work on this model in a separate thread, with progress and interrupts.
    pub(crate) fn run_interruptible<T: Send>(
        &self,
        py: Python<'_>,
        progress: ProgressCallback<'_, '_>,
        job: impl FnOnce() -> Outcome<T> + Send,
    ) -> PyResult<T> {
        run_interruptible(py, &self.listener, progress, job)
    }
}

/// A function by the name of its method.
pub(crate) fn function_by_name(py: Python<'_>, function: &str) -> PyResult<ModelFunction> {
    Ok(match function {
        "inverse_dynamics" => ModelFunction::InverseDynamics,
        "regressor" => ModelFunction::Regressor,
        "mass_matrix" => ModelFunction::MassMatrix,
        "bias" => ModelFunction::Bias,
        "forward_dynamics" => ModelFunction::ForwardDynamics,
        "reactions" => ModelFunction::Reactions,
        other => return Err(input_error(py, &format!("there is no function `{other}`"))),
    })
}

/// The recordings of the library in objects of Python.
fn recordings(all: &[PyRef<'_, PythonRecording>]) -> Vec<Arc<PreparedRecording>> {
    all.iter().map(|one| Arc::clone(&one.recording)).collect()
}

/// References to recordings, as methods of the library take them.
fn borrow_recordings(all: &[Arc<PreparedRecording>]) -> Vec<&PreparedRecording> {
    all.iter().map(|one| &**one).collect()
}

#[pymethods]
impl CoreModel {
    /// Name of the model.
    #[getter]
    fn name(&self) -> &str {
        &self.model.name
    }

    /// Path of the model file, or the name of the text.
    #[getter]
    fn path(&self) -> &str {
        &self.model.path
    }

    /// Text of the model file.
    #[getter]
    fn text(&self) -> &str {
        self.model.text()
    }

    /// Title of the model, if the file has one.
    #[getter]
    fn title(&self) -> Option<&str> {
        self.model.derivation.mechanism.title.as_deref()
    }

    /// Whether the model file has actuators.
    #[getter]
    fn has_actuators(&self) -> bool {
        !self.model.actuators().is_empty()
    }

    /// Names of the active coordinates.
    #[getter]
    fn coordinates(&self) -> Vec<String> {
        self.model.active_coordinates()
    }

    /// Names of the passive coordinates.
    #[getter]
    fn passive(&self) -> Vec<String> {
        self.model.passive_coordinates()
    }

    /// Names of the drives.
    #[getter]
    fn drives(&self) -> Vec<String> {
        self.model.row_names()
    }

    /// Nominal values of the base parameters, in SI units.
    #[getter]
    fn nominal<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.model.values)
    }

    /// Name, retained product, expression, unit, nominal value, whether that is given.
    #[getter]
    fn base(&self) -> Vec<(String, String, String, String, f64, bool)> {
        let infos = self.model.parameter_infos();
        let all = self.model.base.iter().zip(infos).enumerate();
        all.map(|(k, (base, info))| {
            (
                base.name.clone(),
                base.retained.clone(),
                base.expression.clone(),
                info.unit,
                self.model.values[k],
                self.model.has_values(k),
            )
        })
        .collect()
    }

    /// Warnings about the model file, and remarks on the model.
    #[getter]
    fn notes(&self) -> RemarkList {
        let of_file = self.model.loaded.warnings.iter();
        let of_file = of_file.map(|one| ("warning", one.message.clone()));
        of_file.chain(remarks(&self.model.notes)).collect()
    }

    /// Remarks on missing nominal values.
    #[getter]
    fn nominal_notes(&self) -> RemarkList {
        remarks(&self.model.base_parameter_values().notes)
    }

    /// The equations as text in a format.
    fn equations(&self, py: Python<'_>, format: &str) -> PyResult<String> {
        let format = match format {
            "text" => Some(PageFormat::Text),
            "markdown" => Some(PageFormat::Markdown),
            "latex" => Some(PageFormat::Latex),
            "html" => Some(PageFormat::Html),
            "json" => None,
            other => {
                let says = format!("format={other:?}: expected text, markdown, latex, html or json");
                return Err(input_error(py, &says));
            }
        };
        let model = &self.model;
        let written = self.run_interruptible(py, None, || match format {
            Some(format) => model.equations(format),
            None => model.equations_json(),
        })?;
        Ok(written.text)
    }

    /// Checks the model.
    fn check(&self, py: Python<'_>) -> PyResult<PythonResult> {
        let checked = self.run_interruptible(py, None, || self.model.check())?;
        Ok(PythonResult::new(
            &checked.json(&PythonWording),
            &checked.text_with_next_step(TerminalStyle::PLAIN, &PythonWording),
            RemarkList::new(),
        ))
    }

    /// The picture of the mechanism as SVG, at given coordinates and from a direction.
    fn picture(&self, py: Python<'_>, at: Vec<(String, f64)>, view: Option<[f64; 2]>) -> PyResult<String> {
        let drawing = PictureOptions {
            at,
            from: view,
            ..PictureOptions::default()
        };
        self.run_interruptible(py, None, || self.model.picture(&drawing, None))
    }

    /// Names of the components of the reactions, and of those that are not determined.
    fn reaction_names(&self, py: Python<'_>) -> PyResult<(Vec<String>, Vec<String>)> {
        self.run_interruptible(py, None, || self.functions.reactions())
    }

    /// Evaluates a function at states. Returns its numbers state by state and row by row, and its shape.
    #[allow(clippy::too_many_arguments, reason = "each is an array of Python")]
    #[pyo3(name = "at")]
    fn evaluate_at<'py>(
        &self,
        py: Python<'py>,
        function: &str,
        q: PyReadonlyArray2<'py, f64>,
        qd: Option<PyReadonlyArray2<'py, f64>>,
        qdd: Option<PyReadonlyArray2<'py, f64>>,
        forces: Option<PyReadonlyArray2<'py, f64>>,
        values: Vec<f64>,
    ) -> PyResult<(Bound<'py, PyArray1<f64>>, [usize; 2])> {
        let function = function_by_name(py, function)?;
        let given = StateSamples {
            q: state_matrix(py, &q)?,
            qd: qd.as_ref().map(|array| state_matrix(py, array)).transpose()?,
            qdd: qdd.as_ref().map(|array| state_matrix(py, array)).transpose()?,
            forces: forces.as_ref().map(|array| state_matrix(py, array)).transpose()?,
        };
        // A thread costs more time than a few states.
        let few = given.q.numbers.len() <= FEW * given.q.width;
        let functions = &self.functions;
        let job = || {
            let shape = functions.shape(function)?;
            Ok((functions.evaluate_at(function, &given, &values)?, shape))
        };
        let (found, shape) = if few {
            run_blocking(py, job)?
        } else {
            self.run_interruptible(py, None, job)?
        };
        Ok((PyArray1::from_vec(py, found), shape))
    }

    /// The C source of a function for many states, and the shape of its result.
    fn vectors_c(&self, py: Python<'_>, function: &str) -> PyResult<(String, [usize; 2])> {
        let function = function_by_name(py, function)?;
        self.run_interruptible(py, None, || {
            Ok((self.functions.vectors_c(function)?, self.functions.shape(function)?))
        })
    }

    /// Prepares recordings of one machine together: those of a fit, and those of its validation. Each is a recording
    /// that was prepared before, or a name with a source and options. Returns a recording or an exception for each.
    fn prepare_together<'py>(
        &self,
        py: Python<'py>,
        runs: [Vec<PythonInput<'py>>; 2],
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<[Vec<RecordingOrError>; 2]> {
        let input = |one: PythonInput<'py>| match one {
            PythonInput::Prepared(one) => Ok(PassedRecording::Read(one.recording.before_preparation())),
            PythonInput::Source(name, source, options) => PassedRecording::new(py, &name, source, &options),
        };
        let [fit, check] = runs.map(|run| run.into_iter().map(input).collect::<PyResult<Vec<_>>>());
        let prepared = self.prepare_inputs(py, [fit?, check?], progress.as_ref())?;
        let answer = |one: Outcome<Arc<PreparedRecording>>| match one {
            Ok(recording) => (Some(PythonRecording { recording }), None),
            Err(error) => (None, Some(library_error(py, &error))),
        };
        Ok(prepared.map(|run| run.into_iter().map(answer).collect()))
    }

    /// Compares measured forces with those of the model.
    fn compare(
        &self,
        py: Python<'_>,
        data: Vec<PyRef<'_, PythonRecording>>,
        values: Vec<f64>,
        name: &str,
        progress: Option<Bound<'_, PyAny>>,
    ) -> PyResult<PythonResult> {
        let data = recordings(&data);
        self.run_interruptible(py, progress.as_ref(), || {
            let found = self.model.compare(&borrow_recordings(&data), &values)?;
            let text = found.text(name, TerminalStyle::PLAIN, &PythonWording);
            let json = found.json(name, &PythonWording)?;
            Ok(PythonResult::new(&json, &text, remarks(&found.notes)))
        })
    }

    /// Estimates the base parameters.
    #[allow(clippy::too_many_arguments, reason = "each is a keyword of Python")]
    fn identify(
        &self,
        py: Python<'_>,
        data: Vec<PyRef<'_, PythonRecording>>,
        check: Vec<PyRef<'_, PythonRecording>>,
        options: Keywords<EstimatorOptions>,
        reading: Keywords<RecordingOptions>,
        instruments: Vec<PyRef<'_, PythonRecording>>,
        instrument_period: Option<f64>,
        progress: Option<Bound<'_, PyAny>>,
    ) -> PyResult<PythonResult> {
        let estimation = EstimatorOptions {
            standstill: valid_options(py, reading.options())?.standstill.bound(),
            ..valid_options(py, options.options())?
        };
        let (data, check) = (recordings(&data), recordings(&check));
        let instruments = recordings(&instruments);
        self.run_interruptible(py, progress.as_ref(), || {
            let recorded = borrow_recordings(&instruments);
            let instruments = match instrument_period {
                Some(period) => Instruments::Period(period),
                None if recorded.is_empty() => Instruments::None,
                None => Instruments::Recordings(&recorded),
            };
            let (data, check) = (borrow_recordings(&data), borrow_recordings(&check));
            let found = self.model.identify_with(&data, &instruments, &check, &estimation)?;
            let text = found.text(&self.model, TerminalStyle::PLAIN, &PythonWording);
            let json = found.json(&self.model, &PythonWording)?;
            let told = PythonResult::new(&json, &text, remarks(&found.notes));
            Ok(told.with_values(found.values()))
        })
    }

    /// Searches for missing effects; with `held` all parameters keep their values.
    fn diagnose(
        &self,
        py: Python<'_>,
        data: Vec<PyRef<'_, PythonRecording>>,
        check: Vec<PyRef<'_, PythonRecording>>,
        held: bool,
        progress: Option<Bound<'_, PyAny>>,
    ) -> PyResult<PythonResult> {
        let (data, check) = (recordings(&data), recordings(&check));
        let question = DiagnosisOptions {
            fixed: if held {
                FixedParameters::All
            } else {
                FixedParameters::Known
            },
            ..DiagnosisOptions::default()
        };
        self.run_interruptible(py, progress.as_ref(), || {
            let found = self
                .model
                .diagnose(&borrow_recordings(&data), &borrow_recordings(&check), &question)?;
            let wording = PythonWording;
            let text = found.text(TerminalStyle::PLAIN, &wording).join("\n");
            // The model with the effects that were found.
            let better = match found.entries_to_add() {
                [] => None,
                entries => Some(self.with_same_host(self.model.with_added_effects(entries)?)),
            };
            Ok(PythonResult::new(&found.json(&wording), &text, remarks(&found.notes))
                .with_page(page(&found, &wording)?)
                .with_model(better))
        })
    }

    /// Compares runs with the first one; `unread` are those that could not be read, with index, name and reason.
    fn runs(
        &self,
        py: Python<'_>,
        data: Vec<PyRef<'_, PythonRecording>>,
        unread: Vec<(usize, String, String)>,
        per_run: Vec<String>,
        loads: Vec<String>,
        progress: Option<Bound<'_, PyAny>>,
    ) -> PyResult<PythonResult> {
        let what = valid_options(py, options::runs_options(&per_run, &loads))?;
        let mut all: Vec<Result<Arc<PreparedRecording>, UnreadRun>> = recordings(&data).into_iter().map(Ok).collect();
        // Runs that could not be read keep their places in the sequence.
        for (place, file, says) in unread {
            let error = Error::input(says);
            all.insert(place.min(all.len()), Err(UnreadRun { file, error }));
        }
        self.run_interruptible(py, progress.as_ref(), || {
            let found = self.model.runs(all, &what)?;
            let text = found.text(TerminalStyle::PLAIN, &PythonWording);
            let json = found.json(&PythonWording);
            let told = PythonResult::new(&json, &text, remarks(&found.notes));
            Ok(told.with_page(runs_page(&found, &PythonWording)))
        })
    }

    /// Plans a trajectory; with recordings it distinguishes an effect from others.
    fn excite(
        &self,
        py: Python<'_>,
        options: ExcitationOptions,
        data: Vec<PyRef<'_, PythonRecording>>,
        progress: Option<Bound<'_, PyAny>>,
    ) -> PyResult<PythonExcitation> {
        let request = valid_options(py, options.request())?;
        let data = recordings(&data);
        let found = self.run_interruptible(py, progress.as_ref(), || {
            self.model.excite(&request, &borrow_recordings(&data))
        })?;
        Ok(PythonExcitation { found })
    }

    /// The model with an effect, which has parameters of its own at each place or shares them among the places; settings
    /// are values, or names of parameters.
    #[allow(clippy::too_many_arguments, reason = "each is a keyword of Python")]
    fn with_effect(
        &self,
        py: Python<'_>,
        kind: &str,
        at: Vec<String>,
        is_at_each: bool,
        without: Vec<String>,
        values: Vec<(String, f64)>,
        names: Vec<(String, String)>,
    ) -> PyResult<Self> {
        let values = values
            .into_iter()
            .map(|(symbol, value)| (symbol, SettingValue::Value(value)));
        let names = names
            .into_iter()
            .map(|(symbol, name)| (symbol, SettingValue::Name(name)));
        let settings = values.chain(names);
        let settings: Vec<EffectSetting> = settings
            .map(|(symbol, value)| EffectSetting { symbol, value })
            .collect();
        let model = self.run_interruptible(py, None, || {
            let mut effect = new_effect(&self.model.loaded.kinds, kind, &at, &settings)?;
            (effect.is_at_each, effect.without) = (is_at_each, without);
            self.model.with_added_effects(&[effect])
        })?;
        Ok(self.with_same_host(model))
    }

    /// The model with other values of its base parameters.
    fn with_values(&self, py: Python<'_>, values: Vec<f64>) -> PyResult<Self> {
        if values.len() != self.model.base.len() || values.iter().any(|value| !value.is_finite()) {
            let says = format!(
                "{} finite values are expected, one for each base parameter",
                self.model.base.len()
            );
            return Err(input_error(py, &says));
        }
        Ok(self.with_same_host(self.model.with_values(&values)))
    }

    /// Values of a fit that `identify` wrote to a file, and whether it has gains of actuators.
    fn values_of_fit(&self, py: Python<'_>, path: PathBuf) -> PyResult<(Vec<f64>, bool, RemarkList)> {
        let found = run_blocking(py, || {
            let fit = self.model.host().fit(&path)?;
            self.model.values_of(&fit, &path.display().to_string())
        })?;
        Ok((found.values, !found.gains.is_empty(), remarks(&found.notes)))
    }

    /// Physical parameters from a fit, which is a text with a name or the path of a file.
    fn interpret(&self, py: Python<'_>, fit: Option<&str>, name: &str, unknown: Vec<String>) -> PyResult<PythonResult> {
        self.run_interruptible(py, None, || {
            let found = self.model.interpret(&self.fit(fit, name)?, name, &unknown)?;
            let text = found.text(TerminalStyle::PLAIN, &PythonWording);
            Ok(PythonResult::new(&found.json(), &text, remarks(&found.notes)))
        })
    }

    /// The model with the values of a fit in its file, and remarks.
    fn adopt(&self, py: Python<'_>, fit: Option<&str>, name: &str) -> PyResult<(Self, RemarkList)> {
        let (model, notes) = self.run_interruptible(py, None, || {
            let adoption = self.model.adopt(&self.fit(fit, name)?, name)?;
            let host = self.model.host();
            let model = host.derive(&self.model.path, adoption.loaded)?;
            Ok((model, remarks(&adoption.notes)))
        })?;
        Ok((self.with_same_host(model), notes))
    }

    /// A robot description of the model, with the physical parameters of a fit if given, and remarks.
    fn export(
        &self,
        py: Python<'_>,
        format: &str,
        fit: Option<&str>,
        name: Option<&str>,
    ) -> PyResult<(String, RemarkList)> {
        let mut formats = export::Format::ALL.into_iter();
        let Some(format) = formats.find(|one| one.name() == format) else {
            let known = export::Format::ALL.map(export::Format::name).join(", ");
            let says = format!("format={format:?}: expected one of {known}");
            return Err(input_error(py, &says));
        };
        self.run_interruptible(py, None, || {
            let fit = name.map(|name| self.fit(fit, name)).transpose()?;
            let exported = self.model.export(format, fit.as_ref().zip(name))?;
            Ok((exported.text, remarks(&exported.notes)))
        })
    }

    /// Changes from this model to another one; with recordings also changes of force, power and error along them.
    fn diff(
        &self,
        py: Python<'_>,
        other: PyRef<'_, Self>,
        data: Vec<PyRef<'_, PythonRecording>>,
        other_data: Vec<PyRef<'_, PythonRecording>>,
        progress: Option<Bound<'_, PyAny>>,
    ) -> PyResult<PythonResult> {
        let models = [&self.model, &other.model.clone()];
        let runs = [recordings(&data), recordings(&other_data)];
        self.run_interruptible(py, progress.as_ref(), || {
            // Changes of the text and the equations, then those along recordings.
            let [before, after] = models;
            let changes = ModelChanges::from_models(before, after);
            let mut object = changes.json(before, after);
            let mut text = changes.text(before, after, TerminalStyle::PLAIN);
            let mut notes = RemarkList::new();
            if !runs[0].is_empty() {
                let [first, second] = [&runs[0], &runs[1]].map(|runs| borrow_recordings(runs));
                let variants = VariantComparison::along_recordings(models, [&first, &second])?;
                object["along"] = variants.json(&PythonWording);
                text = format!("{text}\n\n{}", variants.text(TerminalStyle::PLAIN));
                notes = remarks(&variants.notes);
            }
            Ok(PythonResult::new(&object, &text, notes))
        })
    }

    /// Emitted code: paths and texts.
    fn generate(
        &self,
        py: Python<'_>,
        language: &str,
        dynamics: bool,
        reactions: bool,
        self_test: bool,
    ) -> PyResult<Vec<(String, String)>> {
        let Some(language) = CodeLanguage::from_name(language) else {
            let known: Vec<&str> = CodeLanguage::all().map(CodeLanguage::name).collect();
            let says = format!("language={language:?}: expected one of {}", known.join(", "));
            return Err(input_error(py, &says));
        };
        let code = CodeOptions {
            language,
            dynamics,
            reactions,
            self_test,
        };
        let files = self.run_interruptible(py, None, || self.model.generate(&code))?;
        Ok(files.into_iter().map(|file| (file.path, file.text)).collect())
    }
}
