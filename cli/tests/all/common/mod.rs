//! Runs the program and reads what it prints.

pub(crate) mod browser;
pub(crate) mod html;
pub(crate) mod markdown;
pub(crate) mod workbench;

use std::panic::Location;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

/// A path below the workspace.
pub(crate) fn workspace(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path)
}

/// A model file by name.
pub(crate) fn model(name: &str) -> String {
    text(&workspace("model-spec/models").join(name))
}

/// A bundled recording by name.
pub(crate) fn run(name: &str) -> String {
    text(&workspace("recordings/spidermill-mbs").join(name))
}

/// A fresh path for a file that a test writes, in a folder for the source file that asks.
#[track_caller]
pub(crate) fn scratch(name: &str) -> String {
    let asker = Path::new(Location::caller().file()).file_stem();
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(asker.expect("a source file"));
    std::fs::create_dir_all(&folder).expect("a folder for what tests write");
    let path = folder.join(name);
    let _ = std::fs::remove_file(&path);
    text(&path)
}

fn text(path: &Path) -> String {
    path.to_str().expect("a path of plain text").to_owned()
}

/// The program, not yet started.
pub(crate) fn modelmill(args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_modelmill"));
    command.args(args).env_remove("NO_COLOR");
    command
}

/// What a run printed and how it ended.
pub(crate) struct Ran {
    pub(crate) status: i32,
    pub(crate) out: String,
    pub(crate) err: String,
}

/// Runs the program to its end.
pub(crate) fn ran(args: &[&str]) -> Ran {
    let Output { status, stdout, stderr } = modelmill(args).output().expect("the program starts");
    Ran {
        status: status.code().expect("no signal ended the program"),
        out: String::from_utf8(stdout).expect("UTF-8 on standard output"),
        err: String::from_utf8(stderr).expect("UTF-8 on standard error"),
    }
}

/// Standard output of a run that must succeed.
#[track_caller]
pub(crate) fn printed(args: &[&str]) -> String {
    let ran = ran(args);
    assert_eq!(ran.status, 0, "{args:?}: {}", ran.err);
    assert!(
        !ran.out.contains('\x1b') && !ran.err.contains('\x1b'),
        "colours outside a terminal"
    );
    ran.out
}

/// The one JSON object that a run prints.
#[track_caller]
pub(crate) fn json(args: &[&str]) -> Value {
    let out = printed(args);
    let value: Value = serde_json::from_str(&out).expect("exactly one JSON value");
    assert!(value.is_object(), "{value}");
    value
}

/// Message of a run that must end with the given status and print nothing on standard output.
#[track_caller]
pub(crate) fn refused(status: i32, args: &[&str]) -> String {
    let ran = ran(args);
    assert_eq!(ran.status, status, "{args:?}: {}{}", ran.out, ran.err);
    assert_eq!(ran.out, "", "{args:?}");
    assert!(!ran.err.contains("panicked"), "{}", ran.err);
    ran.err
}

/// A number of a JSON object by its path.
#[track_caller]
pub(crate) fn number(value: &Value, pointer: &str) -> f64 {
    value
        .pointer(pointer)
        .and_then(Value::as_f64)
        .unwrap_or_else(|| panic!("no number at {pointer} in {value:#}"))
}
