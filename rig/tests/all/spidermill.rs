//! The whole robot against a third party's multibody code (recordings/README.md), plain and with rods, and against
//! Table 1 of the paper.

use crate::common::{bundled, column, load, relative_rms, trajectory};
use modelmill_rig::{forces_along, simulate};

fn check(rig: &str, run: &str) {
    let rig = load(rig);
    let run = bundled(run);
    let trajectory = trajectory(&run, &["theta1", "theta2"]);
    let instants = forces_along(&rig, &trajectory, trajectory.time(), || {})
        .unwrap_or_else(|error| panic!("{}: {error}", rig.name));
    for (d, drive) in rig.drives.iter().enumerate() {
        let ours: Vec<f64> = instants.iter().map(|instant| instant.forces[d]).collect();
        let error = relative_rms(&ours, column(&run, &drive.name));
        println!("{} {}: {error:.2e}", rig.name, drive.name);
        assert!(error < 1e-5, "{}, {}: {error:.2e}", rig.name, drive.name);
    }
}

#[test]
fn the_plain_robot_agrees_with_the_multibody_code_on_the_first_motion() {
    check("spidermill-full", "plain-fit");
}

#[test]
fn the_plain_robot_agrees_with_the_multibody_code_on_the_second_motion() {
    check("spidermill-full", "plain-check");
}

#[test]
fn the_robot_with_rods_agrees_with_the_multibody_code_on_the_first_motion() {
    check("spidermill-with-rods", "with-rods-fit");
}

#[test]
fn the_robot_with_rods_agrees_with_the_multibody_code_on_the_second_motion() {
    check("spidermill-with-rods", "with-rods-check");
}

/// Eq. (1) for bars that move alike: sums of mass, of its first and of its second moment about their own joints.
#[test]
fn the_groups_reduce_to_table_1() {
    let rig = load("spidermill-full");
    let sums = |names: &[&str]| {
        let mut sums = [0.0; 4];
        for body in rig.bodies.iter().filter(|body| names.contains(&body.name.as_str())) {
            let (m, c) = (body.mass, body.centre);
            let second = body.inertia[(2, 2)] + m * (c.x * c.x + c.y * c.y);
            for (sum, part) in sums.iter_mut().zip([m, m * c.x, m * c.y, second]) {
                *sum += part;
            }
        }
        let centre = sums[1] / sums[0];
        [sums[0], centre, sums[2] / sums[0], sums[3] - sums[0] * centre * centre]
    };
    let close = |found: [f64; 4], expected: [f64; 4]| {
        for (x, y) in found.iter().zip(expected) {
            assert!((x - y).abs() < 1e-12, "{found:?} instead of {expected:?}");
        }
    };
    for cranks in [["G1", "G8"], ["G7", "G11"]] {
        close(sums(&cranks), [50.9597, 0.565, 0.0, 6.3195]);
    }
    for couplers in [["G3", "G9"], ["G5", "G10"]] {
        close(sums(&couplers), [14.5773, 0.515, 0.0, 1.6173]);
    }
    for (name, mass) in [("G2", 7.9538), ("G6", 7.9538), ("G4", 12.4560)] {
        let body = rig.bodies.iter().find(|body| body.name == name).expect(name);
        assert!((body.mass - mass).abs() < 1e-12, "{name}");
    }
    assert_eq!(rig.bodies.len(), 11);
}

/// Without sensors a recording has the columns of a recording, and the motion as it was given.
#[test]
fn a_run_has_the_columns_of_a_recording() {
    let rig = load("spidermill-full");
    let run = bundled("plain-fit");
    let trajectory = trajectory(&run, &["theta1", "theta2"]);
    let short = crate::common::shortened(&run, 20);
    let short = crate::common::trajectory(&short, &["theta1", "theta2"]);
    let made = simulate(&rig, &short, None, || {}).expect("inside the workspace");
    let names: Vec<&str> = made.columns.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(
        names,
        [
            "t",
            "theta1",
            "theta2",
            "theta1_d",
            "theta2_d",
            "theta1_dd",
            "theta2_dd",
            "spindle_left",
            "spindle_right"
        ]
    );
    assert_eq!(
        made.columns[1].1[7].to_bits(),
        trajectory.state_at(short.time()[7]).q[0].to_bits()
    );
}
