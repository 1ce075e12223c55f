//! A few recordings of the benchmark of hidden effects, and what is hidden in them is found.

use std::path::Path;

use modelmill_lab::case::HiddenCase;
use modelmill_lab::harness::TestedProgram;
use modelmill_lab::judge::{FALL, judge};
use modelmill_lab::placed::PlacedEffect;
use modelmill_lab::plant::SpidermillPlant;
use modelmill_lab::record;

/// One effect, two, none, and one that no library holds.
#[test]
fn hidden_effects_are_found() {
    const SEED: u64 = 1001;
    let plant = SpidermillPlant::load().expect("rig and model");
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("hidden_diagnosis");
    std::fs::create_dir_all(&folder).expect("a folder for the recordings");
    let program = TestedProgram::new(Path::new(env!("CARGO_BIN_EXE_modelmill")));
    for number in [1, 5, 6, 12, 24, 34] {
        let case = HiddenCase::draw(&plant, SEED, number).expect("a case");
        let mut floor = 0.0;
        let files = record::FILES.map(|file| folder.join(format!("{number}-{file}")));
        for (which, file) in files.iter().enumerate() {
            let recorded = record::record(&case, SEED, which).expect("a recording");
            floor = recorded.floor;
            std::fs::write(file, recorded.csv).expect("the recording is written");
        }
        let (answer, _) = program.diagnose(&plant.model, &files);
        let answer = answer.unwrap_or_else(|why| panic!("{}: {why}", case.truth()));
        let mut excess = |claims: &[PlacedEffect]| {
            let left = case.excess(&plant, claims);
            left.unwrap_or(f64::INFINITY)
        };
        let mark = judge(case.class, &case.placed(), None, &answer, &mut excess);
        assert!(mark.is_right(), "{}: {}; {answer:?}", case.truth(), mark.in_words());
        if !case.hidden.is_empty() {
            let last = answer.steps.last().expect("a ladder").check;
            assert!(last <= FALL * floor, "{}: {last} over {floor}", case.truth());
        }
    }
}
