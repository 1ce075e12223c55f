//! `export`: a model as URDF or MJCF.

use crate::common::{model, printed, ran, refused, run, scratch};

#[test]
fn the_ending_says_the_format() {
    for (ending, head) in [("urdf", "<robot name=\"panda\">"), ("xml", "<mujoco model=\"panda\">")] {
        let out = scratch(&format!("exported.{ending}"));
        let told = ran(&["export", &model("panda.toml"), "--out", &out]);
        assert_eq!(told.status, 0, "{}", told.err);
        let text = std::fs::read_to_string(&out).expect("a description");
        assert!(text.contains(head), "{text}");
        // What was written can be read.
        let back = scratch(&format!("back-from-{ending}.toml"));
        let told = ran(&["import", &out, "--out", &back]);
        assert_eq!(told.status, 0, "{}", told.err);
        assert!(printed(&["check", &back]).contains("43 base parameters"));
    }
    let says = refused(1, &["export", &model("panda.toml"), "--out", &scratch("exported.txt")]);
    assert!(says.contains(".urdf") && says.contains("--format"), "{says}");
}

#[test]
fn base_parameters_are_no_bodies() {
    let fit = scratch("base-only.json");
    let spidermill = model("spidermill.toml");
    let data = run("with-rods-fit.csv");
    printed(&["identify", &spidermill, "--data", &data, "--out", &fit]);
    let out = scratch("exported-base-only.xml");
    let says = refused(1, &["export", &spidermill, "--parameters", &fit, "--out", &out]);
    assert!(says.contains("--physical"), "{says}");
    let says = refused(1, &["export", &model("spidermill-paper.toml"), "--out", &out]);
    assert!(says.contains("moment_at"), "{says}");
}
