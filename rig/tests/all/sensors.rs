//! Sensors: resolution, noise, sampling, delay and currents, as a recording shows them.

use std::f64::consts::PI;

use crate::common::{close, column, rig};
use modelmill_rig::{Rig, RigRecording, RigState, Trajectory, simulate};

fn pendulum(sensors: &str) -> Rig {
    rig(&format!(
        r#"
        gravity = [0, -9.81, 0]
        body = [{{ name = "arm", mass = 2, centre = [0.5, 0, 0], inertia = {{ zz = 0.1 }} }}]
        joint = [{{ name = "hinge", kind = "revolute", between = ["base", "arm"], at = [0, 0, 0] }}]
        coordinate = [{{ name = "q", joint = "hinge" }}]
        drive = [{{ name = "motor", joint = "hinge" }}]
        {sensors}
    "#
    ))
}

fn swing(n: u32) -> Trajectory {
    let time = (0..n).map(|i| f64::from(i) * 0.004).collect();
    Trajectory::from_function(time, |t| RigState {
        q: vec![0.6 * (2.0 * t).sin()],
        qd: vec![1.2 * (2.0 * t).cos()],
        qdd: vec![-2.4 * (2.0 * t).sin()],
    })
    .expect("a trajectory")
}

fn run(rig: &Rig, trajectory: &Trajectory, seed: Option<u64>) -> RigRecording {
    simulate(rig, trajectory, seed, || {}).expect("a run")
}

fn deviation(errors: &[f64]) -> f64 {
    (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()
}

#[test]
fn encoders_read_whole_steps() {
    let rig = pendulum("encoder = [{ of = [\"q\"], bits = 12 }]");
    let step = 2.0 * PI / 4096.0;
    let made = run(&rig, &swing(2000), None);
    let (t, q) = (column(&made.columns, "t"), column(&made.columns, "q"));
    let mut errors = Vec::new();
    for (t, q) in t.iter().zip(q) {
        close((q / step).round() * step, *q, 1e-12);
        errors.push(q - 0.6 * (2.0 * t).sin());
    }
    assert!(errors.iter().all(|e| e.abs() <= step / 2.0 + 1e-12));
    // An even error within a step has this deviation; a reading that rounds down would have twice as much.
    let expected = step / 12.0_f64.sqrt();
    assert!((deviation(&errors) / expected - 1.0).abs() < 0.05);
    assert!(
        made.columns.iter().all(|(name, _)| name != "q_d"),
        "encoders give no rates"
    );
}

#[test]
fn noise_is_seeded_and_has_its_deviation() {
    let rig = pendulum("seed = 3\nforce_sensor = [{ of = [\"motor\"], noise = 1.5 }]");
    let ideal = run(&pendulum(""), &swing(4000), None);
    let (one, again, other) = (
        run(&rig, &swing(4000), None),
        run(&rig, &swing(4000), Some(3)),
        run(&rig, &swing(4000), Some(4)),
    );
    assert_eq!(one, again);
    let errors = |made: &RigRecording| -> Vec<f64> {
        let ideal = column(&ideal.columns, "motor");
        column(&made.columns, "motor")
            .iter()
            .zip(ideal)
            .map(|(x, y)| x - y)
            .collect()
    };
    let (first, second) = (errors(&one), errors(&other));
    for errors in [&first, &second] {
        assert!((deviation(errors) / 1.5 - 1.0).abs() < 0.05, "{}", deviation(errors));
    }
    let product: f64 = first.iter().zip(&second).map(|(x, y)| x * y).sum::<f64>() / 4000.0;
    assert!(product.abs() < 0.1 * 2.25, "different seeds are independent: {product}");
    // Exact positions stay exact: noise of one channel does not leak into another.
    assert_eq!(column(&one.columns, "q"), column(&ideal.columns, "q"));
}

#[test]
fn currents_are_quantised() {
    let rig =
        pendulum("force_sensor = [{ of = [\"motor\"], current = { force_per_ampere = 0.5, resolution = 0.25 } }]");
    let made = run(&rig, &swing(500), None);
    let exact = run(&pendulum(""), &swing(500), None);
    for (read, exact) in column(&made.columns, "motor")
        .iter()
        .zip(column(&exact.columns, "motor"))
    {
        close((read / 0.125).round() * 0.125, *read, 1e-12);
        assert!((read - exact).abs() <= 0.0625 + 1e-9);
    }
}

#[test]
fn samples_come_at_their_rate_and_sensors_lag() {
    let rig = pendulum("sampling = { rate = 100.0, derivatives = true }\nencoder = [{ of = [\"q\"], delay = 0.015 }]");
    let made = run(&rig, &swing(1000), None);
    let t = column(&made.columns, "t");
    assert_eq!(t.len(), 398, "0.02 s to 3.99 s");
    assert!(
        made.notes.iter().any(|note| note.contains("first 2 samples")),
        "{:?}",
        made.notes
    );
    for (i, t) in t.iter().enumerate() {
        close(*t, 0.02 + 0.01 * i as f64, 1e-12);
        close(column(&made.columns, "q")[i], 0.6 * (2.0 * (t - 0.015)).sin(), 1e-9);
        close(column(&made.columns, "q_d")[i], 1.2 * (2.0 * (t - 0.015)).cos(), 1e-6);
        let (q, qdd) = (0.6 * (2.0 * t).sin(), -2.4 * (2.0 * t).sin());
        close(column(&made.columns, "motor")[i], 0.6 * qdd + 9.81 * q.cos(), 1e-6);
    }
}

#[test]
fn runs_that_cannot_be_are_refused() {
    let says = |sensors: &str, trajectory: &Trajectory| {
        simulate(&pendulum(sensors), trajectory, None, || {})
            .expect_err("a fault")
            .to_string()
    };
    assert!(says("encoder = [{ of = [\"q\"], delay = 9 }]", &swing(100)).contains("shorten the delay"));
    assert!(says("sampling = { rate = 1e12 }", &swing(100)).contains("lower the rate"));
    let two = Trajectory::from_function(vec![0.0], |_| RigState {
        q: vec![0.0; 2],
        qd: vec![0.0; 2],
        qdd: vec![0.0; 2],
    });
    assert!(says("", &two.expect("a trajectory")).contains("one column for each"));
}
