//! The compiled part of the Python package `modelmill`: models, recordings and verbs of the library, with JSON and text of
//! what they find. The Python part (`package/`) makes objects with attributes of them.
//!
//! Decision: this is a workspace of its own on the same target folder. Nobody without Python builds it, and
//! features of its crates do not mix with those of the rest. Results cross as the JSON that the program prints, so
//! that both cannot differ; only arrays cross as arrays.

mod arrays;
mod errors;
mod fleet;
mod model;
mod options;
mod results;
mod rigs;
mod spelling;
mod work;

use pyo3::prelude::*;

/// The compiled part of `modelmill`.
#[pymodule]
mod _core {
    #[pymodule_export]
    use crate::fleet::{FleetGround, fleet_merge, fleet_plan};
    #[pymodule_export]
    use crate::model::{CoreModel, contents, import_text, kinds, load, load_text};
    #[pymodule_export]
    use crate::results::{PythonExcitation, PythonRecording, PythonResult};
    #[pymodule_export]
    use crate::rigs::{PythonSimulation, reduce, simulate};
    #[pymodule_export]
    use crate::spelling::advised_names;
}
