//! Models with actuators and logs without forces: identification from signals, fits with gains, and simulation forward in
//! time.

use std::sync::Arc;

use modelmill::Error;
use modelmill::recording::{PreparedRecording, RecordingOptions};
use modelmill::servo::ServoLogs;
use modelmill::text::style::TerminalStyle;
use modelmill::text::table::count;
use pyo3::prelude::*;
use serde_json::json;

use crate::errors::input_error;
use crate::inputs::{PassedRecording, PythonSource};
use crate::model::CoreModel;
use crate::options::Keywords;
use crate::results::{PythonRecording, PythonResult, RemarkList, remarks};
use crate::rigs::PythonSimulation;
use crate::wording::PythonWording;

/// Name in messages, source and options of a recording.
type SourceInput<'py> = (String, PythonSource<'py>, Keywords<RecordingOptions>);

/// Estimates a model with actuators from commands, currents or voltages. None if the model has no actuators, or if a
/// recording has forces and lacks these signals. `unused` are given keywords without effect on such an estimate.
#[pyfunction]
pub(crate) fn identify_signals(
    py: Python<'_>,
    model: PyRef<'_, CoreModel>,
    runs: [Vec<SourceInput<'_>>; 2],
    unused: Vec<String>,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<Option<PythonResult>> {
    let model: &CoreModel = &model;
    let input = |(name, source, options): SourceInput<'_>| PassedRecording::new(py, &name, source, &options);
    let [fit, check] = runs.map(|run| run.into_iter().map(input).collect::<PyResult<Vec<_>>>());
    let runs = [fit?, check?];
    let found = model.run_interruptible(py, progress.as_ref(), || {
        let logs = model.model.prepare_servo_logs(|model, change| {
            let read = |one: &PassedRecording| one.clone().with_reading(change).read(model);
            runs.each_ref().map(|run| run.iter().map(read).collect())
        })?;
        let Some(logs) = logs else {
            return Ok(None);
        };
        match ServoLogs::refuse_options(&unused) {
            Some(says) => Err(Error::input(says)),
            None => Ok(Some(logs.identify()?)),
        }
    })?;
    let Some(found) = found else {
        return Ok(None);
    };
    let values = match &found.model_fit {
        Some(fit) => model.run_interruptible(py, None, || Ok(model.model.values_of(fit, "fit")?.values))?,
        None => Vec::new(),
    };
    let text = found.text(TerminalStyle::PLAIN);
    Ok(Some(
        PythonResult::new(&found.json(&PythonWording), &text, remarks(&found.notes)).with_values(values),
    ))
}

/// The model with the values of a fit, which is a text with a name or the path of a file, and with the gains of actuators
/// that the fit has.
#[pyfunction]
pub(crate) fn with_fit(
    py: Python<'_>,
    model: PyRef<'_, CoreModel>,
    fit: Option<&str>,
    name: &str,
) -> PyResult<(CoreModel, RemarkList)> {
    let model: &CoreModel = &model;
    let (with_fit, notes) = model.run_interruptible(py, None, || {
        let values = model.model.values_of(&model.fit(fit, name)?, name)?;
        Ok((model.model.with_fit(&values), remarks(&values.notes)))
    })?;
    Ok((model.with_same_host(with_fit), notes))
}

/// Position errors of the model when it is simulated forward in time from recorded states.
#[pyfunction]
pub(crate) fn compare_forward(
    py: Python<'_>,
    model: PyRef<'_, CoreModel>,
    data: Vec<PyRef<'_, PythonRecording>>,
    values: Vec<f64>,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<PythonResult> {
    let model: &CoreModel = &model;
    let data: Vec<Arc<PreparedRecording>> = data.iter().map(|one| Arc::clone(&one.recording)).collect();
    model.run_interruptible(py, progress.as_ref(), || {
        let data: Vec<&PreparedRecording> = data.iter().map(|one| &**one).collect();
        let found = model.model.compare_forward(&data, &values)?;
        let text = found.text(TerminalStyle::PLAIN);
        Ok(PythonResult::new(&found.json(), &text, RemarkList::new()))
    })
}

/// The motion of the model under the forces of a recording, or under the signals of its actuators.
#[pyfunction]
pub(crate) fn simulate_motion(
    py: Python<'_>,
    model: PyRef<'_, CoreModel>,
    recording: PyRef<'_, PythonRecording>,
    values: Vec<f64>,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<PythonSimulation> {
    if values.len() != model.model.base.len() {
        let says = format!(
            "{} values are expected, one for each base parameter",
            model.model.base.len()
        );
        return Err(input_error(py, &says));
    }
    let model: &CoreModel = &model;
    let recording = Arc::clone(&recording.recording);
    model.run_interruptible(py, progress.as_ref(), || {
        let made = model.model.simulate_motion(&recording, &values)?;
        let samples = count(made.samples(), "sample", "samples");
        let coordinates = made.coordinates.join(", ");
        let csv = made.csv();
        let mut columns = vec![("t".to_owned(), made.time)];
        columns.extend(made.coordinates.iter().cloned().zip(made.q));
        let rates = made.coordinates.iter().map(|name| format!("{name}_d"));
        columns.extend(rates.zip(made.qd));
        columns.extend(made.forces);
        Ok(PythonSimulation {
            json: json!({
                "model": model.model.name,
                "samples": columns[0].1.len(),
                "input": made.input.name(),
                "coordinates": made.coordinates,
            }),
            text: format!(
                "{}: {samples} of {coordinates} under {}",
                model.model.name,
                made.input.name()
            ),
            csv,
            columns,
            notes: RemarkList::new(),
        })
    })
}
