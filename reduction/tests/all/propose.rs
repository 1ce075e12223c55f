//! A proposed plan: the seventeen bodies of the SpiderMill become the structure of the bundled model, from a table of
//! masses and a list of joints, in whichever order they stand.

use std::path::Path;

use modelmill_boundary::files::{DiskFiles, MemoryFiles};
use modelmill_reduction::{plan, propose_plan, reduce};
use modelmill_rig::Rig;

use crate::{derived, shuffled};

fn rigs(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../model-spec/rigs")
        .join(name)
}

fn load(path: &Path, text: &str) -> Rig {
    let loaded = modelmill_rig::load(&path.to_string_lossy(), text, &DiskFiles::default());
    loaded.unwrap_or_else(|failure| panic!("{failure}")).rig
}

/// The model of the proposed plan.
fn proposed_model(rig: &Rig) -> (String, String) {
    let proposal = propose_plan(rig).unwrap_or_else(|says| panic!("{says}"));
    let made = plan("proposed.toml", &proposal.text).unwrap_or_else(|failure| panic!("{failure}\n{}", proposal.text));
    let reduced = reduce(rig, &made).unwrap_or_else(|failure| panic!("{failure}\n{}", proposal.text));
    (reduced.model, proposal.text)
}

/// Numbers of parts, lumped masses, coordinates and loops.
fn structure(model: &str) -> [usize; 4] {
    let loaded = modelmill_spec::load("model.toml", model, &MemoryFiles::default()).expect("a model");
    let mechanism = &loaded.mechanism;
    [
        mechanism.parts.len(),
        mechanism.lumped_masses.len(),
        mechanism.coordinates.len(),
        mechanism.loops.len(),
    ]
}

/// Number of base parameters.
fn n_base(model: &str) -> usize {
    derived(model).reduction.retained.len()
}

#[test]
fn seventeen_bodies_become_the_structure_of_the_paper() {
    let bundled = std::fs::read_to_string(rigs("../models/spidermill.toml")).expect("the bundled model");
    let expected = structure(&bundled);
    let path = rigs("spidermill-seventeen.toml");
    let text = std::fs::read_to_string(&path).expect("the rig");
    for seed in 0..3 {
        let text = if seed == 0 { text.clone() } else { shuffled(&text, seed) };
        let (model, plan) = proposed_model(&load(&path, &text));
        assert_eq!(structure(&model), expected, "seed {seed}\n{plan}\n{model}");
        if seed == 0 {
            assert!(plan.contains("the error of each statement"), "{plan}");
            assert_eq!(n_base(&model), n_base(&bundled), "{plan}\n{model}");
        }
    }
}

/// The rig of eleven groups, whose joints have points on both bodies, has the same structure.
#[test]
fn eleven_groups_become_the_same_structure() {
    let bundled = std::fs::read_to_string(rigs("../models/spidermill.toml")).expect("the bundled model");
    let path = rigs("spidermill-full.toml");
    let text = std::fs::read_to_string(&path).expect("the rig");
    let (model, plan) = proposed_model(&load(&path, &text));
    assert_eq!(structure(&model), structure(&bundled), "{plan}\n{model}");
}

/// Without symmetry there is nothing to share: symbols stay separate, and similar values are mentioned.
#[test]
fn unequal_halves_keep_their_symbols() {
    let path = rigs("spidermill-full.toml");
    let text = std::fs::read_to_string(&path).expect("the rig");
    let heavier = text.replacen("mass = 30.57582", "mass = 30.9", 1);
    assert_ne!(text, heavier);
    let proposal = propose_plan(&load(&path, &heavier)).unwrap_or_else(|says| panic!("{says}"));
    let symbol = |part: &str| {
        let table = proposal
            .text
            .split("[[part]]")
            .find(|table| table.contains(&format!("name = \"{part}\"")));
        let table = table.expect("the part");
        table
            .split("mass = \"")
            .nth(1)
            .expect("a symbol")
            .split('"')
            .next()
            .map(str::to_owned)
    };
    assert_ne!(symbol("G8"), symbol("G11"), "{}", proposal.text);
    assert!(
        proposal.text.contains("# mass of G8 and G11: the difference is 0.32"),
        "{}",
        proposal.text
    );
}

/// A spatial rig is refused with a reason.
#[test]
fn rigs_that_are_not_planar_are_refused() {
    let text = r#"
        schema = 1
        name = "spatial"
        body = [
            { name = "a", mass = 1, centre = [0.5, 0, 0], inertia = { xx = 0.1, yy = 0.1, zz = 0.1 } },
            { name = "b", mass = 1, centre = [1.5, 0, 0], inertia = { xx = 0.1, yy = 0.1, zz = 0.1 } },
        ]
        joint = [
            { name = "one", kind = "revolute", between = ["base", "a"], at = [0, 0, 0] },
            { name = "two", kind = "revolute", between = ["a", "b"], at = [1, 0, 0], axis = [1, 0, 0] },
        ]
        coordinate = [{ name = "q1", joint = "one" }, { name = "q2", joint = "two" }]
        drive = [{ name = "m1", joint = "one" }, { name = "m2", joint = "two" }]
    "#;
    let says = propose_plan(&load(Path::new("spatial.toml"), text)).expect_err("refused");
    assert!(
        says.contains("do not move in one plane") && says.contains("by hand"),
        "{says}"
    );
}

/// Rods whose other end slides have no place in a model of rotating parts: they are left out, and the rest is the same.
#[test]
fn sliding_rods_are_left_out() {
    let path = rigs("spidermill-with-rods.toml");
    let text = std::fs::read_to_string(&path).expect("the rig");
    let (model, plan) = proposed_model(&load(&path, &text));
    assert!(plan.contains("leave_out = [\"rod_left\", \"rod_right\"]"), "{plan}");
    let bundled = std::fs::read_to_string(rigs("../models/spidermill.toml")).expect("the bundled model");
    assert_eq!(structure(&model), structure(&bundled), "{model}");
}
