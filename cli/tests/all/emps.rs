//! A real ball-screw axis through the program: the published least squares of the EMPS benchmark.
//!
//! The data carry no licence and are not copied: they are looked for beside the workspace.

use crate::common::{json, model, number, workspace};
use serde_json::Value;

/// The recipe of the reference: Butterworth of order 4 at 100 Hz, the ends dropped, decimation by 10.
fn identified(name: &str) -> Option<Value> {
    let folder = workspace("../shared/data/emps");
    let path = |name: &str| folder.join(name).to_str().expect("plain text").to_owned();
    if !folder.join("emps_train.csv").is_file() {
        println!("EMPS is not tested: there are no recordings in ../shared/data/emps beside the workspace.");
        return None;
    }
    Some(json(&[
        "identify",
        &model(name),
        "--data",
        &path("emps_train.csv"),
        "--check",
        &path("emps_pulses.csv"),
        "--order",
        "4",
        "--cutoff",
        "100",
        "--trim",
        "49",
        "--decimate",
        "10",
        "--json",
    ]))
}

fn check_parameters(fit: &Value, published: &[(&str, f64)]) {
    for (k, (expression, value)) in published.iter().enumerate() {
        let found = &fit["parameters"][k];
        assert_eq!(found["expression"], *expression);
        println!("{expression}: {} (published {value})", found["value"]);
        assert!((number(found, "/value") / value - 1.0).abs() < 0.005);
    }
}

#[test]
fn the_published_four_parameters_come_out() {
    let Some(fit) = identified("emps.toml") else {
        return;
    };
    check_parameters(
        &fit,
        &[("M", 95.1089), ("Fv", 203.5034), ("Fc", 20.3935), ("offset", -3.1648)],
    );
    assert!((number(&fit, "/condition_number") - 25.99).abs() < 0.1);
    assert!((100.0 * number(&fit, "/fit/rows/nrms") - 4.083).abs() < 0.15);
    assert!((100.0 * number(&fit, "/check/rows/nrms") - 5.982).abs() < 0.15);
}

#[test]
fn friction_by_direction_gives_the_published_error() {
    let Some(fit) = identified("emps-directional.toml") else {
        return;
    };
    check_parameters(
        &fit,
        &[
            ("M", 95.154),
            ("Fvp", 166.706),
            ("Fvn", 240.424),
            ("Fcp", 20.144),
            ("Fcn", 20.628),
        ],
    );
    let nrms = 100.0 * number(&fit, "/fit/rows/nrms");
    println!("train: {nrms:.3} % (published 3.112)");
    assert!((nrms - 3.112).abs() < 0.15);
}
