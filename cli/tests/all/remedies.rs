//! What the program advises is in its own words, and what users wrote stays as they wrote it.

use std::fmt::Write as _;

use serde_json::Value;

use crate::common::{json, model, printed, ran, refused, run, scratch};

/// Options of the library whose names no user of the program has ever seen.
const LIBRARY_NAMES: [&str; 6] = [
    "band_hz",
    "cutoff_hz",
    "leave_out_events",
    "maps_from_degrees",
    "round_angles",
    "skip_bad_samples",
];

/// A copy of a bundled model under another name, with another text in the place of its title.
fn copy(name: &str, title: &str) -> String {
    let path = scratch(name);
    let text = std::fs::read_to_string(model("two_link.toml")).unwrap();
    let text = text.replace("Two-link arm in a vertical plane", title);
    std::fs::write(&path, text).unwrap();
    path
}

#[test]
fn names_of_files_stay_as_they_are() {
    let path = copy("verb `add`.toml", "option `columns` = `q=x` option `data`");
    let told = json(&["check", &path, "--json"]);
    assert_eq!(told["model"], "verb `add`");
    assert_eq!(told["title"], "option `columns` = `q=x` option `data`");
    let text = printed(&["check", &path]);
    assert!(text.starts_with("verb `add`: valid"), "{text}");
    assert!(text.contains("option `columns` = `q=x` option `data`"), "{text}");
    let missing = path.replace("add", "` `--map");
    let says = refused(1, &["check", &missing]);
    assert!(says.contains(&missing), "{says}");
    let says = refused(1, &["compare", &path, "--data", "option `between`.csv"]);
    assert!(says.contains("option `between`.csv:"), "{says}");
}

#[test]
fn snippets_of_files_stay_as_they_are() {
    let path = copy("snippet.toml", "an arm");
    let line = "schema = true # option `columns` = `q=q [deg]` option `data`, verb `identify`";
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, text.replace("schema = 1", line)).unwrap();
    let says = refused(1, &["check", &path]);
    assert!(says.contains(line), "{says}");
}

/// A recording of the arm in degrees, with forces that stay at a limit, whose lines a test may change.
fn recording(name: &str, line: impl Fn(usize, String) -> String) -> String {
    let mut text = line(0, "t,q1,q2,joint1,joint2".to_owned());
    for k in 0..2000_u16 {
        let t = 0.004 * f64::from(k);
        let (q1, q2) = (800.0 * (3.0 * t).sin(), 900.0 * (2.0 * t + 1.0).sin());
        let force = (30.0 * (7.0 * t).sin()).clamp(-20.0, 20.0);
        let row = format!("{t:.3},{q1},{q2},{force},{}", 10.0 * (4.0 * t).cos());
        let _ = write!(text, "\n{}", line(1 + usize::from(k), row));
    }
    let path = scratch(name);
    std::fs::write(&path, text + "\n").unwrap();
    path
}

/// A bundled recording with a push against one drive.
fn pushed(name: &str) -> String {
    let text = std::fs::read_to_string(run("plain-fit.csv")).unwrap();
    let push = |(k, line): (usize, &str)| match line.rsplit_once(',') {
        Some((others, force)) if (1500..1600).contains(&k) => {
            format!("{others},{}\n", force.parse::<f64>().unwrap() + 500.0)
        }
        _ => format!("{line}\n"),
    };
    let path = scratch(name);
    std::fs::write(&path, text.lines().enumerate().map(push).collect::<String>()).unwrap();
    path
}

/// All texts of a JSON value.
fn texts(value: &Value, all: &mut String) {
    match value {
        Value::String(text) => _ = writeln!(all, "{text}"),
        Value::Array(values) => values.iter().for_each(|value| texts(value, all)),
        Value::Object(members) => members.values().for_each(|value| texts(value, all)),
        _ => {}
    }
}

/// Options and commands of the program that the advice of the commands below names.
const ADVISED: [&str; 17] = [
    "--between",
    "--check",
    "--cutoff",
    "--data",
    "--derivatives positions",
    "--leave-out-events",
    "--limits",
    "--map",
    "--physical",
    "--skip-bad-samples",
    "--smoothing",
    "--unknown",
    "--weights",
    "`modelmill adopt`",
    "`modelmill diagnose`",
    "`modelmill evaluate`",
    "`modelmill identify`",
];

#[test]
fn advice_is_in_the_words_of_the_program() {
    let arm = &model("two_link.toml");
    let as_is = |_: usize, line: String| line;
    let degrees = &recording("degrees.csv", as_is);
    let nameless = &recording("nameless.csv", |k, line| match k {
        0 => line.replace("q2", "elbow").replace("joint1", "motor"),
        _ => line,
    });
    let gappy = &recording("gappy.csv", |k, line| match k {
        700 => "2.796,,1,2,3".to_owned(),
        _ => line,
    });
    let fit = &scratch("fit.json");
    let page = &scratch("page");
    let runs = &scratch("runs.json");
    let trajectory = &scratch("trajectory.csv");
    let mechanism = &model("spidermill.toml");
    let plain = &run("plain-fit.csv");
    let pushed = &pushed("pushed.csv");
    let commands: &[&[&str]] = &[
        &["check", degrees],
        &["check", degrees, "--json"],
        &["compare", arm, "--data", gappy],
        &["compare", arm, "--data", nameless],
        &["compare", arm, "--data", degrees, "--map", "q1=q3"],
        &["compare", arm, "--data", degrees, "--map", "q3=q1"],
        &["compare", arm, "--data", degrees, "--between", "100,200"],
        &["compare", arm, "--data", degrees, "--cutoff", "0.001"],
        &["compare", arm, "--data", degrees, "--json"],
        &["compare", mechanism, "--data", pushed],
        &["compare", mechanism, "--data", pushed, "--leave-out-events"],
        &["compare", mechanism, "--data", plain, "--cutoff", "20"],
        &["identify", arm, "--data", degrees, "--out", fit],
        &["identify", arm, "--data", degrees, "--json"],
        &["identify", mechanism, "--data", plain],
        &["identify", mechanism, "--data", plain, "--check", plain],
        &[
            "identify",
            arm,
            "--data",
            degrees,
            "--weights",
            "channels",
            "--instruments",
            "period=2",
        ],
        &["identify", arm, "--data", degrees, "--weights", "variance"],
        &["interpret", arm, "--fit", degrees, "--unknown", "m"],
        &["interpret", arm, "--fit", fit, "--unknown", "nothing"],
        &["report", arm, "--data", degrees, "--out", page],
        &["runs", mechanism, "--data", plain, nameless, plain, "--out", runs],
        &["excite", arm, "--out", trajectory],
        &["simulate", arm, "--trajectory", degrees, "--out", trajectory],
        &[
            "export",
            arm,
            "--parameters",
            fit,
            "--out",
            &format!("{trajectory}.urdf"),
        ],
    ];
    let mut all = String::new();
    for args in commands {
        let ran = ran(args);
        let mut says = ran.err;
        match serde_json::from_str(&ran.out) {
            Ok(value) => texts(&value, &mut says),
            Err(_) => says.push_str(&ran.out),
        }
        program_words(&says, args);
        all.push_str(&says);
    }
    for path in [fit, runs] {
        let text = std::fs::read_to_string(path).unwrap();
        let mut says = String::new();
        texts(&serde_json::from_str(&text).unwrap(), &mut says);
        program_words(&says, &[path]);
        all.push_str(&says);
    }
    let html = std::fs::read_to_string(format!("{page}/report.html")).unwrap();
    program_words(&html, &[page]);
    for expected in ADVISED {
        assert!(all.contains(expected), "{expected}");
    }
}

#[track_caller]
fn program_words(says: &str, args: &[&str]) {
    for words in ["option `", "Option `", "options `", "verb `"]
        .iter()
        .chain(&LIBRARY_NAMES)
    {
        let at = says.find(words);
        let excerpt = at.map(|at| says[at..].chars().take(120).collect::<String>());
        assert_eq!(excerpt, None, "{args:?}");
    }
}
