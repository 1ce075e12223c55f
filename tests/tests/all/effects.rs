//! Each kind of the library against the same effect in a rig, whose mechanics and laws are other code.

use std::f64::consts::PI;

use modelmill_boundary::files::DiskFiles;
use modelmill_codegen::{ModelEvaluator, MotionStates, ReductionMethod};
use modelmill_rig::{Rig, RigState, RigTracker, forces};
use modelmill_spec::Mechanism;
use modelmill_tests::fixtures::{derive, fixtures, model_file};
use modelmill_tests::laws::Case;

fn spidermill_rig() -> Rig {
    let path = fixtures().join("../../model-spec/rigs/spidermill-full.toml");
    modelmill_rig::load_file(&path)
        .unwrap_or_else(|failure| panic!("{failure}"))
        .rig
}

/// A bundled model with more text behind it.
fn with(model: &str, more: &str) -> Mechanism {
    let path = model_file(model);
    let text = std::fs::read_to_string(&path).expect("a model") + "\n" + more;
    modelmill_spec::load(&path.to_string_lossy(), &text, &DiskFiles::default())
        .unwrap_or_else(|failure| panic!("{failure}"))
        .mechanism
}

/// An `[[effect]]` with nominal values of its parameters, and constants.
fn effect(kind: &str, at: &[&str], values: &[(&str, f64)], constants: &[(&str, f64)]) -> String {
    let values: Vec<String> = values
        .iter()
        .map(|(symbol, value)| format!("{symbol} = {{ nominal = {value:?} }}"))
        .collect();
    let constants: Vec<String> = constants
        .iter()
        .map(|(symbol, value)| format!("{symbol} = {value:?}"))
        .collect();
    format!(
        "[[effect]]\nkind = \"{kind}\"\nat = {at:?}\nparameters = {{ {} }}\nconstants = {{ {} }}\n",
        values.join(", "),
        constants.join(", ")
    )
}

/// A motion of the SpiderMill within its limits, with both directions and standstill.
fn motion(n: i32) -> Vec<RigState> {
    (0..n)
        .map(|i| {
            let wave = |k: f64| (k * f64::from(i)).sin();
            RigState {
                q: vec![1.8 + 0.2 * wave(0.7), 1.341_592_653_589_793 + 0.2 * wave(1.1)],
                qd: vec![wave(1.9), wave(2.3)],
                qdd: vec![5.0 * wave(2.9), 5.0 * wave(3.1)],
            }
        })
        .collect()
}

fn rig_forces(rig: &Rig, states: &[RigState]) -> Vec<Vec<f64>> {
    let mut tracker = RigTracker::new(rig).expect("a pose");
    let mut columns = vec![Vec::new(); rig.drives.len()];
    for state in states {
        let found = forces(rig, &tracker.follow(state).expect("a pose")).expect("forces");
        for (column, force) in columns.iter_mut().zip(found) {
            column.push(force);
        }
    }
    columns
}

fn slices(columns: &[Vec<f64>]) -> Vec<&[f64]> {
    columns.iter().map(Vec::as_slice).collect()
}

/// Forces of the model by its reduced regressor, with nominal values.
fn model_forces(mechanism: &Mechanism, states: &[RigState], load: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let n = states[0].q.len();
    let column = |of: fn(&RigState) -> &Vec<f64>| -> Vec<Vec<f64>> {
        (0..n)
            .map(|i| states.iter().map(|state| of(state)[i]).collect())
            .collect()
    };
    let (q, qd, qdd) = (column(|s| &s.q), column(|s| &s.qd), column(|s| &s.qdd));
    let derivation = derive(mechanism);
    let evaluator = ModelEvaluator::new(&derivation);
    let states = MotionStates {
        q: slices(&q),
        qd: slices(&qd),
        qdd: slices(&qdd),
        load: slices(load),
    };
    let values = derivation.nominal_base_values();
    let inverse = evaluator.inverse_dynamics(&states, &values).expect("forces");
    // tau = H p with the exact reduction says the same.
    let regressor = evaluator.regressor(&states).expect("a regressor");
    let product = regressor * nalgebra::DVector::from_vec(values);
    let drives = mechanism.drives.len();
    for (d, column) in inverse.iter().enumerate() {
        let size = column.iter().fold(1.0_f64, |most, f| most.max(f.abs()));
        for (i, force) in column.iter().enumerate() {
            assert!((product[i * drives + d] - force).abs() < 1e-9 * size);
        }
    }
    inverse
}

fn agree(found: &[Vec<f64>], expected: &[Vec<f64>], what: &str) {
    for (found, expected) in found.iter().zip(expected) {
        let size = expected.iter().fold(0.0_f64, |most, f| most.max(f.abs()));
        for (x, y) in found.iter().zip(expected) {
            assert!((x - y).abs() < 1e-9 * size, "{what}: {x} {y}");
        }
    }
}

/// Holds the SpiderMill with an effect against the whole robot with the same effect, and sees that it does something.
fn check(
    kind: &str,
    at: &[&str],
    in_rig: (&str, &[&str], &[(&str, f64)]),
    values: &[(&str, f64)],
    constants: &[(&str, f64)],
) {
    let states = motion(40);
    let mut rig = spidermill_rig();
    let plain = rig_forces(&rig, &states);
    let (rig_kind, rig_at, rig_values) = in_rig;
    let added = rig
        .effect(rig_kind, rig_at, rig_values)
        .unwrap_or_else(|faults| panic!("{kind}: {}", faults[0]));
    rig.effects.push(added);
    let expected = rig_forces(&rig, &states);
    let largest = plain.iter().flatten().zip(expected.iter().flatten());
    let largest = largest.fold(0.0_f64, |most, (x, y)| most.max((x - y).abs()));
    assert!(largest > 1.0, "{kind} changes forces by {largest} N only");
    let mechanism = with("spidermill", &effect(kind, at, values, constants));
    agree(&model_forces(&mechanism, &states, &plain), &expected, kind);
}

/// The same values, and constants, in model and rig.
fn same(kind: &str, at: &[&str], values: &[(&str, f64)], constants: &[(&str, f64)]) {
    let all: Vec<(&str, f64)> = values.iter().chain(constants).copied().collect();
    check(kind, at, (kind, at, &all), values, constants);
}

#[test]
fn laws_at_drives() {
    let left = &["spindle_left"][..];
    let both = &["spindle_left", "spindle_right"][..];
    same("viscous_friction", both, &[("Fv", 30.0)], &[]);
    same("coulomb_friction", left, &[("Fc", 26.0)], &[]);
    same("stribeck_friction", left, &[("Fs", 20.0)], &[("vs", 0.05)]);
    same("quadratic_friction", both, &[("Fq", 40.0)], &[]);
    same(
        "directional_viscous_friction",
        left,
        &[("Fvp", 20.0), ("Fvn", 60.0)],
        &[],
    );
    same(
        "directional_coulomb_friction",
        left,
        &[("Fcp", 20.0), ("Fcn", 30.0)],
        &[],
    );
    same("load_friction", both, &[("mu", 0.08)], &[]);
    same("drive_inertia", both, &[("Ia", 3.0)], &[]);
    same("force_offset", left, &[("F0", -14.0)], &[]);
    same("spring", left, &[("k", 300.0)], &[("rest", 0.9)]);
    same("force_ripple", left, &[("As", 5.0), ("Ac", -3.0)], &[("pitch", 0.02)]);
    let coupled = [("Ia", 2.0), ("Fv", 20.0), ("Fs", 15.0)];
    same("coupled_drive", both, &coupled, &[]);
    // A cable that is a spring, and a speed that is never reached.
    check(
        "cable_torque",
        left,
        ("spring", left, &[("k", 300.0), ("rest", 0.9)]),
        &[("c0", -270.0), ("c1", 300.0)],
        &[("period", 1.0)],
    );
    check(
        "stribeck_load_friction",
        both,
        ("load_friction", both, &[("mu", 0.08)]),
        &[("mus", 0.08)],
        &[("vs", 1e9)],
    );
}

#[test]
fn laws_in_joints() {
    same("viscous_friction", &["theta1"], &[("Fv", 8.0)], &[]);
    let turn = [("As", 7.0), ("Ac", -5.0), ("pitch", 2.0 * PI)];
    check(
        "counterbalance",
        &["theta1"],
        ("force_ripple", &["theta1"], &turn),
        &[("Gs", 7.0), ("Gc", -5.0)],
        &[],
    );
}

#[test]
fn rods_of_the_spindles() {
    let (m, c, i) = (8.0, 0.45, 0.54);
    let both = &["spindle_left", "spindle_right"][..];
    check(
        "rod_inertia",
        both,
        ("rod_inertia", both, &[("m", m), ("c", c), ("I", i)]),
        &[("Jr", i + m * c * c), ("Sr", m * c), ("mr", m)],
        &[],
    );
}

/// The mass of a rod whose pivot stands on the base says nothing, and disturbs nothing.
#[test]
fn the_mass_of_a_rod_on_the_base_has_no_effect() {
    let plain = derive(&with("spidermill", ""));
    let more = effect("rod_inertia", &["spindle_left", "spindle_right"], &[], &[]);
    let rods = derive(&with("spidermill", &more));
    let base: Vec<String> = rods.base_parameters().into_iter().map(|base| base.expression).collect();
    assert_eq!(base.len(), plain.base_parameters().len() + 2);
    for moment in ["Jr", "Sr"] {
        let name = format!("{moment}_spindle_left_spindle_right");
        assert!(base.contains(&name), "{name} in {base:?}");
    }
    let idle: Vec<String> = (rods.reduction.without_effect.iter())
        .map(|product| product.text(&rods.mechanism))
        .collect();
    assert!(idle.contains(&"mr_spindle_left_spindle_right".to_owned()));
}

#[test]
fn a_mass_at_a_point() {
    same("point_mass", &["R2m"], &[("m", 4.0)], &[]);
}

/// Tilts about one axis are rotations in both; out of the plane only a cosine is felt.
#[test]
fn a_tilted_base() {
    for (symbol, angle) in [("tz", 0.03), ("tx", -0.2)] {
        same("gravity_tilt", &["base"], &[], &[(symbol, angle)]);
    }
}

/// Small tilts about several axes add up in any order.
#[test]
fn a_tilt_about_several_axes() {
    let states = motion(20);
    let tilt = |rig: &mut Rig, values: &[(&str, f64)]| {
        let effect = rig.effect("gravity_tilt", &["base"], values);
        rig.effects
            .push(effect.unwrap_or_else(|faults| panic!("{}", faults[0])));
    };
    // As the model does: the base is turned by Rz Ry Rx, so that gravity turns back about z first.
    let angles = [("tx", 0.1), ("ty", -0.2), ("tz", 0.15)];
    let mut rig = spidermill_rig();
    for (symbol, angle) in angles.iter().rev() {
        tilt(&mut rig, &[(symbol, *angle)]);
    }
    let expected = rig_forces(&rig, &states);
    let mechanism = with("spidermill", &effect("gravity_tilt", &["base"], &[], &angles));
    agree(&model_forces(&mechanism, &states, &[]), &expected, "three tilts");
}

/// One crank differs from the other, with which it shares its parameters.
#[test]
fn an_untied_part() {
    let states = motion(40);
    let mut rig = spidermill_rig();
    let plain = rig_forces(&rig, &states);
    let crank = rig.bodies.iter_mut().find(|body| body.name == "G8");
    let crank = crank.expect("a crank");
    // A further mass of 3 kg at 0.4 m along the crank, with an inertia of its own: about the new centre of mass.
    let (m, c, own) = (3.0, 0.4, 0.2);
    let (mass, at) = (crank.mass + m, nalgebra::Vector3::new(c, 0.0, 0.0));
    let centre = (crank.mass * crank.centre + m * at) / mass;
    let shift = |mass: f64, at: nalgebra::Vector3<f64>| mass * (at - centre).norm_squared();
    crank.inertia[(2, 2)] += shift(crank.mass, crank.centre) + own + shift(m, at);
    crank.mass = mass;
    crank.centre = centre;
    let expected = rig_forces(&rig, &states);
    let values = [("dm", m), ("dmx", m * c), ("dJzz", own + m * c * c)];
    let mechanism = with("spidermill", &effect("untied_part", &["crank_left"], &values, &[]));
    agree(&model_forces(&mechanism, &states, &[]), &expected, "untied_part");
    assert!((plain[0][3] - expected[0][3]).abs() > 1.0);
}

/// The paper's treatment of the platform, mended by the effect that names m4, is the consistent model.
#[test]
fn the_placement_of_m4_mends_the_paper() {
    let states = motion(40);
    let placed = "[[effect]]\nkind = \"lumped_mass_placement\"\nat = [\"R3m\", \"R3m_right\"]\n\
                  parameters = { m = { name = \"m4\" } }\n";
    let consistent = model_forces(&with("spidermill", ""), &states, &[]);
    let paper = model_forces(&with("spidermill-paper", ""), &states, &[]);
    let mended = with("spidermill-paper", placed);
    agree(&model_forces(&mended, &states, &[]), &consistent, "m4");
    assert!((paper[0][3] - consistent[0][3]).abs() > 1.0);
    assert_eq!(mended.parameters.len(), 8, "the effect has no parameter of its own");
}

/// The same correction with a mass of its own, against a rig whose lumped mass is misplaced as much.
#[test]
fn a_placement_with_a_mass_of_its_own() {
    let states = motion(40);
    let more = effect("lumped_mass_placement", &["R3m", "R3m_right"], &[("m", 12.456)], &[]);
    let consistent = model_forces(&with("spidermill", ""), &states, &[]);
    let mended = model_forces(&with("spidermill-paper", &more), &states, &[]);
    agree(&mended, &consistent, "a mass of its own");
}

/// A rod in space whose pivot moves has three moments that count; coupled drives and a tilted base besides.
/// The rod of the independent mechanics consists of three particles.
#[test]
fn a_rod_in_space_obeys_dalembert() {
    let mechanism = modelmill_tests::fixtures::model("swinging_cylinder");
    let case = Case::new(&mechanism, 120, 0.6).expect("a case");
    for figure in [
        case.exact_rank_is_numeric_rank(),
        case.reduction_keeps_the_forces(),
        case.forces_satisfy_dalembert(40),
    ] {
        figure.expect("a law");
    }
    let reduction = &case.derivation.reduction;
    // Roots do not stand in the way.
    assert!(matches!(reduction.method, ReductionMethod::Exact { .. }));
    assert!(reduction.without_effect.is_empty());
}

/// An element between the base and a body three joints away, and one between two bodies of loops.
#[test]
fn what_pulls_two_points_together_obeys_virtual_power() {
    let values = [("F0", -240.0), ("k", 900.0), ("Fv", 35.0)];
    let points = "[[point]]\nname = \"hook\"\non = \"base\"\nat = [0.2, -0.3, 0.4]\n\
                  [[point]]\nname = \"eye\"\non = \"link3\"\nat = [0.1, 0.25, -0.05]\n";
    let arm = format!(
        "{points}{}",
        effect("two_point_element", &["hook", "eye"], &values, &[])
    );
    let robot = effect("two_point_element", &["B_left", "R3m"], &values, &[]);
    for (model, more, reach) in [("puma560", arm, 1.5), ("spidermill", robot, 0.3)] {
        let mechanism = with(model, &more);
        let plain = derive(&with(model, ""));
        let case = if reach > 1.0 {
            Case::new(&mechanism, 120, reach)
        } else {
            Case::near_nominal(&mechanism, 120, reach)
        };
        let case = case.expect("a case");
        for figure in [
            case.exact_rank_is_numeric_rank(),
            case.reduction_keeps_the_forces(),
            case.forces_satisfy_dalembert(40),
        ] {
            figure.unwrap_or_else(|breach| panic!("{model}: {breach}"));
        }
        let reduction = &case.derivation.reduction;
        assert!(matches!(reduction.method, ReductionMethod::Exact { .. }), "{model}");
        // Nothing else pulls along that line.
        let more = reduction.retained.len() - plain.reduction.retained.len();
        assert_eq!(more, 3, "{model}");
    }
}

/// Points whose distance never changes are refused at their place.
#[test]
fn an_element_needs_two_bodies() {
    let path = model_file("spidermill");
    let text = std::fs::read_to_string(&path).expect("a model");
    for (at, says) in [
        (&["R2m", "A_left"][..], "lies in the same frame as the first one"),
        (&["R2m"][..], "takes two places"),
        (&["R2m", "spindle_left"][..], "cannot act here"),
    ] {
        let more = effect("two_point_element", at, &[], &[]);
        let file = path.to_string_lossy();
        let failure = modelmill_spec::load(&file, &format!("{text}\n{more}"), &DiskFiles::default());
        let told = failure.map(|_| ()).expect_err("a refusal").to_string();
        assert!(told.contains(says), "{told}");
    }
}
