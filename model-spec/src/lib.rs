//! Model files of modelmill: TOML goes in, a validated [`Mechanism`] or a list of diagnostics comes out.
//!
//! The way of a file: `document` (TOML with places) -> `merge` (variants) -> `schema` (tables of the format)
//! -> `build` (names, units, shapes) -> `pose` (loops and drives at the nominal pose).

mod actuators;
mod additions;
mod angle;
mod at_values;
mod build;
pub mod bundled;
mod column;
mod column_unit;
mod diagnostic;
mod document;
pub mod edit;
#[cfg(any(test, feature = "schema"))]
mod editor;
#[cfg(test)]
mod editor_tests;
mod exact;
#[cfg(test)]
mod exact_tests;
mod finite;
mod formula;
mod joint_motion;
mod kind_mechanics;
mod kind_terms;
mod kinds;
mod kinematics;
mod load;
mod mechanics;
mod mechanism;
mod merge;
mod motion;
mod nominal;
mod numeric;
mod parser;
mod pose;
mod print;
mod range;
#[cfg(test)]
mod rank_tests;
mod reading;
mod record;
mod schema;
mod scope;
mod sharing;
mod slope;
mod suggest;
mod toml_budget;
mod total_mass;
mod unclosed;
mod unit;
mod values;
mod words;

pub use actuators::{ActuatorGain, ActuatorKind, ActuatorTerm, ModelActuator, ServoForce, SignalQuantity};
pub use additions::{AddedEffect, ConstantValue};
pub use column::{ColumnFault, ColumnQuantity, ColumnSum, read_column};
pub use column_unit::{split_header_unit, unit_factor};
pub use diagnostic::{Diagnostic, DiagnosticSeverity, SourceFile, SourceFiles, SourceSpan};
pub use document::LARGEST_FILE;
pub use exact::*;
pub use joint_motion::CoordinateMotion;
pub use kinds::{
    ActsOn, ConstantSearch, EffectKind, KindConstant, KindParameter, LIBRARY, OtherMotion, PlaceLoad, Scale, Sign,
    library,
};
pub use load::{LoadFailure, LoadedModel, kinds_with, load, load_file, load_file_with, load_with};
pub use mechanics::Mechanics;
pub use mechanism::*;
pub use motion::{CoordinateAxis, FramePlacement, Kinematics, MechanismPoses};
pub use reading::{read_referenced, read_text};
pub use toml_budget::{TomlExcess, find_toml_excess};
pub use unit::unit_product;
pub use values::is_reserved_word;

/// The JSON Schema of model files, by which editors complete and explain them; a test checks that it
/// agrees with the reader.
pub const SCHEMA: &str = include_str!("../schema/modelmill.schema.json");

#[cfg(any(test, feature = "schema"))]
pub use editor::json_schema;
