//! Each kind of effect against its own definition, and where it acts.

use std::f64::consts::PI;

use crate::common::{close, force, rig, states};
use modelmill_rig::{CoordinateSamples, Rig, RigLaw, RigState, RigTracker, Trajectory, forces_along, simulate};

/// A cart of 2 kg on an upright rail: its load is `2*(qdd + 9.81)`.
fn cart() -> Rig {
    rig(r#"
        gravity = [0, 0, -9.81]
        body = [{ name = "cart", mass = 2 }]
        joint = [{ name = "rail", kind = "prismatic", between = ["base", "cart"], at = [0, 0, 0], axis = [0, 0, 1] }]
        coordinate = [{ name = "z", joint = "rail" }]
        drive = [{ name = "screw", joint = "rail" }]
    "#)
}

fn load(state: &RigState) -> f64 {
    2.0 * (state.qdd[0] + 9.81)
}

/// What an effect adds, at a drive and, where it may act there too, in the drive's joint.
fn check(kind: &str, values: &[(&str, f64)], adds: impl Fn(&RigState) -> f64) {
    for place in ["screw", "z", "rail"] {
        let mut rig = cart();
        let effect = match rig.effect(kind, &[place], values) {
            Ok(effect) => effect,
            Err(faults) => {
                assert!(place != "screw", "{}", faults[0]);
                continue;
            }
        };
        rig.effects.push(effect);
        let mut tracker = RigTracker::new(&rig).expect("a pose");
        for state in states(1, 25) {
            close(force(&rig, &mut tracker, &state)[0], load(&state) + adds(&state), 1e-12);
        }
        // At standstill dry friction is zero and nothing divides by the rate.
        let rest = RigState {
            q: vec![0.3],
            qd: vec![0.0],
            qdd: vec![0.0],
        };
        close(force(&rig, &mut tracker, &rest)[0], load(&rest) + adds(&rest), 1e-12);
    }
}

fn sign(x: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x.signum() }
}

#[test]
fn laws_at_a_drive_and_in_its_joint() {
    check("viscous_friction", &[("Fv", 3.0)], |s| 3.0 * s.qd[0]);
    check("coulomb_friction", &[("Fc", 3.0)], |s| 3.0 * sign(s.qd[0]));
    check("stribeck_friction", &[("Fs", 3.0)], |s| {
        3.0 * sign(s.qd[0]) * (-(s.qd[0] / 0.02).powi(2)).exp()
    });
    check("stribeck_friction", &[("Fs", 3.0), ("vs", 0.7)], |s| {
        3.0 * sign(s.qd[0]) * (-(s.qd[0] / 0.7).powi(2)).exp()
    });
    check("quadratic_friction", &[("Fq", 3.0)], |s| {
        3.0 * s.qd[0].powi(2) * sign(s.qd[0])
    });
    check("directional_viscous_friction", &[("Fvp", 3.0), ("Fvn", 5.0)], |s| {
        s.qd[0] * if s.qd[0] > 0.0 { 3.0 } else { 5.0 }
    });
    check("directional_coulomb_friction", &[("Fcp", 3.0), ("Fcn", 5.0)], |s| {
        if s.qd[0] == 0.0 {
            -1.0
        } else if s.qd[0] > 0.0 {
            3.0
        } else {
            -5.0
        }
    });
    check("load_friction", &[("mu", 0.1)], |s| 0.1 * load(s).abs() * sign(s.qd[0]));
    check("drive_inertia", &[("Ia", 3.0)], |s| 3.0 * s.qdd[0]);
    check("force_offset", &[("F0", -3.0)], |_| -3.0);
    check("spring", &[("k", 30.0), ("rest", 0.2)], |s| 30.0 * (s.q[0] - 0.2));
    check("force_ripple", &[("As", 3.0), ("Ac", 2.0), ("pitch", 0.01)], |s| {
        let phase = 2.0 * PI * s.q[0] / 0.01;
        3.0 * phase.sin() + 2.0 * phase.cos()
    });
}

#[test]
fn every_kind_has_values_and_a_law() {
    for kind in RigLaw::KINDS {
        assert!(RigLaw::values(kind).is_some_and(|values| !values.is_empty()), "{kind}");
    }
    assert!(RigLaw::values("magic").is_none());
}

/// The wrist of the TX40: each motor feels the other's rotor and their common seals.
#[test]
fn coupled_drives_feel_each_other() {
    let text = r#"
        body = [{ name = "a", mass = 2 }, { name = "b", mass = 3 }]
        joint = [
            { name = "left", kind = "prismatic", between = ["base", "a"], at = [0, 0, 0], axis = [1, 0, 0] },
            { name = "right", kind = "prismatic", between = ["base", "b"], at = [0, 0, 0], axis = [1, 0, 0] },
        ]
        coordinate = [{ name = "x", joint = "left" }, { name = "y", joint = "right" }]
        drive = [{ name = "f", joint = "left" }, { name = "g", joint = "right" }]
        effect = [{ kind = "coupled_drive", at = ["f", "g"], values = { Ia = 0.4, Fv = 7.0, Fs = 2.0 } }]
    "#;
    let rig = rig(text);
    let mut tracker = RigTracker::new(&rig).expect("a pose");
    for state in states(2, 20) {
        let together = 2.0 * sign(state.qd[0] + state.qd[1]);
        let found = force(&rig, &mut tracker, &state);
        close(
            found[0],
            2.0 * state.qdd[0] + 0.4 * state.qdd[1] + 7.0 * state.qd[1] + together,
            1e-12,
        );
        close(
            found[1],
            3.0 * state.qdd[1] + 0.4 * state.qdd[0] + 7.0 * state.qd[0] + together,
            1e-12,
        );
    }
}

/// Friction in a joint that no drive holds reaches the drive by virtual power.
#[test]
fn friction_in_a_passive_joint() {
    let text = r#"
        body = [{ name = "one", mass = 1 }, { name = "two", mass = 1 }]
        joint = [
            { name = "a", kind = "revolute", between = ["base", "one"], at = [0, 0, 0] },
            { name = "b", kind = "revolute", between = ["one", "two"], at = [0.4, 0, 0] },
            { name = "rail", kind = "point_on_line", between = ["base", "two"], at = [1.0, 0, 0], axis = [1, 0, 0] },
        ]
        coordinate = [{ name = "q", joint = "a" }]
        drive = [{ name = "motor", joint = "a" }]
    "#;
    let plain = rig(text);
    let mut worn = plain.clone();
    worn.effects.push(
        plain
            .effect("viscous_friction", &["b"], &[("Fv", 5.0)])
            .expect("an effect"),
    );
    let mut trackers = [
        RigTracker::new(&plain).expect("a pose"),
        RigTracker::new(&worn).expect("a pose"),
    ];
    for state in states(1, 20) {
        let q = state.q[0];
        // The coupler's end, 0.6 m behind its joint, stays on the line y = 0.
        let slope = -(0.4 / 0.6) * q.cos() / (1.0 - (0.4 / 0.6 * q.sin()).powi(2)).sqrt() - 1.0;
        let [without, with] = [
            force(&plain, &mut trackers[0], &state)[0],
            force(&worn, &mut trackers[1], &state)[0],
        ];
        close(with - without, 5.0 * slope * slope * state.qd[0], 1e-11);
    }
}

/// A bar that turns about the origin.
fn bar() -> Rig {
    rig(r#"
        gravity = [0, -9.81, 0]
        body = [{ name = "bar", mass = 1, inertia = { zz = 0.1 } }]
        point = [{ name = "end", on = "bar", at = [0.8, 0, 0] }, { name = "middle", on = "bar", at = [0.5, 0, 0] }]
        joint = [{ name = "hinge", kind = "revolute", between = ["base", "bar"], at = [0, 0, 0] }]
        coordinate = [{ name = "q", joint = "hinge" }]
        drive = [{ name = "motor", joint = "hinge" }]
    "#)
}

fn check_bar(kind: &str, at: &[&str], values: &[(&str, f64)], mass_at_end: f64, torque: impl Fn(f64, f64) -> f64) {
    let mut rig = bar();
    if mass_at_end > 0.0 {
        rig.effects.push(
            rig.effect("point_mass", &["end"], &[("m", mass_at_end)])
                .expect("a mass"),
        );
    }
    rig.effects.push(rig.effect(kind, at, values).expect("an effect"));
    let mut tracker = RigTracker::new(&rig).expect("a pose");
    for state in states(1, 20) {
        close(
            force(&rig, &mut tracker, &state)[0],
            torque(state.q[0], state.qdd[0]),
            1e-12,
        );
    }
}

#[test]
fn masses_and_gravity() {
    check_bar("point_mass", &["end"], &[("m", 3.0)], 0.0, |q, qdd| {
        (0.1 + 3.0 * 0.64) * qdd + 3.0 * 9.81 * 0.8 * q.cos()
    });
    check_bar(
        "lumped_mass_placement",
        &["end", "middle"],
        &[("m", 3.0)],
        3.0,
        |q, qdd| (0.1 + 3.0 * 0.25) * qdd + 3.0 * 9.81 * 0.5 * q.cos(),
    );
    check_bar("gravity_tilt", &["base"], &[("tz", 0.2)], 3.0, |q, qdd| {
        (0.1 + 3.0 * 0.64) * qdd + 3.0 * 9.81 * 0.8 * (q + 0.2).cos()
    });
}

/// A rod as an effect is the rod as a body: the whole robot, whose rods a third party's code has as bodies.
#[test]
fn rods_as_effects_are_rods_as_bodies() {
    let whole = crate::common::load("spidermill-with-rods");
    let mut plain = crate::common::load("spidermill-full");
    for drive in ["spindle_left", "spindle_right"] {
        let values = [("m", 8.0), ("c", 0.45), ("I", 8.0 * 0.81 / 12.0)];
        plain
            .effects
            .push(plain.effect("rod_inertia", &[drive], &values).expect("a rod"));
    }
    let run = crate::common::shortened(&crate::common::bundled("with-rods-fit"), 300);
    let trajectory = crate::common::trajectory(&run, &["theta1", "theta2"]);
    let along = |rig: &Rig| {
        let instants = forces_along(rig, &trajectory, trajectory.time(), || {}).expect("forces");
        let forces: Vec<f64> = instants.into_iter().flat_map(|instant| instant.forces).collect();
        forces
    };
    let error = crate::common::relative_rms(&along(&plain), &along(&whole));
    assert!(error < 1e-9, "{error:.1e}");
}

/// What is read is the force of a while ago, and nothing else changes.
#[test]
fn a_delay_shifts_the_forces_alone() {
    let mut rig = cart();
    rig.effects
        .push(rig.effect("time_delay", &["force"], &[("T", 0.02)]).expect("an effect"));
    let time: Vec<f64> = (0..200).map(|i| f64::from(i) * 0.005).collect();
    let z = |t: f64| RigState {
        q: vec![(3.0 * t).sin()],
        qd: vec![3.0 * (3.0 * t).cos()],
        qdd: vec![-9.0 * (3.0 * t).sin()],
    };
    let trajectory = Trajectory::from_function(time, z).expect("a trajectory");
    let run = simulate(&rig, &trajectory, None, || {}).expect("a run");
    let column = |name: &str| crate::common::column(&run.columns, name).to_vec();
    let (t, q, f) = (column("t"), column("z"), column("screw"));
    assert_eq!(t.len(), 196);
    for i in 0..t.len() {
        close(q[i], (3.0 * t[i]).sin(), 1e-12);
        close(f[i], 2.0 * (9.81 - 9.0 * (3.0 * (t[i] - 0.02)).sin()), 1e-7);
    }
}

/// Faults of a description are all found, each with its part.
#[test]
fn faulty_effects_are_named() {
    let rig = bar();
    let says = |kind: &str, at: &[&str], values: &[(&str, f64)]| {
        let faults = rig.effect(kind, at, values).expect_err("a fault");
        let texts: Vec<String> = faults.iter().map(ToString::to_string).collect();
        texts.join("\n")
    };
    assert!(says("magic", &["motor"], &[]).contains("`viscous_friction`"));
    assert!(says("viscous_friction", &["motor"], &[]).contains("lacks the value `Fv`"));
    assert!(says("viscous_friction", &["end"], &[("Fv", 1.0)]).contains("known are `motor`, `q`, `hinge`"));
    assert!(says("viscous_friction", &["motor"], &[("Fv", f64::NAN)]).contains("finite"));
    assert!(says("stribeck_friction", &["motor"], &[("Fs", 1.0), ("vs", 0.0)]).contains("above zero"));
    assert!(says("viscous_friction", &["motor"], &[("Fv", 1.0), ("fv", 1.0)]).contains("no value `fv`"));
    assert!(says("coupled_drive", &["motor"], &[]).contains("two drives"));
    assert!(says("rod_inertia", &["motor"], &[("m", 1.0), ("c", 0.1), ("I", 0.1)]).contains("linear drive"));
    assert!(says("load_friction", &["hinge"], &[("mu", 0.1)]).contains("its load is known"));
    assert!(says("point_mass", &[], &[("m", 0.1)]).contains("a point of a body"));
    let two = says("force_ripple", &["nowhere"], &[("pitch", -1.0)]);
    assert_eq!(two.lines().count(), 2, "{two}");
}

/// Samples are the same whether derivatives are given or found.
#[test]
fn missing_derivatives_are_found() {
    let time: Vec<f64> = (0..500).map(|i| f64::from(i) * 0.004).collect();
    let q: Vec<f64> = time.iter().map(|t| 0.3 * (2.0 * t).sin()).collect();
    let samples = vec![CoordinateSamples { q, qd: None, qdd: None }];
    let trajectory = Trajectory::new(time.clone(), samples).expect("a trajectory");
    for instant in forces_along(&cart(), &trajectory, &time, || {}).expect("forces") {
        close(instant.forces[0], 2.0 * (9.81 - 4.0 * instant.state.q[0]), 1e-5);
    }
}
