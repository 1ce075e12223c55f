//! The JSON Schema beside the sources is up to date, and fits every model.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::json_schema;

fn folder(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn to_json(path: &Path) -> Value {
    let text = std::fs::read_to_string(path).unwrap();
    serde_json::to_value(toml::from_str::<toml::Table>(&text).unwrap()).unwrap()
}

/// `UPDATE_SCHEMA=1 cargo test -p modelmill-spec` writes the file anew.
#[test]
fn is_up_to_date() {
    let path = folder("schema/modelmill.schema.json");
    let mut now = serde_json::to_string_pretty(&json_schema()).unwrap();
    now.push('\n');
    if std::env::var_os("UPDATE_SCHEMA").is_some() {
        std::fs::write(&path, &now).unwrap();
    }
    let written = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        written == now,
        "schema/modelmill.schema.json is stale; run UPDATE_SCHEMA=1 cargo test -p modelmill-spec"
    );
}

#[test]
fn fits_every_model() {
    let schema = json_schema();
    assert!(jsonschema::meta::is_valid(&schema));
    let validator = jsonschema::validator_for(&schema).unwrap();
    let mut n = 0;
    for place in ["models", "../tests/fixtures/variants"] {
        for entry in std::fs::read_dir(folder(place)).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|end| end == "toml") {
                let model = to_json(&path);
                let faults: Vec<String> = validator
                    .iter_errors(&model)
                    .map(|fault| format!("{}: {fault}", fault.instance_path()))
                    .collect();
                assert!(faults.is_empty(), "{}: {faults:#?}", path.display());
                n += 1;
            }
        }
    }
    assert!(n > 30);
}

#[test]
fn refuses_what_the_loader_refuses() {
    let validator = jsonschema::validator_for(&json_schema()).unwrap();
    for name in ["unknown_keys", "wrong_types", "empty", "schema_version", "bad_parts"] {
        let model = to_json(&folder("tests/faulty").join(format!("{name}.toml")));
        assert!(!validator.is_valid(&model), "{name}");
    }
}
