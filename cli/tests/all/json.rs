//! The JSON of every command has the shape that scripts rely on.

use crate::common::{json, model, number, printed, run, scratch};
use serde_json::{Value, json as value};

#[track_caller]
fn keys(object: &Value) -> Vec<&str> {
    let map = object.as_object().expect("an object");
    map.keys().map(String::as_str).collect()
}

#[test]
fn check_summarises_the_model() {
    let summary = json(&["check", &model("spidermill-paper.toml"), "--json"]);
    assert_eq!(summary["model"], "spidermill-paper");
    assert_eq!(summary["valid"], true);
    assert_eq!(summary["bodies"], 4);
    assert_eq!(
        summary["joints"],
        value!({ "active": ["theta1", "theta2"], "passive": ["gamma1", "gamma2"] })
    );
    assert_eq!(summary["actuators"], value!(["spindle_left", "spindle_right"]));
    assert_eq!(summary["degrees_of_freedom"], 2);
    assert_eq!(summary["parameters"].as_array().map(Vec::len), Some(8));
    let text = printed(&["check", &model("spidermill-paper.toml")]);
    assert!(
        text.contains("11 products of parameters with an effect on the drives, 5 base parameters"),
        "{text}"
    );
}

#[test]
fn equations_are_those_of_the_paper() {
    let equations = json(&["equations", &model("spidermill-paper.toml"), "--format", "json"]);
    assert_eq!(
        keys(&equations),
        [
            "model",
            "parameters",
            "without_effect",
            "dependencies",
            "base",
            "rank",
            "operations"
        ]
    );
    assert_eq!(equations["model"], "spidermill-paper");
    assert_eq!(
        equations["parameters"],
        value!([
            "m1*dc1", "m1*dc1^2", "m2", "m3", "m3*dc3", "m3*dc3^2", "m4", "m4*dc3", "m4*dc3^2", "Ic12", "Ic32"
        ])
    );
    assert_eq!(equations["without_effect"], value!(["m1"]));
    assert_eq!(
        equations["dependencies"][0],
        value!({ "parameter": "m2", "equals": { "m1*dc1": "d1", "m1*dc1^2": "d1^2" } })
    );
    assert_eq!(keys(&equations["base"][0]), ["name", "retained", "expression"]);
    assert_eq!(equations["rank"], value!({ "exact": 5, "numeric": 5, "samples": 40 }));
    for program in ["regressor", "inverse_dynamics"] {
        for operation in ["add", "mul", "div", "sqrt", "sincos"] {
            assert!(equations["operations"][program][operation].is_u64());
        }
    }
    assert_eq!(
        equations,
        json(&["equations", &model("spidermill-paper.toml"), "--json"])
    );
}

#[test]
fn every_bundled_model_has_equal_ranks_and_pages_in_all_formats() {
    for name in ["spidermill", "two_link", "four_bar", "three_rrr", "scara", "emps"] {
        let file = model(&format!("{name}.toml"));
        let equations = json(&["equations", &file, "--json"]);
        assert_eq!(equations["rank"]["exact"], equations["rank"]["numeric"], "{name}");
        assert_eq!(
            equations["base"].as_array().map(Vec::len),
            equations["rank"]["exact"]
                .as_u64()
                .map(|n| usize::try_from(n).expect("small"))
        );
        for (format, mark) in [
            ("text", "p1_min"),
            ("markdown", "# "),
            ("latex", "\\documentclass"),
            ("html", "<math"),
        ] {
            let page = printed(&["equations", &file, "--format", format]);
            assert!(page.contains(mark), "{name} as {format}");
        }
    }
    let out = scratch("scara.html");
    assert_eq!(
        printed(&["equations", &model("scara.toml"), "--format", "html", "--out", &out]),
        ""
    );
    let page = std::fs::read_to_string(out).expect("the page");
    assert!(page.starts_with("<!DOCTYPE html>") && !page.contains("<script src"));
}

#[test]
fn diff_says_what_the_papers_treatment_changes() {
    let diff = json(&[
        "diff",
        &model("spidermill.toml"),
        &model("spidermill-paper.toml"),
        "--json",
    ]);
    assert_eq!(diff["before"]["base"].as_array().map(Vec::len), Some(4));
    assert_eq!(diff["after"]["base"].as_array().map(Vec::len), Some(5));
    let names = |key: &str| -> Vec<String> {
        let list = diff[key].as_array().expect("a list");
        list.iter()
            .filter_map(|c| c["name"].as_str().map(str::to_owned))
            .collect()
    };
    assert_eq!(names("entries"), ["lumped mass on S3", "lumped mass on S5", "retain"]);
    assert_eq!(names("parameters"), ["m4*dc3", "m4*dc3^2"]);
    assert!(names("dependencies").contains(&"h[m4*dc3]".to_owned()));
    assert_eq!(names("base").len(), 6);
    assert!(diff["operations"]["inverse_dynamics"]["after"]["mul"].is_u64());
    let same = json(&["diff", &model("scara.toml"), &model("scara.toml"), "--json"]);
    for key in ["entries", "parameters", "dependencies", "base"] {
        assert_eq!(same[key], value!([]));
    }
    let text = printed(&["diff", &model("spidermill.toml"), &model("spidermill-paper.toml")]);
    assert!(
        text.contains("9 -> 11 products") && text.contains("+ m4: m4 - m4*dc3/d3"),
        "{text}"
    );
}

#[test]
fn identify_and_compare_give_figures_by_channel() {
    let fit = json(&[
        "identify",
        &model("spidermill.toml"),
        "--data",
        &run("with-rods-fit.csv"),
        "--data",
        &run("with-rods-check.csv"),
        "--json",
    ]);
    assert_eq!(fit["model"], "spidermill");
    assert_eq!(fit["samples"], 7190);
    assert_eq!(fit["check"], Value::Null);
    let parameter = &fit["parameters"][0];
    for key in ["name", "expression", "value", "std", "unit", "nominal"] {
        assert!(!parameter[key].is_null(), "{key} in {parameter}");
    }
    assert_eq!(parameter["unit"], "kg m");
    let compared = json(&[
        "compare",
        &model("spidermill.toml"),
        "--data",
        &run("with-rods-check.csv"),
        "--json",
    ]);
    for figures in [&fit["fit"], &compared] {
        assert!(number(figures, "/nrms") > 0.0);
        for channel in ["spindle_left", "spindle_right"] {
            for figure in ["nrms", "mean_relative", "max_abs"] {
                assert!(number(figures, &format!("/channels/{channel}/{figure}")) > 0.0);
            }
        }
    }
    assert_eq!(compared["parameters"], "nominal");
    let regions = compared["where"].as_array().expect("regions");
    assert!(!regions.is_empty());
    for region in regions {
        for key in ["channel", "in", "says"] {
            assert!(region[key].is_string(), "{region}");
        }
        // Ranges have their unit; that of a coordinate differs from that of a drive's force.
        let unit = match region["in"].as_str().expect("a variable") {
            "t" => "s",
            "spindle_left" | "spindle_right" => "N",
            "theta1" | "theta2" | "gamma1" | "gamma2" => "rad",
            "spindle_left_length" | "spindle_right_length" => "m",
            "spindle_left_d" | "spindle_right_d" => "m/s",
            rate if rate.ends_with("_dd") => "rad/s^2",
            _ => "rad/s",
        };
        let says = region["says"].as_str().expect("a sentence");
        let before_share = says.rsplit_once(" (").expect("a share of the samples").0;
        assert!(
            before_share
                .trim_end_matches(", around zero")
                .ends_with(&format!(" {unit}")),
            "{says}"
        );
        assert!(number(region, "/range/0") < number(region, "/range/1"));
        assert!((0.0..=1.0).contains(&number(region, "/share")));
    }
    assert!(compared["by_rate"].is_array(), "{compared}");
}

#[test]
fn generate_prints_rust_and_completions_name_the_commands() {
    let source = printed(&["generate", &model("two_link.toml")]);
    assert!(
        source.contains("p1_min") && source.contains("pub fn"),
        "{}",
        &source[..400]
    );
    assert!(!source.contains("pub fn mass_matrix"), "made on demand");
    let with_dynamics = printed(&["generate", &model("two_link.toml"), "--dynamics"]);
    assert!(with_dynamics.contains("pub fn mass_matrix"));
    let both = ["--reactions", "--self-test"];
    let asked = printed(&["generate", &model("two_link.toml"), both[0], both[1]]);
    assert!(asked.contains("pub fn transmitted") && asked.contains("pub fn self_test"));
    let out = scratch("two_link.rs");
    printed(&["generate", &model("two_link.toml"), "--out", &out]);
    assert_eq!(std::fs::read_to_string(out).expect("the source"), source);
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = printed(&["completions", shell]);
        assert!(script.contains("identify") && script.contains("tour"), "{shell}");
    }
}

/// A run held against itself has not changed; the deviations are those of one run.
#[test]
fn runs_says_what_changed() {
    let recording = run("plain-fit.csv");
    let found = json(&[
        "runs",
        &model("spidermill.toml"),
        "--data",
        &recording,
        "--data",
        &recording,
        "--json",
    ]);
    assert_eq!(
        keys(&found),
        [
            "model",
            "together",
            "runs",
            "moved",
            "changes",
            "change_points",
            "unread",
            "per_run"
        ]
    );
    let [first, second] = &found["runs"].as_array().expect("runs")[..] else {
        panic!("{found:#}");
    };
    assert_eq!(
        keys(second),
        ["file", "samples", "parameters", "verdict", "undecided", "says"]
    );
    assert_eq!(
        (&first["verdict"], &second["verdict"]),
        (&value!(null), &value!("unchanged"))
    );
    assert_eq!(first["parameters"], second["parameters"]);
    assert_eq!(
        keys(&second["parameters"][0]),
        ["name", "expression", "value", "std", "unit"]
    );
    assert_eq!((&found["moved"], &found["changes"]), (&value!([]), &value!([])));
    let other = json(&[
        "runs",
        &model("spidermill.toml"),
        "--data",
        &recording,
        &run("with-rods-fit.csv"),
        "--json",
    ]);
    let moved = &other["moved"][0];
    assert!(number(moved, "/sigmas") > 4.0, "{moved}");
    let change = &other["changes"][0];
    assert_eq!(
        keys(change),
        [
            "kind",
            "at",
            "estimates",
            "between",
            "interval",
            "gain",
            "indistinguishable_from",
            "says"
        ]
    );
    assert_eq!(change["between"], value!([0, 1]));
    let text = printed(&["runs", &model("spidermill.toml"), "--data", &recording, &recording]);
    assert!(text.contains("No change found"), "{text}");
}

/// The JSON Schema of a command's answer.
fn answer_schema(command: &str) -> jsonschema::Validator {
    let file =
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../modelmill/schema/{command}.schema.json"));
    let text = std::fs::read_to_string(file).expect("the schema is there");
    let schema: Value = serde_json::from_str(&text).expect("the schema is JSON");
    jsonschema::validator_for(&schema).expect("a valid schema")
}

/// Fails with the places where an answer differs from its schema.
#[track_caller]
fn assert_fits(schema: &jsonschema::Validator, answer: &Value) {
    let faults: Vec<String> = schema
        .iter_errors(answer)
        .map(|fault| format!("{}: {fault}", fault.instance_path()))
        .collect();
    assert!(faults.is_empty(), "{faults:#?}");
}

#[test]
fn answers_fit_their_schemas() {
    let diagnose = answer_schema("diagnose");
    let (fit, check) = (run("with-rods-fit.csv"), run("with-rods-check.csv"));
    let [paper, complete] = ["spidermill-paper.toml", "spidermill.toml"].map(model);
    // Effects, candidates, alternatives and all parameters fixed.
    for more in [&[][..], &["--held"], &["--check", &check]] {
        let args = [&["diagnose", paper.as_str(), "--data", &fit, "--json"], more].concat();
        let answer = json(&args);
        assert_fits(&diagnose, &answer);
        let mut renamed = answer.clone();
        renamed["verdict"] = value!("perhaps");
        assert!(!diagnose.is_valid(&renamed));
        let object = renamed.as_object_mut().expect("an object");
        object.insert("verdict".to_owned(), answer["verdict"].clone());
        object.remove("budget");
        assert!(!diagnose.is_valid(&renamed));
    }
    let runs = answer_schema("runs");
    for more in [&[][..], &["--per-run", "offset"]] {
        let args = [&["runs", complete.as_str(), "--data", &fit, &check, "--json"], more].concat();
        let answer = json(&args);
        assert_fits(&runs, &answer);
        assert_eq!(answer["per_run"].is_null(), more.is_empty());
    }
}
