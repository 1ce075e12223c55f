//! States from positions alone: recordings with 20 bits and 1 N of force noise, made elsewhere, leave that noise and
//! nothing else, whether their motion is known to be periodic or not.
//!
//! The recordings are not copied: they are looked for beside the workspace.

use std::fmt::Write as _;

use crate::common::{json, model, number, scratch, workspace};

/// The head of a recording, as a file of its own.
fn first(seconds: f64, name: &str) -> String {
    let text = std::fs::read_to_string(workspace("../shared/data/spidermill-cases/null").join(name)).expect("readable");
    let mut lines = text.lines();
    let mut kept = format!("{}\n", lines.next().expect("a header"));
    for line in lines {
        let t: f64 = line.split(',').next().and_then(|t| t.parse().ok()).expect("a time");
        if t < seconds {
            writeln!(kept, "{line}").expect("text grows");
        }
    }
    let path = scratch(&format!("null-{seconds}-{name}"));
    std::fs::write(&path, kept).expect("writable");
    path
}

#[test]
fn nothing_but_the_noise_of_the_forces_is_left() {
    if !workspace("../shared/data/spidermill-cases/null/fit.csv").is_file() {
        println!("Preparation is not tested: there is no ../shared/data/spidermill-cases beside the workspace.");
        return;
    }
    // Two periods; one; and parts of one, which is filtered.
    for (seconds, series, tolerance) in [
        (20.0, true, 0.03),
        (7.29, true, 0.03),
        (5.3, false, 0.06),
        (8.9, false, 0.06),
    ] {
        let found = json(&[
            "identify",
            &model("spidermill.toml"),
            "--data",
            &first(seconds, "fit.csv"),
            "--check",
            &first(seconds, "check.csv"),
            "--json",
        ]);
        let notes = found["data"].to_string();
        assert_eq!(notes.contains("a Fourier series of period 7.29"), series, "{notes}");
        for part in ["fit", "check"] {
            let rms = number(&found, &format!("/{part}/rms"));
            println!("{seconds} s, {part}: {rms:.4} N");
            assert!((rms - 1.0).abs() < tolerance, "{seconds} s, {part}: {rms} N");
        }
    }
}

/// A motion that repeats itself averages over its periods what an encoder of 10 mrad does to it, though what is left is no
/// white noise; a low-pass leaves more than ten times as much.
#[test]
fn a_series_is_taken_where_forces_tell_that_it_leaves_less() {
    let path = workspace("../shared/data/spidermill-cases/null/fit.csv");
    let Ok(text) = std::fs::read_to_string(path) else {
        println!("Series are not tested: there is no ../shared/data/spidermill-cases beside the workspace.");
        return;
    };
    let mut coarse = String::new();
    for (i, line) in text.lines().enumerate() {
        let fields = line
            .split(',')
            .enumerate()
            .map(|(k, field)| match field.parse::<f64>() {
                Ok(q) if i > 0 && (1..=2).contains(&k) => ((q / 0.01).round() * 0.01).to_string(),
                _ => field.to_owned(),
            });
        let fields: Vec<String> = fields.collect();
        writeln!(coarse, "{}", fields.join(",")).expect("text grows");
    }
    let path = scratch("coarse-periodic.csv");
    std::fs::write(&path, coarse).expect("writable");
    let off = |more: &[&str]| {
        let spidermill = model("spidermill.toml");
        let mut args = vec!["identify", &spidermill, "--data", &path, "--json"];
        args.extend(more);
        let found = json(&args);
        let parameters = found["parameters"].as_array().expect("parameters");
        let off = parameters
            .iter()
            .map(|p| (number(p, "/value") / number(p, "/nominal") - 1.0).abs())
            .fold(0.0, f64::max);
        (off, found["data"].to_string())
    };
    let (series, says) = off(&[]);
    assert!(says.contains("is fitted by a Fourier series of period 7.29"), "{says}");
    let (filtered, _) = off(&["--smoothing", "butterworth"]);
    println!("a series: {series:.4}, a low-pass: {filtered:.4}");
    assert!(series < 0.01 && 10.0 * series < filtered, "{series} {filtered}");
}
