//! Rigs, numeric models of complete machines: simulated recordings, and the reduction to planar models.

use std::path::PathBuf;

use modelmill::reduce::RigReductionOptions;
use modelmill::text::table::count;
use numpy::PyArray1;
use pyo3::prelude::*;
use serde_json::{Value, json};

use crate::model::new_host;
use crate::results::{PythonResult, RemarkList};
use crate::work::run_interruptible;

/// A simulated recording.
#[pyclass(frozen, name = "Simulation")]
pub(crate) struct PythonSimulation {
    /// What was simulated, as JSON.
    pub(crate) json: Value,
    /// The simulation in one line.
    pub(crate) text: String,
    /// The recording as CSV.
    pub(crate) csv: String,
    /// Names and values of the columns, in SI units.
    pub(crate) columns: Vec<(String, Vec<f64>)>,
    /// Remarks.
    pub(crate) notes: RemarkList,
}

#[pymethods]
impl PythonSimulation {
    /// What was simulated, as JSON.
    #[getter]
    fn json(&self) -> String {
        self.json.to_string()
    }

    /// The simulation in one line.
    #[getter]
    fn text(&self) -> &str {
        &self.text
    }

    /// Remarks, each with severity and text.
    #[getter]
    fn notes(&self) -> RemarkList {
        self.notes.clone()
    }

    /// The recording as CSV.
    #[getter]
    fn csv(&self) -> &str {
        &self.csv
    }

    /// Names and values of the columns, in SI units.
    fn columns<'py>(&self, py: Python<'py>) -> Vec<(String, Bound<'py, PyArray1<f64>>)> {
        let columns = self.columns.iter();
        columns
            .map(|(name, values)| (name.clone(), PyArray1::from_slice(py, values)))
            .collect()
    }
}

/// Simulates a rig along a trajectory.
#[pyfunction]
pub(crate) fn simulate(
    py: Python<'_>,
    rig: PathBuf,
    trajectory: PathBuf,
    columns: Vec<(String, String)>,
    seed: Option<u64>,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<PythonSimulation> {
    let (host, listener) = new_host(Vec::new(), false);
    let made = run_interruptible(py, &listener, progress.as_ref(), || {
        host.simulate(&rig, &trajectory, &columns, seed)
    })?;
    let columns = made.run.columns.iter();
    let columns: Vec<&str> = columns.map(|(name, _)| name.as_str()).collect();
    let samples = count(made.samples(), "sample", "samples");
    Ok(PythonSimulation {
        json: json!({
            "rig": made.rig,
            "samples": made.samples(),
            "seed": made.seed,
            "columns": columns,
            "notes": made.notes,
        }),
        text: format!(
            "{}: {samples} of {}, seed {}",
            made.rig,
            made.drives.join(", "),
            made.seed
        ),
        csv: made.csv(),
        notes: made.notes.iter().map(|says| ("info", says.clone())).collect(),
        columns: made.run.columns,
    })
}

/// Reduces a rig to a planar model. Returns the report on all assumptions, and the text of the model file.
#[pyfunction]
pub(crate) fn reduce(
    py: Python<'_>,
    rig: PathBuf,
    plan: Option<PathBuf>,
    tolerance: f64,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<(PythonResult, String)> {
    let (host, listener) = new_host(Vec::new(), false);
    let reduced = run_interruptible(py, &listener, progress.as_ref(), || {
        let options = RigReductionOptions {
            plan: plan.as_deref(),
            gap_tolerance: tolerance,
        };
        host.reduce(&rig, &options)
    })?;
    let mut object = reduced.json("");
    if let Some(object) = object.as_object_mut() {
        object.shift_remove("out");
    }
    let found = PythonResult::new(&object, &reduced.text(), RemarkList::new());
    Ok((found, reduced.reduction.model))
}
