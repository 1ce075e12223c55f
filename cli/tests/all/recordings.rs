//! Recordings that are short, at rest, or come from a pipe, and options that do nothing: what is said of them.

use std::fmt::Write as _;
use std::io::Write as _;
use std::process::{Command, Stdio};

use crate::common::{modelmill, ran, refused, scratch};
use serde_json::Value;

/// A pendulum with viscous friction: three base parameters.
const PENDULUM: &str = r#"
schema = 1
name = "pendulum"
gravity = [0, "-g", 0]
constants = { g = { value = 9.81, unit = "m/s^2" } }
coordinates = { q = {} }
frame = [{ name = "arm", on = "base", modified_dh = { theta = "q" } }]
part = [{ on = "arm", linear = { planar = "1" } }]
drive = [{ name = "motor", joint = "q" }]
effect = [{ kind = "viscous_friction", at = ["motor"] }]
"#;

const HEAD: &str = "t,q,q_d,q_dd,motor\n";

fn model(name: &str) -> String {
    let path = scratch(name);
    std::fs::write(&path, PENDULUM).expect("written");
    path
}

/// A swing with all derivatives; `force` adds to what the pendulum takes.
fn swing(samples: u32, force: impl Fn(f64) -> f64) -> String {
    let mut text = HEAD.to_owned();
    for i in 0..samples {
        let t = 0.01 * f64::from(i);
        let (q, v, a) = ((2.0 * t).sin(), 2.0 * (2.0 * t).cos(), -4.0 * (2.0 * t).sin());
        let tau = 0.5 * a + 3.0 * 9.81 * q.cos() + 0.2 * v + force(t);
        writeln!(text, "{t},{q},{v},{a},{tau}").expect("a text grows");
    }
    text
}

fn written(name: &str, text: &str) -> String {
    let path = scratch(name);
    std::fs::write(&path, text).expect("written");
    path
}

#[test]
fn few_samples_promise_no_more_than_the_classical_deviation() {
    let model = model("few.toml");
    // A disturbance that is no column of the model.
    let data = written("few.csv", &swing(7, |t| (90.0 * t).sin()));
    let ran = ran(&["identify", &model, "--data", &data, "--json"]);
    assert_eq!(ran.status, 0, "{}", ran.err);
    assert!(
        ran.err
            .contains("There are only 7 equations for 4 unknown base parameters"),
        "{}",
        ran.err
    );
    let fit: Value = serde_json::from_str(&ran.out).expect("JSON");
    for p in fit["parameters"].as_array().expect("a list") {
        let (std, classical) = (p["std"].as_f64(), p["classical_std"].as_f64());
        let (std, classical) = (std.expect("a number"), classical.expect("a number"));
        assert!(std >= classical * (1.0 - 1e-12), "{p}");
        assert!(classical > 0.0, "{p}");
    }
}

#[cfg(unix)]
#[test]
fn a_recording_may_come_from_a_pipe() {
    let model = model("pipe.toml");
    let text = swing(400, |_| 0.0);
    let data = written("pipe.csv", &text);
    let from_file = ran(&["identify", &model, "--data", &data, "--json"]);
    let mut command: Command = modelmill(&["identify", &model, "--data", "/dev/stdin", "--json"]);
    let mut child = command
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let mut stdin = child.stdin.take().expect("standard input");
    stdin.write_all(text.as_bytes()).expect("written");
    drop(stdin);
    let output = child.wait_with_output().expect("an end");
    let says = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{says}");
    let piped: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let filed: Value = serde_json::from_str(&from_file.out).expect("JSON");
    assert_eq!(piped["parameters"], filed["parameters"]);
    assert_eq!(piped["samples"], 400);
}

#[test]
fn options_that_do_nothing_are_named() {
    let model = model("idle.toml");
    let data = written("idle.csv", &swing(400, |_| 0.0));
    let all = ["identify", &model, "--data", &data];
    let with = |more: &[&str]| ran(&[&all[..], more].concat());
    let says = with(&["--order", "2", "--cutoff", "20"]).err;
    assert!(says.contains("`--cutoff` and `--order` do nothing to"), "{says}");
    assert!(with(&["--order", "2"]).err.contains("`--order` does nothing to"));
    let says = with(&["--order", "2", "--derivatives", "positions"]).err;
    assert!(!says.contains("nothing to"), "{says}");
    assert!(!with(&[]).err.contains("nothing to"));
    let says = with(&["--trim", "10"]).err;
    assert!(says.contains("as requested by `--trim`"), "{says}");
}

#[test]
fn what_cannot_be_done_names_the_option() {
    let model = model("option.toml");
    let data = written("option.csv", &swing(400, |_| 0.0));
    let all = ["identify", &model, "--data", &data];
    let says = refused(1, &[&all[..], &["--trim", "5000"]].concat());
    assert!(says.contains("`--trim`") && !says.contains("transients"), "{says}");
    let low = ["--derivatives", "positions", "--cutoff", "1e-9"];
    let says = refused(1, &[&all[..], &low].concat());
    assert!(says.contains("too low for a recording of 4.0000 s"), "{says}");
    let says = refused(2, &[&all[..], &["--cutoff", "-3"]].concat());
    assert!(says.contains("expected a frequency above 0 in Hz"), "{says}");
    let bad = written("bad-field.csv", &swing(400, |_| 0.0));
    let text = std::fs::read_to_string(&bad).expect("read");
    let mut lines: Vec<&str> = text.lines().collect();
    lines[5] = "0.04,nan,1,1,1";
    std::fs::write(&bad, lines.join("\n")).expect("written");
    let says = refused(1, &["identify", &model, "--data", &bad]);
    assert!(says.contains("--skip-bad-samples") && says.contains("line 6"), "{says}");
    // Comment lines are skipped, and lines count as in the file.
    let commented = written("comment.csv", &format!("# made by x\n{}", lines.join("\n")));
    let says = refused(1, &["identify", &model, "--data", &commented]);
    assert!(says.contains("line 7") && says.contains("--skip-bad-samples"), "{says}");
}

#[test]
fn forces_that_are_zero_throughout_are_refused() {
    let model = model("zero.toml");
    let mut text = HEAD.to_owned();
    for line in swing(400, |_| 0.0).lines().skip(1) {
        let (states, _) = line.rsplit_once(',').expect("columns");
        writeln!(text, "{states},0").expect("a text grows");
    }
    let data = written("zero.csv", &text);
    let says = refused(1, &["identify", &model, "--data", &data]);
    assert!(
        says.contains("measured force of `motor`")
            && says.contains("error: ")
            && says.contains("the measured forces are zero throughout"),
        "{says}"
    );
    assert_eq!(says.matches("throughout").count(), 1, "{says}");
    assert_eq!(says.matches("is 0 in every sample").count(), 1, "{says}");
}

/// A share of a nominal value is its uncertainty; where all are 0 there is none, although the file gives them.
#[test]
fn nominal_values_of_zero_are_no_prior() {
    let given = PENDULUM.replace(
        "planar = \"1\" }",
        "planar = \"1\", nominal = { ZZ = 0, MX = 0, MY = 0 } }",
    );
    assert_ne!(given, PENDULUM);
    let model = written("zero-nominal.toml", &given);
    let data = written("zero-nominal.csv", &swing(400, |t| 0.1 * (40.0 * t).sin()));
    let says = refused(1, &["identify", &model, "--data", &data, "--prior", "0.2"]);
    assert!(
        says.contains("are 0 or not given") && !says.contains("gives none"),
        "{says}"
    );
    // Where some have one, the others are counted.
    let some = written("some-nominal.toml", &given.replace("MX = 0,", "MX = 2.5,"));
    let ran = ran(&["identify", &some, "--data", &data, "--prior", "0.2"]);
    assert!(
        ran.out
            .contains("nominal values of 1 base parameter are used as soft constraints")
            && ran
                .out
                .contains("have none, since their nominal values are 0 or not given"),
        "{}{}",
        ran.out,
        ran.err
    );
}

/// A file that cannot be read stops no other: the rest is printed, and the exit status states that something failed.
#[test]
fn a_file_that_cannot_be_read_stops_no_other() {
    let good = written("readable.csv", &swing(100, |_| 0.0));
    let missing = [scratch("not-there-1.csv"), scratch("not-there-2.csv")];
    let both = ran(&["recordings", &missing[0], &good]);
    assert_eq!(both.status, 1, "{}", both.err);
    assert!(
        both.out.contains("q_dd") && both.err.contains("not-there-1.csv"),
        "{} {}",
        both.out,
        both.err
    );
    let all = ran(&["recordings", &missing[0], &good, &missing[1], "--json"]);
    assert_eq!(all.status, 1);
    let object: Value = serde_json::from_str(&all.out).expect("JSON");
    assert_eq!(object["recordings"].as_array().map(Vec::len), Some(1), "{object:#}");
    assert_eq!(object["unread"].as_array().map(Vec::len), Some(2), "{object:#}");
    assert!(all.err.contains("2 of 3 recordings cannot be read"), "{}", all.err);
}
