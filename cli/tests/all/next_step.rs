//! The next step of commands that compare a model with recordings: where an effect is missing, all of them send to the
//! diagnosis, and none to another recording.

use crate::common::{json, model, workspace};

/// A recording of a case beside the workspace; none where it is absent.
fn recording(case: &str, file: &str) -> Option<String> {
    let path = workspace("../shared/data").join(case).join(file);
    if !path.is_file() {
        println!("Not tested: there is no recording {}.", path.display());
        return None;
    }
    Some(path.to_string_lossy().into_owned())
}

#[track_caller]
fn sends_to_diagnosis(args: &[&str]) {
    let answer = json(args);
    let next = answer["next"]
        .as_str()
        .unwrap_or_else(|| panic!("no next step of {args:?}"));
    assert!(next.contains("Next: `modelmill diagnose`"), "{args:?}: {next}");
    assert!(!next.contains("`modelmill excite`"), "{args:?}: {next}");
}

#[test]
fn missing_friction_is_diagnosed_first() {
    let plain = model("spidermill.toml");
    let (Some(fit), Some(check)) = (
        recording("spidermill-harsh/shared-and-single", "fit.csv"),
        recording("spidermill-harsh/shared-and-single", "check.csv"),
    ) else {
        return;
    };
    sends_to_diagnosis(&["identify", &plain, "--data", &fit, "--json"]);
    sends_to_diagnosis(&["identify", &plain, "--data", &fit, "--check", &check, "--json"]);
    sends_to_diagnosis(&["compare", &plain, "--data", &fit, "--json"]);
}

/// The fit of this arm without one friction has many uncertain parameters, and predicts one joint worse than the nominal
/// values do.
#[test]
fn uncertain_parameters_are_no_reason_to_record_again_while_friction_is_missing() {
    let case = "beyond/three-disturbances-coulomb";
    let [Some(arm), Some(fit), Some(check)] =
        ["model.toml", "run0.csv.gz", "run1.csv.gz"].map(|file| recording(case, file))
    else {
        return;
    };
    let args = ["identify", &arm, "--data", &fit, "--check", &check, "--json"];
    sends_to_diagnosis(&args);
    let next = json(&args)["next"].to_string();
    assert!(
        next.contains("worse than the nominal ones") && next.contains("joint1"),
        "{next}"
    );
}

/// A complete model needs no diagnosis, and `compare` says nothing.
#[test]
fn a_complete_model_has_no_finding() {
    let recording = crate::common::run("plain-check.csv");
    let answer = json(&["compare", &model("spidermill.toml"), "--data", &recording, "--json"]);
    assert!(answer["next"].is_null(), "{}", answer["next"]);
}
