//! The library under WebAssembly gives the numbers that it gives here.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

const TARGET: &str = "wasm32-unknown-unknown";

/// Largest deviation of a number, relative: sines and cosines come from another library there.
const TOLERANCE: f64 = 1e-9;

#[test]
fn node_derives_identifies_and_diagnoses_with_the_same_numbers() {
    let Some(module) = module() else { return };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/print_answer.mjs");
    let node = Command::new("node").arg(script).arg(module).output();
    let output = node.expect("node was there before");
    let text = String::from_utf8_lossy(&output.stdout);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let there: Value = serde_json::from_str(&text).unwrap_or_else(|_| panic!("{text}"));
    let here = modelmill_in_wasm::answer().unwrap();
    assert_eq!(here["missing"][0]["kind"], "rod_inertia");
    assert_eq!(here["base"].as_array().map(Vec::len), Some(4));
    let numbers = compare(&here, &there, "answer");
    assert!(numbers >= 14, "{numbers} numbers were compared");
}

/// The module, built now; `None`, with the reason, where this machine has no compiler or no Node for it.
fn module() -> Option<PathBuf> {
    let skip = |why: &str| {
        assert!(
            std::env::var_os("MODELMILL_WASM_REQUIRED").is_none(),
            "{why}"
        );
        eprintln!("skipped: {why}");
    };
    let runs = |program: &str| Command::new(program).arg("--version").output().is_ok();
    if !runs("node") {
        skip("there is no `node` to run WebAssembly");
        return None;
    }
    let rustc = Command::new("rustc")
        .args(["--print", "target-libdir", "--target", TARGET])
        .output()
        .expect("rustc runs");
    let library = String::from_utf8_lossy(&rustc.stdout).trim().to_owned();
    if library.is_empty() || !Path::new(&library).is_dir() {
        skip("the compiler lacks the target: `rustup target add wasm32-unknown-unknown`");
        return None;
    }
    // The folder of this test is `deps` in that of its profile, and that in the folder of builds or of a target in it.
    let test = std::env::current_exe().expect("a test has a path");
    let builds = test.ancestors().nth(3).expect("a folder of builds");
    let status = Command::new(env!("CARGO"))
        .args(["build", "--locked", "--package", "modelmill-in-wasm"])
        .args(["--target", TARGET, "--target-dir"])
        .arg(builds)
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../.."))
        .status()
        .expect("cargo runs");
    assert!(status.success(), "the library builds for {TARGET}");
    Some(builds.join(TARGET).join("debug/modelmill_in_wasm.wasm"))
}

/// Compares two answers, and counts their numbers.
fn compare(here: &Value, there: &Value, place: &str) -> usize {
    match (here, there) {
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => (a.iter().zip(b).enumerate())
            .map(|(k, (a, b))| compare(a, b, &format!("{place}[{k}]")))
            .sum(),
        (Value::Object(a), Value::Object(b)) => {
            assert_eq!(a.len(), b.len(), "{place}");
            let members = a.iter();
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
