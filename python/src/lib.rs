//! The compiled part of the Python package `modelmill`: models, recordings and methods of the library, with their
//! results as JSON and text. The Python part (`package/`) makes objects with attributes from them.
//!
//! Decision: this is a separate workspace with the same target folder. So it is built only with Python, and features of
//! its crates do not mix with those of the rest. Results are passed as the JSON that the program prints, so that both
//! agree; only arrays are passed as arrays.

mod arrays;
mod errors;
mod fleet;
mod inputs;
mod model;
mod options;
mod results;
mod rigs;
mod servo;
mod states;
mod wording;
mod work;

use pyo3::prelude::*;

/// The compiled part of `modelmill`.
#[pymodule]
mod _core {
    #[pymodule_export]
    use crate::fleet::{FleetGround, fleet_merge, fleet_plan};
    #[pymodule_export]
    use crate::inputs::{column_mapping, contents, kinds};
    #[pymodule_export]
    use crate::model::{CoreModel, import_text, load, load_text};
    #[pymodule_export]
    use crate::results::{PythonExcitation, PythonRecording, PythonResult};
    #[pymodule_export]
    use crate::rigs::{PythonSimulation, reduce, simulate};
    #[pymodule_export]
    use crate::servo::{compare_forward, identify_signals, simulate_motion, with_fit};
    #[pymodule_export]
    use crate::states::{at_single, drive_units, forces_along, model_contents};
    #[pymodule_export]
    use crate::wording::advised_names;
}
