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
