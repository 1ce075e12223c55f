//! Small machines against formulas that were derived by hand with Lagrange's equations.

use crate::common::{close, force, rig, states};
use modelmill_rig::{Rig, RigState, RigTracker, energy, forces};

const G: f64 = 9.81;

/// A slider on rails, driven by a crank through a coupler without mass; the crank is balanced and has a mass at
/// its pin.
pub(crate) fn slider_crank() -> Rig {
    rig(r#"
        gravity = [0, -9.81, 0]
        body = [
            { name = "crank", mass = 1.0, inertia = { zz = 0.2 } },
            { name = "coupler", at = [0.3, 0, 0] },
            { name = "slider", at = [1.1, 0, 0], mass = 3.0 },
        ]
        point = [{ name = "pin", on = "crank", at = [0.3, 0, 0] }]
        lumped_mass = [{ at = "pin", mass = 0.7 }]
        joint = [
            { name = "shaft", kind = "revolute", between = ["base", "crank"], at = [0, 0, 0] },
            { name = "big_end", kind = "revolute", between = ["crank", "coupler"], at = [0.3, 0, 0] },
            { name = "small_end", kind = "revolute", between = ["coupler", "slider"], at = [1.1, 0, 0] },
            { name = "rails", kind = "prismatic", between = ["base", "slider"], at = [0, 0, 0], axis = [1, 0, 0] },
        ]
        coordinate = [{ name = "q", joint = "shaft" }]
        drive = [{ name = "motor", joint = "shaft" }]
    "#)
}

#[test]
fn a_pendulum() {
    let rig = rig(r#"
        gravity = [0, -9.81, 0]
        body = [{ name = "arm", mass = 2, centre = [0.5, 0.1, 0.3], inertia = { xx = 0.2, yy = 0.2, zz = 0.1, xz = 0.01 } }]
        joint = [{ name = "hinge", kind = "revolute", between = ["base", "arm"], at = [0, 0, 0] }]
        coordinate = [{ name = "q", joint = "hinge" }]
        drive = [{ name = "motor", joint = "hinge" }]
    "#);
    let mut tracker = RigTracker::new(&rig).expect("a pose");
    for state in states(1, 30) {
        let (q, qdd) = (state.q[0], state.qdd[0]);
        let inertia = 0.1 + 2.0 * (0.25 + 0.01);
        let expected = inertia * qdd + 2.0 * G * (0.5 * q.cos() - 0.1 * q.sin());
        close(force(&rig, &mut tracker, &state)[0], expected, 1e-11);
    }
}

#[test]
fn a_slider_crank() {
    let rig = slider_crank();
    let mut tracker = RigTracker::new(&rig).expect("a pose");
    let (r, l): (f64, f64) = (0.3, 0.8);
    for state in states(1, 30) {
        let (q, qd, qdd) = (3.0 * state.q[0], state.qd[0], state.qdd[0]);
        let (s, c) = q.sin_cos();
        let root = (l * l - r * r * s * s).sqrt();
        let slope = -r * s - r * r * s * c / root;
        let bend = -r * c - r * r * (c * c - s * s) / root - (r * r * s * c).powi(2) / root.powi(3);
        let slider = 3.0 * (slope * qdd + bend * qd * qd) * slope;
        let pin = 0.7 * (r * r * qdd + G * r * c);
        let state = RigState {
            q: vec![q],
            qd: vec![qd],
            qdd: vec![qdd],
        };
        close(force(&rig, &mut tracker, &state)[0], 0.2 * qdd + slider + pin, 1e-10);
    }
}

/// A head that pans about the vertical and tilts: all entries of an inertia and Coriolis forces in space.
#[test]
fn a_head_that_pans_and_tilts() {
    let rig = rig(r#"
        gravity = [0, 0, -9.81]
        body = [
            { name = "fork", mass = 1, inertia = { zz = 0.05 } },
            { name = "head", mass = 4, centre = [0.3, 0, 0], inertia = { xx = 0.03, yy = 0.08, zz = 0.07 } },
        ]
        joint = [
            { name = "pan", kind = "revolute", between = ["base", "fork"], at = [0, 0, 0] },
            { name = "tilt", kind = "revolute", between = ["fork", "head"], at = [0, 0, 0], axis = [0, -1, 0] },
        ]
        coordinate = [{ name = "a", joint = "pan" }, { name = "b", joint = "tilt" }]
        drive = [{ name = "pan_motor", joint = "pan" }, { name = "tilt_motor", joint = "tilt" }]
    "#);
    let mut tracker = RigTracker::new(&rig).expect("a pose");
    for state in states(2, 30) {
        let b = state.q[1];
        let (ad, bd, add, bdd) = (state.qd[0], state.qd[1], state.qdd[0], state.qdd[1]);
        let (s, c) = b.sin_cos();
        let across = 0.07 + 4.0 * 0.09;
        let about = 0.05 + 0.03 * s * s + across * c * c;
        let slope = 2.0 * s * c * (0.03 - across);
        let found = force(&rig, &mut tracker, &state);
        close(found[0], about * add + slope * ad * bd, 1e-11);
        close(
            found[1],
            (0.08 + 0.36) * bdd - 0.5 * slope * ad * ad + 4.0 * G * 0.3 * c,
            1e-11,
        );
    }
}

/// A body that screws, slides and turns at once, on joints that leave two freedoms.
#[test]
fn a_cylindrical_joint_has_two_freedoms() {
    let rig = rig(r#"
        gravity = [0, 0, -9.81]
        body = [{ name = "spool", mass = 3, inertia = { zz = 0.4 } }]
        point = [
            { name = "above", on = "base", at = [0, 0, 2] },
            { name = "middle", on = "spool", at = [0, 0, 0] },
            { name = "side", on = "spool", at = [0.5, 0, 0] },
            { name = "wall", on = "base", at = [0.5, -1, 0] },
        ]
        joint = [{ name = "sleeve", kind = "cylindrical", between = ["base", "spool"], at = [0, 0, 0] }]
        coordinate = [
            { name = "height", length = { from = "above", to = "middle" } },
            { name = "rope", length = { from = "wall", to = "side" } },
        ]
        drive = [
            { name = "hoist", linear = { from = "above", to = "middle" } },
            { name = "pull", linear = { from = "wall", to = "side" } },
        ]
    "#);
    let mut tracker = RigTracker::new(&rig).expect("a pose");
    // Sinking by 2 m/s^2 without turning; the rope's length follows from rope^2 = 1 + (2 - height)^2, angle 0.
    let state = RigState {
        q: vec![2.0, 1.0],
        qd: vec![0.0, 0.0],
        qdd: vec![2.0, 0.0],
    };
    let found = force(&rig, &mut tracker, &state);
    close(found[0], 3.0 * (2.0 - G), 1e-10);
    close(found[1], 0.0, 1e-10);
}

/// Power of the drives is what the energy grows by, plus what friction takes: on the whole robot with rods, a tool
/// and a tilted base.
#[test]
fn power_balances_energy() {
    let mut rig = crate::common::load("spidermill-with-rods");
    let motion = |t: f64| {
        let wave = |a: f64, w: f64| [a * (w * t).sin(), a * w * (w * t).cos(), -a * w * w * (w * t).sin()];
        let [one, two] = [wave(0.2, 3.0), wave(-0.15, 4.0)];
        RigState {
            q: vec![1.8 + one[0], 1.341_592_653_589_793 + two[0]],
            qd: vec![one[1], two[1]],
            qdd: vec![one[2], two[2]],
        }
    };
    for (kind, at, values) in [
        ("point_mass", "R3m", vec![("m", 5.0)]),
        ("gravity_tilt", "base", vec![("tz", 0.05)]),
        ("rod_inertia", "spindle_left", vec![("m", 4.0), ("c", 0.3), ("I", 0.2)]),
        ("viscous_friction", "spindle_right", vec![("Fv", 900.0)]),
        ("viscous_friction", "coupler_left_beside", vec![("Fv", 30.0)]),
    ] {
        let effect = rig.effect(kind, &[at], &values).expect("an effect");
        rig.effects.push(effect);
    }
    let mut tracker = RigTracker::new(&rig).expect("a pose");
    let h = 1e-3;
    let mut largest: f64 = 0.0;
    for t in [0.1, 0.45, 0.7, 1.3] {
        let mut at = |t: f64| tracker.follow(&motion(t)).expect("inside the workspace");
        let energies = [-2.0, -1.0, 1.0, 2.0].map(|k| energy(&rig, &at(t + k * h)));
        let growth = (energies[0] - 8.0 * energies[1] + 8.0 * energies[2] - energies[3]) / (12.0 * h);
        let now = at(t);
        let mut balance = -growth;
        for (force, place) in forces(&rig, &now).expect("forces").iter().zip([0, 1]) {
            let rate = modelmill_rig::place_motion(&rig, modelmill_rig::RigPlace::Drive(place), &now)
                .expect("a drive")
                .rate;
            balance += force * rate;
            largest = largest.max((force * rate).abs());
        }
        for (effect, coefficient) in [(3, 900.0), (4, 30.0)] {
            let place = rig.effects[effect].places[0];
            balance -= coefficient
                * modelmill_rig::place_motion(&rig, place, &now)
                    .expect("a place")
                    .rate
                    .powi(2);
        }
        assert!(balance.abs() < 1e-6 * largest, "{balance} of {largest} at {t}");
    }
}

/// What a tracker has kept from earlier poses saves time and changes nothing: jumps and small steps end where a fresh
/// start ends.
#[test]
fn the_past_of_a_tracker_does_not_show() {
    let rig = crate::common::load("spidermill-with-rods");
    let fresh = RigTracker::new(&rig).expect("a pose");
    let mut used = fresh.clone();
    for (i, draw) in states(2, 40).into_iter().enumerate() {
        // Jumps across the workspace, and between them steps as small as those of a recording.
        let reach = if i % 4 == 0 { 0.6 } else { 0.004 };
        let state = RigState {
            q: vec![1.8 + reach * draw.q[0], 1.341_592_653_589_793 + reach * draw.q[1]],
            ..draw
        };
        let kept = force(&rig, &mut used, &state);
        let anew = force(&rig, &mut fresh.clone(), &state);
        for (x, y) in kept.iter().zip(anew) {
            close(*x, y, 1e-9);
        }
    }
}
