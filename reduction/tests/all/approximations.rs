//! What is not exact is found and sized: each number here is worked out by hand.

use modelmill_boundary::files::MemoryFiles;
use modelmill_reduction::{PlanarReduction, ReductionFinding, default_plan, plan, reduce, sampled_forces};
use modelmill_rig::Rig;

fn rig(text: &str) -> Rig {
    let text = format!("schema = 1\nname = \"test\"\ngravity = [0, -9.81, 0]\n{text}");
    modelmill_rig::load("test.toml", &text, &MemoryFiles::default())
        .unwrap_or_else(|f| panic!("{f}"))
        .rig
}

/// A front and a back bar, welded; and an arm with a rod on it.
fn machine() -> Rig {
    rig(r#"
        body = [
            { name = "front", at = [0, 0, 0.1], mass = 1, centre = [0.3, 0.01, 0], inertia = { zz = 0.02 } },
            { name = "back", at = [0, 0, -0.1], mass = 1.2, centre = [0.3, 0.01, 0], inertia = { zz = 0.02 } },
            { name = "arm", at = [2, 0, 0], mass = 2.4, centre = [0.35, 0, 0], inertia = { zz = 0.05 } },
            { name = "rod", at = [2, 0, 0], mass = 0.6, centre = [0.5, 0, 0], inertia = { zz = 0.05 } },
        ]
        point = [
            { name = "O", on = "base", at = [0, 0, 0] },
            { name = "P", on = "base", at = [2, 0, 0] },
            { name = "D", on = "base", at = [0.2, -0.8, 0] },
            { name = "front_hinge", on = "front", at = [0, 0, -0.1] },
            { name = "front_end", on = "front", at = [1, 0, -0.1] },
            { name = "contact", on = "front", at = [0.2, 0.05, -0.1] },
            { name = "near", on = "arm", at = [0, 0, 0] },
            { name = "far", on = "arm", at = [1, 0, 0] },
        ]
        joint = [
            { name = "left", kind = "revolute", between = ["base", "front"], at = [0, 0, 0] },
            { name = "weld", kind = "fixed", between = ["front", "back"], at = [0, 0, 0] },
            { name = "right", kind = "revolute", between = ["base", "arm"], at = [2, 0, 0] },
            { name = "clamp", kind = "fixed", between = ["arm", "rod"], at = [2, 0, 0] },
        ]
        coordinate = [{ name = "q1", joint = "left" }, { name = "q2", joint = "right" }]
        drive = [{ name = "ram", linear = { from = "D", to = "contact" } }, { name = "motor", joint = "right" }]
        effect = [
            { kind = "viscous_friction", at = ["ram"], values = { Fv = 30.0 } },
            { kind = "stribeck_friction", at = ["ram"], values = { Fs = 4.0, vs = 0.1 } },
            { kind = "force_offset", at = ["right"], values = { F0 = 1.0 } },
        ]
    "#)
}

const PLAN: &str = r#"
schema = 1
name = "reduced"
group = [{ name = "pair", bodies = ["front", "back"] }]
part = [
    { name = "one", groups = ["pair"], on = "base", at = "O", from = "front_hinge", to = "front_end", coordinate = "q1", symbols = { mass = "m" }, off_axis = "drop" },
    { name = "two", groups = ["arm"], on = "base", at = "P", from = "near", to = "far", coordinate = "q2", symbols = { mass = "m" } },
]
lumped_mass = [{ name = "rod", groups = ["rod"], at = ["near", "far"] }]
drive = [{ name = "ram", contact_on_axis = true }]
"#;

fn reduced() -> PlanarReduction {
    let plan = plan("plan.toml", PLAN).unwrap_or_else(|failure| panic!("{failure}"));
    reduce(&machine(), &plan).unwrap_or_else(|failure| panic!("{failure}"))
}

fn finding(reduction: &PlanarReduction, about: &str, says: &str) -> ReductionFinding {
    let found = reduction
        .report
        .findings
        .iter()
        .find(|f| f.about == about && f.says.contains(says));
    found
        .unwrap_or_else(|| panic!("nothing about {about}, {says}: {}", reduction.report.text()))
        .clone()
}

fn close(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-9, "{found} instead of {expected}");
}

#[test]
fn sizes_are_those_worked_out_by_hand() {
    let reduction = reduced();
    // The heavier back bar draws the centre out of the plane.
    close(
        finding(&reduction, "pair", "not halved").sizes[0].value,
        0.1 * 0.2 / 2.2,
    );
    // Parts: the shared mass is the mean, the offset from the axis is dropped, the inertia is kept.
    let one = finding(&reduction, "one", "= pair");
    close(one.sizes[0].value, 0.1);
    close(one.sizes[1].value, 0.01);
    close(one.sizes[2].value, 0.0);
    close(finding(&reduction, "m", "one and two").sizes[0].value, 0.1);
    // A rod halved into its ends has three times its inertia, and here it is felt: the arm turns.
    let rod = finding(&reduction, "rod", "residuals have an effect");
    close(rod.sizes[0].value, 0.0);
    close(rod.sizes[1].value, 0.0);
    close(rod.sizes[2].value, 0.6 * 0.25 - 0.05);
    // The contact moves onto the axis: the ram is off by as much at most as the contact has moved.
    let ram = finding(&reduction, "ram", "same points");
    let moved = (0.2_f64.hypot(0.05) - 0.2).hypot(0.05);
    assert!(
        ram.sizes[0].value > 0.01 * moved && ram.sizes[0].value <= moved,
        "{ram:?}"
    );
    assert!(ram.sizes[1].value > 0.01);
    // Effects at drives go over, those in joints are named as left out.
    finding(&reduction, "viscous_friction", "as in the rig");
    finding(&reduction, "force_offset", "left out");
    let text = &reduction.model;
    assert!(
        text.contains("Fs = { nominal = 4.0 }") && text.contains("constants = { vs = 0.1 }"),
        "{text}"
    );
    assert!(text.contains("m = { nominal = 2.3, unit = \"kg\""), "{text}");
}

/// Poses at which a reduction is checked are the same every time.
#[test]
fn a_reduction_is_the_same_every_time() {
    assert_eq!(reduced(), reduced());
    let (one, two) = (sampled_forces(&machine(), 20, 0.2), sampled_forces(&machine(), 20, 0.2));
    assert_eq!(one.expect("forces"), two.expect("forces"));
}

/// Without a plan each body becomes a part; a four-bar linkage keeps its loop.
#[test]
fn a_rig_without_a_plan() {
    let rig = rig(r#"
        body = [
            { name = "crank", mass = 1, centre = [0.2, 0.05, 0], inertia = { zz = 0.02 } },
            { name = "coupler", at = [0.4, 0, 0], rpy = [0, 0, 0.7], mass = 2, centre = [0.4, 0, 0.01], inertia = { zz = 0.2 } },
            { name = "rocker", at = [1, 0, 0], rpy = [0, 0, 1.7], mass = 1.5, centre = [0.3, 0, 0], inertia = { zz = 0.1 } },
        ]
        point = [{ name = "coupler_end", on = "coupler", at = [0.9, 0, 0] }, { name = "rocker_end", on = "rocker", at = [0.7, 0, 0] }]
        joint = [
            { name = "shaft", kind = "revolute", between = ["base", "crank"], at = [0, 0, 0] },
            { name = "pin", kind = "revolute", between = ["crank", "coupler"], at = [0.4, 0, 0] },
            { name = "pivot", kind = "revolute", between = ["rocker", "base"], at = [1, 0, 0] },
            { name = "end", kind = "revolute", between = ["coupler", "rocker"], points = ["coupler_end", "rocker_end"] },
        ]
        coordinate = [{ name = "phi", joint = "shaft" }]
        drive = [{ name = "motor", joint = "shaft" }]
    "#);
    let plan = default_plan(&rig).unwrap_or_else(|says| panic!("{says:?}"));
    let reduction = reduce(plan.rig(&rig), &plan).unwrap_or_else(|failure| panic!("{failure}"));
    let mechanism = modelmill_spec::load("model.toml", &reduction.model, &MemoryFiles::default())
        .expect("a model")
        .mechanism;
    assert_eq!((mechanism.parts.len(), mechanism.loops.len()), (3, 1));
    let derivation = modelmill_codegen::derive(&mechanism).expect("a derivation");
    let sampled = sampled_forces(&rig, 40, 0.3).expect("forces");
    let column = |of: fn(&modelmill_rig::RigState) -> f64| -> Vec<f64> { sampled.iter().map(|(s, _)| of(s)).collect() };
    let (q, qd, qdd) = (column(|s| s.q[0]), column(|s| s.qd[0]), column(|s| s.qdd[0]));
    let states = modelmill_codegen::MotionStates {
        q: vec![&q],
        qd: vec![&qd],
        qdd: vec![&qdd],
        load: Vec::new(),
    };
    let evaluator = modelmill_codegen::ModelEvaluator::new(&derivation);
    let found = evaluator
        .inverse_dynamics(&states, &derivation.nominal_base_values())
        .expect("forces");
    for (x, (_, y)) in found[0].iter().zip(&sampled) {
        assert!((x - y[0]).abs() < 1e-8 * y[0].abs().max(1.0), "{x} instead of {}", y[0]);
    }

    let says = default_plan(&machine()).expect_err("a weld").in_library_words();
    assert!(
        says.contains("`weld` is not a revolute joint") && says.contains("option `plan`"),
        "{says}"
    );
}
