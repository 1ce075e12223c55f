//! Machines that hang upside down beside their model: the forces of bundled models, recorded with friction, are held against the
//! same models with gravity turned round, and against themselves.

use crate::made::{Made, bundled, run_of};
use modelmill::Model;
use modelmill::recording::RecordingOptions;

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
