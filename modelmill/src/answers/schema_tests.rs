//! The JSON Schemas in `modelmill/schema` are those of the answers.

use std::path::Path;

use schemars::{JsonSchema, schema_for};

use super::{DiagnosisAnswer, RunsAnswer};

/// Compares the schema of an answer with its file; `UPDATE_SCHEMA=1 cargo test -p modelmill` writes the file anew.
fn compare<T: JsonSchema>(command: &str) {
    let schema = schema_for!(T);
    let text = serde_json::to_string_pretty(&schema).expect("a schema is JSON") + "\n";
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("schema/{command}.schema.json"));
    if std::env::var_os("UPDATE_SCHEMA").is_some() {
        std::fs::write(&file, &text).expect("the schema is written");
    }
    let shipped = std::fs::read_to_string(&file).unwrap_or_default();
    assert!(
        shipped == text,
        "{} is stale; run UPDATE_SCHEMA=1 cargo test -p modelmill",
        file.display()
    );
}

#[test]
fn schemas_are_those_of_the_answers() {
    compare::<DiagnosisAnswer>("diagnose");
    compare::<RunsAnswer>("runs");
}
