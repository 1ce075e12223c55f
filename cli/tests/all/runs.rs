//! `runs` over files, folders and patterns: what it says on the recordings of the guide, what it does with files that are none,
//! and what it writes.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::common::{html, json, number, printed, refused, scratch, workspace};

fn day(name: &str) -> String {
    let path = workspace("recordings/spidermill-days").join(name);
    path.to_str().expect("plain text").to_owned()
}

fn kinds(found: &Value) -> Vec<(String, u64)> {
    let changes = found["changes"].as_array().expect("changes");
    let one = |change: &Value| {
        let kind = change["kind"].as_str().expect("a kind").to_owned();
        (kind, change["between"][1].as_u64().expect("a run"))
    };
    changes.iter().map(one).collect()
}

/// The truth stands in `recordings/README.md`.
#[test]
fn days_are_told_apart() {
    let model = day("spidermill-friction.toml");
    let files = ["monday.csv", "tuesday.csv", "with-load.csv"].map(day);
    let found = json(&["runs", &model, "--json", "--data", &files[0], &files[1], &files[2]]);
    assert_eq!(kinds(&found), [("payload".to_owned(), 2)]);
    assert_eq!(found["changes"][0]["estimates"][0]["name"], "mass");
    let mass = number(&found, "/changes/0/estimates/0/value");
    assert!((mass - 3.0).abs() < 0.02, "{mass}");

    let found = json(&["runs", &model, "--json", "--data", &day("cold.csv"), &day("warm.csv")]);
    assert_eq!(kinds(&found), [("friction".to_owned(), 1), ("friction".to_owned(), 1)]);
    for change in found["changes"].as_array().expect("changes") {
        let says = change["says"].as_str().expect("words");
        assert_eq!(says.matches("(-15 %)").count(), 2, "{says}");
    }
}

/// A folder, a pattern, a file that cannot be read, a page, and values of each run as a file.
#[test]
fn many_runs_become_a_page() {
    let model = day("spidermill-friction.toml");
    let folder = scratch("days");
    let folder = Path::new(&folder);
    let _ = fs::remove_dir_all(folder);
    fs::create_dir_all(folder).expect("a folder");
    let order = [
        "monday.csv",
        "tuesday.csv",
        "monday.csv",
        "with-load.csv",
        "with-load.csv",
    ];
    for (k, name) in order.iter().enumerate() {
        fs::copy(day(name), folder.join(format!("run{}.csv", 8 + k))).expect("writable");
    }
    fs::write(folder.join("run13.csv"), "t,theta1\n0,1\n").expect("writable");
    fs::write(folder.join("notes.txt"), "no recording").expect("writable");
    let data = folder.to_str().expect("plain text");
    let out = scratch("page");
    let says = printed(&["runs", &model, "--data", data, "--out", &out]);
    assert!(says.contains("run13.csv was not evaluated"), "{says}");
    let is_load = |line: &&str| line.contains("the load on S3") && line.contains("kg larger");
    assert!(
        says.contains("from run 4 on") && says.lines().any(|line| is_load(&line)),
        "{says}"
    );
    let page = fs::read_to_string(Path::new(&out).join("runs.html")).expect("a page");
    html::check(&page);
    assert!(page.contains("From run 4 on") && page.contains("run13.csv"));

    let pattern = format!("{data}/run1[0-2].csv");
    assert!(refused(1, &["runs", &model, "--data", &pattern]).contains("run1[0-2].csv"));
    let pattern = format!("{data}/run1?.csv");
    let file = scratch("own.json");
    let says = printed(&[
        "runs",
        &model,
        "--data",
        &pattern,
        "--per-run",
        "payload@S3,friction",
        "--out",
        &file,
    ]);
    assert!(says.contains("payload@S3"), "{says}");
    let found: Value = serde_json::from_str(&fs::read_to_string(&file).expect("a file")).expect("JSON");
    assert_eq!(found["unread"].as_array().map(Vec::len), Some(1));
    let values = found["per_run"]["runs"][1]["values"].as_array().expect("values");
    let mass = values.iter().find(|one| one["name"] == "mass").expect("a mass");
    let mass = mass["value"].as_f64().expect("a number");
    assert!((mass - 3.0).abs() < 0.05, "{mass}");

    let says = refused(2, &["runs", &model, "--data", data, "--per-run", "payload"]);
    assert!(says.contains("payload@flange"), "{says}");
    let empty = scratch("empty");
    fs::create_dir_all(&empty).expect("a folder");
    assert!(refused(1, &["runs", &model, "--data", &empty]).contains("no recording"));
}
