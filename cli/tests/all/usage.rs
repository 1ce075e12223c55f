//! What goes wrong is said with its place and what to do; exit status 1 for the input, 2 for usage.

use std::fmt::Write as _;
use std::io::Read;
use std::process::Stdio;

use crate::common::{json, model, modelmill, number, printed, ran, refused, run, scratch};

#[test]
fn wrong_usage_ends_with_two() {
    for args in [
        &[][..],
        &["nonsense"],
        &["check"],
        &["check", "a.toml", "b.toml"],
        &["identify", &model("emps.toml")],
        &["equations", &model("emps.toml"), "--format", "pdf"],
        &["evaluate", "m.toml", "--data", "r.csv", "--decimate", "0"],
        &["evaluate", "m.toml", "--data", "r.csv", "--cutoff", "-3"],
        &["evaluate", "m.toml", "--data", "r.csv", "--trim", "a"],
        &["evaluate", "m.toml", "--data", "r.csv", "--trim", "-5"],
        &["evaluate", "m.toml", "--data", "r.csv", "--order", "0"],
        &["evaluate", "m.toml", "--data", "r.csv", "--order", "21"],
        &["evaluate", "m.toml", "--data", "r.csv", "--map", "theta1"],
        &["completions", "tcsh9"],
    ] {
        let says = refused(2, args);
        assert!(says.contains("Usage") || says.contains("--help"), "{args:?}: {says}");
        // Dashes would make the number a second model file.
        assert!(!says.contains("'-- -"), "{args:?}: {says}");
    }
    let says = refused(
        2,
        &[
            "evaluate",
            &model("spidermill.toml"),
            "--data",
            &run("plain-fit.csv"),
            "--map",
            "gamma1=theta1",
        ],
    );
    assert!(says.contains("passive") && says.contains("theta1_dd"), "{says}");
}

#[test]
fn every_command_helps_with_an_example() {
    for command in [
        "check",
        "diff",
        "equations",
        "generate",
        "evaluate",
        "identify",
        "compare",
        "verify",
        "simulate",
        "reduce",
        "import",
        "export",
        "doctor",
        "manual",
        "completions",
        "tour",
    ] {
        let help = printed(&[command, "--help"]);
        assert!(
            help.contains("Example") && help.contains(&format!("modelmill {command}")),
            "{help}"
        );
    }
    assert!(printed(&["--version"]).starts_with("modelmill "));
}

#[test]
fn a_missing_model_names_those_nearby() {
    let says = refused(1, &["check", &model("spidermil.toml")]);
    assert!(
        says.contains("no file") && says.contains("spidermill-paper.toml"),
        "{says}"
    );
    let says = refused(
        1,
        &[
            "check",
            &crate::common::workspace("model-spec/models").display().to_string(),
        ],
    );
    assert!(says.contains("is a folder") && says.contains("panda.toml"), "{says}");
}

#[test]
fn a_faulty_model_is_marked_where_it_is_wrong() {
    let text = std::fs::read_to_string(model("two_link.toml")).expect("a model");
    let file = scratch("broken.toml");
    std::fs::write(&file, text.replace("unit = \"m\"", "unit = \"kg\"")).expect("written");
    let says = refused(1, &["check", &file]);
    assert!(
        says.contains("broken.toml:") && says.contains('^') && says.contains("help"),
        "{says}"
    );
    let ran = ran(&["check", &file, "--json"]);
    assert_eq!(ran.status, 1);
    let object: serde_json::Value = serde_json::from_str(&ran.out).expect("one JSON object");
    assert_eq!(object["valid"], false);
    assert!(object["diagnostics"][0]["line"].is_u64());
}

#[test]
fn a_faulty_recording_is_named_with_its_line() {
    let file = scratch("bad.csv");
    let head = "t,theta1,theta2,theta1_d,theta2_d,theta1_dd,theta2_dd,spindle_left,spindle_right\n";
    let compare = |text: &str| {
        std::fs::write(&file, text).expect("written");
        refused(1, &["compare", &model("spidermill.toml"), "--data", &file])
    };
    let says = compare(&format!("{head}0,1.8,1.34,0,0,0,0,1,2\n0.1,1.8,x,0,0,0,0,1,2\n"));
    assert!(says.contains("bad.csv, line 3") && says.contains("theta2"), "{says}");
    let says = compare(&head.replace("theta2,", "theta_2,"));
    assert!(says.contains("bad.csv"), "{says}");
    let says = compare("");
    assert!(says.contains("empty"), "{says}");
    let says = refused(1, &["compare", &model("spidermill.toml"), "--data", "no/such.csv"]);
    assert!(says.contains("no/such.csv"), "{says}");
    let says = refused(
        1,
        &[
            "compare",
            &model("spidermill.toml"),
            "--data",
            &run("plain-fit.csv"),
            "--parameters",
            "no/such.json",
        ],
    );
    assert!(
        says.contains("no/such.json") && says.contains("modelmill identify"),
        "{says}"
    );
}

#[test]
fn a_pose_out_of_reach_names_time_and_line() {
    let mut text = "t,theta1,theta2,theta1_d,theta2_d,theta1_dd,theta2_dd\n".to_owned();
    for i in 0..9000 {
        let t = f64::from(i) * 0.002;
        // From sample 8000 on the cranks point away from each other.
        let (a, b) = if i < 8000 { (1.8, 1.34) } else { (3.1, 0.0) };
        let _ = writeln!(text, "{t},{a},{b},0,0,0,0");
    }
    let file = scratch("reach.csv");
    std::fs::write(&file, text).expect("written");
    let says = refused(1, &["evaluate", &model("spidermill.toml"), "--data", &file]);
    assert!(
        says.contains("reach.csv, line 8002 (t = 16 s)")
            && says.contains("cannot close")
            && says.contains("theta1 = 3.1")
            && says.contains("--map"),
        "{says}"
    );
}

#[test]
fn columns_are_found_by_mapping() {
    let text = std::fs::read_to_string(run("plain-check.csv")).expect("a recording");
    let file = scratch("renamed.csv");
    let renamed =
        text.replacen("t,theta1,theta2", "time,left,right", 1)
            .replacen("theta1_d,theta2_d", "left_v,right_v", 1);
    std::fs::write(&file, renamed).expect("written");
    let compared = json(&[
        "compare",
        &model("spidermill.toml"),
        "--data",
        &file,
        "--map",
        "t=time",
        "--map",
        "theta1=left",
        "--map",
        "theta2=right",
        "--map",
        "theta1_d=left_v",
        "--map",
        "theta2_d=right_v",
        "--json",
    ]);
    assert!(number(&compared, "/nrms") < 1e-5);
}

/// Rates and accelerations are prepared where a recording has positions only.
#[test]
fn positions_alone_will_do() {
    let compared = json(&[
        "compare",
        &model("spidermill.toml"),
        "--data",
        &run("plain-check.csv"),
        "--derivatives",
        "positions",
        "--json",
    ]);
    let nrms = number(&compared, "/nrms");
    println!("positions only: nrms {nrms:.2e}");
    assert!(nrms < 1e-2);
    let notes = compared["data"].as_array().expect("notes");
    assert!(
        notes
            .iter()
            .any(|n| { n["says"].as_str().is_some_and(|s| s.contains("Butterworth")) })
    );
}

#[test]
fn an_input_is_never_overwritten() {
    let file = scratch("precious.toml");
    std::fs::copy(model("two_link.toml"), &file).expect("a copy");
    let says = refused(2, &["generate", &file, "--out", &file]);
    assert!(says.contains("overwrite"), "{says}");
    let says = refused(2, &["equations", &file, "--out", &file]);
    assert!(says.contains("overwrite"), "{says}");
    let data = scratch("precious.csv");
    std::fs::copy(run("plain-fit.csv"), &data).expect("a copy");
    let says = refused(
        2,
        &["evaluate", &model("spidermill.toml"), "--data", &data, "--out", &data],
    );
    assert!(says.contains("overwrite"), "{says}");
    let says = refused(1, &["generate", &file, "--out", "/no/such/folder/a.rs"]);
    assert!(says.contains("cannot be written"), "{says}");
}

/// Slips of the hand get an answer that says what to give instead.
#[test]
fn what_stands_in_the_wrong_place_is_named() {
    let arm = model("two_link.toml");
    for command in [
        &["equations", &arm][..],
        &["generate", &arm],
        &["generate", &arm, "--language", "c"],
        &["report", &arm, "--data", "none.csv"],
    ] {
        let says = refused(2, &[command, &["--out", "-"]].concat());
        assert!(says.contains("--out -: the name of a file"), "{says}");
    }
    let data = run("plain-fit.csv");
    let spidermill = model("spidermill.toml");
    let says = refused(1, &["report", &spidermill, "--data", &data, "--out", &data]);
    assert!(
        says.contains("this is a file") && says.contains("name of a folder"),
        "{says}"
    );
    let compare = ["compare", &spidermill, "--data", &data, "--parameters", &data];
    let says = refused(1, &compare);
    assert!(
        says.contains("is not a fit") && says.contains("pass recordings to `--data`"),
        "{says}"
    );
    let out = scratch("no-rig.csv");
    let says = refused(1, &["simulate", &arm, "--trajectory", &data, "--out", &out]);
    assert!(
        says.contains("is a model file; a rig file is expected") && says.contains("evaluate"),
        "{says}"
    );
    let file = scratch("folder.toml");
    std::fs::write(&file, "schema = 1\nname = \"x\"\nextends = \".\"\n").expect("written");
    let says = refused(1, &["check", &file]);
    assert!(
        says.contains("`.` is a folder") && says.contains("name the file in it"),
        "{says}"
    );
}

#[test]
fn a_reader_that_goes_away_is_no_error() {
    let mut child = modelmill(&["evaluate", &model("spidermill.toml"), "--data", &run("plain-fit.csv")])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    drop(child.stdout.take());
    let mut err = String::new();
    let mut stderr = child.stderr.take().expect("standard error");
    stderr.read_to_string(&mut err).expect("UTF-8");
    assert!(child.wait().expect("an end").success());
    assert_eq!(err, "");
}

#[test]
fn an_unknown_part_is_answered_with_the_parts_of_the_model() {
    let file = model("spidermill-paper.toml");
    let says = refused(1, &["equations", &file, "--balances", "nothing"]);
    assert!(says.contains("crank_left") && says.contains("coupler_right"), "{says}");
}

/// A file name with line ends must not look like messages of the program.
#[cfg(unix)]
#[test]
fn names_of_files_stay_on_one_line() {
    let missing = "none\nerror: all is well\nwarning: x.csv";
    for args in [
        vec!["check", missing],
        vec!["recordings", missing],
        vec!["generate", missing, "--out", missing],
    ] {
        let ran = crate::common::ran(&args);
        assert_ne!(ran.status, 0);
        let forged = ran
            .err
            .lines()
            .skip(1)
            .find(|line| line.starts_with("error: all") || line.starts_with("warning: x"));
        assert_eq!(forged, None, "{}", ran.err);
    }
}

/// A disk without room is an error of help and version, too.
#[cfg(target_os = "linux")]
#[test]
fn help_that_cannot_be_written_is_an_error() {
    for args in [["help"], ["--version"]] {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let ended = crate::common::modelmill(&args).stdout(full).output().unwrap();
        assert_eq!(ended.status.code(), Some(1), "{args:?}");
        assert!(String::from_utf8_lossy(&ended.stderr).contains("standard output cannot be written"));
    }
}

/// The reference in the guide is what the program prints. `UPDATE_REFERENCE=1` writes it.
#[test]
fn the_reference_of_the_guide_is_that_of_the_program() {
    let path = crate::common::workspace("docs/guide/src/commands.md");
    let expected = printed(&["manual"]);
    if std::env::var_os("UPDATE_REFERENCE").is_some() {
        std::fs::write(&path, &expected).expect("written");
    }
    let found = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        found == expected,
        "docs/guide/src/commands.md is old; write it with UPDATE_REFERENCE=1 cargo test --workspace --test all -- reference"
    );
    // Every flag that a help lists is in the reference.
    for command in ["identify", "excite", "diagnose", "import", "manual"] {
        let help = printed(&[command, "--help"]);
        let flags = help.lines().map(str::trim_start).filter(|line| line.starts_with("--"));
        for flag in flags.filter_map(|line| line.split([' ', '[']).next()) {
            assert!(expected.contains(&format!("| `{flag}")), "{command} {flag}");
        }
    }
}

/// One manual page for the program and one for each command, each with the flags of its command.
#[test]
fn manual_pages_are_written_for_all_commands() {
    let folder = std::path::PathBuf::from(crate::common::scratch("man"));
    let path = folder.display().to_string();
    printed(&["manual", "--out", &path]);
    let help = printed(&["help"]);
    let commands = help.split("Commands:\n").nth(1).expect("a list of commands");
    let names = commands
        .lines()
        .take_while(|line| !line.is_empty())
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help");
    let mut pages = 0;
    for name in names {
        let page = std::fs::read_to_string(folder.join(format!("modelmill-{name}.1"))).expect("a page");
        let title = format!(".TH MODELMILL-{} 1", name.to_uppercase());
        assert!(page.contains(&title), "{page}");
        pages += 1;
    }
    assert!(pages > 20, "{pages} pages");
    let identify = std::fs::read_to_string(folder.join("modelmill-identify.1")).expect("a page");
    // A hyphen of a flag is escaped in manual pages.
    assert!(identify.contains("\\-\\-leave\\-out\\-events"), "{identify}");
}
