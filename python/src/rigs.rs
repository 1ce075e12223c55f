//! Rigs, numeric models of complete machines: simulated recordings, and the reduction to planar models.

use std::path::PathBuf;

use modelmill::reduce::RigReductionOptions;
use modelmill::text::table::count;
use numpy::PyArray1;
use pyo3::prelude::*;
use serde_json::json;

use crate::model::new_host;
use crate::results::{PythonResult, RemarkList};
use crate::work::run_interruptible;

/// The recording of a simulated rig.
#[pyclass(frozen, name = "Simulation")]
pub(crate) struct PythonSimulation {
    /// The simulation of the library.
    made: modelmill::simulate::RigSimulation,
}

#[pymethods]
impl PythonSimulation {
    /// Rig, number of samples, seed, columns and notes as JSON.
    #[getter]
    fn json(&self) -> String {
        let made = &self.made;
        let columns = made.run.columns.iter();
        let columns: Vec<&str> = columns.map(|(name, _)| name.as_str()).collect();
        json!({
            "rig": made.rig,
            "samples": made.samples(),
            "seed": made.seed,
            "columns": columns,
            "notes": made.notes,
        })
        .to_string()
    }

    /// The simulation in one line.
    #[getter]
    fn text(&self) -> String {
        let made = &self.made;
        let samples = count(made.samples(), "sample", "samples");
        let drives = made.drives.join(", ");
        format!("{}: {samples} of {drives}, seed {}", made.rig, made.seed)
    }

    /// Remarks, each with severity and text.
    #[getter]
    fn notes(&self) -> RemarkList {
        let notes = self.made.notes.iter();
        notes.map(|says| ("info", says.clone())).collect()
    }

    /// The recording as CSV.
    #[getter]
    fn csv(&self) -> String {
        self.made.csv()
    }

    /// Names and values of the columns, in SI units.
    fn columns<'py>(&self, py: Python<'py>) -> Vec<(String, Bound<'py, PyArray1<f64>>)> {
        let columns = self.made.run.columns.iter();
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
    Ok(PythonSimulation { made })
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
