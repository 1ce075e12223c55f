//! Pages of tasks for agents: each has a head that agents read, all of its commands succeed one after the other, and the
//! answers have the keys that its tables name.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::common::markdown::Page;
use crate::common::{modelmill, printed, workspace};

/// The page of each folder of `skills`, in the order of the names.
pub(crate) fn skill_paths() -> Vec<PathBuf> {
    let folders = fs::read_dir(workspace("skills")).expect("the folder of skills");
    let pages = folders.map(|folder| folder.expect("an entry").path().join("SKILL.md"));
    let mut pages: Vec<PathBuf> = pages.collect();
    pages.sort();
    pages
}

/// The name of a skill: its folder.
fn skill_name(path: &Path) -> &str {
    let folder = path.parent().and_then(Path::file_name);
    folder.and_then(|name| name.to_str()).expect("a name of plain text")
}

/// A head of YAML gives the name of the folder and a description; limits are those of the format of agent skills.
#[test]
fn heads_name_the_folder_and_describe_the_task() {
    let paths = skill_paths();
    assert!(paths.len() >= 5, "{paths:?}");
    for path in paths {
        let text = fs::read_to_string(&path).expect("a page");
        let head = text.strip_prefix("---\n").and_then(|rest| rest.split_once("\n---\n"));
        let (head, body) = head.unwrap_or_else(|| panic!("{}: no head", path.display()));
        let entry = |key: &str| {
            let mut lines = head.lines();
            let value = lines.find_map(|line| line.strip_prefix(&format!("{key}: ")));
            value.unwrap_or_else(|| panic!("{}: the head has no {key}", path.display()))
        };
        assert_eq!(entry("name"), skill_name(&path));
        assert!((50..=1024).contains(&entry("description").len()), "{}", path.display());
        // An agent reads the whole page before it starts.
        assert!(body.lines().count() <= 120, "{} is too long", path.display());
    }
}

/// AGENTS.md lists every skill.
#[test]
fn agents_are_shown_all_skills() {
    let text = fs::read_to_string(workspace("AGENTS.md")).expect("a page");
    for path in skill_paths() {
        let link = format!("skills/{}/SKILL.md", skill_name(&path));
        assert!(text.contains(&link), "AGENTS.md does not name {link}");
    }
}

/// AGENTS.md lists the commands without `--json`, which are those of the manual.
#[test]
fn agents_are_shown_the_commands_without_json() {
    let text = fs::read_to_string(workspace("AGENTS.md")).expect("a page");
    let line = text.lines().find(|line| line.contains("have no `--json`: "));
    let (_, list) = line.and_then(|line| line.split_once(": ")).expect("a list");
    let listed: BTreeSet<&str> = list.split('`').skip(1).step_by(2).collect();
    let manual = printed(&["manual"]);
    let sections = manual.split("\n## ").skip(1);
    let without: BTreeSet<&str> = sections
        .filter_map(|section| section.split_once('\n'))
        .filter(|(name, text)| text.contains(&format!("\n`modelmill {name}")) && !text.contains("| `--json` |"))
        .map(|(name, _)| name)
        .collect();
    assert_eq!(listed, without);
}

#[test]
fn the_commands_of_every_skill_succeed_in_their_order() {
    let mut faults = String::new();
    for path in skill_paths() {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR"))
            .join("skills")
            .join(skill_name(&path));
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).expect("a folder");
        fs::write(folder.join("log.csv"), servo_log()).expect("written");
        let page = Page::read(&path);
        let mut answer = None;
        let mut ran = 0;
        for block in &page.blocks {
            let first = block.text.lines().next().unwrap_or_default();
            if let Some(name) = first.strip_prefix("# ").filter(|_| block.language == "toml") {
                fs::write(folder.join(name), &block.text).expect("written");
            }
            for words in Page::commands(block) {
                let words: Vec<String> = words.iter().map(|word| bundled_path(word)).collect();
                let words: Vec<&str> = words.iter().map(String::as_str).collect();
                let output = modelmill(&words)
                    .current_dir(&folder)
                    .output()
                    .expect("the program starts");
                let message = String::from_utf8_lossy(&output.stderr);
                if !output.status.success() {
                    let _ = writeln!(faults, "{}: {words:?}: {message}", path.display());
                }
                if words.contains(&"--json") {
                    let object: Value = serde_json::from_slice(&output.stdout).unwrap_or(Value::Null);
                    answer = Some((words.join(" "), object));
                }
                ran += 1;
            }
            // The table after a command that prints JSON names keys of its answer.
            for key in &block.keys_of_next_table {
                let (command, object) = answer.as_ref().expect("a table of keys follows a command with --json");
                if find_key(object, key).is_empty() {
                    let _ = writeln!(faults, "{}: the answer of {command} has no `{key}`", path.display());
                }
            }
        }
        assert!(ran >= 3, "{}: {ran} commands", path.display());
    }
    assert!(faults.is_empty(), "{faults}");
}

/// The identified gains of the servo's log are those with which it was simulated.
#[test]
fn the_servo_log_is_identified_as_it_was_made() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("skills-servo");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).expect("a folder");
    fs::write(folder.join("log.csv"), servo_log()).expect("written");
    let page = Page::read(&workspace("skills/servo-logs/SKILL.md"));
    let model = page
        .blocks
        .iter()
        .find(|block| block.language == "toml")
        .expect("a model");
    fs::write(folder.join("servo.toml"), &model.text).expect("written");
    let command = ["identify", "servo.toml", "--data", "log.csv", "--json"];
    let output = modelmill(&command)
        .current_dir(&folder)
        .output()
        .expect("the program starts");
    let answer: Value = serde_json::from_slice(&output.stdout).expect("one object");
    for (expression, expected) in [
        ("J", SERVO.inertia),
        ("kp", SERVO.stiffness),
        ("kd + Fv_motor", SERVO.damping),
        ("Fc_motor", SERVO.friction),
    ] {
        let parameters = answer["parameters"].as_array().expect("parameters");
        let found = parameters.iter().find(|one| one["expression"] == expression);
        let value = found.and_then(|one| one["value"].as_f64()).expect("a value");
        // Numeric derivatives have an error of up to 1 % at 200 Hz.
        assert!(
            (value / expected - 1.0).abs() < 0.02,
            "{expression}: {value}, made with {expected}"
        );
    }
}

/// The values of an answer under a dotted key; `[]` stands for every element of a list. There are none if a part of the
/// key is missing or if a list is empty: a skill shows an answer with at least one element.
fn find_key<'a>(object: &'a Value, key: &str) -> Vec<&'a Value> {
    let mut values = vec![object];
    for part in key.split('.') {
        let (name, is_list) = part.strip_suffix("[]").map_or((part, false), |name| (name, true));
        values = values.iter().filter_map(|value| value.get(name)).collect();
        if is_list {
            values = values.iter().filter_map(|value| value.as_array()).flatten().collect();
        }
    }
    values
}

/// A word of a command with the path of a bundled file as one that works from every folder.
fn bundled_path(word: &str) -> String {
    let is_bundled = ["model-spec/", "recordings/"]
        .iter()
        .any(|folder| word.starts_with(folder));
    if is_bundled {
        workspace(word).display().to_string()
    } else {
        word.to_owned()
    }
}

/// What the log of the servo was simulated with, SI units.
struct SimulatedServo {
    inertia: f64,
    stiffness: f64,
    damping: f64,
    friction: f64,
    moment: f64,
}

const SERVO: SimulatedServo = SimulatedServo {
    inertia: 0.05,
    stiffness: 40.0,
    damping: 1.5,
    friction: 0.1,
    moment: 0.15,
};

/// A log of the servo on the page: 20 s at 200 Hz, positions rounded as by an encoder of 20 bits per turn.
fn servo_log() -> String {
    let step = 2e-4;
    let encoder = std::f64::consts::TAU / f64::from(1 << 20);
    let (mut position, mut rate) = (0.0_f64, 0.0_f64);
    let mut log = "t,position,goal_position\n".to_owned();
    for k in 0..100_000_u32 {
        let t = f64::from(k) * step;
        let goal = 0.6 * (std::f64::consts::TAU * 0.7 * t).sin() + 0.3 * (std::f64::consts::TAU * 1.9 * t).sin();
        if k % 25 == 0 {
            let read = (position / encoder).round() * encoder;
            let _ = writeln!(log, "{t:.4},{read},{goal}");
        }
        let drive = SERVO.stiffness * (goal - position) - SERVO.damping * rate;
        let others = 9.81 * SERVO.moment * position.sin() + SERVO.friction * (rate / 1e-3).tanh();
        rate += step * (drive - others) / SERVO.inertia;
        position += step * rate;
    }
    log
}
