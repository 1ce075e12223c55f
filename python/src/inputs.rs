//! Recordings as Python passes them: files, tables, or recordings that were prepared before.

use std::path::{Path, PathBuf};

use modelmill::recording::{RecordingOptions, UnpreparedRecording};
use modelmill::text::style::TerminalStyle;
use modelmill::{Host, Model, Outcome, print};
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;

use crate::errors::input_error;
use crate::model::new_host;
use crate::options::Keywords;
use crate::results::{PythonRecording, PythonResult, RemarkList};
use crate::work::{run_blocking, run_interruptible};

/// The source of a recording: files of one run, or named columns.
#[derive(FromPyObject)]
pub(crate) enum PythonSource<'py> {
    /// Paths of files.
    Files(Vec<PathBuf>),
    /// Names and values of columns, in SI units.
    Table(Vec<(String, PyReadonlyArray1<'py, f64>)>),
}

/// A recording that is to be prepared together with others.
#[derive(FromPyObject)]
#[expect(clippy::large_enum_variant, reason = "a call has a few of them")]
pub(crate) enum PythonInput<'py> {
    /// One that was prepared before.
    Prepared(PyRef<'py, PythonRecording>),
    /// Name in messages, source and options.
    Source(String, PythonSource<'py>, Keywords<RecordingOptions>),
}

/// A prepared recording, or the exception that states why there is none.
pub(crate) type RecordingOrError = (Option<PythonRecording>, Option<PyErr>);

/// A recording that is to be prepared, independent of the interpreter.
#[derive(Clone)]
pub(crate) enum PassedRecording {
    /// Files of one run.
    Files(Vec<PathBuf>, RecordingOptions),
    /// Name and columns of a table.
    Table(String, Vec<(String, Vec<f64>)>, RecordingOptions),
    /// A recording that was read before.
    Read(UnpreparedRecording),
}

impl PassedRecording {
    /// A source of Python with its options; fails with the first invalid option.
    pub(crate) fn new(
        py: Python<'_>,
        name: &str,
        source: PythonSource<'_>,
        options: &Keywords<RecordingOptions>,
    ) -> PyResult<Self> {
        let reading = options.options().map_err(|says| input_error(py, &says))?;
        Ok(match source {
            PythonSource::Files(files) => Self::Files(files, reading),
            PythonSource::Table(columns) => {
                let columns = columns.into_iter().map(|(name, values)| {
                    let values = values.as_array().iter().copied().collect();
                    (name, values)
                });
                Self::Table(name.to_owned(), columns.collect(), reading)
            }
        })
    }

    /// With other options, which follow from the given ones; a recording that was read before stays.
    pub(crate) fn with_reading(self, change: impl Fn(&RecordingOptions) -> RecordingOptions) -> Self {
        match self {
            Self::Files(files, reading) => Self::Files(files, change(&reading)),
            Self::Table(name, columns, reading) => Self::Table(name, columns, change(&reading)),
            Self::Read(recording) => Self::Read(recording),
        }
    }

    /// Reads it for a model.
    pub(crate) fn read(self, model: &Model) -> Outcome<UnpreparedRecording> {
        match self {
            Self::Files(files, reading) => {
                let files: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
                model.read_recording(&files, &reading)
            }
            Self::Table(name, columns, reading) => model.read_recording_of_table(&name, columns, &reading),
            Self::Read(recording) => Ok(recording),
        }
    }
}

/// Contents of a log, independent of a model.
#[pyfunction]
pub(crate) fn contents(py: Python<'_>, path: PathBuf) -> PyResult<PythonResult> {
    let (host, listener) = new_host(Vec::new(), false);
    let found = run_interruptible(py, &listener, None, || host.recordings(&path))?;
    Ok(PythonResult::new(
        &found.json(),
        &found.text(TerminalStyle::PLAIN),
        RemarkList::new(),
    ))
}

/// Kinds of effects that a model may have: name and description.
#[pyfunction]
pub(crate) fn kinds(py: Python<'_>, libraries: Vec<PathBuf>) -> PyResult<String> {
    let (host, _) = new_host(libraries, false);
    let kinds = run_blocking(py, || host.kinds())?;
    Ok(print::effects::json(&kinds).to_string())
}

/// The pairs of a file with the table `[recording.columns]`.
#[pyfunction]
pub(crate) fn column_mapping(py: Python<'_>, path: PathBuf) -> PyResult<Vec<(String, String)>> {
    run_blocking(py, || Host::new().column_mapping(&path))
}
