//! The mill under WebAssembly gives the answers that it gives here.

use std::fs::File;
use std::path::Path;
use std::process::{Command, Stdio};

use modelmill_in_browser::make;
use modelmill_workbench::RequestHandler;
use serde_json::{Value, json};

use crate::common::scratch;

/// Largest deviation of a number, relative: sines and cosines come from another library there, in whose last digit they differ.
/// The model explains the forces but for 4e-7 of them, so that what is told of this rest has seven digits fewer.
const TOLERANCE: f64 = 1e-7;

/// What is held against each other of a diagnosis: the robot is symmetric, so that candidates tie and may change places.
const FOUND: [&str; 5] = ["verdict", "noise_floor", "budget", "steps", "effects"];

#[test]
fn node_derives_identifies_and_diagnoses_with_the_same_numbers() {
    if Command::new("node").arg("--version").output().is_err() {
        let why = "there is no `node` to run WebAssembly";
        assert!(std::env::var_os("MODELMILL_WASM_REQUIRED").is_none(), "{why}");
        eprintln!("skipped: {why}");
        return;
    }
    let Some(module) = super::module() else { return };
    let bundle = make::load_bundle().expect("models and recordings are there");
    let recordings = bundle.recordings.iter().map(|(_, name, text, _)| (name, text));
    let models = bundle.models.iter().map(|(name, text)| (name, text));
    let files: Vec<(&String, &String)> = models.chain(recordings).collect();
    let open = json!({
        "model": "spidermill.toml", "data": ["with-rods-fit.csv"], "check": ["with-rods-check.csv"],
    });
    let questions = [
        ("open", open),
        ("compare", json!({ "places": true, "afresh": true })),
        ("diagnose", json!({})),
        ("add", json!({ "entry": 0 })),
        ("picture", json!({})),
        ("edit", json!({ "base": 2, "text": "schema = [" })),
        ("save", json!({})),
    ];

    let mut desk = RequestHandler::new(|| 0.0, |_| {});
    for (name, text) in &files {
        desk.add_file(name, text.as_bytes());
    }
    let here = questions.iter().map(|(question, body)| {
        let answer = desk.answer_request(question, body.to_string().as_bytes());
        serde_json::from_str(&answer).expect("JSON")
    });
    let here: Vec<Value> = here.collect();
    let found = &here[2]["told"]["found"]["entries"][0]["kind"];
    assert_eq!(found, "rod_inertia");

    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/all/in_browser/ask.mjs");
    let asked = scratch("questions.json");
    let text = json!({ "files": files, "questions": questions }).to_string();
    std::fs::write(&asked, text).expect("the questions are written");
    let node = Command::new("node")
        .args([script, module])
        .stdin(Stdio::from(File::open(&asked).expect("the questions")))
        .output();
    let output = node.expect("node was there before");
    let text = String::from_utf8_lossy(&output.stdout);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let there: Value = serde_json::from_str(&text).unwrap_or_else(|_| panic!("{text}"));
    assert!(there["heard"].as_u64() > Some(3), "the diagnosis says how far it is");
    let mut numbers = 0;
    for ((question, _), (here, there)) in questions
        .iter()
        .zip(here.iter().zip(there["answers"].as_array().expect("answers")))
    {
        let found = "/told/found";
        match (here.pointer(found), there.pointer(found)) {
            (Some(here), Some(there)) => {
                let parts = FOUND.iter();
                numbers += parts
                    .map(|part| compare(&here[part], &there[part], part))
                    .sum::<usize>();
            }
            _ => numbers += compare(here, there, question),
        }
    }
    assert!(numbers > 200, "{numbers} numbers were compared");
}

/// Compares two answers, and counts their numbers. How long something took is no part of them, and pictures and texts of
/// tables may round their last digit otherwise.
fn compare(here: &Value, there: &Value, place: &str) -> usize {
    match (here, there) {
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => (a.iter().zip(b).enumerate())
            .map(|(k, (a, b))| compare(a, b, &format!("{place}[{k}]")))
            .sum(),
        (Value::Object(a), Value::Object(b)) => {
            assert_eq!(a.len(), b.len(), "{place}");
            let members = a.iter().filter(|(name, _)| *name != "seconds");
            members
                .map(|(name, a)| compare(a, &b[name], &format!("{place}.{name}")))
                .sum()
        }
        (Value::Number(a), Value::Number(b)) => {
            let [a, b] = [a, b].map(|n| n.as_f64().expect("a number fits"));
            assert!(
                (a - b).abs() <= TOLERANCE * a.abs().max(b.abs()),
                "{place}: {a} here, {b} there"
            );
            1
        }
        _ => {
            assert_eq!(here, there, "{place}");
            0
        }
    }
}
