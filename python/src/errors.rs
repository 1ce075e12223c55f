//! Faults as exceptions of the class `ModelmillError` of the package, with diagnostics as data.

use modelmill::{Error, print};
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;
use serde_json::{Value, json};

use crate::wording::PythonWording;

/// An exception `modelmill.ModelmillError` with a text; `diagnostics` is a list of objects.
pub(crate) fn modelmill_error(py: Python<'_>, says: &str, diagnostics: &Value) -> PyErr {
    /// The exception class of the Python part, imported at its first use.
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let class = CLASS.import(py, "modelmill._errors", "ModelmillError");
    let made = class.and_then(|class| class.call1((says, diagnostics.to_string())));
    match made {
        Ok(error) => PyErr::from_value(error),
        Err(error) => error,
    }
}

/// An exception for a fault of the input.
pub(crate) fn input_error(py: Python<'_>, says: &str) -> PyErr {
    let diagnostics = json!([{ "severity": "error", "says": says }]);
    modelmill_error(py, says, &diagnostics)
}

/// A fault of the library as an exception.
pub(crate) fn library_error(py: Python<'_>, error: &Error) -> PyErr {
    match error {
        Error::Model(faults) => {
            let told = print::faults(faults, &PythonWording);
            let says = faults.render_for(false, &PythonWording);
            modelmill_error(py, says.trim_end(), &told["diagnostics"])
        }
        Error::Cancelled => PyKeyboardInterrupt::new_err(error.to_string()),
        other => input_error(py, &other.format_for(&PythonWording)),
    }
}
