//! Rigs whose numbers contradict each other: a parallel crank that is too long cannot follow the other exactly.

use std::path::{Path, PathBuf};

use modelmill_reduction::{plan_file, propose_plan, reduce, sampled_forces};
use modelmill_rig::Rig;

fn here(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// The rig of a file with one number replaced at the first place after a mark, and with a tolerance, m.
fn changed(file: &str, mark: &str, [old, new]: [&str; 2], tolerance: f64) -> Rig {
    let path = here(file);
    let text = std::fs::read_to_string(&path).expect("a rig");
    let (before, after) = text.split_once(mark).expect("the mark");
    assert!(after.contains(old), "{old} stands after {mark}");
    let text = format!("{before}{mark}{}", after.replacen(old, new, 1));
    let files = modelmill_boundary::files::DiskFiles::default();
    let mut rig = modelmill_rig::load(&path.display().to_string(), &text, &files)
        .expect("a rig")
        .rig;
    rig.gap_tolerance = tolerance;
    rig
}

/// The whole robot with a parallel crank whose elbow is displaced by some mm.
fn longer_crank(millimetres: u32, tolerance: f64) -> Rig {
    let at = format!("at = [1.13{millimetres},");
    changed(
        "../model-spec/rigs/spidermill-full.toml",
        "name = \"R2_G1\"",
        ["at = [1.13,", &at],
        tolerance,
    )
}

/// The largest gap that a report states, m.
fn stated_gap(report: &modelmill_reduction::ReductionReport) -> f64 {
    let finding = report.findings.iter().find(|finding| finding.about == "joints");
    finding.expect("the gaps are reported").sizes[0].value
}

#[test]
fn gaps_within_the_tolerance_are_accepted_and_reported() {
    let plan = plan_file(&here("../model-spec/rigs/spidermill-plan.toml")).expect("a plan");
    let exact = reduce(&longer_crank(0, 0.0), &plan).expect("a robot that closes");
    let gaps = [1, 2].map(|millimetres| {
        let reduced = reduce(&longer_crank(millimetres, 2e-3), &plan)
            .unwrap_or_else(|failure| panic!("{}", failure.render(false)));
        // The plan keeps its structure: the same coordinates, parts and loops.
        let names = |text: &str| -> Vec<String> {
            let lines = text
                .lines()
                .filter(|line| line.starts_with("name = ") || line.starts_with("[["));
            lines.map(str::to_owned).collect()
        };
        assert_eq!(names(&reduced.model), names(&exact.model));
        stated_gap(&reduced.report)
    });
    // All joints of the loop share the displacement of one joint, in proportion.
    for (gap, displacement) in gaps.iter().zip([1e-3, 2e-3]) {
        assert!(*gap > 0.05 * displacement && *gap < displacement, "{gaps:?}");
    }
    assert!((gaps[1] / gaps[0] - 2.0).abs() < 0.05, "{gaps:?}");
    // Without a tolerance nothing is accepted, nor above it.
    for tolerance in [0.0, 1e-5] {
        let failure = reduce(&longer_crank(2, tolerance), &plan).expect_err("an open joint");
        let says = failure.render(false);
        assert!(
            says.contains("tolerance") && says.contains("`elbow_left_beside` by 2 mm"),
            "{says}"
        );
    }
}

/// A tolerance changes nothing if all joints close.
#[test]
fn a_tolerance_leaves_a_rig_that_closes_alone() {
    let plan = plan_file(&here("../model-spec/rigs/spidermill-plan.toml")).expect("a plan");
    let [exact, tolerant] = [0.0, 2e-3].map(|tolerance| reduce(&longer_crank(0, tolerance), &plan).expect("a model"));
    assert_eq!(exact.model, tolerant.model);
    assert!(stated_gap(&tolerant.report) < 1e-9);
}

/// Bodies that move alike but for the gaps become one part: the proposed plan is that of the rig that closes.
#[test]
fn a_plan_is_proposed_for_a_rig_with_gaps() {
    let file = "../model-spec/rigs/spidermill-seventeen.toml";
    let mark = "name = \"elbow_left_beside_front\"";
    let parts = |rig: &Rig| {
        let text = propose_plan(rig).unwrap_or_else(|says| panic!("{says}")).text;
        ["[[part]]", "[[lumped_mass]]", "[[loop]]"].map(|table| text.matches(table).count())
    };
    let exact = changed(file, mark, ["-0.456", "-0.456"], 0.0);
    let longer = |tolerance: f64| changed(file, mark, ["-0.456", "-0.457"], tolerance);
    assert_eq!(parts(&longer(2e-3)), parts(&exact));
    let refused = propose_plan(&longer(0.0)).expect_err("the cranks contradict each other");
    assert!(refused.contains("contradict each other"), "{refused}");
}

/// With joints closed as well as possible, forces change continuously: half the gap, half the change.
#[test]
fn forces_change_in_proportion_to_the_gap() {
    let forces = |millimetres: u32| -> Vec<f64> {
        let rig = longer_crank(millimetres, 5e-3);
        let sampled = sampled_forces(&rig, 40, 0.2).expect("forces");
        sampled.into_iter().flat_map(|(_, forces)| forces).collect()
    };
    let exact = forces(0);
    let change = |millimetres: u32| {
        let changed = forces(millimetres);
        assert_eq!(changed.len(), exact.len());
        let squares = changed.iter().zip(&exact).map(|(a, b)| (a - b).powi(2));
        (squares.sum::<f64>() / exact.iter().map(|x| x * x).sum::<f64>()).sqrt()
    };
    let [one, two] = [1, 2].map(change);
    assert!(one > 1e-6 && two < 0.02, "{one} {two}");
    assert!((two / one - 2.0).abs() < 0.05, "{one} {two}");
}
