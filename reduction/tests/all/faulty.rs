//! Faulty plans for the whole robot: each fixture's whole message is a snapshot, so that every change of a message is
//! seen.

use std::path::{Path, PathBuf};

use modelmill_reduction::{plan, plan_file, reduce};

fn here(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

#[test]
fn messages() {
    let rig = modelmill_rig::load_file(&here("../model-spec/rigs/spidermill-full.toml"))
        .expect("a rig")
        .rig;
    let mut names: Vec<String> = std::fs::read_dir(here("tests/faulty"))
        .expect("fixtures")
        .map(|entry| entry.expect("a file").file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    assert!(names.len() >= 15);
    insta::with_settings!({ snapshot_path => "../snapshots", prepend_module_to_snapshot => false, omit_expression => true }, {
        for name in names {
            let text = std::fs::read_to_string(here("tests/faulty").join(&name)).expect("a fixture");
            let outcome = plan(&name, &text).and_then(|plan| reduce(&rig, &plan));
            let failure = outcome.map(|_| ()).expect_err(&name);
            insta::assert_snapshot!(name.trim_end_matches(".toml").to_owned(), failure.render(false));
        }
    });
}

#[test]
fn a_plan_that_cannot_be_read() {
    let failure = plan_file(Path::new("no/such/plan.toml")).expect_err("no file");
    assert!(failure.render(false).contains("cannot read `no/such/plan.toml`"));
}

/// A parallel crank that is 2 mm too long: the residual of the assembly is shared by all joints of the loop, so the gap of
/// the joint that is wrong is stated as well.
#[test]
fn a_joint_that_is_open_is_named_with_its_gap() {
    let text = std::fs::read_to_string(here("../model-spec/rigs/spidermill-full.toml")).expect("a rig");
    let (before, after) = text
        .split_once("name = \"R2_G1\"")
        .expect("the elbow of the parallel crank");
    let text = format!(
        "{before}name = \"R2_G1\"{}",
        after.replacen("at = [1.13,", "at = [1.132,", 1)
    );
    let files = modelmill_boundary::files::DiskFiles::default();
    let rig = modelmill_rig::load("gap.toml", &text, &files).expect("a rig").rig;
    let plan = plan_file(&here("../model-spec/rigs/spidermill-plan.toml")).expect("a plan");
    let message = reduce(&rig, &plan).expect_err("an open joint").render(false);
    assert!(message.contains("`elbow_left_beside` by 2 mm"), "{message}");
}
