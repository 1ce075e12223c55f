//! Clocks and lengths: times that are all too long have the forces of lengths that are all too short, and an arm with one
//! length cannot show which of the two is wrong.

use crate::made::{Made, bundled, run_of};
use modelmill::Model;
use modelmill::diagnose::{DiagnosisFindings, DiagnosisOptions};
use modelmill::print::RustWording;
use modelmill::recording::RecordingOptions;

/// The diagnosis of the two-link arm by recordings of a machine.
fn diagnosis(machine: &Model, made: Made) -> DiagnosisFindings {
    let model = Model::open(bundled("two_link")).expect("a model");
    let [first, second] = [31, 32].map(|seed| {
        let file = run_of(machine, "two_link", seed, made);
        model
            .recording(file, &RecordingOptions::default())
            .expect("the recording")
    });
    let options = DiagnosisOptions {
        repeat_with_nominal: false,
        ..DiagnosisOptions::default()
    };
    model.diagnose(&[&first], &[&second], &options).expect("a diagnosis")
}

/// Whether a diagnosis names both the clock and the length `L` for the same error.
fn names_both(found: &DiagnosisFindings) -> bool {
    let answer = found.json(&RustWording);
    let is = |one: &serde_json::Value, kind: &str, at: &str| one["kind"] == kind && one["at"][0] == at;
    let claims = ["effects", "disturbances"].map(|list| answer[list].as_array().cloned().unwrap_or_default());
    claims.into_iter().flatten().any(|claim| {
        let others = claim["indistinguishable_from"].as_array().cloned().unwrap_or_default();
        let mut all = others.iter().chain([&claim]);
        let mut again = all.clone();
        all.any(|one| is(one, "time_base", "t")) && again.any(|one| is(one, "constant_error", "L"))
    })
}

#[test]
fn a_clock_and_a_length_are_named_together() {
    let text = std::fs::read_to_string(bundled("two_link")).expect("a model");
    let longer = text.replace("L = { value = 0.5,", "L = { value = 0.54,");
    assert_ne!(text, longer);
    let machine = |text: &str| Model::from_text("two_link", text).expect("a model");
    for (what, machine, made) in [
        ("length", machine(&longer), Made::Nothing),
        ("clock", machine(&text), Made::Clock(1.04)),
    ] {
        let found = diagnosis(&machine, made);
        assert!(names_both(&found), "{what}: {}", found.verdict_text());
    }
}
