//! Weights: what is known less well counts less, and equations at standstill need not count.

use std::fmt::Write as _;

use crate::common::{json, model, number, refused, run, scratch};

/// Even numbers between -1 and 1, the same on every machine.
fn noise() -> impl FnMut() -> f64 {
    let mut state = 12_345_u64;
    move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let upper = u32::try_from(state >> 33).unwrap_or(0);
        f64::from(upper) / f64::from(1_u32 << 30) - 1.0
    }
}

/// The bundled recording with noise of up to 200 N on the first half of the left force, and its variance beside it.
fn noisy() -> String {
    let text = std::fs::read_to_string(run("plain-fit.csv")).expect("a bundled recording");
    let mut lines = text.lines();
    let mut out = format!(
        "{},spindle_left_var,spindle_right_var\n",
        lines.next().unwrap_or_default()
    );
    let mut noise = noise();
    for (k, line) in lines.enumerate() {
        let mut fields: Vec<f64> = line.split(',').map(|f| f.parse().expect("a number")).collect();
        let size = if k < 1800 { 200.0 } else { 0.1 };
        fields[7] += size * noise();
        fields.extend([size * size / 3.0, 0.01 / 3.0]);
        let fields: Vec<String> = fields.iter().map(f64::to_string).collect();
        let _ = writeln!(out, "{}", fields.join(","));
    }
    let path = scratch("noisy.csv");
    std::fs::write(&path, out).expect("written");
    path
}

/// The largest relative error of the identified parameters, whose nominal values are true.
fn error(path: &str, more: &[&str]) -> f64 {
    let model = model("spidermill.toml");
    let mut args = vec!["identify", &model, "--data", path, "--json"];
    args.extend(more);
    let fit = json(&args);
    let parameters = fit["parameters"].as_array().expect("parameters");
    let errors = parameters
        .iter()
        .map(|p| (number(p, "/value") / number(p, "/nominal") - 1.0).abs());
    errors.fold(0.0, f64::max)
}

#[test]
fn recorded_variances_keep_noise_out() {
    let path = noisy();
    let equal = error(&path, &[]);
    let weighted = error(&path, &["--weights", "variance"]);
    println!("largest error {equal:.2e} with equal weights, {weighted:.2e} with recorded variances");
    assert!(equal > 1e-3 && weighted < 1e-4);
    // What is left out at standstill multiplies the weights, wherever they come from.
    let both = error(&path, &["--weights", "variance", "--standstill", "0.1"]);
    assert!(both < 1e-4, "{both:.2e}");
    let says = refused(
        1,
        &[
            "identify",
            &model("spidermill.toml"),
            "--data",
            &run("plain-fit.csv"),
            "--weights",
            "variance",
        ],
    );
    assert!(says.contains("`spindle_left_var`") && says.contains("--map"), "{says}");
}

#[test]
fn equations_at_standstill_are_left_out_and_counted() {
    let model = model("spidermill.toml");
    let run = run("plain-fit.csv");
    let fit = json(&["identify", &model, "--data", &run, "--standstill", "0.1", "--json"]);
    let notes = fit["data"].to_string();
    assert!(
        notes.contains("equations of `spindle_left`") && notes.contains("--standstill"),
        "{notes}"
    );
    assert!(number(&fit, "/fit/nrms") < 1e-5);
    let says = refused(2, &["identify", &model, "--data", &run, "--standstill", "3"]);
    assert!(says.contains("between 0 and 1"), "{says}");
}
