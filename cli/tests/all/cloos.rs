//! A real welding arm: errors per joint on a motion that the fit does not see, beside the published ones.
//!
//! The data are not copied: they are looked for beside the workspace.
//! Source of the numbers: Volkmann et al., IEEE ICMA 2020, as given with the recordings.

use crate::common::{json, model, number, workspace};
use serde_json::Value;

/// `sum |error| / sum |torque|` on run C, %, for 35 parameters.
const PUBLISHED: [f64; 6] = [15.2, 13.7, 17.4, 16.3, 14.3, 12.5];

/// Joint 4 stays worse than published, and half of that is its drive inertia, which run A does not determine: it comes
/// out negative, and C pays for it.
#[test]
fn errors_on_another_motion_are_those_published() {
    // Published figures count every sample.
    let Some(weighted) = identified(&["--standstill", "0"]) else {
        return;
    };
    check_errors(&weighted);
    // The ladder's last rung, as reproduced independently: 15.4 % on A and on C.
    assert!((100.0 * number(&weighted, "/fit/nrms") - 15.4).abs() < 0.15);
    assert!((100.0 * number(&weighted, "/check/nrms") - 15.4).abs() < 0.15);
    let mean = check_errors(&identified(&["--standstill", "0.01"]).expect("the same recordings"));
    assert!(mean < PUBLISHED.iter().sum::<f64>() / 6.0);
    // About as many parameters as were published.
    let essential = identified(&["--standstill", "0.01", "--essential"]);
    let essential = essential.expect("the same recordings");
    let kept = essential["parameters"].as_array().map(|all| {
        let is_kept = |p: &&Value| p["status"] != "not_essential";
        all.iter().filter(is_kept).count()
    });
    assert!(kept.is_some_and(|kept| (29..=33).contains(&kept)), "{kept:?}");
    assert!(check_errors(&essential) < mean);
    assert!((100.0 * number(&essential, "/check/channels/joint4/abs_ratio") - 16.6).abs() < 0.3);
}

fn identified(more: &[&str]) -> Option<Value> {
    let folder = workspace("../shared/data/cloos-qrc350");
    let path = |name: &str| folder.join(name).to_str().expect("plain text").to_owned();
    if !folder.join("traj_A.csv").is_file() {
        println!(
            "The Cloos arm is not tested: there are no recordings in ../shared/data/cloos-qrc350 beside the workspace."
        );
        return None;
    }
    let (model, fit, check) = (model("cloos.toml"), path("traj_A.csv"), path("traj_C.csv"));
    let mut args = vec![
        "identify",
        &model,
        "--data",
        &fit,
        "--check",
        &check,
        "--weights",
        "variance",
        "--json",
    ];
    args.extend(more);
    Some(json(&args))
}

/// The mean of the six errors on C, %.
fn check_errors(fit: &Value) -> f64 {
    let errors: Vec<f64> = (1..=6)
        .map(|i| 100.0 * number(fit, &format!("/check/channels/joint{i}/abs_ratio")))
        .collect();
    let mean = errors.iter().sum::<f64>() / 6.0;
    println!("sum|e|/sum|tau| on C: {errors:.1?} %, published {PUBLISHED:?} %; mean {mean:.2} %");
    assert!(mean <= 15.4);
    for (ours, published) in errors.iter().zip(PUBLISHED) {
        assert!(*ours < published + 2.2, "{ours} % where {published} % is published");
    }
    mean
}

/// Without effects the arm has 36 base parameters, as published.
#[test]
fn the_rigid_arm_has_36_base_parameters() {
    for name in ["cloos.toml", "tx40.toml"] {
        let loaded = modelmill_spec::load_file(model(name).as_ref()).expect("a sound model");
        let mut rigid = loaded.mechanism;
        rigid.effects.clear();
        let derivation = modelmill_codegen::derive(&rigid).expect("a derivation");
        assert_eq!(derivation.reduction.retained.len(), 36, "{name}");
    }
}
