//! States from positions alone: recordings with 20 bits and 1 N of force noise, made elsewhere, leave that noise and
//! nothing else, whether their motion is known to be periodic or not.
//!
//! The recordings are not copied: they are looked for beside the workspace.

use std::fmt::Write as _;

use crate::common::{json, model, number, scratch, workspace};

/// The head of a recording, as a file of its own.
fn first(seconds: f64, name: &str) -> String {
    let text =
        std::fs::read_to_string(workspace("../shared/data/spidermill-cases/null").join(name))
            .expect("readable");
    let mut lines = text.lines();
    let mut kept = format!("{}\n", lines.next().expect("a header"));
    for line in lines {
        let t: f64 = line
            .split(',')
            .next()
            .and_then(|t| t.parse().ok())
            .expect("a time");
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
        println!(
            "Preparation is not tested: there is no ../shared/data/spidermill-cases beside the workspace."
        );
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
        assert_eq!(
            notes.contains("a Fourier series of period 7.29"),
            series,
            "{notes}"
        );
        for part in ["fit", "check"] {
            let rms = number(&found, &format!("/{part}/rms"));
            println!("{seconds} s, {part}: {rms:.4} N");
            assert!(
                (rms - 1.0).abs() < tolerance,
                "{seconds} s, {part}: {rms} N"
            );
        }
    }
}
