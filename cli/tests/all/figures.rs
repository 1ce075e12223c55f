//! The figures that the program must reach on the bundled recordings of the whole robot.

use crate::common::{json, model, number, printed, run, scratch};

/// Four masses, lengths and inertias of Table 1 in the expressions of `p_min`, by hand.
fn nominal_consistent() -> [f64; 4] {
    let (m1, m2, m3, m4) = (50.9597, 7.9538, 14.5773, 12.4560);
    let (dc1, dc3, ic12, ic32) = (0.565, 0.515, 6.3195, 1.6173);
    let (d1, d3) = (1.13, 1.03);
    let lumped = m2 + m3 + 0.5 * m4;
    [
        m1 * dc1 + d1 * lumped,
        m1 * dc1 * dc1 + d1 * d1 * lumped + ic12,
        m3 * dc3 + 0.5 * d3 * m4,
        m3 * dc3 * dc3 + 0.5 * d3 * d3 * m4 + ic32,
    ]
}

#[test]
fn the_reduced_model_agrees_with_the_whole_robot_without_identification() {
    let consistent = json(&[
        "compare",
        &model("spidermill.toml"),
        "--data",
        &run("plain-check.csv"),
        "--json",
    ]);
    let nrms = number(&consistent, "/nrms");
    println!("consistent, nominal, plain-check: nrms {nrms:.3e}");
    assert!(nrms < 1e-5);
    for channel in ["spindle_left", "spindle_right"] {
        assert!(number(&consistent, &format!("/channels/{channel}/nrms")) < 1e-5);
    }
    let paper = json(&[
        "compare",
        &model("spidermill-paper.toml"),
        "--data",
        &run("plain-check.csv"),
        "--json",
    ]);
    let nrms = number(&paper, "/nrms");
    println!("the paper's treatment, nominal, plain-check: nrms {nrms:.4}");
    assert!((0.2..0.5).contains(&nrms));
}

#[test]
fn evaluated_forces_are_the_recorded_ones() {
    let out = scratch("forces.csv");
    printed(&[
        "evaluate",
        &model("spidermill.toml"),
        "--data",
        &run("plain-check.csv"),
        "--out",
        &out,
    ]);
    let read = |path: &str| -> Vec<Vec<String>> {
        let text = std::fs::read_to_string(path).expect("a file");
        text.lines()
            .map(|line| line.split(',').map(str::to_owned).collect())
            .collect()
    };
    let (forces, recording) = (read(&out), read(&run("plain-check.csv")));
    assert_eq!(forces[0], ["t", "spindle_left", "spindle_right"]);
    assert_eq!(forces.len(), recording.len());
    let column = |name: &str| recording[0].iter().position(|c| c == name).expect("a column");
    let (mut error, mut size) = (0.0_f64, 0.0_f64);
    for (model, measured) in forces.iter().zip(&recording).skip(1) {
        assert_eq!(model[0], measured[column("t")]);
        for (k, drive) in ["spindle_left", "spindle_right"].iter().enumerate() {
            let y: f64 = measured[column(drive)].parse().expect("a number");
            let m: f64 = model[k + 1].parse().expect("a number");
            error += (y - m).powi(2);
            size += y * y;
        }
    }
    let nrms = (error / size).sqrt();
    println!("evaluate, plain-check: nrms {nrms:.3e}");
    assert!(nrms < 1e-5);
}

#[test]
fn identification_finds_the_table_again() {
    let fit = json(&[
        "identify",
        &model("spidermill.toml"),
        "--data",
        &run("plain-fit.csv"),
        "--check",
        &run("plain-check.csv"),
        "--json",
    ]);
    let parameters = fit["parameters"].as_array().expect("parameters");
    let by_hand = nominal_consistent();
    assert_eq!(parameters.len(), by_hand.len());
    for (parameter, by_hand) in parameters.iter().zip(by_hand) {
        let (value, nominal) = (number(parameter, "/value"), number(parameter, "/nominal"));
        println!(
            "{} = {}: {value:.6} (nominal {nominal:.6}, std {:.1e})",
            parameter["name"],
            parameter["expression"],
            number(parameter, "/std")
        );
        assert!((nominal / by_hand - 1.0).abs() < 1e-12);
        assert!((value / nominal - 1.0).abs() < 1e-4);
    }
    assert!(number(&fit, "/fit/nrms") < 1e-5);
    assert!(number(&fit, "/check/nrms") < 1e-5);
    assert!((10.0..15.0).contains(&number(&fit, "/condition_number")));
    assert_eq!(fit["samples"], 3595);
}

/// The mass that the paper places twice shows in its fourth parameter, from data alone.
#[test]
fn the_data_refute_the_placement_of_the_platform() {
    let fit = json(&[
        "identify",
        &model("spidermill-paper.toml"),
        "--data",
        &run("plain-fit.csv"),
        "--check",
        &run("plain-check.csv"),
        "--json",
    ]);
    let p4 = &fit["parameters"][3];
    assert_eq!(p4["name"], "p4_min");
    assert!((number(p4, "/nominal") - 6.228).abs() < 1e-9);
    assert!(number(p4, "/value").abs() < 1e-3);
    assert!(number(&fit, "/nominal/check/nrms") > 0.2);
    assert!(number(&fit, "/check/nrms") < 1e-5);
}

/// What the model lacks is taken up in part by the parameters; the rest stays.
#[test]
fn with_rods_identification_halves_the_error_and_no_more() {
    for (name, before, after) in [
        ("spidermill.toml", 0.0469, 0.0218),
        ("spidermill-paper.toml", 0.356, 0.0215),
    ] {
        let fit = json(&[
            "identify",
            &model(name),
            "--data",
            &run("with-rods-fit.csv"),
            "--check",
            &run("with-rods-check.csv"),
            "--json",
        ]);
        let figures =
            ["/nominal/fit", "/fit", "/nominal/check", "/check"].map(|place| number(&fit, &format!("{place}/nrms")));
        println!(
            "{name}, with rods: fit {:.4} -> {:.4}, check {:.4} -> {:.4}",
            figures[0], figures[1], figures[2], figures[3]
        );
        assert!((figures[2] / before - 1.0).abs() < 0.02, "{figures:?}");
        assert!((figures[3] / after - 1.0).abs() < 0.02, "{figures:?}");
    }
}

#[test]
fn a_written_fit_is_read_back() {
    let fit = scratch("rods-fit.json");
    printed(&[
        "identify",
        &model("spidermill.toml"),
        "--data",
        &run("with-rods-fit.csv"),
        "--out",
        &fit,
    ]);
    let compared = json(&[
        "compare",
        &model("spidermill.toml"),
        "--data",
        &run("with-rods-check.csv"),
        "--parameters",
        &fit,
        "--json",
    ]);
    assert!((number(&compared, "/nrms") / 0.0218 - 1.0).abs() < 0.02);
    let other = crate::common::refused(
        1,
        &[
            "compare",
            &model("spidermill-paper.toml"),
            "--data",
            &run("with-rods-check.csv"),
            "--parameters",
            &fit,
        ],
    );
    assert!(other.contains("identify"), "{other}");
}
