//! `diagnose` on recordings with what real sensors, drives and days do to data: the model lacks nothing, and what is wrong is
//! named. The recordings lie beside the workspace; `cargo bench -p modelmill-lab --bench harsh` scores all of them.

use crate::common::{json, scratch, workspace};

/// Cases in which nothing of the model is missing, with a kind of disturbance that must be named, if any.
const CASES: [(&str, Option<&str>); 7] = [
    ("clean", None),
    ("noise-medium", Some("coloured_noise")),
    ("hum", Some("periodic_in_time")),
    ("friction-fades", Some("friction_drift")),
    ("other-day", Some("different_runs")),
    ("contact-check", Some("contact_event")),
    ("jitter-unstamped", Some("time_jitter")),
];

#[test]
fn what_recordings_have_is_no_missing_part_of_the_model() {
    let folder = workspace("../shared/data/spidermill-harsh");
    if !folder.join("model-friction.toml").is_file() {
        println!(
            "Not tested: there are no recordings in {} beside the workspace.",
            folder.display()
        );
        return;
    }
    let friction = std::fs::read_to_string(folder.join("model-friction.toml")).expect("a model file");
    let plain = workspace("model-spec/models/spidermill.toml");
    let text = friction.replace("\"spidermill.toml\"", &format!("{:?}", plain.to_string_lossy()));
    let model = scratch("harsh-friction.toml");
    std::fs::write(&model, text).expect("a variant of the model");
    for (case, kind) in CASES {
        let [fit, check] = ["fit.csv", "check.csv"].map(|file| {
            let path = folder.join(case).join(file);
            path.to_string_lossy().into_owned()
        });
        let answer = json(&["diagnose", &model, "--data", &fit, "--check", &check, "--json"]);
        assert_eq!(answer["verdict"], "adequate", "{case}: {answer:#}");
        assert_eq!(answer["effects"].as_array().map(Vec::len), Some(0), "{case}");
        let named = answer["disturbances"].as_array().expect("a list");
        match kind {
            Some(kind) => assert!(named.iter().any(|one| one["kind"] == kind), "{case}: {named:?}"),
            None => assert!(named.is_empty(), "{case}: {named:?}"),
        }
        for (drive, budget) in answer["budget"].as_object().expect("an object") {
            let parts = ["noise", "not_repeating", "model"].map(|part| budget[part].as_f64());
            let sound = parts.iter().all(|p| p.is_some_and(|p| (0.0..0.5).contains(&p)));
            assert!(sound && budget["rms"].as_f64() > Some(1.0), "{case}, {drive}: {budget}");
        }
    }
}
