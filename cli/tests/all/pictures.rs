//! Mechanisms are drawn at the pose that is asked for, and over each other.

use crate::common::{model, printed, refused, scratch};

/// The picture that `args` write.
fn drawn(name: &str, args: &[&str]) -> String {
    let file = scratch(name);
    let mut all = args.to_vec();
    all.extend(["--picture", &file]);
    printed(&all);
    let text = std::fs::read_to_string(&file).expect("the picture");
    roxmltree::Document::parse(&text).expect("well-formed SVG");
    text
}

#[test]
fn a_pose_and_a_view_can_be_chosen() {
    let spidermill = model("spidermill.toml");
    let nominal = drawn("nominal.svg", &["check", &spidermill]);
    for name in ["theta1", "spindle_left", "R3m"] {
        assert!(nominal.contains(&format!(">{name}</text>")), "{name}");
    }
    let moved = drawn("moved.svg", &["check", &spidermill, "--at", "theta1=1.6"]);
    assert_ne!(nominal, moved);
    // Loops are closed there: a loop that were open would have two ends.
    let rings = |text: &str| text.matches("class=\"closing\"").count();
    assert_eq!(rings(&nominal), rings(&moved));
    let panda = model("panda.toml");
    let aside = drawn("aside.svg", &["check", &panda, "--view", "30,20"]);
    assert_ne!(
        aside,
        drawn("above.svg", &["check", &panda, "--view", "-30,80", "--frames"])
    );
}

#[test]
fn a_variant_lies_over_what_it_was() {
    let [before, after] = ["arm_four_bar.toml", "arm_parallelogram.toml"].map(model);
    let both = drawn("both.svg", &["diff", &before, &after]);
    assert_eq!(both.matches("class=\"shadow\"").count(), 1);
}

#[test]
fn what_cannot_be_drawn_is_said() {
    let spidermill = model("spidermill.toml");
    let file = scratch("never.svg");
    let at = |value: &str| refused(2, &["check", &spidermill, "--picture", &file, "--at", value]);
    let unknown = at("gamma1=1");
    assert!(
        unknown.contains("`gamma1` is no active coordinate") && unknown.contains("theta1, theta2"),
        "{unknown}"
    );
    let apart = at("theta1=-1.5");
    assert!(apart.contains("loops of spidermill cannot close"), "{apart}");
    refused(2, &["check", &spidermill, "--at", "theta1=1"]);
    refused(2, &["check", &spidermill, "--picture", &spidermill]);
}
