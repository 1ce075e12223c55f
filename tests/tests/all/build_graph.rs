//! What `cargo test --workspace` compiles: every library once, for build scripts and for tests alike.
//!
//! Cargo resolves features of build scripts apart from those of programs, and takes other profiles for them. Where one of
//! either differs, the crate and all that use it are compiled a second time, which for the derivation takes minutes.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

/// The compilations of `cargo test --workspace`, none of which is run.
///
/// `cargo tree` is stable and prints features, but neither profiles nor compilations. The build plan is a preview
/// feature; `RUSTC_BOOTSTRAP` makes the stable program print it. Its format has been version 1 since 2020.
fn planned_units() -> Vec<Value> {
    let plan = Command::new(env!("CARGO"))
        .args(["test", "--workspace", "--locked", "--offline"])
        .args(["--unit-graph", "-Z", "unstable-options"])
        .env("RUSTC_BOOTSTRAP", "1")
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join(".."))
        .output()
        .expect("cargo runs");
    let said = String::from_utf8_lossy(&plan.stderr);
    assert!(plan.status.success(), "{said}");
    let mut plan: Value = serde_json::from_slice(&plan.stdout).expect("a plan");
    assert_eq!(plan["version"], 1, "the plan has another form");
    match plan["units"].take() {
        Value::Array(units) => units,
        _ => panic!("a list of units"),
    }
}

/// Whether a unit compiles a library for others to use, not its tests.
fn compiles_library(unit: &Value) -> bool {
    let kinds = unit["target"]["kind"].as_array().expect("kinds");
    let is_library = kinds
        .iter()
        .any(|kind| ["lib", "rlib", "cdylib", "proc-macro"].contains(&kind.as_str().unwrap_or("")));
    is_library && unit["mode"] == "build"
}

#[test]
fn every_library_is_compiled_once() {
    let units = planned_units();
    // A user's settings may name a target, for which everything is compiled apart from build scripts.
    let mut compilations: BTreeMap<(String, String), Vec<String>> = BTreeMap::new();
    for unit in units.iter().filter(|unit| compiles_library(unit)) {
        let package = unit["pkg_id"].as_str().expect("a package");
        let compilation = format!("features {}, profile {}", unit["features"], unit["profile"]);
        let key = (package.to_string(), unit["platform"].to_string());
        compilations.entry(key).or_default().push(compilation);
    }
    for name in [
        "modelmill-algebra",
        "modelmill-boundary",
        "modelmill-spec",
        "modelmill-draw",
        "modelmill-codegen",
        "modelmill-emit",
        "modelmill-runtime",
        "modelmill-build",
        "nalgebra",
        "num-bigint",
    ] {
        let is_there = |(package, _): &(String, String)| package.contains(&format!("{name}@"));
        assert!(compilations.keys().any(is_there), "{name} is not planned");
    }
    let repeated: Vec<String> = compilations
        .iter()
        .filter(|(_, all)| all.len() > 1)
        .map(|((package, _), all)| format!("{package}:\n    {}", all.join("\n    ")))
        .collect();
    assert!(
        repeated.is_empty(),
        "these are compiled more than once; where features differ, see the build-dependencies of `generated`:\n{}",
        repeated.join("\n")
    );
}
