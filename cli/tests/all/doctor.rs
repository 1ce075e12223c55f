//! `doctor`: finds programs where they are, and reports what is missing without a failure.

use std::process::Command;

use serde_json::Value;

use crate::common::modelmill;

/// The answer with a changed environment; the program must end with success.
fn examine(change: impl FnOnce(&mut Command)) -> Value {
    let mut command = modelmill(&["doctor", "--json"]);
    change(&mut command);
    let output = command.output().expect("the program starts");
    let says = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && says.is_empty(), "{says}");
    serde_json::from_slice(&output.stdout).expect("one object")
}

/// One requirement of an answer.
fn requirement<'a>(answer: &'a Value, name: &str) -> &'a Value {
    let all = answer["requirements"].as_array().expect("a list");
    all.iter()
        .find(|one| one["name"] == name)
        .unwrap_or_else(|| panic!("{name} is not in {answer}"))
}

#[test]
fn every_requirement_has_the_same_keys_and_a_remedy_where_it_is_not_met() {
    for answer in [
        examine(|_| {}),
        examine(|command| {
            command.env_clear();
        }),
    ] {
        assert_eq!(answer["version"], env!("CARGO_PKG_VERSION"));
        for one in answer["requirements"].as_array().expect("a list") {
            let keys: Vec<&String> = one.as_object().expect("an object").keys().collect();
            let expected = [
                "name",
                "essential",
                "state",
                "version",
                "least_version",
                "path",
                "needed_for",
                "remedy",
            ];
            assert_eq!(keys, expected);
            assert_eq!(one["state"] == "present", one["remedy"].is_null(), "{one}");
            assert!(!one["needed_for"].as_array().expect("a list").is_empty(), "{one}");
        }
    }
}

/// Other programs are not essential: without a search path all of them are missing, and the program is ready.
#[test]
fn nothing_is_found_without_a_search_path() {
    let answer = examine(|command| {
        command.env_clear();
    });
    assert_eq!(answer["ready"], true);
    assert_eq!(requirement(&answer, "derivation")["state"], "present");
    for name in [
        "Rust compiler",
        "Cargo",
        "C compiler",
        "Python",
        "Julia",
        "browser",
        "numpy in Python",
    ] {
        assert_eq!(requirement(&answer, name)["state"], "missing", "{name}");
    }
}

/// The compiler that builds this test is found with its version.
#[test]
fn the_rust_compiler_is_found() {
    let printed = Command::new("rustc").arg("--version").output().expect("a compiler");
    let printed = String::from_utf8_lossy(&printed.stdout).into_owned();
    let answer = examine(|command| {
        command.env_remove("RUSTC");
    });
    let rust = requirement(&answer, "Rust compiler");
    assert_eq!(rust["state"], "present");
    let version = rust["version"].as_str().expect("a version");
    assert!(printed.contains(version), "{printed}: {version}");
}

/// Programs that fail, print no version, are too old, or do not end.
#[cfg(unix)]
#[test]
fn states_distinguish_programs_that_do_not_work() {
    use std::fs;
    use std::os::unix::fs::PermissionsExt;
    use std::path::Path;

    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("doctor");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).expect("a folder");
    for (name, script, mode) in [
        ("rustc", "#!/bin/sh\necho rustc 1.20.0\n", 0o755),
        ("cc", "#!/bin/sh\nexit 1\n", 0o755),
        ("julia", "#!/bin/sh\necho julia\n", 0o755),
        // Not a program: nobody may run it.
        ("cargo", "#!/bin/sh\necho cargo 1.99.0\n", 0o644),
        // A descendant keeps the output open after the program has ended.
        ("lualatex", "#!/bin/sh\necho 1.2.3\n/bin/sleep 60 &\n", 0o755),
    ] {
        let path = folder.join(name);
        fs::write(&path, script).expect("written");
        fs::set_permissions(&path, fs::Permissions::from_mode(mode)).expect("a mode");
    }
    let start = std::time::Instant::now();
    let answer = examine(|command| {
        command
            .env_clear()
            .env("PATH", &folder)
            .env("BROWSER", "no-such-browser");
    });
    assert!(start.elapsed().as_secs() < 30, "the program waits for another one");
    for (name, state) in [
        ("Rust compiler", "outdated"),
        ("C compiler", "fails"),
        ("Julia", "present"),
        ("Cargo", "missing"),
        ("LaTeX", "fails"),
        ("browser", "missing"),
    ] {
        assert_eq!(requirement(&answer, name)["state"], state, "{name}");
    }
    let remedy = requirement(&answer, "browser")["remedy"].as_str().expect("a remedy");
    assert!(remedy.contains("BROWSER"), "{remedy}");
}
