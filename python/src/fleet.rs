//! Summaries of recordings of a fleet, as bytes, for query engines that run Python.

use std::path::{Path, PathBuf};

use modelmill::recording::{RecordingOptions, StatePreparation};
use modelmill_fleet::{FleetFault, FleetModel, FleetPlan, FleetSummary};
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::errors::input_error;
use crate::wording::PythonWording;

/// A plan with its model derived.
#[pyclass(frozen)]
pub(crate) struct FleetGround {
    /// The plan with its derived model.
    ground: FleetModel,
}

/// A fault of the library as an exception.
fn fleet_error(py: Python<'_>, fault: &FleetFault) -> PyErr {
    input_error(py, &fault.message().format_for(&PythonWording))
}

/// Makes a plan from reference recordings, as JSON.
#[pyfunction]
#[pyo3(signature = (model, reference, columns, cutoff_hz, decimate, skip_bad_samples))]
pub(crate) fn fleet_plan(
    py: Python<'_>,
    model: PathBuf,
    reference: Vec<PathBuf>,
    columns: Vec<(String, String)>,
    cutoff_hz: Option<f64>,
    decimate: usize,
    skip_bad_samples: bool,
) -> PyResult<String> {
    let reading = RecordingOptions {
        columns,
        preparation: StatePreparation {
            cutoff_hz,
            decimate: decimate.max(1),
            ..StatePreparation::default()
        },
        skip_bad_samples,
        ..RecordingOptions::default()
    };
    let made = py.detach(|| {
        let reference: Vec<&Path> = reference.iter().map(PathBuf::as_path).collect();
        FleetPlan::from_recordings(&model, &reading, &reference).map(|plan| plan.json())
    });
    made.map_err(|fault| fleet_error(py, &fault))
}

/// Adds summaries; `None` without any.
#[pyfunction]
pub(crate) fn fleet_merge(py: Python<'_>, summaries: Vec<Vec<u8>>) -> PyResult<Option<Bound<'_, PyBytes>>> {
    let merged = py.detach(|| {
        let mut sum: Option<FleetSummary> = None;
        for bytes in &summaries {
            let one = FleetSummary::from_bytes(bytes)?;
            match &mut sum {
                None => sum = Some(one),
                Some(sum) => sum.merge(&one)?,
            }
        }
        Ok(sum.map(|sum| sum.bytes()))
    });
    let merged = merged.map_err(|fault| fleet_error(py, &fault))?;
    Ok(merged.map(|bytes| PyBytes::new(py, &bytes)))
}

#[pymethods]
impl FleetGround {
    /// Derives the model of a plan, which is given as JSON.
    #[new]
    fn new(py: Python<'_>, plan: &str) -> PyResult<Self> {
        let made = py.detach(|| FleetPlan::parse("the plan", plan).and_then(|plan| plan.derive_model()));
        let ground = made.map_err(|fault| fleet_error(py, &fault))?;
        Ok(Self { ground })
    }

    /// Names of the columns that a recording needs.
    #[getter]
    fn columns(&self) -> Vec<String> {
        self.ground.columns()
    }

    /// The summary of a recording from its columns in SI units, as bytes.
    fn summarise<'py>(
        &self,
        py: Python<'py>,
        recording: &str,
        columns: Vec<(String, PyReadonlyArray1<'py, f64>)>,
    ) -> Bound<'py, PyBytes> {
        let columns = columns.into_iter().map(|(name, values)| {
            let values = values.as_array().iter().copied().collect();
            (name, values)
        });
        let columns = columns.collect();
        let bytes = py.detach(|| self.ground.summarise(recording, columns).bytes());
        PyBytes::new(py, &bytes)
    }

    /// The summary of a recording from a file, as bytes.
    fn summarise_file<'py>(&self, py: Python<'py>, recording: &str, path: PathBuf) -> Bound<'py, PyBytes> {
        let bytes = py.detach(|| self.ground.summarise_file(recording, &path).bytes());
        PyBytes::new(py, &bytes)
    }

    /// Parameters with standard deviations, and the number of bad recordings, as JSON.
    fn solve(&self, py: Python<'_>, summary: &[u8]) -> PyResult<String> {
        let solved = py.detach(|| {
            let summary = FleetSummary::from_bytes(summary)?;
            let fit = self.ground.solve(&summary)?;
            Ok(self.ground.json(&fit).to_string())
        });
        solved.map_err(|fault: FleetFault| fleet_error(py, &fault))
    }

    /// Changes and dead sensors of a robot, from the summaries of its days in order, as JSON.
    fn robot(&self, py: Python<'_>, name: &str, days: Vec<(String, Vec<u8>)>) -> PyResult<String> {
        let found = py.detach(|| {
            let days = days
                .iter()
                .map(|(day, bytes)| Ok((day.clone(), FleetSummary::from_bytes(bytes)?)));
            let days = days.collect::<Result<Vec<_>, FleetFault>>()?;
            let robot = modelmill_fleet::robot::robot_history(&self.ground, name, &days)?;
            Ok(robot.json(&self.ground).to_string())
        });
        found.map_err(|fault: FleetFault| fleet_error(py, &fault))
    }
}
