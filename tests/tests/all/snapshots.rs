//! Pages and emitted code of every bundled model, for review: a change of them shows in the diff.
//!
//! Their truth is shown elsewhere: `emitted`, `spidermill`, `published_groupings`, `operation_counts`.

use modelmill_codegen::review::{PageFormat, page};
use modelmill_tests::fixtures::derived;

/// Models whose code is too long for anyone to look through; their pages are looked at.
const LONG: [&str; 3] = ["gough_stewart", "gough_stewart_tied", "humanoid"];

macro_rules! snapshots {
    ($($name:ident: $file:literal),* $(,)?) => {$(
        #[test]
        fn $name() {
            let derivation = derived($file);
            let mut settings = insta::Settings::clone_current();
            settings.set_snapshot_path("../snapshots");
            settings.set_prepend_module_to_snapshot(false);
            settings.set_omit_expression(true);
            settings.bind(|| {
                insta::assert_snapshot!(concat!($file, ".page"), page(&derivation, PageFormat::Markdown, None));
                if !LONG.contains(&$file) {
                    insta::assert_snapshot!(concat!($file, ".rs"), modelmill_emit::emit(&derivation).file());
                }
            });
        }
    )*};
}

snapshots! {
    arm_four_bar: "arm_four_bar",
    arm_parallelogram: "arm_parallelogram",
    cloos: "cloos",
    delta: "delta",
    delta_tied: "delta_tied",
    drone: "drone",
    emps: "emps",
    emps_directional: "emps-directional",
    five_bar: "five_bar",
    four_bar: "four_bar",
    gough_stewart: "gough_stewart",
    gough_stewart_tied: "gough_stewart_tied",
    humanoid: "humanoid",
    panda: "panda",
    parallelogram: "parallelogram",
    puma560: "puma560",
    quadruped: "quadruped",
    rx90: "rx90",
    scara: "scara",
    slider_crank: "slider_crank",
    spidermill: "spidermill",
    spidermill_paper: "spidermill-paper",
    stanford: "stanford",
    three_rpr: "three_rpr",
    three_rrr: "three_rrr",
    two_link: "two_link",
    tx40: "tx40",
}

#[test]
fn every_bundled_model_has_its_snapshots() {
    let models = modelmill_tests::fixtures::model_file("two_link");
    let folder = models.parent().expect("models lie in a folder");
    let snapshots = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/snapshots");
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "toml") {
            let name = path.file_stem().unwrap().to_string_lossy().into_owned();
            let kinds = if LONG.contains(&name.as_str()) { 1 } else { 2 };
            for kind in &["page", "rs"][..kinds] {
                let snapshot = snapshots.join(format!("{name}.{kind}.snap"));
                assert!(snapshot.exists(), "{name} is missing among the snapshots");
            }
        }
    }
}
