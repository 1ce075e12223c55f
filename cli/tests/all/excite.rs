//! `excite` finds motion within limits that beats random motion, the same for the same seed, and from which the base
//! parameters are found.

use std::f64::consts::PI;
use std::fmt::Write as _;

use crate::common::{json, model, number, printed, refused, scratch};
use serde_json::Value;

/// Motion of a coordinate at a time, from the coefficients that the program prints: eq. (15) written out once more.
fn at(one: &Value, period: f64, t: f64) -> [f64; 3] {
    let list = |name: &str| -> Vec<f64> {
        let list = one[name].as_array().unwrap();
        list.iter().map(|x| x.as_f64().unwrap()).collect()
    };
    let mut motion = [one["offset"].as_f64().unwrap(), 0.0, 0.0];
    for (k, (mu, nu)) in list("mu").iter().zip(list("nu")).enumerate() {
        let w = 2.0 * PI / period * (k + 1) as f64;
        let (s, c) = (w * t).sin_cos();
        motion[0] += mu / w * s - nu / w * c;
        motion[1] += mu * c + nu * s;
        motion[2] += -mu * w * s + nu * w * c;
    }
    motion
}

fn columns(path: &str) -> (Vec<String>, Vec<Vec<f64>>) {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let names = lines.next().unwrap().split(',').map(str::to_owned).collect();
    let rows = lines.map(|line| line.split(',').map(|x| x.parse().unwrap()).collect());
    (names, rows.collect())
}

/// The best period within bounds is at least as good as the end of the bounds, and the best number of harmonics is written.
#[test]
fn the_period_and_the_number_of_harmonics_are_searched() {
    let search = |extra: &[&str]| {
        let out = scratch("excite-period.csv");
        let robot = model("two_link.toml");
        let limits = [
            "--limits",
            "q1=-1:1",
            "--limits",
            "q1_d=2",
            "--limits",
            "q2=-1.5:1.5",
            "--limits",
            "q2_d=3",
        ];
        let mut all = vec![
            "excite",
            robot.as_str(),
            "--random",
            "40",
            "--starts",
            "1",
            "--out",
            &out,
            "--json",
        ];
        all.extend(limits);
        all.extend(extra);
        json(&all)
    };
    let free = search(&["--harmonics", "2,3", "--period", "2:8"]);
    let period = number(&free, "/period");
    assert!((2.0..=8.0).contains(&period), "{period}");
    assert_eq!(free["violations"], 0);
    let compared = free["compared_harmonics"].as_array().unwrap();
    let best = compared
        .iter()
        .map(|one| number(one, "/condition_number"))
        .fold(f64::INFINITY, f64::min);
    assert_eq!(compared.len(), 2);
    assert!((number(&free, "/condition_number") - best).abs() < 1e-9 * best);
    let fixed = search(&["--harmonics", "3", "--period", "8"]);
    assert!(best < 1.02 * number(&fixed, "/condition_number"), "{free} {fixed}");
    refused(
        2,
        &["excite", &model("two_link.toml"), "--period", "8:2", "--out", "x.csv"],
    );
}

/// The paper's series for the SpiderMill: period 7.29 s, seven harmonics.
#[test]
fn beats_the_best_of_a_thousand_random_trajectories_without_leaving_the_limits() {
    let out = scratch("excite-spidermill.csv");
    let found = json(&[
        "excite",
        &model("spidermill.toml"),
        "--starts",
        "2",
        "--out",
        &out,
        "--json",
    ]);
    let (start, condition) = (number(&found, "/start"), number(&found, "/condition_number"));
    println!(
        "condition number {condition:.3}, best of 1000 random ones {start:.3}: {:.2} times better",
        start / condition
    );
    assert_eq!(found["random"], 1000);
    assert_eq!(found["violations"], 0);
    assert!(start >= 1.25 * condition, "{start} against {condition}");

    // No limit is left anywhere, looked at on a grid that has nothing to do with the program's.
    let limits = [("theta1", [1.50, 2.10]), ("theta2", [1.04, 1.64])];
    for (name, [low, high]) in limits {
        let one = &found["coefficients"][name];
        for i in 0..100_003 {
            let [q, qd, qdd] = at(one, 7.29, 7.29 * f64::from(i) / 100_003.0);
            assert!(
                q >= low && q <= high && qd.abs() <= 1.2 && qdd.abs() <= 4.0,
                "{name} at {i}"
            );
        }
    }

    // The file holds the series, and the picture shows it.
    let (names, rows) = columns(&out);
    assert_eq!(
        names,
        [
            "t",
            "theta1",
            "theta2",
            "theta1_d",
            "theta2_d",
            "theta1_dd",
            "theta2_dd"
        ]
    );
    assert_eq!(rows.len(), 3645);
    for row in rows.iter().step_by(97) {
        for (k, name) in ["theta1", "theta2"].into_iter().enumerate() {
            let motion = at(&found["coefficients"][name], 7.29, row[0]);
            for (d, value) in motion.into_iter().enumerate() {
                assert!((row[1 + k + 2 * d] - value).abs() < 1e-9);
            }
        }
    }
    let picture = std::fs::read_to_string(out.replace(".csv", ".svg")).unwrap();
    assert!(picture.starts_with("<svg") && picture.contains("theta2"));

    // The condition number is that of the regressor along the file, as identification sees it.
    let recording = scratch("excite-recording.csv");
    let fit = identified(&out, &recording, true);
    let seen = number(&fit, "/condition_number");
    assert!((seen / condition - 1.0).abs() < 1e-3, "{seen} against {condition}");

    // From positions alone, with encoders of 20 bits and 1 N of noise in the forces.
    let fit = identified(&out, &recording, false);
    for parameter in fit["parameters"].as_array().unwrap() {
        let (value, nominal) = (number(parameter, "/value"), number(parameter, "/nominal"));
        let error = value / nominal - 1.0;
        println!("{}: {:.4} %", parameter["name"], 100.0 * error);
        assert!(error.abs() < 2e-3, "{parameter}");
    }
}

/// A recording along a trajectory, by the nominal model, and what is identified from it: with the exact states, or
/// from positions by an encoder of 20 bits; the forces carry 1 N of noise.
fn identified(trajectory: &str, recording: &str, exact: bool) -> Value {
    let spidermill = model("spidermill.toml");
    let forces = scratch("excite-forces.csv");
    printed(&["evaluate", &spidermill, "--data", trajectory, "--out", &forces]);
    let ((names, states), (_, forces)) = (columns(trajectory), columns(&forces));
    let kept = if exact { names.len() } else { 3 };
    let step = 2.0 * PI / f64::from(1 << 20);
    let mut text = format!("{},spindle_left,spindle_right\n", names[..kept].join(","));
    let mut seed = 42_u64;
    let mut noise = || {
        let mut sum = -6.0;
        for _ in 0..12 {
            seed = seed
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            sum += (seed >> 11) as f64 / (1_u64 << 53) as f64;
        }
        sum
    };
    for (state, force) in states.iter().zip(&forces) {
        let _ = write!(text, "{}", state[0]);
        for value in &state[1..kept] {
            let read = if exact { *value } else { (value / step).round() * step };
            let _ = write!(text, ",{read}");
        }
        for value in &force[1..] {
            let _ = write!(text, ",{}", value + noise());
        }
        text.push('\n');
    }
    std::fs::write(recording, text).unwrap();
    json(&["identify", &spidermill, "--data", recording, "--json"])
}

#[test]
fn the_same_seed_gives_the_same_bytes() {
    let (one, other, third) = (
        scratch("excite-1.csv"),
        scratch("excite-2.csv"),
        scratch("excite-3.csv"),
    );
    let arguments = |out: &str, seed: &str| -> Vec<String> {
        let text = format!(
            "excite {} --harmonics 3 --period 5 --random 20 --starts 1 --limits q1=-1:1,q1_d=2,q2=-1:1,q2_dd=9 \
             --seed {seed} --out {out}",
            model("two_link.toml")
        );
        text.split(' ').map(str::to_owned).collect()
    };
    for (out, seed) in [(&one, "4"), (&other, "4"), (&third, "5")] {
        let arguments = arguments(out, seed);
        printed(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
    }
    let read = |path: &str| std::fs::read(path).unwrap();
    assert_eq!(read(&one), read(&other));
    assert_ne!(read(&one), read(&third));
}

#[test]
fn passive_angles_forces_points_and_singular_poses_are_limited_too() {
    let out = scratch("excite-limits.csv");
    let run = |more: &str| {
        json(&[
            "excite",
            &model("spidermill.toml"),
            "--random",
            "60",
            "--starts",
            "1",
            "--harmonics",
            "3",
            "--limits",
            more,
            "--out",
            &out,
            "--json",
        ])
    };
    let free = run("theta1_d=1.2");
    let tight = run("gamma1=-2.75:-2.45,spindle_left=500,R3m.x=0.38:0.52,singularity=0.8");
    assert_eq!(tight["violations"], 0);
    let names: Vec<&str> = tight["limits"]
        .as_array()
        .unwrap()
        .iter()
        .map(|limit| limit["name"].as_str().unwrap())
        .collect();
    for name in ["gamma1", "spindle_left", "R3m.x", "singularity of the loops"] {
        assert!(names.contains(&name), "{names:?}");
    }
    assert!(number(&tight, "/condition_number") > number(&free, "/condition_number"));

    // Where the platform is, by geometry of its own: R3m is where circles of 1.03 m about the elbows meet, below them.
    let (_, rows) = columns(&out);
    let (mut left, mut lowest) = (f64::INFINITY, f64::INFINITY);
    for row in &rows {
        let elbow = |x: f64, theta: f64| [x + 1.13 * theta.cos(), 1.13 * theta.sin()];
        let (a, b) = (elbow(0.0, row[1]), elbow(0.90, row[2]));
        let middle = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let length = dx.hypot(dy);
        let height = (1.03_f64.powi(2) - 0.25 * length * length).sqrt();
        let platform = [middle[0] + height * dy / length, middle[1] - height * dx / length];
        left = left.min((platform[0] - 0.38).min(0.52 - platform[0]));
        let gamma = (platform[1] - a[1]).atan2(platform[0] - a[0]) - row[1];
        lowest = lowest.min((gamma + 2.75).min(-2.45 - gamma));
    }
    assert!(left >= 0.0 && lowest >= 0.0, "{left} {lowest}");
}

#[test]
fn impossible_limits_are_told() {
    let out = scratch("excite-refused.csv");
    let spidermill = model("spidermill.toml");
    let run = |status: i32, more: &[&str]| {
        let mut arguments = vec!["excite", &spidermill, "--random", "5", "--out", &out];
        arguments.extend(more);
        refused(status, &arguments)
    };
    let says = run(1, &["--limits", "spindle_left=0.001"]);
    assert!(says.contains("spindle_left") && says.contains("widen"), "{says}");
    let says = run(1, &["--limits", "theta9=1:2"]);
    assert!(says.contains("theta9") && says.contains("theta1"), "{says}");
    let says = run(1, &["--limits", "gamma1_d=1"]);
    assert!(says.contains("passive"), "{says}");
    run(2, &["--limits", "theta1=2:1"]);
    run(2, &["--harmonics", "0"]);
    run(2, &["--period", "-1"]);
    let two_link = model("two_link.toml");
    let says = refused(1, &["excite", &two_link, "--out", &out]);
    assert!(says.contains("limits.coordinates") && says.contains("q1"), "{says}");
    let says = refused(2, &["excite", &spidermill, "--out", &spidermill]);
    assert!(says.contains("overwrite"), "{says}");
}
