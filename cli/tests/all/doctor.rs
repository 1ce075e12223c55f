//! `doctor`: finds programs where they are, and reports what is missing without a failure.

#[cfg(unix)]
use std::fs;
#[cfg(unix)]
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::common::modelmill;

/// The answer with a changed environment; the program must end with success.
fn examine(change: impl FnOnce(&mut Command)) -> Value {
    let mut command = modelmill(&["doctor", "--json"]);
    change(&mut command);
    let output = command.output().expect("the program starts");
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && message.is_empty(), "{message}");
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

/// Writes scripts with their modes into a new folder.
#[cfg(unix)]
fn write_scripts(folder: &str, scripts: &[(&str, &str, u32)]) -> PathBuf {
    use std::os::unix::fs::PermissionsExt;

    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(folder);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).expect("a folder");
    for (name, script, mode) in scripts {
        let path = folder.join(name);
        fs::write(&path, script).expect("written");
        fs::set_permissions(&path, fs::Permissions::from_mode(*mode)).expect("a mode");
    }
    folder
}

/// Programs that fail, print no version, are too old, or do not end.
#[cfg(unix)]
#[test]
fn states_distinguish_programs_that_do_not_work() {
    let scripts = [
        ("rustc", "#!/bin/sh\necho rustc 1.20.0\n", 0o755),
        ("cc", "#!/bin/sh\nexit 1\n", 0o755),
        ("julia", "#!/bin/sh\necho julia\n", 0o755),
        // Not a program: nobody may run it.
        ("cargo", "#!/bin/sh\necho cargo 1.99.0\n", 0o644),
        // A descendant keeps the output open after the program has ended.
        ("lualatex", "#!/bin/sh\necho 1.2.3\n/bin/sleep 60 &\n", 0o755),
    ];
    let folder = write_scripts("doctor", &scripts);
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

/// Variables name a program with or without arguments, by a path with spaces too, and browsers one after the other.
#[cfg(unix)]
#[test]
fn variables_name_programs_with_spaces_and_arguments() {
    let scripts = [
        ("my rustc", "#!/bin/sh\necho rustc 99.1.0\n", 0o755),
        ("my cc", "#!/bin/sh\necho cc 14.2.0\n", 0o755),
        ("ccache", "#!/bin/sh\necho ccache 4.1.0\n", 0o755),
        ("my pages", "#!/bin/sh\n", 0o755),
    ];
    let folder = write_scripts("doctor with spaces", &scripts);
    let path = |name: &str| folder.join(name).display().to_string();
    let examine_with = |variables: &[(&str, &str)]| {
        examine(|command| {
            command.env_clear().env("PATH", &folder).envs(variables.iter().copied());
        })
    };
    let browsers = format!("no-such-browser:{} %s:other", path("my pages"));
    let options = format!("{} -O2", path("my cc"));
    let answer = examine_with(&[("RUSTC", &path("my rustc")), ("CC", &options), ("BROWSER", &browsers)]);
    for (name, program) in [
        ("Rust compiler", "my rustc"),
        ("C compiler", "my cc"),
        ("browser", "my pages"),
    ] {
        let check = requirement(&answer, name);
        assert_eq!(check["state"], "present", "{check}");
        assert_eq!(check["path"], path(program), "{check}");
    }
    // The colon separates nothing but browsers.
    let answer = examine_with(&[("CC", "ccache gcc"), ("RUSTC", "no-such-rustc:ccache")]);
    assert_eq!(requirement(&answer, "C compiler")["path"], path("ccache"));
    let rust = requirement(&answer, "Rust compiler");
    let remedy = rust["remedy"].as_str().expect("a remedy");
    assert!(
        rust["state"] == "missing" && remedy.contains("no-such-rustc:ccache"),
        "{rust}"
    );
}

/// Packages of an outdated Python are found. Where one is missing, Python is to be updated first.
#[cfg(unix)]
#[test]
fn packages_of_an_outdated_python_are_found() {
    let script = "#!/bin/sh\n\
        case \"$*\" in *--version*) echo Python 3.6.1;; *numpy*) echo 1.19.5;; *) exit 1;; esac\n";
    let folder = write_scripts("doctor-python", &[("python3", script, 0o755)]);
    let answer = examine(|command| {
        command.env_clear().env("PATH", &folder);
    });
    assert_eq!(requirement(&answer, "Python")["state"], "outdated");
    let numpy = requirement(&answer, "numpy in Python");
    assert_eq!(numpy["state"], "present", "{numpy}");
    assert_eq!(numpy["version"], "1.19.5", "{numpy}");
    let package = requirement(&answer, "modelmill in Python");
    let remedy = package["remedy"].as_str().expect("a remedy");
    assert!(
        package["state"] == "missing" && remedy.starts_with("Update Python"),
        "{package}"
    );
    // Without any Python, the remedy states that nothing was searched.
    let answer = examine(|command| {
        command.env_clear();
    });
    let package = requirement(&answer, "numpy in Python").to_string();
    assert!(package.contains("was not searched"), "{package}");
}

/// The folder for temporary files is present only if a file can be created in it, and none stays there.
#[cfg(unix)]
#[test]
fn the_temporary_folder_is_tested_by_a_file() {
    let folder = write_scripts("doctor-temporary", &[("file", "", 0o644)]);
    let check = |folder: &Path| {
        let answer = examine(|command| {
            command.env("TMPDIR", folder);
        });
        requirement(&answer, "temporary folder").clone()
    };
    assert_eq!(check(&folder)["state"], "present");
    assert_eq!(fs::read_dir(&folder).expect("a folder").count(), 1);
    assert_eq!(check(&folder.join("none"))["state"], "missing");
    assert_eq!(check(&folder.join("file"))["state"], "missing");
    if cfg!(target_os = "linux") {
        let fault = check(Path::new("/proc"));
        assert!(
            fault["state"] == "fails" && fault["remedy"].to_string().contains("TMPDIR"),
            "{fault}"
        );
    }
}
