//! What comes in has an end and goes nowhere else, and what goes out replaces a file as a whole or not at all.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use crate::common::{modelmill, ran};

/// A pendulum whose remarks make the file longer than a kilobyte; `{more}` comes behind its name.
fn pendulum(more: &str) -> String {
    let remarks = "# A remark that makes the file longer than what a small limit lets through.\n".repeat(40);
    format!(
        r#"schema = 1
name = "pendulum"
{more}
gravity = [0, "-g", 0]
{remarks}
[constants]
g = {{ value = 9.81, unit = "m/s^2" }}
[coordinates]
q = {{}}
[[frame]]
name = "arm"
on = "base"
modified_dh = {{ theta = "q" }}
[[part]]
on = "arm"
linear = {{ planar = "1" }}
[[drive]]
name = "motor"
joint = "q"
"#
    )
}

/// A new folder for one test.
fn folder(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("boundary").join(name);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).expect("a folder");
    path
}

fn written(folder: &Path, name: &str, text: &str) -> String {
    let path = folder.join(name);
    std::fs::write(&path, text).expect("written");
    path.to_str().expect("plain text").to_owned()
}

/// Runs the program in a shell that first says something else.
fn after(first: &str, args: &[&str]) -> Output {
    Command::new("sh")
        .args([
            "-c",
            &format!("{first}; exec \"$0\" \"$@\""),
            env!("CARGO_BIN_EXE_modelmill"),
        ])
        .args(args)
        .output()
        .expect("a shell")
}

fn says(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

const ADD: [&str; 4] = ["viscous_friction", "--at", "motor", "--in-place"];

#[test]
fn a_model_stays_whole_when_the_first_write_is_the_last() {
    let folder = folder("limit");
    let old = pendulum("");
    let model = written(&folder, "pendulum.toml", &old);
    let args = [&["add", model.as_str()][..], &ADD[..]].concat();
    // No byte may be written: the system ends the program at its first one, unless the signal is turned off.
    let killed = after("ulimit -f 0", &args);
    assert!(!killed.status.success());
    assert_eq!(std::fs::read_to_string(&model).expect("whole"), old);
    let refused = after("trap '' XFSZ; ulimit -f 1", &args);
    assert_eq!(refused.status.code(), Some(1), "{}", says(&refused));
    assert!(says(&refused).contains("cannot be written"), "{}", says(&refused));
    assert_eq!(std::fs::read_to_string(&model).expect("whole"), old);
    let parts = std::fs::read_dir(&folder).expect("a folder").filter_map(Result::ok);
    let parts = parts.filter(|entry| entry.path().extension().is_some_and(|end| end == "part"));
    // Only the program that was killed could not take its own away.
    assert!(parts.count() <= 1);
    assert_eq!(ran(&args).status, 0);
    assert!(
        std::fs::read_to_string(&model)
            .expect("whole")
            .contains("viscous_friction")
    );
}

/// A full disk, where the system lets us have one of our own.
#[test]
fn a_model_stays_whole_when_the_disk_is_full() {
    let folder = folder("full");
    let old = pendulum("");
    let model = written(&folder, "pendulum.toml", &old);
    let script = "mount -t tmpfs -o size=16k none \"$1\" || exit 77
        cp \"$2\" \"$1/m.toml\" && head -c 100000 /dev/zero > \"$1/filler\"
        \"$0\" add \"$1/m.toml\" viscous_friction --at motor --in-place; echo status $?
        cmp \"$2\" \"$1/m.toml\" && ls -A \"$1\"";
    let disk = folder.join("disk");
    std::fs::create_dir(&disk).expect("a folder");
    let output = Command::new("unshare")
        .args(["-m", "sh", "-c", script, env!("CARGO_BIN_EXE_modelmill")])
        .args([disk.as_path(), Path::new(&model)])
        .output();
    match output {
        Ok(output) if output.status.success() => {
            let out = String::from_utf8_lossy(&output.stdout);
            assert!(out.ends_with("status 1\nfiller\nm.toml\n"), "{out}\n{}", says(&output));
            assert!(says(&output).contains("make room"), "{}", says(&output));
        }
        // Without the right to mount there is a device that is always full.
        _ => println!("no small disk can be mounted here: only /dev/full is tried"),
    }
    if Path::new("/dev/full").exists() {
        let full = ran(&["equations", &model, "--out", "/dev/full"]);
        assert_eq!(full.status, 1);
        assert!(full.err.contains("make room"), "{}", full.err);
    }
}

#[test]
fn an_input_is_not_overwritten_however_it_is_reached() {
    let folder = folder("inputs");
    let base = written(&folder, "base.toml", &pendulum(""));
    let model = written(
        &folder,
        "model.toml",
        "schema = 1\nname = \"variant\"\nextends = \"base.toml\"\n",
    );
    let data = written(&folder, "report.html", "t,q,q_d,q_dd,motor\n0,0,0,0,1\n1,1,0,0,1\n");
    let hard = folder.join("hard.html");
    std::fs::hard_link(&data, &hard).expect("a link");
    let soft = folder.join("soft.toml");
    std::os::unix::fs::symlink("base.toml", &soft).expect("a link");
    let path = |path: &Path| path.to_str().expect("plain text").to_owned();
    let (hard, soft, here) = (path(&hard), path(&soft), path(&folder));
    for args in [
        &["report", &model, "--data", &data, "--out", &here][..],
        &["report", &model, "--data", &hard, "--out", &here],
        &["equations", &model, "--out", &base],
        &["equations", &model, "--out", &soft],
        &["generate", &model, "--out", &soft],
    ] {
        let before = [&base, &model, &data].map(|path| std::fs::read(path).expect("there"));
        let refused = ran(args);
        assert_ne!(refused.status, 0, "{args:?}");
        assert!(refused.err.contains("overwrit"), "{args:?}: {}", refused.err);
        let behind = [&base, &model, &data].map(|path| std::fs::read(path).expect("there"));
        assert!(before == behind, "{args:?}");
    }
}

#[test]
fn what_never_ends_has_an_end() {
    let folder = folder("endless");
    let model = written(&folder, "model.toml", &pendulum(""));
    let zero = written(&folder, "zero.toml", "schema = 1\nextends = \"/dev/zero\"\n");
    let kinds = written(&folder, "kinds.toml", &pendulum("library = \"/dev/zero\""));
    let pipe = folder.join("pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status().expect("mkfifo").success());
    let pipe = pipe.to_str().expect("plain text");
    let out = folder.join("out.toml");
    let out = out.to_str().expect("plain text");
    for args in [
        &["check", "/dev/zero"][..],
        &["check", &zero],
        &["check", &kinds],
        &["import", "/dev/zero", "--out", out],
        &["compare", &model, "--data", "/dev/zero"],
        &["compare", &model, "--data", &model, "--parameters", "/dev/zero"],
        &["interpret", &model, "--fit", "/dev/zero"],
    ] {
        let ran = ran(args);
        assert!([1, 2].contains(&ran.status), "{args:?}");
        assert!(!ran.err.contains('\0'), "{args:?}: {}", ran.err);
    }
    for args in [&["check", pipe][..], &["compare", &model, "--data", pipe]] {
        let ran = ran(args);
        assert_eq!(ran.status, 1, "{args:?}");
        assert!(ran.err.contains("nothing came through this pipe"), "{}", ran.err);
    }
    let mut child = modelmill(&["check", "/dev/stdin"])
        .stdin(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let mut stdin = child.stdin.take().expect("standard input");
    let line = vec![b'#'; 1 << 16];
    // It stops listening when there is more than any model holds.
    while stdin.write_all(&line).is_ok() {}
    let output = child.wait_with_output().expect("an end");
    assert_eq!(output.status.code(), Some(1));
    assert!(says(&output).contains("has more than"), "{}", says(&output));
}

/// A pipe is read once, so that the question whether it is a rig must not use it up.
#[cfg(unix)]
#[test]
fn a_model_may_come_from_a_pipe() {
    let mut child = modelmill(&["check", "/dev/stdin"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let mut stdin = child.stdin.take().expect("standard input");
    stdin.write_all(pendulum("").as_bytes()).expect("written");
    drop(stdin);
    let output = child.wait_with_output().expect("an end");
    assert_eq!(output.status.code(), Some(0), "{}", says(&output));
    let shown = String::from_utf8_lossy(&output.stdout);
    assert!(shown.contains("pendulum"), "{shown}");
}

/// A word of rigs in a model gives the fault of a model.
#[test]
fn a_model_with_a_body_is_no_rig() {
    let folder = folder("body");
    let model = written(&folder, "model.toml", &pendulum("").replace("[[part]]", "[[body]]"));
    let ran = ran(&["check", &model]);
    assert_eq!(ran.status, 1);
    assert!(ran.err.contains("unknown key `body`"), "{}", ran.err);
    assert!(!ran.err.contains("modified_dh"), "{}", ran.err);
}

#[test]
fn nothing_is_told_of_files_that_are_no_models() {
    let folder = folder("secrets");
    let secret = written(
        &folder,
        "secret.txt",
        "root:x:0:0\npassword = \"hunter2\"\n[token]\nvalue = 'abc123'\n",
    );
    let table = written(
        &folder,
        "secret.toml",
        "password = \"hunter2\"\n[token]\nvalue = 'abc123'\n",
    );
    for (i, named) in [
        "extends = \"secret.txt\"",
        "extends = \"secret.toml\"",
        "library = \"secret.txt\"",
        "library = \"secret.toml\"",
    ]
    .iter()
    .enumerate()
    {
        let model = written(&folder, &format!("model{i}.toml"), &pendulum(named));
        let ran = ran(&["check", &model]);
        assert_eq!(ran.status, 1, "{named}");
        assert!(ran.err.contains("something else"), "{named}: {}", ran.err);
        for word in ["root:x", "hunter2", "abc123", "token"] {
            assert!(
                !ran.err.contains(word) && !ran.out.contains(word),
                "{named}: {}",
                ran.err
            );
        }
    }
    let ran = ran(&["effects", "--library", &secret]);
    assert!(ran.status != 0 && !ran.err.contains("hunter2"), "{}", ran.err);
    assert!(Path::new(&table).exists());
}
