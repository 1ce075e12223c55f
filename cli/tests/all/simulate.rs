//! `simulate`: a rig stands in for the hardware, and what is wrong is said with its place.

use std::fmt::Write as _;

use crate::common::{json, model, number, ran, refused, run, scratch, workspace};

fn rig(name: &str) -> String {
    workspace("model-spec/rigs").join(name).display().to_string()
}

/// A run of the rig is a recording: the reduced model, which shares no mechanics with it, explains it without
/// identification.
#[test]
fn the_reduced_model_explains_a_run_of_the_rig() {
    let out = scratch("simulated.csv");
    let told = json(&[
        "simulate",
        &rig("spidermill-full.toml"),
        "--trajectory",
        &run("plain-check.csv"),
        "--out",
        &out,
        "--json",
    ]);
    assert_eq!(told["samples"], 3595);
    assert_eq!(told["columns"][8], "spindle_right");
    let compared = json(&["compare", &model("spidermill.toml"), "--data", &out, "--json"]);
    let nrms = number(&compared, "/nrms");
    println!("rig and reduced model: nrms {nrms:.2e}");
    assert!(nrms < 1e-9, "{nrms}");
    let compared = json(&["compare", &model("spidermill-paper.toml"), "--data", &out, "--json"]);
    assert!(number(&compared, "/nrms") > 0.01, "the placement of m4 shows");
}

#[test]
fn a_seed_makes_the_same_noise_again() {
    let file = scratch("noisy.toml");
    let parent = workspace("model-spec/rigs/spidermill-full.toml");
    std::fs::write(
        &file,
        format!(
            "schema = 1\nname = \"noisy\"\nextends = '{}'\n[[encoder]]\nof = [\"theta1\", \"theta2\"]\nbits = 20\n\
             [[force_sensor]]\nof = [\"spindle_left\"]\nnoise = 1.0\n",
            parent.canonicalize().expect("the rig").display()
        ),
    )
    .expect("written");
    let short: Vec<String> = std::fs::read_to_string(run("plain-fit.csv"))
        .expect("a recording")
        .lines()
        .take(60)
        .map(str::to_owned)
        .collect();
    let trajectory = scratch("short.csv");
    std::fs::write(&trajectory, short.join("\n")).expect("written");
    let made = |seed: &str| {
        let out = scratch("noisy.csv");
        let ran = ran(&[
            "simulate",
            &file,
            "--trajectory",
            &trajectory,
            "--out",
            &out,
            "--seed",
            seed,
        ]);
        assert_eq!((ran.status, ran.out.as_str()), (0, ""), "{}", ran.err);
        assert!(ran.err.contains("positions only"), "{}", ran.err);
        std::fs::read_to_string(out).expect("a run")
    };
    let first = made("5");
    assert!(first.starts_with("t,theta1,theta2,spindle_left,spindle_right\n"));
    assert_eq!(first, made("5"));
    assert_ne!(first, made("6"));
}

#[test]
fn faults_have_their_places() {
    let out = scratch("never.csv");
    let simulate =
        |rig: &str, trajectory: &str| refused(1, &["simulate", rig, "--trajectory", trajectory, "--out", &out]);
    let says = simulate("no/such.toml", &run("plain-fit.csv"));
    assert!(says.contains("no/such.toml") && says.contains("rig file"), "{says}");
    let says = simulate(&model("two_link.toml"), &run("plain-fit.csv"));
    assert!(
        says.contains("two_link.toml is a model file") && says.contains("`modelmill evaluate`"),
        "{says}"
    );
    let says = simulate(&rig("spidermill-full.toml"), "no/such.csv");
    assert!(says.contains("no/such.csv"), "{says}");

    let file = scratch("trajectory.csv");
    let along = |text: &str| {
        std::fs::write(&file, text).expect("written");
        simulate(&rig("spidermill-full.toml"), &file)
    };
    let says = along("t,theta1\n0,1.8\n");
    assert!(says.contains("theta2") && says.contains("trajectory.csv"), "{says}");
    let says = along("t,theta1,theta2\n0,1.8,1.34\n0.1,1.8,oops\n");
    assert!(says.contains("line 3") && says.contains("theta2"), "{says}");
    let says = along("t,theta1,theta2\n0,1.8,1.34\n0,1.8,1.34\n");
    assert!(says.contains("line 3") && says.contains("not later"), "{says}");
    let says = along("t,theta1,theta2\n0,1.8,1.34\n0.1,1.8,1.34\n");
    assert!(says.contains("at least 5 samples"), "{says}");
    let mut text = "t,theta1,theta2,theta1_d,theta2_d,theta1_dd,theta2_dd\n".to_owned();
    for i in 0..40 {
        let _ = writeln!(text, "{},{},1.34,0,0,0,0", f64::from(i) * 0.1, 1.8 + 0.1 * f64::from(i));
    }
    let says = along(&text);
    assert!(
        says.contains("line ") && says.contains("theta1 = ") && says.contains("do not close"),
        "{says}"
    );
    assert!(!std::path::Path::new(&out).exists(), "nothing is written when it fails");

    let says = refused(
        2,
        &[
            "simulate",
            &rig("spidermill-full.toml"),
            "--trajectory",
            &file,
            "--out",
            &file,
        ],
    );
    assert!(says.contains("overwrite"), "{says}");
    let says = refused(2, &["simulate", &rig("spidermill-full.toml"), "--trajectory", &file]);
    assert!(says.contains("--out"), "{says}");
}

/// The servo arm that MuJoCo simulated moves as its log says, under its commands alone: a wrong force in the log is not used.
#[test]
fn commands_move_the_model_whatever_forces_the_log_has() {
    let arm = scratch("servo_arm.toml");
    let recordings = workspace("recordings/servo-arm");
    let description = recordings.join("servo_arm.xml").display().to_string();
    ran(&["import", &description, "--known-bodies", "--out", &arm]);
    // What the machine has and the description lacks, see lab/servo-plant/servo_arm.py.
    let mut text = std::fs::read_to_string(&arm).expect("the model");
    for (old, new) in [
        (
            "shoulder_drive\"]\nparameters = { Fv = { nominal = 0.05",
            "shoulder_drive\"]\nparameters = { Fv = { nominal = 0.12",
        ),
        (
            "elbow_drive\"]\nparameters = { Fv = { nominal = 0.05",
            "elbow_drive\"]\nparameters = { Fv = { nominal = 0.06",
        ),
        (
            "shoulder_drive\"]\nparameters = { Ia = { nominal = 0.01",
            "shoulder_drive\"]\nparameters = { Ia = { nominal = 0.022",
        ),
        (
            "elbow_drive\"]\nparameters = { Ia = { nominal = 0.01",
            "elbow_drive\"]\nparameters = { Ia = { nominal = 0.014",
        ),
        (
            "signal = \"shoulder_servo\"\n",
            "signal = \"shoulder_servo\"\ndelay = 0.012\n",
        ),
        (
            "signal = \"elbow_servo\"\n",
            "signal = \"elbow_servo\"\ndelay = 0.012\n",
        ),
    ] {
        assert!(text.contains(old), "{old} in\n{text}");
        text = text.replace(old, new);
    }
    for (drive, friction) in [("shoulder_drive", 0.15), ("elbow_drive", 0.09)] {
        let _ = write!(
            text,
            "\n[[effect]]\nkind = \"coulomb_friction\"\nat = [\"{drive}\"]\nparameters = {{ Fc = {{ nominal = {friction} }} }}\n"
        );
    }
    std::fs::write(&arm, text).expect("written");
    let log = std::fs::read_to_string(recordings.join("check.csv")).expect("the log");
    let with_forces: Vec<String> = (log.lines().enumerate())
        .map(|(k, line)| {
            if k == 0 {
                format!("{line},shoulder_drive,elbow_drive")
            } else {
                format!("{line},-5,5")
            }
        })
        .collect();
    let log = scratch("with-forces.csv");
    std::fs::write(&log, with_forces.join("\n")).expect("written");
    let motion = scratch("servo-motion.csv");
    let told = json(&["simulate", &arm, "--command", &log, "--out", &motion, "--json"]);
    assert_eq!(told["input"], "commands");
    let table = |path: &str| -> Vec<Vec<f64>> {
        let text = std::fs::read_to_string(path).expect("a table");
        let rows = text.lines().skip(1);
        rows.map(|row| row.split(',').map(|x| x.parse().expect("a number")).collect())
            .collect()
    };
    let (recorded, made) = (table(&log), table(&motion));
    assert!(made.len() > 1900, "{}", made.len());
    let (mut sum, mut count) = (0.0, 0.0);
    for row in &made {
        let sample = recorded
            .iter()
            .find(|one| (one[0] - row[0]).abs() < 1e-6)
            .expect("the sample");
        sum += (row[1] - sample[1]).powi(2) + (row[2] - sample[2]).powi(2);
        count += 2.0;
    }
    let error = f64::sqrt(sum / count);
    println!("servo arm under its commands: {error:.2e} rad");
    assert!(error < 2e-3, "{error}");
    // Under these forces it leaves the motion of the log.
    let told = json(&["simulate", &arm, "--data", &log, "--out", &motion, "--json"]);
    assert_eq!(told["input"], "forces");
    let largest = table(&motion).iter().map(|row| row[1].abs()).fold(0.0, f64::max);
    assert!(largest > 3.0, "{largest}");
}

#[test]
fn commands_need_actuators_and_their_signals() {
    let out = scratch("no-motion.csv");
    let says = refused(
        1,
        &[
            "simulate",
            &model("spidermill.toml"),
            "--command",
            &run("plain-check.csv"),
            "--out",
            &out,
        ],
    );
    assert!(says.contains("the model has no `[[actuator]]`"), "{says}");
    let arm = scratch("servo_arm_2.toml");
    let description = workspace("recordings/servo-arm/servo_arm.xml").display().to_string();
    ran(&["import", &description, "--known-bodies", "--out", &arm]);
    let log = scratch("no-commands.csv");
    std::fs::write(&log, "t,shoulder,elbow\n0,0,0\n0.01,0,0\n0.02,0,0\n").expect("written");
    let says = refused(1, &["simulate", &arm, "--command", &log, "--out", &out]);
    assert!(says.contains("no column for shoulder_servo, elbow_servo"), "{says}");
}

/// The forces of a log of servos follow from the gains of the fit, and not from wrong ones of the file.
#[test]
fn compare_uses_the_gains_of_a_fit() {
    let arm = scratch("servo_arm_3.toml");
    let recordings = workspace("recordings/servo-arm");
    let description = recordings.join("servo_arm.xml").display().to_string();
    ran(&["import", &description, "--known-bodies", "--out", &arm]);
    let mut text = std::fs::read_to_string(&arm).expect("the model");
    assert!(text.contains("kp = 20.0") && !text.contains("[parameters]"), "{text}");
    text = text.replace("kp = 20.0", "kp = \"kp1\"");
    text.push_str("\n[parameters]\nkp1 = { unit = \"N m\", nominal = 40 }\n");
    for drive in ["shoulder_drive", "elbow_drive"] {
        let _ = write!(text, "\n[[effect]]\nkind = \"coulomb_friction\"\nat = [\"{drive}\"]\n");
    }
    std::fs::write(&arm, text).expect("written");
    let [data, check] = ["fit.csv", "check.csv"].map(|name| recordings.join(name).display().to_string());
    let fit = scratch("servo_arm_3.json");
    ran(&["identify", &arm, "--data", &data, "--out", &fit]);
    let error = |parameters: &str| {
        let told = json(&["compare", &arm, "--data", &check, "--parameters", parameters, "--json"]);
        told["nrms"].as_f64().expect("a number")
    };
    let [of_file, of_fit] = ["nominal", &fit].map(error);
    println!("error of the file {of_file}, of the fit {of_fit}");
    assert!(of_fit < 0.03 && of_file > 0.2, "{of_fit} {of_file}");
}
