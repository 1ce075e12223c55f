//! Recordings as machines make them, made from the bundled one: lost samples, clocks that jitter, missing forces, encoder steps,
//! jumps, spikes, clipping. Positions only, defaults; base parameters are held against those of the model that made the forces.

use std::fmt::Write as _;

use crate::common::{json, model, number, run, scratch, workspace};
use serde_json::Value;

/// Columns of the bundled recording: time, positions, rates, accelerations, forces.
fn bundled() -> Vec<[f64; 9]> {
    let text = std::fs::read_to_string(run("plain-fit.csv")).expect("readable");
    let rows = text.lines().skip(1).map(|line| {
        let fields: Vec<f64> = line.split(',').map(|x| x.parse().expect("a number")).collect();
        fields.try_into().expect("nine columns")
    });
    rows.collect()
}

/// Writes time, positions and forces; what is no number stays empty.
fn write(name: &str, rows: &[[f64; 5]]) -> String {
    let mut text = "t,theta1,theta2,spindle_left,spindle_right\n".to_owned();
    for row in rows {
        let fields = row.map(|x| if x.is_finite() { x.to_string() } else { String::new() });
        writeln!(text, "{}", fields.join(",")).expect("text grows");
    }
    let path = scratch(name);
    std::fs::write(&path, text).expect("writable");
    path
}

fn kept(row: &[f64; 9]) -> [f64; 5] {
    [row[0], row[1], row[2], row[7], row[8]]
}

/// The largest deviation of a base parameter, %, and all that was said.
fn identified(path: &str, more: &[&str]) -> (f64, String) {
    let model = model("spidermill.toml");
    let mut args = vec!["identify", &model, "--data", path, "--json"];
    args.extend(more);
    let fit = json(&args);
    let parameters = fit["parameters"].as_array().expect("parameters");
    let off = parameters
        .iter()
        .map(|p| (number(p, "/value") / number(p, "/nominal") - 1.0).abs())
        .fold(0.0, f64::max);
    println!("{path}: {:.4} %", 100.0 * off);
    (100.0 * off, fit["data"].to_string())
}

/// Numbers between -1 and 1 that are the same every time (a linear congruence).
fn random() -> impl FnMut() -> f64 {
    let mut state = 20_231_u64;
    move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

#[test]
fn lost_samples_and_missing_forces_cost_nothing() {
    let all = bundled();
    let lost: Vec<[f64; 5]> = (all.iter().enumerate())
        .filter(|(i, _)| i % 277 != 100)
        .map(|(_, row)| kept(row))
        .collect();
    assert_eq!(all.len() - lost.len(), 13);
    let (off, says) = identified(&write("lost.csv", &lost), &[]);
    assert!(off < 1.0 && says.contains("13 gaps"), "{says}");
    let mut missing: Vec<[f64; 5]> = all.iter().map(kept).collect();
    for i in 0..12 {
        missing[150 + 290 * i][3 + i % 2] = f64::NAN;
    }
    let (off, says) = identified(&write("missing.csv", &missing), &["--skip-bad-samples"]);
    assert!(off < 1.0, "{off}");
    assert!(
        says.contains("6 of 3595 samples") && says.contains("lack the force of `spindle_right`"),
        "{says}"
    );
    // Positions stay, so that there is no gap.
    assert!(!says.contains("gap"), "{says}");
}

#[test]
fn a_clock_that_jitters_costs_nothing() {
    let all = bundled();
    for (jitter, most) in [(0.01, 1.0), (0.25, 2.0)] {
        let mut random = random();
        let rows: Vec<[f64; 5]> = (1..all.len() - 1)
            .map(|i| {
                let [t, a, b, a_d, b_d, a_dd, b_dd, left, right] = all[i];
                let late = 0.002 * jitter * random();
                let moved = |q: f64, qd: f64, qdd: f64| q + late * (qd + 0.5 * late * qdd);
                let slope = |k: usize| (all[i + 1][k] - all[i - 1][k]) / 0.004;
                [
                    t + late,
                    moved(a, a_d, a_dd),
                    moved(b, b_d, b_dd),
                    left + late * slope(7),
                    right + late * slope(8),
                ]
            })
            .collect();
        let (off, says) = identified(&write("jitter.csv", &rows), &[]);
        assert!(off < most && says.contains("uneven"), "{off} {says}");
    }
}

#[test]
fn faults_of_sensors_are_named_and_treated() {
    let all: Vec<[f64; 5]> = bundled().iter().map(kept).collect();
    for (step, most) in [(3e-3, 15.0), (1e-2, 50.0)] {
        let mut coarse = all.clone();
        for row in &mut coarse {
            for q in &mut row[1..3] {
                *q = (*q / step).round() * step;
            }
        }
        let (off, says) = identified(&write("steps.csv", &coarse), &[]);
        assert!(off < most, "{off}");
        assert!(says.contains("steps of the encoder: `theta1` of 0.0"), "{says}");
    }
    let mut jump = all.clone();
    for row in &mut jump[1800..] {
        row[1] += 0.02;
    }
    let (off, says) = identified(&write("jump.csv", &jump), &[]);
    assert!(
        off < 1.0 && says.contains("`theta1`") && says.contains("jumps once"),
        "{says}"
    );
    let mut spike = all.clone();
    spike[1800][3] = 1e6;
    spike[2500][4] = -1e6;
    let (off, says) = identified(&write("spike.csv", &spike), &[]);
    assert!(off < 1.0 && says.contains("1 spike that no drive can cause"), "{says}");
    // Spikes of a million newtons would have moved parameters by many of their deviations.
    assert!(says.contains("Without their repair, the sensor faults in"), "{says}");
    let (_, says) = identified(&write("sound.csv", &all), &[]);
    assert!(!says.contains("Without their repair"), "{says}");
    // A motor's force before a gear of 60 is another quantity.
    let geared: Vec<[f64; 5]> = (all.iter())
        .map(|[t, a, b, left, right]| [*t, *a, *b, left / 60.0, right / -60.0])
        .collect();
    let (_, says) = identified(&write("geared.csv", &geared), &[]);
    assert!(
        says.contains("[recording.torque]") && says.contains("spindle_right = { ratio = -60 }"),
        "{says}"
    );
    let mut clipped = all;
    let mut random = random();
    for row in &mut clipped {
        row[3] = row[3].clamp(-450.0, 450.0) + 1e-6 * random();
    }
    let (_, says) = identified(&write("clipped.csv", &clipped), &[]);
    assert!(says.contains("stays at 450 except for noise"), "{says}");
}

/// Measured and predicted force through one low-pass on data that the fit has not seen, %: at most 1.15 times what an expert's
/// settings give. The recordings are looked for beside the workspace.
#[test]
fn defaults_are_an_experts() {
    let shared = |path: &str| workspace("../shared/data").join(path);
    if !shared("panda/fit.csv").is_file() {
        println!("Defaults are not tested on real arms: there is no ../shared/data beside the workspace.");
        return;
    }
    let text = |path: &str| shared(path).to_str().expect("plain text").to_owned();
    let panda = scratch("panda-friction.toml");
    std::fs::copy(shared("panda/panda-friction.toml"), &panda).expect("writable");
    std::fs::copy(model("panda.toml"), scratch("panda.toml")).expect("writable");
    let [outer, middle] = tx40_parts(&text("tx40/tx40_motor_5kHz.csv"));
    let case = |name, model, fit: &[&str], check: &str, band, expert| Case {
        name,
        model,
        fit: fit.iter().map(|path| text(path)).collect(),
        check: text(check),
        band,
        expert,
        more: &[],
    };
    let tx40 = Case {
        fit: vec![outer],
        check: middle,
        ..case("TX40", model("tx40.toml"), &[], "tx40", "20", 11.36)
    };
    let of_panda = |name, expert, more| Case {
        // The ends of the check data are held against nobody: 17 % at each.
        more,
        ..case(name, panda.clone(), &["panda/fit.csv"], "panda/check.csv", "10", expert)
    };
    let emps = (&["emps/emps_train.csv"], "emps/emps_pulses.csv");
    let cloos = (&["cloos-qrc350/traj_A.csv"], "cloos-qrc350/traj_C.csv");
    let kuka = (
        &["kuka-kr300/kuka_A.csv", "kuka-kr300/kuka_B.csv"],
        "kuka-kr300/kuka_C.csv",
    );
    let pendulums = [0, 1, 2, 3, 4].map(|k| format!("machines/double-pendulum/trajectory_0{k}.csv"));
    let pendulums = pendulums.each_ref().map(String::as_str);
    let pendulum_model = text("machines/double-pendulum/dp_A_full.toml");
    let swing_up = "machines/simple-pendulum/ddp_data_measured.csv";
    let from_positions = ["--trim", "1000", "--derivatives", "positions"];
    let cases = [
        case("EMPS", model("emps.toml"), emps.0, emps.1, "40", 5.59),
        tx40,
        case("Cloos", model("cloos.toml"), cloos.0, cloos.1, "10", 11.06),
        of_panda("Panda", 0.87, &["--trim", "1000"]),
        of_panda("Panda, positions only", 1.7 / 1.15, &from_positions),
        case("KUKA", text("kuka-kr300/kuka_full.toml"), kuka.0, kuka.1, "8", 11.24),
        case(
            "double pendulum",
            pendulum_model,
            &pendulums[..4],
            pendulums[4],
            "15",
            55.5,
        ),
        // The expert has no other run either.
        case(
            "pendulum",
            text("machines/simple-pendulum/sp_full.toml"),
            &[swing_up],
            swing_up,
            "15",
            17.5,
        ),
    ];
    for Case {
        name,
        model,
        fit,
        check,
        band,
        expert,
        more,
    } in &cases
    {
        let mut args = vec!["identify", model, "--check", check, "--band", band, "--json"];
        for path in fit {
            args.extend(["--data", path]);
        }
        args.extend(*more);
        let found: Value = json(&args);
        let left = 100.0 * number(&found, "/check/band/nrms");
        println!("{name}: {left:.2} % (an expert: {expert} %)");
        assert!(left < 1.15 * expert, "{name}: {left} %");
    }
}

/// Recordings of a machine for fit and check, with the band and the error of an expert's settings.
struct Case<'a> {
    name: &'a str,
    model: String,
    fit: Vec<String>,
    check: String,
    band: &'a str,
    expert: f64,
    more: &'a [&'a str],
}

/// The outer four fifths of the run, and its middle fifth.
fn tx40_parts(path: &str) -> [String; 2] {
    let text = std::fs::read_to_string(path).expect("readable");
    let (header, rows) = text.split_once('\n').expect("a header");
    let mut parts = [format!("{header}\n"), format!("{header}\n")];
    for row in rows.lines() {
        let time: f64 = row.split(',').next().and_then(|t| t.parse().ok()).expect("a time");
        let part = usize::from((3.6..5.4).contains(&time));
        writeln!(parts[part], "{row}").expect("text grows");
    }
    let paths = ["tx40-outer.csv", "tx40-middle.csv"].map(scratch);
    for (path, part) in paths.iter().zip(parts) {
        std::fs::write(path, part).expect("writable");
    }
    paths
}

/// Who counts samples instead of reading stamps has a clock that the recorded rates contradict.
#[test]
fn a_wrong_time_base_is_named() {
    let path = workspace("../shared/data/panda/fit.csv");
    let Ok(text) = std::fs::read_to_string(path) else {
        println!("Clocks are not tested: there is no ../shared/data/panda beside the workspace.");
        return;
    };
    let mut counted = String::new();
    for (i, line) in text.lines().enumerate() {
        match line.split_once(',') {
            Some((_, rest)) if i > 0 => {
                writeln!(counted, "{:.3},{rest}", 1e-3 * i as f64).expect("text grows");
            }
            _ => writeln!(counted, "{line}").expect("text grows"),
        }
    }
    let path = scratch("counted.csv");
    std::fs::write(&path, counted).expect("writable");
    let fit = json(&["identify", &model("panda.toml"), "--data", &path, "--json"]);
    let says = fit["data"].to_string();
    assert!(says.contains("runs too slowly") && says.contains("1.01"), "{says}");
}
