//! Model files of modelmill: TOML goes in, a validated [`Mechanism`] or a list of diagnostics comes out.
//!
//! The way of a file: `document` (TOML with places) -> `merge` (variants) -> `schema` (tables of the format)
//! -> `build` (names, units, shapes) -> `pose` (loops and drives at the nominal pose).

mod angle;
mod build;
mod diagnostic;
mod document;
mod exact;
mod formula;
mod kinds;
mod load;
mod mechanism;
mod merge;
mod numeric;
mod pose;
mod print;
mod record;
mod schema;
mod scope;
mod suggest;
mod unit;

pub use diagnostic::{Diagnostic, Severity, SourceFile, Sources, Span};
pub use exact::*;
pub use kinds::{ActsOn, Carries, EffectKind, KindConstant, KindParameter, LIBRARY, Sign, library};
pub use load::{Failure, Loaded, load, load_file};
pub use mechanism::*;

/// The JSON Schema of model files, for editors.
pub fn json_schema() -> serde_json::Value {
    let mut schema = schemars::generate::SchemaSettings::draft2020_12()
        .into_generator()
        .into_root_schema_for::<schema::ModelEntry>();
    schema.insert("title".to_owned(), "A model file of modelmill".into());
    schema.to_value()
}
