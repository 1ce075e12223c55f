//! Columns of recordings for a model: proposals that can be pasted, units in names, sampling rates, and shared columns.

use std::fmt::Write as _;

use serde_json::Value;

use crate::common::{json, model, printed, ran, refused, run, scratch};

/// Samples of a bundled recording that are used, so that tests are quick.
const SAMPLES: usize = 700;

/// The start of a bundled recording as `t`, two positions, two rates and two forces, in SI units.
fn samples() -> Vec<[f64; 7]> {
    let text = std::fs::read_to_string(run("plain-check.csv")).expect("a bundled recording");
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let names = [
        "t",
        "theta1",
        "theta2",
        "theta1_d",
        "theta2_d",
        "spindle_left",
        "spindle_right",
    ];
    let places = names.map(|name| header.iter().position(|other| *other == name).expect("a column"));
    let rows = lines.take(SAMPLES).map(|line| {
        let fields: Vec<f64> = line.split(',').map(|field| field.parse().expect("a number")).collect();
        places.map(|place| fields[place])
    });
    rows.collect()
}

/// A recording with other names, whose columns are functions of the samples.
fn written(name: &str, header: &str, row: impl Fn(&[f64; 7]) -> Vec<f64>) -> String {
    let mut text = header.to_owned();
    for one in samples() {
        let fields: Vec<String> = row(&one).iter().map(f64::to_string).collect();
        writeln!(text, "{}", fields.join(",")).expect("a text grows");
    }
    let path = scratch(name);
    std::fs::write(&path, text).expect("written");
    path
}

/// The model with a table of columns at its end.
fn model_with(name: &str, table: &str) -> String {
    let text = std::fs::read_to_string(model("spidermill.toml")).expect("a bundled model");
    let path = scratch(name);
    std::fs::write(&path, format!("{text}\n{table}\n")).expect("written");
    path
}

/// The error of a model for a recording, in percent.
fn error_of(args: &[&str]) -> f64 {
    let found = json(&[&["compare"], args, &["--json"]].concat());
    found["nrms"].as_f64().unwrap_or_else(|| panic!("{found}"))
}

/// The part of a text from `[recording.columns]` on.
fn table_of(text: &str) -> String {
    let at = text.find("[recording.columns]").unwrap_or_else(|| panic!("{text}"));
    text[at..].to_owned()
}

#[test]
fn a_proposal_can_be_pasted_into_the_model() {
    let plain = written(
        "plain.csv",
        "t,theta1,theta2,theta1_d,theta2_d,spindle_left,spindle_right\n",
        |x| x.to_vec(),
    );
    let spidermill = model("spidermill.toml");
    let expected = error_of(&[&spidermill, "--data", &plain]);
    let degrees = 180.0 / std::f64::consts::PI;
    // Other names, units in brackets and behind names, another order, and signals that no model reads.
    let other = written(
        "other.csv",
        "temperature1,F_right [kN],F_left [kN],angle2 [deg],angle1 [deg],speed1,speed2,target_angle1 [deg],stamp_ms\n",
        |[t, q1, q2, v1, v2, left, right]| {
            let (speed1, speed2) = (v1 * degrees, v2 * degrees);
            vec![
                40.0,
                right / 1e3,
                left / 1e3,
                q2 * degrees,
                q1 * degrees,
                speed1,
                speed2,
                q1 * degrees + 1.0,
                t * 1e3,
            ]
        },
    );
    let text = printed(&["recordings", &other, "--model", &spidermill]);
    let table = table_of(&text);
    for line in [
        "t = \"stamp_ms [ms]\"",
        "theta1 = \"angle1 [deg]\"",
        "theta1_d = \"speed1 [deg/s]\"",
        "spindle_left = \"F_left [kN]\"",
    ] {
        assert!(table.contains(line), "{line}: {table}");
    }
    let completed = model_with("pasted.toml", &table);
    let found = error_of(&[&completed, "--data", &other]);
    assert!((found / expected - 1.0).abs() < 1e-3, "{found} instead of {expected}");
    let object = json(&["recordings", &other, "--model", &spidermill, "--json"]);
    let proposal = &object["recordings"][0]["proposal"];
    assert_eq!(proposal["columns"].as_array().map(Vec::len), Some(7), "{proposal}");
    assert_eq!(proposal["missing"].as_array().map(Vec::len), Some(0), "{proposal}");
}

/// Without names the forces follow from the model, and are marked as uncertain.
#[test]
fn forces_without_names_are_paired_by_the_model() {
    let bare = written("bare.csv", "", |[t, q1, q2, v1, v2, left, right]| {
        vec![*t, *q1, *q2, *v1, *v2, *right, *left]
    });
    let text = printed(&["recordings", &bare, "--model", &model("spidermill.toml")]);
    let table = table_of(&text);
    for line in [
        "t = \"column_1\"",
        "theta1 = \"column_2\"",
        "spindle_left = \"column_7\"",
        "spindle_right = \"column_6\"",
    ] {
        assert!(table.contains(line), "{line}: {table}");
    }
    assert!(table.contains("uncertain: the model explains"), "{table}");
}

/// A column with the name of the model is that one, and a wrong sign is remarked where nominal forces show it.
#[test]
fn equal_names_are_certain_and_wrong_signs_are_remarked() {
    let turned = written(
        "turned.csv",
        "t,theta1,theta2,spindle_left,spindle_right\n",
        |[t, q1, q2, _, _, left, right]| vec![*t, *q1, *q2, *left, -right],
    );
    let table = table_of(&printed(&["recordings", &turned, "--model", &model("spidermill.toml")]));
    let line = |name: &str| {
        table
            .lines()
            .find(|line| line.starts_with(name))
            .expect("a line")
            .to_owned()
    };
    assert!(
        line("theta2").contains("the same name") && !line("theta2").contains("uncertain"),
        "{table}"
    );
    assert!(line("spindle_right").contains("its sign is opposite"), "{table}");
    assert!(!line("spindle_left").contains("its sign is opposite"), "{table}");
}

/// What is not in the recording is missing, and not taken from another column.
#[test]
fn names_without_a_column_are_missing() {
    let part = written("part.csv", "t,theta1,F_left\n", |[t, q1, _, _, _, left, _]| {
        vec![*t, *q1, *left]
    });
    let table = table_of(&printed(&["recordings", &part, "--model", &model("spidermill.toml")]));
    assert!(
        table.contains("# theta2 = \"...\"") && table.contains("# spindle_right = \"...\""),
        "{table}"
    );
    assert!(
        !table.contains("\ntheta2 =") && !table.contains("\nspindle_right ="),
        "{table}"
    );
}

#[test]
fn units_in_the_header_need_no_mapping() {
    let plain = written(
        "si.csv",
        "t,theta1,theta2,theta1_d,theta2_d,spindle_left,spindle_right\n",
        |x| x.to_vec(),
    );
    let degrees = 180.0 / std::f64::consts::PI;
    let header = "t,theta1,theta2,theta1_d,theta2_d,spindle_left,spindle_right\nms,deg,deg,rad/s,rad/s,N,kN\n";
    let units = written("units.csv", header, |[t, q1, q2, v1, v2, left, right]| {
        vec![t * 1e3, q1 * degrees, q2 * degrees, *v1, *v2, *left, right / 1e3]
    });
    let spidermill = model("spidermill.toml");
    let [expected, found] = [&plain, &units].map(|data| error_of(&[&spidermill, "--data", data]));
    assert!((found / expected - 1.0).abs() < 1e-6, "{found} instead of {expected}");
    // A unit that does not fit is reported, because the numbers are not converted.
    let wrong = written(
        "current.csv",
        "t,theta1,theta2,spindle_left (A),spindle_right\n",
        |[t, q1, q2, _, _, left, right]| vec![*t, *q1, *q2, *left, *right],
    );
    let says = ran(&["compare", &spidermill, "--data", &wrong]).err;
    assert!(
        says.contains("the unit A, which is no unit of `spindle_left`"),
        "{says}"
    );
}

#[test]
fn a_rate_replaces_times() {
    let spidermill = model("spidermill.toml");
    let plain = written(
        "timed.csv",
        "t,theta1,theta2,spindle_left,spindle_right\n",
        |[t, q1, q2, _, _, left, right]| vec![*t, *q1, *q2, *left, *right],
    );
    let untimed = written(
        "untimed.csv",
        "theta1,theta2,spindle_left,spindle_right\n",
        |[_, q1, q2, _, _, left, right]| vec![*q1, *q2, *left, *right],
    );
    let all = samples();
    let rate = (1.0 / (all[1][0] - all[0][0])).round().to_string();
    let says = refused(1, &["compare", &spidermill, "--data", &untimed]);
    assert!(says.contains("no column `t`") && says.contains("`--rate HZ`"), "{says}");
    let expected = error_of(&[&spidermill, "--data", &plain]);
    let found = error_of(&[&spidermill, "--data", &untimed, "--rate", &rate]);
    assert!((found / expected - 1.0).abs() < 1e-2, "{found} instead of {expected}");
    let both = refused(
        2,
        &[
            "compare",
            &spidermill,
            "--data",
            &plain,
            "--rate",
            &rate,
            "--map",
            "t=t",
        ],
    );
    assert!(both.contains("give one of the two"), "{both}");
}

/// Two names of the model for one column are a copy and no error.
#[test]
fn two_names_share_a_column() {
    let spidermill = model("spidermill.toml");
    let one = written("shared.csv", "t,a,F_left,F_right\n", |[t, q1, _, _, _, left, right]| {
        vec![*t, *q1, *left, *right]
    });
    let maps = ["theta1=a", "theta2=a", "spindle_left=F_left", "spindle_right=F_right"];
    let mut args = vec!["compare", &spidermill, "--data", &one];
    for map in &maps {
        args.extend(["--map", map]);
    }
    let found = ran(&args);
    assert!(!found.err.contains("renamed twice"), "{}", found.err);
    assert!(
        found
            .err
            .contains("`theta1` and `theta2` are both read from the column `a`"),
        "{}",
        found.err
    );
}

/// An arm as `import` writes it: coordinates with the names of joints.
const JOINTS: &str = r#"
schema = 1
name = "arm"
gravity = [0, "-g", 0]
constants = { g = { value = 9.81, unit = "m/s^2" }, l = { value = 0.4, unit = "m" } }
coordinates = { shoulder_pan_joint = {}, joint_2 = {} }
frame = [
  { name = "upper", on = "base", modified_dh = { theta = "shoulder_pan_joint" } },
  { name = "lower", on = "upper", modified_dh = { theta = "joint_2", a = "l" } },
]
part = [{ on = "upper", linear = { planar = "1" } }, { on = "lower", linear = { planar = "2" } }]
drive = [
  { name = "shoulder_pan_joint_drive", joint = "shoulder_pan_joint" },
  { name = "joint_2_drive", joint = "joint_2" },
]
"#;

/// A motion of that arm: time, positions, velocities, torques.
fn rows() -> Vec<[f64; 7]> {
    let row = |k: u32| {
        let t = 0.01 * f64::from(k);
        let q = [(2.0 * t).sin(), (3.1 * t).cos() - 1.0];
        let v = [2.0 * (2.0 * t).cos(), -3.1 * (3.1 * t).sin()];
        let a = [-4.0 * (2.0 * t).sin(), -9.61 * (3.1 * t).cos()];
        let far = 0.3 * (a[0] + a[1]) + 2.0 * 9.81 * (q[0] + q[1]).cos();
        [t, q[0], q[1], v[0], v[1], 0.8 * a[0] + far + 5.0 * q[0].cos(), far]
    };
    (0..500).map(row).collect()
}

/// The recording with given names of columns.
fn table(header: &str, first: f64) -> String {
    let mut text = format!("{header}\n");
    for [t, more @ ..] in rows() {
        let more: Vec<String> = more.iter().map(ToString::to_string).collect();
        writeln!(text, "{},{}", first * t, more.join(",")).expect("a text grows");
    }
    text
}

/// Values of a fit to a recording, and what the program says.
fn fitted(name: &str, header: &str, first: f64, options: &[&str]) -> (Vec<f64>, String) {
    let (model, data) = (scratch(&format!("{name}.toml")), scratch(&format!("{name}.csv")));
    std::fs::write(&model, JOINTS).expect("written");
    std::fs::write(&data, table(header, first)).expect("written");
    let mut arguments = vec!["identify", &model, "--data", &data, "--json"];
    arguments.extend(options);
    let ran = ran(&arguments);
    assert_eq!(ran.status, 0, "{header}: {}", ran.err);
    let fit: Value = serde_json::from_str(&ran.out).expect("JSON");
    let parameters = fit["parameters"].as_array().expect("a list").iter();
    (
        parameters.map(|one| one["value"].as_f64().expect("a number")).collect(),
        ran.err,
    )
}

/// Whether two fits are equal, but for rounding of the times.
fn are_equal(one: &[f64], other: &[f64]) -> bool {
    one.len() == other.len()
        && one
            .iter()
            .zip(other)
            .all(|(a, b)| (a - b).abs() < 1e-6 * (1.0 + a.abs()))
}

#[test]
fn columns_that_name_joints_need_no_mapping() {
    let plain = "t,shoulder_pan_joint,joint_2,shoulder_pan_joint_d,joint_2_d,shoulder_pan_joint_drive,joint_2_drive";
    let (expected, _) = fitted("joints-plain", plain, 1.0, &[]);
    for (k, (header, first)) in [
        (
            "t,joint_states.position.shoulder_pan_joint,joint_states.position.joint_2,joint_states.velocity.shoulder_pan_joint,\
             joint_states.velocity.joint_2,joint_states.effort.shoulder_pan_joint,joint_states.effort.joint_2",
            1.0,
        ),
        (
            "time,shoulder_pan_joint.position,joint_2.position,shoulder_pan_joint.velocity,joint_2.velocity,\
             shoulder_pan_joint.effort,joint_2.effort",
            1.0,
        ),
        (
            "time_ms,q_shoulder_pan_joint,q_joint_2,dq_shoulder_pan_joint,dq_joint_2,tau_shoulder_pan_joint,tau_joint_2",
            1000.0,
        ),
    ]
    .into_iter()
    .enumerate()
    {
        let (found, says) = fitted(&format!("joints-{k}"), header, first, &[]);
        assert!(are_equal(&found, &expected), "{header}: {found:?} for {expected:?}");
        assert!(says.contains("by the names of joints"), "{says}");
    }
}

#[test]
fn a_column_that_may_be_another_signal_is_not_taken() {
    let model = scratch("joints-doubt.toml");
    std::fs::write(&model, JOINTS).expect("written");
    for (k, header) in [
        // Two topics have the same joints.
        "t,a.position.shoulder_pan_joint,b.position.shoulder_pan_joint,position.joint_2,x,y,z",
        // Set points, motor positions and numbers without names are no positions of joints.
        "t,desired.position.shoulder_pan_joint,motor_position.joint_2,position_2,x,y,z",
    ]
    .into_iter()
    .enumerate()
    {
        let data = scratch(&format!("joints-doubt-{k}.csv"));
        std::fs::write(&data, table(header, 1.0)).expect("written");
        let refused = ran(&["identify", &model, "--data", &data]);
        assert_ne!(refused.status, 0);
        assert!(refused.err.contains("shoulder_pan_joint"), "{}", refused.err);
    }
}

#[test]
fn a_mapping_file_gives_what_its_lines_give_as_options() {
    let header = "clock,a,b,c,d,e,f";
    let pairs = [
        ("t", "clock [ms]"),
        ("shoulder_pan_joint", "a"),
        ("joint_2", "b"),
        ("shoulder_pan_joint_d", "c"),
        ("joint_2_d", "d"),
        ("shoulder_pan_joint_drive", "e"),
        ("joint_2_drive", "f"),
    ];
    let maps: Vec<String> = pairs
        .iter()
        .map(|(ours, theirs)| format!("--map={ours}={theirs}"))
        .collect();
    let maps: Vec<&str> = maps.iter().map(String::as_str).collect();
    let (expected, _) = fitted("mapped", header, 1000.0, &maps);
    // The first line is wrong in the file, and right as an option.
    let lines: Vec<String> = (pairs.iter().skip(1))
        .map(|(ours, theirs)| format!("{ours} = \"{theirs}\"\n"))
        .collect();
    let file = scratch("mapping.toml");
    std::fs::write(&file, format!("[recording.columns]\nt = \"clock\"\n{}", lines.concat())).expect("written");
    let (found, _) = fitted("mapped-by-file", header, 1000.0, &["--mapping", &file, maps[0]]);
    assert!(are_equal(&found, &expected), "{found:?} for {expected:?}");
    std::fs::write(&file, lines.concat()).expect("written");
    let (found, _) = fitted("mapped-without-header", header, 1000.0, &["--mapping", &file, maps[0]]);
    assert!(are_equal(&found, &expected), "{found:?} for {expected:?}");
    std::fs::write(&file, "joint_2 = 3\n").expect("written");
    let refused = ran(&["identify", "arm.toml", "--data", "run.csv", "--mapping", &file]);
    assert_eq!(refused.status, 2);
    assert!(refused.err.contains("[recording.columns]"), "{}", refused.err);
}
