//! A few cases of the benchmark of hidden effects, from end to end; `cargo bench -p modelmill --bench hidden_effects`
//! runs all of them.
#![allow(
    dead_code,
    reason = "modules of the benchmark, of which the score is tested elsewhere"
)]

#[path = "../benches/hidden_effects/alternatives.rs"]
mod alternatives;
#[path = "../benches/hidden_effects/answer.rs"]
mod answer;
#[path = "../benches/hidden_effects/ask.rs"]
mod ask;
#[path = "../benches/hidden_effects/case.rs"]
mod case;
#[path = "../benches/hidden_effects/columns.rs"]
mod columns;
#[path = "../benches/hidden_effects/course.rs"]
mod course;
#[path = "../benches/hidden_effects/hidden.rs"]
mod hidden;
#[path = "../benches/hidden_effects/judge.rs"]
mod judge;
#[path = "../benches/hidden_effects/outside.rs"]
mod outside;
#[path = "../benches/hidden_effects/placed.rs"]
mod placed;
#[path = "../benches/hidden_effects/plant.rs"]
mod plant;
#[path = "../benches/hidden_effects/random.rs"]
mod random;
#[path = "../benches/hidden_effects/record.rs"]
mod record;
#[path = "../benches/hidden_effects/span.rs"]
mod span;

use std::path::Path;

use case::Case;
use judge::{FALL, judge};
use plant::Plant;

/// One effect, two, none, and one that no library holds.
#[test]
fn hidden_effects_are_found() {
    const SEED: u64 = 1001;
    let specs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../model-spec");
    let plant = Plant::load(&specs).expect("rig and model");
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("hidden_diagnosis");
    std::fs::create_dir_all(&folder).expect("a folder for the recordings");
    let program = Path::new(env!("CARGO_BIN_EXE_modelmill"));
    for number in [1, 5, 6, 12, 24, 34] {
        let case = Case::draw(&plant, SEED, number).expect("a case");
        let mut floor = 0.0;
        let files = record::FILES.map(|file| folder.join(format!("{number}-{file}")));
        for (which, file) in files.iter().enumerate() {
            let recorded = record::record(&case, SEED, which).expect("a recording");
            floor = recorded.floor;
            std::fs::write(file, recorded.csv).expect("the recording is written");
        }
        let (answer, _) = ask::diagnose(program.as_os_str(), &plant.model, &files[0], &files[1]);
        let answer = answer.unwrap_or_else(|why| panic!("{}: {why}", case.truth()));
        let mut excess = |claims: &[placed::Placed]| {
            let left = case.excess(&plant, claims);
            left.unwrap_or(f64::INFINITY)
        };
        let mark = judge(case.class, &case.placed(), &answer, &mut excess);
        assert!(
            mark.is_right(),
            "{}: {}; {answer:?}",
            case.truth(),
            mark.says()
        );
        if !case.hidden.is_empty() {
            let last = answer.steps.last().expect("a ladder").check;
            assert!(
                last <= FALL * floor,
                "{}: {last} over {floor}",
                case.truth()
            );
        }
    }
}
