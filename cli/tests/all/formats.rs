//! The formats that robots write, from the file to the fit; files are those of `identify/tests/fixtures`.

use std::path::Path;

use serde_json::Value;

use crate::common::{json, model, number, printed, ran, refused, run, scratch, workspace};

fn fixture(name: &str) -> String {
    let path = workspace("identify/tests/fixtures").join(name);
    path.to_str().expect("plain text").to_owned()
}

/// How the columns of the two-link arm are called in a file of `form`.
fn maps(form: &str) -> Vec<String> {
    let columns = |q: &str, tau: &str, names: [&str; 2]| {
        let [one, two] = names;
        let pairs = [
            format!("q1={q}{one}"),
            format!("q2={q}{two}"),
            format!("joint1={tau}{one}"),
            format!("joint2={tau}{two}"),
        ];
        pairs.into_iter().flat_map(|pair| ["--map".to_owned(), pair]).collect()
    };
    match form {
        "plain" => columns("q_", "tau_", ["1", "2"]),
        "grouped" => columns("run.q_", "run.tau_", ["1", "2"]),
        topic => columns(
            &format!("{topic}.position."),
            &format!("{topic}.effort."),
            ["elbow", "arm/wrist"],
        ),
    }
}

/// The fit of a file, with the name of the file taken out.
fn fit(file: &str, form: &str) -> String {
    let (two_link, data, out) = (model("two_link.toml"), fixture(file), scratch("fit.json"));
    let maps = maps(form);
    let mut args = vec!["identify", &two_link, "--data", &data, "--out", &out];
    args.extend(maps.iter().map(String::as_str));
    printed(&args);
    std::fs::read_to_string(&out).expect("a fit").replace(&data, "RUN")
}

/// Forces of the fixture are those of no arm, which is all the same to the comparison of bytes.
#[test]
fn every_format_gives_the_same_bytes() {
    let csv = fit("run.csv", "plain");
    assert!(csv.contains("\"parameters\"") && csv.contains("RUN"));
    for (file, form) in [
        ("run.csv.gz", "plain"),
        ("run.csv.zst", "plain"),
        ("run-zstd-v1.parquet", "plain"),
        ("run-brotli-v2.parquet", "plain"),
        ("run-v73.mat", "plain"),
        ("run-zstd.mcap", "joint_states"),
        ("run-lz4.mcap", "joint_states"),
        ("run-v8.db3", "joint_states"),
        ("run-v9-big.db3", "joint_states"),
    ] {
        assert!(fit(file, form) == csv, "{file}");
    }
    // What is left aside of this one is said, and stands in the fit.
    let value = |text: &str| {
        let mut value: Value = serde_json::from_str(text).expect("JSON");
        value["data"].take();
        value
    };
    assert_eq!(value(&fit("run-earliest.h5", "grouped")), value(&csv));
}

/// Columns of logs stand in sums, with units.
#[test]
fn columns_of_topics_can_be_computed_with() {
    let (two_link, data) = (model("two_link.toml"), fixture("run-v8.db3"));
    let maps = maps("joint_states");
    let mut doubled = maps.clone();
    doubled[5] = "joint1=-2*joint_states.effort.elbow".to_owned();
    doubled[7] = "joint2=-0.002*joint_states.effort.arm/wrist [kN m]".to_owned();
    let values = |maps: &[String]| {
        let mut args = vec!["identify", &two_link, "--data", &data, "--json"];
        args.extend(maps.iter().map(String::as_str));
        let found = json(&args);
        let list = found["parameters"].as_array().expect("a list").clone();
        list.iter().map(|p| number(p, "/value")).collect::<Vec<f64>>()
    };
    let (once, twice) = (values(&maps), values(&doubled));
    assert!(!once.is_empty());
    for (one, two) in once.iter().zip(&twice) {
        assert!((two + 2.0 * one).abs() <= 1e-9 * one.abs(), "{one} {two}");
    }
}

#[test]
fn recordings_lists_topics_and_columns() {
    let (log, matlab) = (fixture("run-zstd.mcap"), fixture("run-v73.mat"));
    let listed = json(&["recordings", &log, &matlab, "--json"]);
    let topic = listed.pointer("/recordings/0/tables/0").expect("a topic");
    assert_eq!(topic["name"], "joint_states");
    assert_eq!(topic["type"], "sensor_msgs/msg/JointState");
    assert_eq!(topic["samples"], 60);
    assert!((number(topic, "/rate") - 250.0).abs() < 1e-6);
    assert_eq!(topic["columns"][3]["name"], "joint_states.velocity.arm/wrist");
    let arrays = listed.pointer("/recordings/1/tables/0").expect("a table");
    assert_eq!(arrays["columns"].as_array().expect("a list").len(), 7);
    assert!((number(arrays, "/end") - 0.236).abs() < 1e-12);
    let text = printed(&["recordings", &log]);
    for says in [
        "status (lab_msgs/msg/Status): 12 samples",
        "arrival",
        "status.drives.left.count",
        "uint64",
    ] {
        assert!(text.contains(says), "{says}: {text}");
    }
    let says = refused(1, &["recordings", &model("two_link.toml")]);
    assert!(says.contains("two_link.toml is a model file"), "{says}");
}

/// A recording cut into a file of states and one of forces is the recording.
#[test]
fn files_of_one_run_are_joined() {
    let whole = std::fs::read_to_string(run("plain-check.csv")).expect("a recording");
    let part = |name: &str, keep: &dyn Fn(usize, usize) -> bool| {
        let lines = whole.lines().enumerate().filter(|(i, _)| keep(*i, 0));
        let text: Vec<String> = lines
            .map(|(i, line)| {
                let fields = line.split(',').enumerate();
                let kept: Vec<&str> = fields.filter(|(j, _)| keep(i, j + 1)).map(|(_, f)| f).collect();
                kept.join(",")
            })
            .collect();
        let path = scratch(name);
        std::fs::write(&path, text.join("\n")).expect("written");
        path
    };
    // Columns: t, two coordinates with rates and accelerations, two forces.
    let states = part("states.csv", &|_, j| j < 8);
    let forces = part("forces.csv", &|_, j| !(2..=7).contains(&j));
    let rare = part("rare.csv", &|i, j| (i < 1 || i % 4 == 1) && !(2..=7).contains(&j));
    let spidermill = model("spidermill.toml");
    let errors = |data: &str| {
        let found = json(&["compare", &spidermill, "--data", data, "--json"]);
        (
            number(&found, "/samples"),
            number(&found, "/channels/spindle_left/nrms"),
            found,
        )
    };
    let (n, error, _) = errors(&run("plain-check.csv"));
    let (joined_n, joined_error, _) = errors(&format!("{states}+{forces}"));
    assert!(
        (joined_n - n).abs() < 0.5 && (joined_error - error).abs() < 1e-15,
        "{joined_n} {joined_error}"
    );
    let (rare_n, rare_error, found) = errors(&format!("{states}+{rare}"));
    assert!((rare_n - n / 4.0).abs() <= 1.0, "{rare_n} of {n}");
    assert!(rare_error < 1e-5, "{rare_error}");
    assert!(
        found["data"].to_string().contains("interpolated linearly to them"),
        "{found}"
    );
    let says = refused(
        1,
        &[
            "compare",
            &spidermill,
            "--data",
            &format!("{states}+{}", run("plain-check.csv")),
        ],
    );
    assert!(says.contains("`theta1`") && says.contains("states.csv too"), "{says}");
}

/// A fit in the model file is the fit beside it; a later one takes its place, and one of physical parameters is told by them.
#[test]
fn fits_travel() {
    let spidermill = model("spidermill.toml");
    let (data, other) = (run("with-rods-fit.csv"), run("with-rods-check.csv"));
    let (fit, physical) = (scratch("travels.json"), scratch("physical.json"));
    printed(&["identify", &spidermill, "--data", &data, "--out", &fit]);
    printed(&[
        "identify",
        &spidermill,
        "--data",
        &data,
        "--physical",
        "--out",
        &physical,
    ]);
    let error = |args: &[&str]| {
        let mut all = vec!["compare", "--data", &other, "--json"];
        all.extend(args);
        number(&json(&all), "/channels/spindle_left/nrms")
    };
    let adopted = scratch("adopted.toml");
    let says = printed(&["adopt", &spidermill, &fit, "--out", &adopted]);
    assert!(says.contains("+[identified]"), "{says}");
    let beside = error(&[&spidermill, "--parameters", &fit]);
    let within = error(&[&adopted]);
    assert_eq!(beside.to_bits(), within.to_bits());
    assert!(within < 0.5 * error(&[&spidermill]), "{within}");
    printed(&["adopt", &adopted, &physical, "--in-place"]);
    let text = std::fs::read_to_string(&adopted).expect("a model");
    assert_eq!(text.matches("[identified]").count(), 1);
    assert!(
        text.contains("parameters = { m1 = ") && !text.contains("base = ["),
        "{text}"
    );
    let (beside, within) = (error(&[&spidermill, "--parameters", &physical]), error(&[&adopted]));
    assert!((beside - within).abs() < 1e-9 * beside, "{beside} {within}");
    // What is held is the fit.
    let held = |args: &[&str]| {
        let mut all = vec!["diagnose", &spidermill, "--data", &data, "--held", "--json"];
        all.extend(args);
        number(&json(&all), "/steps/0/fit")
    };
    let (nominal, fitted) = (held(&[]), held(&["--parameters", &fit]));
    assert!(fitted < 0.5 * nominal, "{fitted} {nominal}");
    // A fit of another model is none.
    let says = refused(1, &["adopt", &model("two_link.toml"), &fit]);
    assert!(says.contains("belongs to another model"), "{says}");
    let unknown = ran(&["adopt", &adopted, Path::new(&adopted).to_str().expect("text")]);
    assert_eq!(unknown.status, 1, "{}", unknown.err);
}

/// A column in motor amperes is the joint's torque by the constants of the drive.
#[test]
fn columns_of_motors_are_declared() {
    let (data, two_link) = (fixture("run.csv"), model("two_link.toml"));
    let declared = scratch("motors.toml");
    let text = std::fs::read_to_string(&two_link).expect("a model");
    let says = "\n[recording.torque]\njoint1 = { ratio = -100, constant = 0.05 }\njoint2 = { ratio = -5 }\n";
    std::fs::write(&declared, text + says).expect("written");
    let maps = maps("plain");
    let values = |model: &str| {
        let mut args = vec!["identify", model, "--data", &data, "--json"];
        args.extend(maps.iter().map(String::as_str));
        let found = json(&args);
        let list = found["parameters"].as_array().expect("a list").clone();
        list.iter().map(|p| number(p, "/value")).collect::<Vec<f64>>()
    };
    for (plain, scaled) in values(&two_link).iter().zip(values(&declared)) {
        assert!((scaled + 5.0 * plain).abs() <= 1e-9 * plain.abs(), "{plain} {scaled}");
    }
    for (entry, word) in [
        ("joint1 = { ratio = 0 }", "zero"),
        ("joint1 = {}", "is empty"),
        ("q1 = { ratio = 2 }", "unknown drive"),
    ] {
        let text = std::fs::read_to_string(&two_link).expect("a model");
        std::fs::write(&declared, format!("{text}\n[recording.torque]\n{entry}\n")).expect("written");
        let says = refused(1, &["check", &declared]);
        assert!(says.contains(word), "{says}");
    }
}
