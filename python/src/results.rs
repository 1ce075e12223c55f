//! Results of methods as JSON (the same as the program prints), text and pages; and prepared recordings.

use std::sync::Arc;

use modelmill::recording::PreparedRecording;
use modelmill::{NoteSeverity, RecordingNote};
use numpy::PyArray1;
use pyo3::prelude::*;
use serde_json::Value;

use crate::model::CoreModel;
use crate::wording::PythonWording;

/// Remarks, each with severity and text.
pub(crate) type RemarkList = Vec<(&'static str, String)>;

/// Notes of the library in the wording of Python.
pub(crate) fn remarks<'a>(notes: impl IntoIterator<Item = &'a RecordingNote>) -> RemarkList {
    let one = |note: &RecordingNote| {
        let severity = match note.severity {
            NoteSeverity::Warning => "warning",
            NoteSeverity::Info => "info",
        };
        (severity, note.says.format_for(&PythonWording))
    };
    notes.into_iter().map(one).collect()
}

/// A recording that was read and prepared for a model.
#[pyclass(frozen, name = "Recording")]
pub(crate) struct PythonRecording {
    /// The recording of the library.
    pub(crate) recording: Arc<PreparedRecording>,
}

#[pymethods]
impl PythonRecording {
    /// Path of the file, or the name of the table.
    #[getter]
    fn file(&self) -> String {
        self.recording.file().to_owned()
    }

    /// Remarks of the preparation.
    #[getter]
    fn notes(&self) -> RemarkList {
        remarks(self.recording.notes())
    }

    /// Times of the prepared samples, then one list per coordinate of positions, rates, accelerations, then forces.
    #[pyo3(name = "prepared")]
    fn prepared_arrays<'py>(&self, py: Python<'py>) -> PreparedArrays<'py> {
        let runs = || self.recording.segments.iter().map(|segment| &segment.run);
        // Each column over all segments.
        let joined = |of: &dyn Fn(&modelmill::recording::PreparedRun) -> &[Vec<f64>]| {
            let width = runs().next().map_or(0, |run| of(run).len());
            let column = |k: usize| {
                let values = runs().flat_map(|run| of(run)[k].iter().copied());
                PyArray1::from_vec(py, values.collect())
            };
            (0..width).map(column).collect()
        };
        let time = runs().flat_map(|run| run.time.iter().copied()).collect();
        (
            PyArray1::from_vec(py, time),
            joined(&|run| &run.q),
            joined(&|run| &run.qd),
            joined(&|run| &run.qdd),
        )
    }

    /// Measured forces at the prepared samples, an array for each drive, with NaN where a force was not measured or was
    /// found faulty; `None` if the recording has no forces.
    fn forces<'py>(&self, py: Python<'py>) -> Option<ArrayColumns<'py>> {
        let runs = || self.recording.segments.iter().map(|segment| &segment.run);
        let n_drives = runs().next()?.force.as_ref()?.len();
        let mut columns = vec![Vec::new(); n_drives];
        for run in runs() {
            for (k, (column, force)) in columns.iter_mut().zip(run.force.as_ref()?).enumerate() {
                let out = run.left_out.get(k);
                let is_out = |i: usize| out.is_some_and(|out| out.get(i).copied().unwrap_or(false));
                let values = force.iter().enumerate();
                column.extend(values.map(|(i, force)| if is_out(i) { f64::NAN } else { *force }));
            }
        }
        Some(
            columns
                .into_iter()
                .map(|column| PyArray1::from_vec(py, column))
                .collect(),
        )
    }

    /// Numbers of samples of the segments between gaps in time.
    fn segment_lengths(&self) -> Vec<usize> {
        let segments = self.recording.segments.iter();
        segments.map(|segment| segment.run.time.len()).collect()
    }
}

/// One array for each coordinate or drive.
type ArrayColumns<'py> = Vec<Bound<'py, PyArray1<f64>>>;
/// Times, then columns of positions, rates and accelerations.
type PreparedArrays<'py> = (
    Bound<'py, PyArray1<f64>>,
    ArrayColumns<'py>,
    ArrayColumns<'py>,
    ArrayColumns<'py>,
);

/// The result of a method.
#[pyclass(frozen, name = "Result")]
#[derive(Default)]
pub(crate) struct PythonResult {
    /// The JSON that the program prints with `--json`.
    json: String,
    /// The text that the program prints.
    text: String,
    /// The HTML page, if the method has one.
    page: Option<String>,
    /// Remarks.
    notes: RemarkList,
    /// Values of the base parameters, if there are any.
    values: Vec<f64>,
    /// The model with the result, for example with the effects that a diagnosis found.
    model: Option<CoreModel>,
}

impl PythonResult {
    /// A result with JSON, text and remarks.
    pub(crate) fn new(json: &Value, text: &str, notes: RemarkList) -> Self {
        Self {
            json: json.to_string(),
            text: text.to_owned(),
            notes,
            ..Self::default()
        }
    }

    /// The result with an HTML page.
    pub(crate) fn with_page(mut self, page: String) -> Self {
        self.page = Some(page);
        self
    }

    /// The result with values of the base parameters.
    pub(crate) fn with_values(mut self, values: Vec<f64>) -> Self {
        self.values = values;
        self
    }

    /// The result with a model.
    pub(crate) fn with_model(mut self, model: Option<CoreModel>) -> Self {
        self.model = model;
        self
    }
}

#[pymethods]
impl PythonResult {
    /// The JSON that the program prints with `--json`.
    #[getter]
    fn json(&self) -> &str {
        &self.json
    }

    /// The text that the program prints.
    #[getter]
    fn text(&self) -> &str {
        &self.text
    }

    /// The HTML page, if there is one.
    #[getter]
    fn page(&self) -> Option<&str> {
        self.page.as_deref()
    }

    /// Remarks, each with severity and text.
    #[getter]
    fn notes(&self) -> RemarkList {
        self.notes.clone()
    }

    /// Values of the base parameters; empty if there are none.
    #[getter]
    fn values<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.values)
    }

    /// The model with the result, if there is one.
    #[getter]
    fn model(&self) -> Option<CoreModel> {
        self.model.clone()
    }
}

/// A planned trajectory.
#[pyclass(frozen, name = "Excitation")]
pub(crate) struct PythonExcitation {
    /// The result of the library.
    pub(crate) found: modelmill::excite::ExcitationResult,
}

#[pymethods]
impl PythonExcitation {
    /// All figures as JSON.
    #[getter]
    fn json(&self) -> String {
        self.found.json().to_string()
    }

    /// The figures as text.
    #[getter]
    fn text(&self) -> String {
        let plain = modelmill::text::style::TerminalStyle::PLAIN;
        self.found.text(plain, &PythonWording)
    }

    /// Remarks, each with severity and text.
    #[getter]
    fn notes(&self) -> RemarkList {
        remarks(&self.found.notes)
    }

    /// The picture of the trajectory as SVG.
    #[getter]
    fn picture(&self) -> &str {
        &self.found.picture
    }

    /// The trajectory as CSV.
    #[getter]
    fn csv(&self) -> String {
        self.found.csv()
    }

    /// Times, then positions, rates and accelerations, a list per coordinate.
    fn motion<'py>(&self, py: Python<'py>) -> PreparedArrays<'py> {
        let all = |columns: &[Vec<f64>]| -> ArrayColumns<'py> {
            columns.iter().map(|column| PyArray1::from_slice(py, column)).collect()
        };
        let motion = &self.found.motion;
        (
            PyArray1::from_slice(py, &self.found.time),
            all(&motion.q),
            all(&motion.qd),
            all(&motion.qdd),
        )
    }
}
