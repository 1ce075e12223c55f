//! Machines that hang upside down beside their model: the forces of bundled models, recorded with friction, are held against the
//! same models with gravity turned round, and against themselves.

use crate::made::{Made, bundled, run_of};
use modelmill::Model;
use modelmill::diagnose::DiagnosisOptions;
use modelmill::faults::RecordingFaultKind;
use modelmill::print::RustWording;
use modelmill::recording::RecordingOptions;
use modelmill::text::TerminalStyle;

/// What is said of gravity when a recording of one model is read for another.
fn told(of: &Model, by: &Model, name: &str, seed: u64) -> Vec<String> {
    let file = run_of(of, name, seed, Made::Friction(0, 0.2, 0.3));
    let recording = by.recording(file, &RecordingOptions::default()).expect("the recording");
    let notes = recording.notes().map(|note| note.says.in_library_words());
    let is_its = |says: &String| says.to_lowercase().contains("gravity");
    notes.filter(is_its).collect()
}

#[test]
fn gravity_that_pulls_the_other_way_is_told() {
    for name in ["puma560", "rx90", "two_link", "five_bar", "arm_parallelogram"] {
        let text = std::fs::read_to_string(bundled(name)).expect("a model");
        let turned = text.replace("\"-g\"", "\"g\"");
        assert_ne!(text, turned, "{name}");
        let [stands, hangs] = [text, turned].map(|t| Model::from_text(name, &t).expect("a model"));
        for seed in 0..3 {
            let says = told(&stands, &hangs, name, seed);
            assert!(
                says.iter().any(|says| says.contains("gravity points along")),
                "{name}, {seed}: {says:?}"
            );
            assert_eq!(told(&stands, &stands, name, seed), [""; 0], "{name}, {seed}");
        }
    }
}

/// A planar arm feels no gravity across its plane; within the plane its direction is still found.
#[test]
fn gravity_along_another_axis_of_a_plane_is_told() {
    let text = std::fs::read_to_string(bundled("two_link")).expect("a model");
    let turned = text.replace("[0, \"-g\", 0]", "[\"g\", 0, 0]");
    assert_ne!(text, turned);
    let [given, machine] = [text, turned].map(|text| Model::from_text("two_link", &text).expect("a model"));
    for seed in 0..3 {
        let says = told(&machine, &given, "two_link", seed);
        let is_stated = |says: &String| says.contains("gravity points along x of the base");
        assert!(says.iter().any(is_stated), "{seed}: {says:?}");
    }
}

/// One model has one gravity: recordings that show another direction are named, and where others contradict them nothing is
/// claimed.
#[test]
fn a_direction_of_gravity_is_stated_of_recordings_that_show_it() {
    let name = "two_link";
    let text = std::fs::read_to_string(bundled(name)).expect("a model");
    let [stands, hangs] =
        [text.clone(), text.replace("\"-g\"", "\"g\"")].map(|t| Model::from_text(name, &t).expect("a model"));
    let record = |machine: &Model, seed: u64| {
        let file = run_of(machine, name, seed, Made::Friction(0, 0.2, 0.3));
        let read = stands.recording(file, &RecordingOptions::default());
        read.expect("the recording")
    };
    let [first, second, upright] = [record(&hangs, 50), record(&hangs, 51), record(&stands, 52)];
    let options = DiagnosisOptions {
        repeat_with_nominal: false,
        ..DiagnosisOptions::default()
    };
    let found = (stands.diagnose(&[&first], &[&second], &options)).expect("a diagnosis");
    let [fault] = &found.corrected[..] else {
        panic!("{:?}", found.corrected);
    };
    assert_eq!(fault.kind, RecordingFaultKind::GravityDirection);
    assert_eq!(fault.recordings.len(), 2, "{fault:?}");
    // The model file may be wrong, so that this is no disturbance that is no model error.
    let lines = found.text(TerminalStyle::PLAIN, &RustWording);
    let text = lines.join("\n");
    assert!(text.contains("Before the next diagnosis: "), "{text}");
    let listed = text
        .split("(not model errors)")
        .nth(1)
        .and_then(|rest| rest.split("\n\n").next());
    assert!(!listed.is_some_and(|listed| listed.contains("gravity")), "{text}");

    let found = (stands.diagnose(&[&first], &[&upright], &options)).expect("a diagnosis");
    let [fault] = &found.unresolved[..] else {
        panic!("{:?} {:?}", found.corrected, found.unresolved);
    };
    assert_eq!(fault.kind, RecordingFaultKind::GravityDirection);
    assert!(
        found.missing.is_empty() && fault.clause.contains("agrees with the model file"),
        "{fault:?}"
    );
    assert!(found.completed_model().is_err());
}
