//! `diff --data`: what a variant costs, with the figures of `evaluate` and `compare`.

use serde_json::Value;

use crate::common::{self, json, model, number, printed, refused, run, scratch};

/// The bundled robot with another mass of its platform.
fn heavier(name: &str, mass: &str) -> String {
    let text = std::fs::read_to_string(model("spidermill.toml")).expect("the model");
    assert!(text.contains("12.4560"));
    let path = scratch(name);
    std::fs::write(&path, text.replace("12.4560", mass)).expect("a variant");
    path
}

/// Columns of a CSV by their names, without the time.
fn columns(path: &str) -> Vec<(String, Vec<f64>)> {
    let text = std::fs::read_to_string(path).expect("a file");
    let mut lines = text.lines();
    let names = lines.next().expect("names").split(',').skip(1);
    let rows: Vec<Vec<f64>> = lines
        .map(|line| line.split(',').map(|x| x.parse().expect("a number")).collect())
        .collect();
    let column = |k: usize| rows.iter().map(|row| row[k]).collect();
    names.zip(1..).map(|(name, k)| (name.to_owned(), column(k))).collect()
}

#[track_caller]
fn close(found: f64, expected: f64) {
    assert!(
        (found - expected).abs() <= 1e-9 * expected.abs(),
        "{found} for {expected}"
    );
}

#[test]
fn a_variant_costs_what_its_forces_say() {
    let (before, after) = (model("spidermill.toml"), heavier("heavy.toml", "92.4560"));
    let data = run("plain-check.csv");
    let told = json(&["diff", &before, &after, "--data", &data, "--json"]);
    assert_eq!(told["entries"][0]["name"], "parameter m4");
    let along = &told["along"];
    for (side, path) in [("before", &before), ("after", &after)] {
        let out = scratch("forces.csv");
        printed(&["evaluate", path, "--data", &data, "--out", &out]);
        for ((name, force), told) in columns(&out).iter().zip(along["drives"].as_array().expect("drives")) {
            assert_eq!(told["drive"], name.as_str());
            let peak = force.iter().fold(0.0_f64, |most, f| most.max(f.abs()));
            let mean = force.iter().map(|f| f * f).sum::<f64>() / force.len() as f64;
            close(number(told, &format!("/{side}/peak")), peak);
            close(number(told, &format!("/{side}/rms")), mean.sqrt());
        }
        let compared = json(&["compare", path, "--data", &data, "--json"]);
        let errors = &along["errors"][side];
        for key in ["nrms", "rms", "samples", "channels", "band"] {
            assert_eq!(errors[key], compared[key], "{side} {key}");
        }
    }
    for drive in along["drives"].as_array().expect("drives") {
        let products = drive["products"].as_array().expect("products");
        let names: Vec<&str> = products.iter().filter_map(|one| one["product"].as_str()).collect();
        assert_eq!(names, ["m4"]);
        let terms = products[0]["terms"].as_array().expect("terms");
        let shares: f64 = terms.iter().map(|term| number(term, "/share")).sum();
        close(shares, 1.0);
        assert!(terms.iter().any(|term| term["term"] == "1/2*d3*m4"), "{terms:?}");
    }
    // The limit of 1500 N is the file's; motion is the same for both.
    let crossed = |limit: &str| {
        let mut limits = along["limits"].as_array().expect("limits").iter();
        limits.find(|one| one["limit"] == limit).expect("the limit")["crossing"].clone()
    };
    assert_eq!(crossed("spindle_left"), "now_exceeded");
    assert_eq!(crossed("theta1"), "kept");

    let text = printed(&["diff", &before, &after, "--data", &data]);
    for says in [
        "1/2*d3*m4",
        "spindle_left (-1500.00 to 1500.00) is now exceeded",
        "positive work, J",
        "Error relative to the measured forces",
    ] {
        assert!(text.contains(says), "{says}: {text}");
    }
    // Without recordings there is nothing to move along.
    assert_eq!(json(&["diff", &before, &after, "--json"])["along"], Value::Null);
}

#[test]
fn motions_are_enough() {
    let (before, after) = (model("spidermill.toml"), heavier("motion-heavy.toml", "22.4560"));
    let text = std::fs::read_to_string(run("plain-check.csv")).expect("a recording");
    let kept: Vec<usize> = (text.lines().next().expect("names").split(','))
        .zip(0..)
        .filter(|(name, _)| !name.starts_with("spindle"))
        .map(|(_, k)| k)
        .collect();
    let pick = |line: &str| -> String {
        let fields: Vec<&str> = line.split(',').collect();
        kept.iter().map(|k| fields[*k]).collect::<Vec<_>>().join(",")
    };
    let path = scratch("motion.csv");
    let lines: Vec<String> = text.lines().map(pick).collect();
    std::fs::write(&path, lines.join("\n")).expect("a motion");
    let along = &json(&["diff", &before, &after, "--data", &path, "--json"])["along"];
    assert_eq!(along["errors"]["before"], Value::Null);
    assert!(along["notes"].to_string().contains("neither model is compared with"));
    assert!(number(along, "/drives/0/difference/rms") > 10.0);
    // Both are read as the options say.
    let trimmed = &json(&["diff", &before, &after, "--data", &path, "--trim", "100,50", "--json"])["along"];
    close(number(trimmed, "/samples"), number(along, "/samples") - 150.0);
}

#[test]
fn remarks_on_a_recording_are_told_once() {
    let (before, after) = (model("spidermill.toml"), heavier("once.toml", "22.4560"));
    let data = run("with-rods-check.csv");
    let ran = common::ran(&["diff", &before, &after, "--data", &data]);
    let mut lines: Vec<&str> = ran.err.lines().collect();
    let all = lines.len();
    lines.sort_unstable();
    lines.dedup();
    assert_eq!(lines.len(), all, "{}", ran.err);
}

#[test]
fn what_cannot_be_held_beside_is_refused() {
    let (before, panda) = (model("spidermill.toml"), model("panda.toml"));
    let says = refused(1, &["diff", &before, &panda, "--data", &run("plain-check.csv")]);
    assert!(says.contains("no active coordinates theta1, theta2"), "{says}");
    let says = refused(1, &["diff", &before, &before, "--data", "no-such-run.csv"]);
    assert!(says.contains("no-such-run.csv"), "{says}");
}

#[test]
fn values_of_base_parameters_that_differ_are_listed() {
    let before = model("spidermill.toml");
    // Base parameters are linear in the mass of the platform.
    let [one, two] = [("heavy-values.toml", "92.4560"), ("heavier-values.toml", "172.4560")].map(|(name, mass)| {
        let told = json(&["diff", &before, &heavier(name, mass), "--json"]);
        told["values"].as_array().expect("a list").clone()
    });
    assert!(!one.is_empty() && one.len() == two.len());
    for (one, two) in one.iter().zip(&two) {
        assert_eq!((&one["name"], &one["before"]), (&two["name"], &two["before"]));
        let change = |told: &Value| number(told, "/after") - number(told, "/before");
        close(change(two), 2.0 * change(one));
    }
    let printed = printed(&["diff", &before, &heavier("heavy-values.toml", "92.4560")]);
    assert!(printed.contains("nominal values of p_min"), "{printed}");
    assert_eq!(
        json(&["diff", &before, &before, "--json"])["values"],
        Value::Array(Vec::new())
    );
}
