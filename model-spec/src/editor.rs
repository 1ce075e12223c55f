//! The JSON Schema of model files, which editors use to complete, explain and check them.
//!
//! The types that read a file go in, one JSON document comes out. A test compares it with the stored file.

use serde_json::{Map, Value, json};

/// Suffix of the names of definitions for variants, whose entries may be incomplete.
const PARTIAL: &str = "InVariant";

/// The JSON Schema of model files.
///
/// It is derived from the types that read a file. Entries of a variant, a file with `extends`, override single
/// fields. Therefore required fields may be missing only there.
pub fn json_schema() -> Value {
    let root = schemars::generate::SchemaSettings::draft2020_12()
        .into_generator()
        .into_root_schema_for::<crate::schema::ModelEntry>()
        .to_value();
    // Every definition exists twice: as it is, and with all fields optional.
    let mut strict_definitions = root["$defs"].as_object().cloned().unwrap_or_default();
    let mut definitions = Map::new();
    for (name, schema) in &strict_definitions {
        definitions.insert(format!("{name}{PARTIAL}"), optional_schema(schema));
    }
    definitions.append(&mut strict_definitions);
    let known: Vec<String> = definitions.keys().cloned().collect();
    // Without `extends` the strict properties apply in addition.
    let mut schema = json!({
        "$schema": root["$schema"],
        "title": "A model file of modelmill",
        "description": root["description"],
        "type": "object",
        "properties": optional_schema(&root["properties"]),
        "required": root["required"],
        "additionalProperties": false,
        "if": { "not": { "required": ["extends"] } },
        "then": { "properties": root["properties"] },
        "$defs": definitions,
    });
    prune(&mut schema, &known);
    schema
}

/// A copy without required fields, whose references lead to such copies.
fn optional_schema(schema: &Value) -> Value {
    match schema {
        Value::Object(fields) => Value::Object(
            fields
                .iter()
                // A property may be called `required`; only a list of names is the keyword.
                .filter(|(key, value)| !(*key == "required" && value.is_array()))
                .map(|(key, value)| match value.as_str() {
                    Some(target) if key == "$ref" => (key.clone(), Value::String(format!("{target}{PARTIAL}"))),
                    _ => (key.clone(), optional_schema(value)),
                })
                .collect(),
        ),
        Value::Array(entries) => Value::Array(entries.iter().map(optional_schema).collect()),
        other => other.clone(),
    }
}

/// Removes copies that equal their originals, and redirects references to the originals.
fn prune(schema: &mut Value, known: &[String]) {
    // Each removal may make further copies equal, so passes are repeated until nothing changes.
    for _ in 0..known.len() {
        let Some(definitions) = schema["$defs"].as_object() else {
            return;
        };
        let same: Vec<String> = known
            .iter()
            .filter_map(|name| name.strip_suffix(PARTIAL))
            .filter(|name| {
                let copy = definitions.get(&format!("{name}{PARTIAL}"));
                copy.is_some() && copy == definitions.get(*name)
            })
            .map(str::to_owned)
            .collect();
        if same.is_empty() {
            return;
        }
        for name in same {
            let copy = format!("{name}{PARTIAL}");
            if let Some(definitions) = schema["$defs"].as_object_mut() {
                definitions.remove(&copy);
            }
            redirect(schema, &format!("#/$defs/{copy}"), &format!("#/$defs/{name}"));
        }
    }
}

/// Replaces all references to `from` by references to `to`.
fn redirect(schema: &mut Value, from: &str, to: &str) {
    match schema {
        Value::Object(fields) => {
            for (key, value) in fields.iter_mut() {
                if key == "$ref" && value == from {
                    *value = Value::String(to.to_owned());
                } else {
                    redirect(value, from, to);
                }
            }
        }
        Value::Array(entries) => {
            for entry in entries {
                redirect(entry, from, to);
            }
        }
        _ => {}
    }
}
