//! Functions of a model at one state and along a recording, and the contents of a model from which it can be derived
//! again in another process.

use std::path::PathBuf;

use modelmill::{Outcome, along};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1};
use pyo3::prelude::*;

use crate::errors::input_error;
use crate::model::{CoreModel, function_by_name};
use crate::results::PythonRecording;
use crate::work::run_blocking;

/// An argument of a function of one state.
type StateArgument<'a, 'py> = Option<&'a Bound<'py, PyAny>>;

/// A function at one state: positions, rates, accelerations and forces of the drives as vectors of numbers. `values`
/// are those of the base parameters; without them the nominal ones are used. Returns the numbers row by row, or `None`
/// if the arguments are not such vectors or the state has no solution: the function for many states then reports why.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "each is an array of Python")]
pub(crate) fn at_single<'py>(
    py: Python<'py>,
    model: &CoreModel,
    function: &str,
    size: usize,
    q: StateArgument<'_, 'py>,
    qd: StateArgument<'_, 'py>,
    qdd: StateArgument<'_, 'py>,
    forces: StateArgument<'_, 'py>,
    values: StateArgument<'_, 'py>,
) -> PyResult<Option<Bound<'py, PyArray1<f64>>>> {
    let (n, drives) = (model.n_active, model.n_drives);
    let arrays = [(q, n), (qd, n), (qdd, n), (forces, drives)].map(|(given, width)| vector(given, width));
    let [Some(q), Some(qd), Some(qdd), Some(forces)] = arrays else {
        return Ok(None);
    };
    let Some(values) = vector(values, model.model.base.len()) else {
        return Ok(None);
    };
    let arrays = [q.as_ref(), qd.as_ref(), qdd.as_ref(), forces.as_ref()].map(numbers);
    let [Some(q), Some(qd), Some(qdd), Some(forces)] = arrays else {
        return Ok(None);
    };
    let values = match values.as_ref() {
        None => Some(model.model.values.as_slice()),
        given => numbers(given),
    };
    let Some(values) = values else { return Ok(None) };
    let function = function_by_name(py, function)?;
    let mut out = vec![0.0; size];
    let is_done = run_blocking(py, || {
        (model.functions).evaluate_single(function, [q, qd, qdd, forces], values, &mut out)
    })?;
    Ok(is_done.then(|| PyArray1::from_vec(py, out)))
}

/// A vector of 64-bit numbers of a length; `None` within if there is none, and `None` if it is something else.
#[allow(clippy::option_option, reason = "an argument may be absent, or of another type")]
fn vector<'py>(given: StateArgument<'_, 'py>, width: usize) -> Option<Option<PyReadonlyArray1<'py, f64>>> {
    let Some(given) = given else { return Some(None) };
    let array = given.cast::<PyArray1<f64>>().ok()?.try_readonly().ok()?;
    (array.as_array().len() == width).then_some(Some(array))
}

/// The numbers of a vector, none without one; `None` if they are not contiguous.
fn numbers<'a>(array: Option<&'a PyReadonlyArray1<'_, f64>>) -> Option<&'a [f64]> {
    match array {
        None => Some(&[]),
        Some(array) => array.as_slice().ok(),
    }
}

/// Forces of a model along the prepared samples of a recording, an array for each drive; `values` are those of the base
/// parameters.
#[pyfunction]
pub(crate) fn forces_along<'py>(
    py: Python<'py>,
    model: &CoreModel,
    recording: &PythonRecording,
    values: Vec<f64>,
) -> PyResult<Vec<Bound<'py, PyArray1<f64>>>> {
    if values.len() != model.model.base.len() {
        return Err(input_error(py, "one value is expected for each base parameter"));
    }
    let mut columns = vec![Vec::new(); model.n_drives];
    model.run_interruptible(py, None, || -> Outcome<()> {
        for segment in &recording.recording.segments {
            let forces = along::forces(&model.model, segment, &values)?;
            columns.iter_mut().zip(forces).for_each(|(all, more)| all.extend(more));
        }
        Ok(())
    })?;
    Ok(columns
        .into_iter()
        .map(|column| PyArray1::from_vec(py, column))
        .collect())
}

/// Path, text, libraries, and whether the model was derived for the values of its file only.
type ModelContents = (String, String, Vec<PathBuf>, bool);

/// The contents of a model, from which it can be derived again.
#[pyfunction]
pub(crate) fn model_contents(model: &CoreModel) -> ModelContents {
    let host = model.model.host();
    (
        model.model.path.clone(),
        model.model.text().to_owned(),
        host.libraries().to_vec(),
        host.has_numeric_constants(),
    )
}

/// The unit of the force of each drive.
#[pyfunction]
pub(crate) fn drive_units(model: &CoreModel) -> Vec<&'static str> {
    (0..model.n_drives).map(|drive| model.model.force_unit(drive)).collect()
}
