//! Faulty rig files: each fixture's whole message is a snapshot, so that every change of a message is seen.

use std::path::Path;

use modelmill_boundary::files::{DiskFiles, FileSource, MemoryFiles};
use modelmill_rig::{RigTracker, load};

fn folder() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/faulty")
}

/// Reads a fixture under the path that messages should show, and stands the rig up if it can be read.
fn message(name: &str) -> String {
    let text = std::fs::read_to_string(folder().join(name)).expect("a fixture");
    let paths = DiskFiles::default().list(&folder()).expect("fixtures");
    let files = paths.iter().filter(|path| path.is_file());
    let files = files.fold(MemoryFiles::default(), |files, path| {
        let name = path.file_name().expect("a name");
        files.with_file(name, std::fs::read(path).expect("a fixture"))
    });
    match load(name, &text, &files) {
        Ok(loaded) => match RigTracker::new(&loaded.rig) {
            Ok(_) => panic!("{name} has no fault"),
            Err(error) => format!("{error}\n"),
        },
        Err(failure) => {
            let named = |found: &modelmill_spec::Diagnostic| found.span.is_some() || name == "empty.toml";
            assert!(
                failure.diagnostics.iter().all(named),
                "{name}: a finding without its place"
            );
            failure.render(false)
        }
    }
}

#[test]
fn messages() {
    let mut names: Vec<String> = std::fs::read_dir(folder())
        .expect("fixtures")
        .map(|entry| entry.expect("a file").file_name().to_string_lossy().into_owned())
        .filter(|name| Path::new(name).extension().is_some_and(|end| end == "toml"))
        .collect();
    names.sort();
    assert!(names.len() >= 14);
    insta::with_settings!({ snapshot_path => "../snapshots", prepend_module_to_snapshot => false, omit_expression => true }, {
        for name in names {
            insta::assert_snapshot!(name.trim_end_matches(".toml").to_owned(), message(&name));
        }
    });
}

#[test]
fn a_file_that_cannot_be_read() {
    let failure = modelmill_rig::load_file(Path::new("no/such/rig.toml")).expect_err("no file");
    assert!(failure.render(false).contains("cannot read `no/such/rig.toml`"));
}

#[test]
fn a_file_of_megabytes_and_one_of_nonsense() {
    let none = &MemoryFiles::default();
    let huge = load("rig.toml", &"x".repeat(5 << 20), none).expect_err("too large");
    assert!(huge.render(false).contains("too large"));
    for text in ["\u{0}\u{1}", "= = =", "schema = 1\nname = 1", "[[[[", "name = \"\\q\""] {
        assert!(load("rig.toml", text, none).is_err(), "{text:?}");
    }
}

/// Files that someone is still writing: cut anywhere, or with a line left out, they give an answer and no panic.
#[test]
fn unfinished_files_give_an_answer() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../model-spec/rigs/spidermill-full.toml");
    let text = std::fs::read_to_string(path).expect("a rig");
    let none = &MemoryFiles::default();
    let mut sound = 0;
    let lines: Vec<&str> = text.lines().collect();
    let without = (0..lines.len())
        .step_by(5)
        .map(|k| [&lines[..k], &lines[k + 1..]].concat().join("\n"));
    let cut = (0..text.len())
        .step_by(211)
        .filter_map(|k| text.get(..k).map(str::to_owned));
    for unfinished in without.chain(cut) {
        match load("rig.toml", &unfinished, none) {
            // A comment that is missing does no harm; a joint that is missing may leave a body free.
            Ok(loaded) => sound += usize::from(RigTracker::new(&loaded.rig).is_ok()),
            Err(failure) => assert!(!failure.render(false).is_empty()),
        }
    }
    assert!(sound > 5);
}
