//! `diagnose --out`: the completed model, written in one step. It is the file that the printed commands make one by one, it
//! lacks nothing on the same recordings, and text, JSON and file state the same values.

use serde_json::Value;

use crate::common::{json, model, printed, ran, refused, run, scratch, workspace};

/// Both recordings of a case beside the workspace; none where they are absent.
fn case(name: &str) -> Option<[String; 2]> {
    let folder = workspace("../shared/data/spidermill-harsh").join(name);
    if !folder.is_dir() {
        println!("Not tested: there are no recordings in {}.", folder.display());
        return None;
    }
    Some(["fit.csv", "check.csv"].map(|file| folder.join(file).to_string_lossy().into_owned()))
}

/// Values of all effects by kind and symbol, as the JSON writes them.
fn values(answer: &Value) -> Vec<String> {
    let effects = answer["effects"].as_array().expect("a list");
    let estimates = effects
        .iter()
        .flat_map(|one| one["estimates"].as_array().expect("a list"));
    estimates
        .map(|one| format!("{}={}", one["name"].as_str().expect("a name"), one["value"]))
        .collect()
}

#[test]
fn the_completed_model_is_that_of_the_printed_commands_and_lacks_nothing() {
    for name in ["spring-and-offset", "shared-and-single"] {
        let Some([fit, check]) = case(name) else { return };
        let given = model("spidermill.toml");
        let completed = scratch(&format!("{name}.toml"));
        let base = ["diagnose", &given, "--data", &fit, "--check", &check];
        let wrote = ran(&[&base[..], &["--out", &completed]].concat());
        assert_eq!(wrote.status, 0, "{}", wrote.err);
        assert!(wrote.err.contains(&format!("{completed} is written")), "{}", wrote.err);
        // What was done is no next step.
        assert!(
            !wrote.out.contains("modelmill add") && !wrote.out.contains("completed.toml"),
            "{}",
            wrote.out
        );
        let ran = ran(&base);
        let answer = json(&[&base[..], &["--json"]].concat());
        assert_eq!(answer["verdict"], "missing_effect");
        assert_eq!(answer["written"], Value::Null);

        // One value per finding: text, JSON, command and file.
        let file = std::fs::read_to_string(&completed).expect("the completed model");
        for value in values(&answer) {
            let in_text = value.replace('=', " = ");
            assert!(ran.out.contains(&format!("{in_text} ")), "{in_text} in {}", ran.out);
            assert!(ran.out.contains(&format!("--set {value} ")), "{value} in {}", ran.out);
            let number = value.split('=').next_back().expect("a number");
            assert!(file.contains(number), "{number} in {file}");
        }

        // The printed commands lead to the same file.
        let one_by_one = scratch(&format!("{name}-one-by-one.toml"));
        std::fs::copy(&given, &one_by_one).expect("a copy of the model");
        let commands = ran
            .out
            .lines()
            .filter_map(|line| line.trim().strip_prefix("modelmill "));
        let commands: Vec<&str> = commands.filter(|line| line.starts_with("add ")).collect();
        assert!(commands.len() > 1, "{}", ran.out);
        for command in commands {
            let command = command.replace(&given, &one_by_one);
            printed(&command.split(' ').collect::<Vec<_>>());
        }
        let one_by_one = std::fs::read_to_string(one_by_one).expect("the model");
        assert_eq!(one_by_one, file);

        // Nothing is missing any more, and the error is that of the last step.
        let again = json(&["diagnose", &completed, "--data", &fit, "--check", &check, "--json"]);
        assert_eq!(again["verdict"], "adequate", "{again:#}");
        let error = |step: Option<&Value>| step.expect("a step")["check"].as_f64().expect("an error");
        let expected = error(answer["steps"].as_array().and_then(|steps| steps.last()));
        let found = error(again["steps"].as_array().and_then(|steps| steps.first()));
        assert!((found / expected - 1.0).abs() < 0.02, "{found}, not {expected}");
    }
}

#[test]
fn forces_of_the_completed_model_are_those_of_the_finding() {
    let [given, fit, check] = [
        model("spidermill.toml"),
        run("with-rods-fit.csv"),
        run("with-rods-check.csv"),
    ];
    let completed = scratch("with-rods.toml");
    let base = ["diagnose", &given, "--data", &fit, "--check", &check];
    let answer = json(&[&base[..], &["--out", &completed, "--json"]].concat());
    assert_eq!(answer["written"], completed.as_str());
    // The values of this model's bodies are true, so nothing is to be estimated: all of the error is that of the values
    // of the effect.
    let compared = json(&["compare", &completed, "--data", &check, "--json"]);
    let error = compared["nrms"].as_f64().expect("an error");
    assert!(error < 1e-4, "{error}");
}

#[test]
fn a_model_that_lacks_nothing_is_written_as_it_is() {
    let [given, fit, check] = [model("spidermill.toml"), run("plain-fit.csv"), run("plain-check.csv")];
    let completed = scratch("plain.toml");
    let ran = ran(&[
        "diagnose", &given, "--data", &fit, "--check", &check, "--out", &completed,
    ]);
    assert_eq!(ran.status, 0, "{}", ran.err);
    assert!(ran.err.contains("without added effects"), "{}", ran.err);
    let [before, after] = [&given, &completed].map(|path| std::fs::read_to_string(path).expect("a model"));
    assert_eq!(before, after);
}

#[test]
fn inputs_are_not_written_over() {
    let [given, fit] = [model("spidermill.toml"), run("plain-fit.csv")];
    for target in [&given, &fit] {
        let says = refused(2, &["diagnose", &given, "--data", &fit, "--out", target]);
        assert!(
            says.contains("would overwrite a file that this command reads"),
            "{says}"
        );
    }
}
