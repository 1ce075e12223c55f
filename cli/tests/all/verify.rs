//! A model is tested against recordings: the right one passes, a wrong one fails with its cause, and what cannot be decided
//! is not evaluated.

use std::fs;

use serde_json::{Value, json as value};

use crate::common::{json, model, number, printed, ran, refused, run, scratch};

/// The JSON of a verification that does not pass.
#[track_caller]
fn failed(args: &[&str]) -> Value {
    let ran = ran(args);
    assert_eq!(ran.status, 1, "{args:?}: {}{}", ran.out, ran.err);
    serde_json::from_str(&ran.out).unwrap_or_else(|error| panic!("{error}: {}{}", ran.out, ran.err))
}

/// The checks of a scope.
fn checks<'a>(object: &'a Value, scope: &str) -> Vec<&'a Value> {
    let all = object["checks"].as_array().expect("a list of checks");
    all.iter().filter(|one| one["scope"] == scope).collect()
}

/// A copy of the bundled model with other text in it.
fn changed_model(name: &str, from: &str, to: &str) -> String {
    let text = fs::read_to_string(model("spidermill.toml")).expect("a model");
    assert!(text.contains(from), "{from}");
    let file = scratch(name);
    fs::write(&file, text.replace(from, to)).expect("written");
    file
}

/// A copy of a bundled recording whose column is multiplied by a factor.
fn scaled_recording(name: &str, column: &str, factor: f64) -> String {
    let text = fs::read_to_string(run("plain-check.csv")).expect("a recording");
    let mut lines = text.lines();
    let head = lines.next().expect("a header");
    let at = head.split(',').position(|one| one == column).expect("the column");
    let mut out = format!("{head}\n");
    for line in lines {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        let number: f64 = cells[at].parse().expect("a number");
        cells[at] = (factor * number).to_string();
        out.push_str(&cells.join(","));
        out.push('\n');
    }
    let file = scratch(name);
    fs::write(&file, out).expect("written");
    file
}

#[test]
fn the_right_model_passes() {
    let args = ["verify", &model("spidermill.toml"), "--data", &run("plain-check.csv")];
    let text = printed(&args);
    assert!(text.starts_with("spidermill with nominal parameters passes"), "{text}");
    assert!(text.contains("Default limits were used"), "{text}");
    let object = json(&[&args[..], &["--json"]].concat());
    assert_eq!(object["schema"], "modelmill.verify/1");
    assert_eq!(object["state"], "pass");
    assert_eq!(object["counts"], value!({"pass": 8, "fail": 0, "not_evaluated": 0}));
    assert_eq!(object["diagnosis"]["verdict"], "adequate");
    for scope in ["recording", "drive", "parameter", "effect"] {
        assert!(!checks(&object, scope).is_empty(), "{scope}");
    }
}

#[test]
fn hashes_follow_the_contents() {
    let hashes = |data: &str, model: &str| -> Vec<String> {
        let ran = ran(&["verify", model, "--data", data, "--json"]);
        let object: Value = serde_json::from_str(&ran.out).expect("one JSON object");
        let program = object["program"]["sha256"].as_str().expect("a hash").to_owned();
        let inputs = object["inputs"].as_array().expect("a list").iter();
        let of = |one: &Value| one["sha256"].as_str().expect("a hash").to_owned();
        inputs.map(of).chain([program]).collect()
    };
    let first = hashes(&run("plain-check.csv"), &model("spidermill.toml"));
    assert!(
        first
            .iter()
            .all(|hash| hash.len() == 64 && hash.chars().all(|c| c.is_ascii_hexdigit()))
    );
    assert_eq!(first, hashes(&run("plain-check.csv"), &model("spidermill.toml")));
    let other = hashes(
        &scaled_recording("other.csv", "spindle_left", 1.000_001),
        &model("spidermill.toml"),
    );
    assert_eq!((&first[0], &first[2]), (&other[0], &other[2]));
    assert_ne!(first[1], other[1]);
}

#[test]
fn a_turned_sign_fails_with_its_cause() {
    let turned = changed_model("turned.toml", "gravity = [0, \"-g\", 0]", "gravity = [0, \"g\", 0]");
    let object = failed(&["verify", &turned, "--data", &run("plain-check.csv"), "--json"]);
    assert_eq!(object["state"], "fail");
    for one in checks(&object, "drive") {
        assert_eq!(one["state"], "fail", "{one}");
        let cause = one["cause"].as_str().expect("a cause");
        assert!(cause.contains("gravity points along -y"), "{cause}");
    }
    let negative = scaled_recording("negative.csv", "spindle_left", -1.0);
    let object = failed(&["verify", &model("spidermill.toml"), "--data", &negative, "--json"]);
    for one in checks(&object, "drive") {
        let is_turned = one["at"] == "spindle_left";
        assert_eq!(one["state"], if is_turned { "fail" } else { "pass" }, "{one}");
        if is_turned {
            let cause = one["cause"].as_str().expect("a cause");
            assert!(cause.contains("spindle_left has the wrong sign"), "{cause}");
            assert!(
                cause.contains("or the model counts it in the other direction"),
                "{cause}"
            );
        }
    }
}

#[test]
fn a_missing_effect_is_the_cause_unless_it_is_accepted() {
    let data = run("with-rods-check.csv");
    let args = ["verify", &model("spidermill.toml"), "--data", &data, "--json"];
    let object = failed(&args);
    let effects = checks(&object, "effect");
    assert!(
        effects
            .iter()
            .all(|one| one["state"] == "fail" && number(one, "/value") > 0.5)
    );
    assert!(
        effects
            .iter()
            .any(|one| one["at"].as_str().is_some_and(|at| at.contains("rod inertia")))
    );
    let limits = scratch("accepted.toml");
    fs::write(&limits, "[effects]\naccepted = [\"rod_inertia\"]\n").expect("written");
    let object = json(&[&args[..], &["--limits", &limits]].concat());
    let effects = checks(&object, "effect");
    assert_eq!(effects.len(), 1);
    assert_eq!(effects[0]["state"], "pass");
    assert!(
        effects[0]["says"]
            .as_str()
            .is_some_and(|says| says.contains("accepted: rod inertia"))
    );
}

/// The base parameter whose expression contains the inertia fails, and no other.
#[test]
fn a_wrong_inertia_fails_where_it_enters() {
    let heavy = changed_model("heavy.toml", "Ic12 = { nominal = 6.3195", "Ic12 = { nominal = 26.0");
    let object = failed(&["verify", &heavy, "--data", &run("plain-check.csv"), "--json"]);
    for one in checks(&object, "parameter") {
        let has_it = one["says"].as_str().is_some_and(|says| says.contains("Ic12"));
        assert_eq!(one["state"], if has_it { "fail" } else { "pass" }, "{one}");
    }
    for one in checks(&object, "drive").iter().filter(|one| one["state"] == "fail") {
        let cause = one["cause"].as_str().expect("a cause");
        assert!(cause.contains("parameters of the machine differ"), "{cause}");
    }
}

#[test]
fn limits_of_the_user_decide() {
    let limits = scratch("verify.toml");
    let verify = |text: &str| {
        fs::write(&limits, text).expect("written");
        let ran = ran(&[
            "verify",
            &model("spidermill.toml"),
            "--data",
            &run("plain-check.csv"),
            "--limits",
            &limits,
            "--json",
        ]);
        (
            ran.status,
            serde_json::from_str::<Value>(&ran.out).unwrap_or_default(),
            ran.err,
        )
    };
    // The error is 2e-4 N, or 7e-5 %.
    let (status, object, _) = verify("[drives.spindle_left]\nerror = 0.001\nerror_percent = 0.001\n");
    assert_eq!(status, 0);
    assert_eq!(checks(&object, "drive").len(), 3);
    let (status, object, _) = verify("[all_drives]\nerror = 1e-5\n");
    assert_eq!(status, 1);
    assert!(
        checks(&object, "drive")
            .iter()
            .all(|one| one["state"] == "fail" && one["unit"] == "N")
    );
    // p1_min is 61.29 kg m.
    let (status, object, _) = verify("[parameters]\np1_min = [61, 62]\n");
    assert_eq!((status, &object["checks"][3]["state"]), (0, &value!("pass")));
    let (status, object, _) = verify("[parameters]\np1_min = [61.3, 62]\n");
    assert_eq!((status, &object["checks"][3]["state"]), (1, &value!("fail")));
    // The recording does not determine it that well.
    let (status, object, _) = verify("[parameters]\np1_min = [61.2900, 61.2900000001]\n");
    assert_eq!(status, 1, "{object:#}");
    // What is wrong in the file is stated with its line.
    for (text, line, says) in [
        ("[drives.left]\nerror = 1\n", 1, "spindle_left, spindle_right"),
        ("\n[all_drives]\nerror = -1\n", 3, "above 0"),
        ("[parameters]\nm1 = [1, 2]\n", 2, "p1_min"),
        ("[parameters]\np1_min = [2, 1]\n", 2, "interval"),
        ("[effects]\nmost_probability = 2\n", 2, "0 to 1"),
        ("[limit]\n", 1, "[all_drives]"),
        ("drives = 3\n", 1, "table"),
        ("a = \n", 1, "TOML"),
    ] {
        let (status, _, err) = verify(text);
        assert_eq!(status, 2, "{text}: {err}");
        assert!(
            err.contains(&format!("line {line}:")) && err.contains(says),
            "{text}: {err}"
        );
    }
}

#[test]
fn a_parser_reads_the_junit_file() {
    let odd = changed_model(
        "odd & <model>.toml",
        "gravity = [0, \"-g\", 0]",
        "gravity = [0, \"g\", 0]",
    );
    let file = scratch("verify.xml");
    let object = failed(&[
        "verify",
        &odd,
        "--data",
        &run("plain-check.csv"),
        "--junit",
        &file,
        "--json",
    ]);
    let text = fs::read_to_string(&file).expect("the file is written");
    let document = roxmltree::Document::parse(&text).expect("XML");
    let root = document.root_element();
    assert_eq!(root.attribute("name"), Some("odd & <model>"));
    let count = |node: roxmltree::Node<'_, '_>, tag: &str| node.descendants().filter(|n| n.has_tag_name(tag)).count();
    for suite in root
        .descendants()
        .filter(|n| n.has_tag_name("testsuite") || n.has_tag_name("testsuites"))
    {
        for (attribute, tag) in [("tests", "testcase"), ("failures", "failure"), ("skipped", "skipped")] {
            let said: usize = suite.attribute(attribute).expect(attribute).parse().expect("a number");
            assert_eq!(said, count(suite, tag), "{attribute}");
        }
    }
    let failures = object["counts"]["fail"].as_u64().expect("a number");
    assert_eq!(u64::try_from(count(root, "failure")).expect("a count"), failures);
    let mut names: Vec<(Option<&str>, Option<&str>)> = root
        .descendants()
        .filter(|n| n.has_tag_name("testcase"))
        .map(|n| (n.attribute("classname"), n.attribute("name")))
        .collect();
    let all = names.len();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), all, "names of test cases differ");
    let mut failure = root.descendants().filter(|n| n.has_tag_name("failure"));
    let first = failure.next().and_then(|n| n.text()).expect("a cause");
    assert!(first.starts_with("Cause: gravity points along -y"), "{first}");
}

/// A recording without forces decides nothing, so that nothing passes.
#[test]
fn what_cannot_be_evaluated_does_not_pass() {
    let text = fs::read_to_string(run("plain-check.csv")).expect("a recording");
    let short: Vec<&str> = text.lines().take(40).collect();
    let file = scratch("short.csv");
    fs::write(&file, short.join("\n") + "\n").expect("written");
    let limits = scratch("strict.toml");
    fs::write(&limits, "[parameters]\np1_min = [61, 62]\n").expect("written");
    let object = failed(&[
        "verify",
        &model("spidermill.toml"),
        "--data",
        &file,
        "--limits",
        &limits,
        "--json",
    ]);
    assert_eq!(object["state"], "not_evaluated");
    assert!(
        checks(&object, "parameter")
            .iter()
            .all(|one| one["state"] == "not_evaluated")
    );
    let says = refused(
        2,
        &["verify", &model("spidermill.toml"), "--data", &file, "--junit", &file],
    );
    assert!(says.contains("--junit") && says.contains("overwrite"), "{says}");
}
