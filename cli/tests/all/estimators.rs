//! The estimators through the program: weights, outliers, nominal values, bodies that can be, essential parameters, and
//! instruments.

use std::fmt::Write as _;

use crate::common::{json, model, number, printed, ran, refused, run, scratch, workspace};
use serde_json::Value;

/// Sums of twelve uniform numbers pass for normal ones.
struct Noise(u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

/// Names of seven columns, each with a comma before it.
fn header(name: &str, suffix: &str) -> String {
    (1..=7).fold(String::new(), |list, k| list + &format!(",{name}{k}{suffix}"))
}

/// A recording of the bundled arm on a motion of three harmonics: forces by the program itself with noise of the given sizes
/// by joint, their variance in columns of its own, and a share of forces that are far off.
fn arm(name: &str, samples: i32, sizes: [f64; 7], spoilt: f64) -> String {
    let mut noise = Noise(11);
    let nominal = [0.1, -0.5, 0.2, -2.0, 0.3, 1.8, 0.7];
    let columns = |suffix: &str| header("q", suffix);
    let mut states = format!("t{}{}{}\n", columns(""), columns("_d"), columns("_dd"));
    let mut lines = Vec::new();
    for i in 0..samples {
        let t = 0.01 * f64::from(i);
        let mut rows = [[0.0; 7]; 3];
        for (k, centre) in nominal.into_iter().enumerate() {
            rows[0][k] = centre;
            for h in 1..=3 {
                let w = 0.7 * f64::from(h) * (1.0 + 0.07 * k as f64);
                let (sin, cos) = (w * t + 1.9 * f64::from(h) + k as f64).sin_cos();
                let a = 0.45 / f64::from(h);
                rows[0][k] += a * sin;
                rows[1][k] += a * w * cos;
                rows[2][k] -= a * w * w * sin;
            }
        }
        let mut line = format!("{t:.2}");
        for value in rows.iter().flatten() {
            write!(line, ",{value}").unwrap();
        }
        writeln!(states, "{line}").unwrap();
        lines.push(line);
    }
    let (without, forces, path) = (
        scratch(&format!("{name}-states.csv")),
        scratch(&format!("{name}-forces.csv")),
        scratch(name),
    );
    std::fs::write(&without, &states).unwrap();
    printed(&["evaluate", &model("panda.toml"), "--data", &without, "--out", &forces]);
    let forces = std::fs::read_to_string(&forces).unwrap();
    let joints = |suffix: &str| header("joint", suffix);
    let mut text = format!("{}{}{}\n", states.lines().next().unwrap(), joints(""), joints("_var"));
    for (line, force) in lines.iter().zip(forces.lines().skip(1)) {
        text.push_str(line);
        for (force, size) in force.split(',').skip(1).zip(sizes) {
            let far = if noise.uniform() < spoilt { 60.0 } else { 0.0 };
            write!(text, ",{}", force.parse::<f64>().unwrap() + size * noise.normal() + far).unwrap();
        }
        for size in sizes {
            write!(text, ",{}", size * size).unwrap();
        }
        text.push('\n');
    }
    std::fs::write(&path, text).unwrap();
    path
}

/// Sum of squared errors of the base parameters, each in its deviation of the plain fit.
fn error(fit: &Value, plain: &Value) -> f64 {
    let list = |fit: &Value| fit["parameters"].as_array().unwrap().clone();
    list(fit)
        .iter()
        .zip(list(plain))
        .map(|(p, plain)| ((number(p, "/value") - number(p, "/nominal")) / number(&plain, "/std")).powi(2))
        .sum()
}

fn identified(recording: &str, options: &[&str]) -> Value {
    let panda = model("panda.toml");
    let mut args = vec!["identify", &panda, "--data", recording, "--json"];
    args.extend(options);
    json(&args)
}

#[test]
fn weights_find_more_than_plain_least_squares() {
    let path = arm("weights.csv", 1200, [1.0, 1.0, 0.5, 0.5, 0.02, 0.02, 0.02], 0.0);
    let plain = identified(&path, &[]);
    assert_eq!(plain["estimator"]["weights"], "none");
    let effective = number(&plain, "/estimator/effective_samples");
    assert!(
        (600.0..2400.0).contains(&effective),
        "white noise, 1200 samples: {effective}"
    );
    let channels = identified(&path, &["--weights", "channels"]);
    let variance = identified(&path, &["--weights", "variance"]);
    assert_eq!(channels["estimator"]["settled"], true);
    let scale = number(&channels, "/estimator/residual_scale/joint7");
    assert!((0.018..0.022).contains(&scale), "{scale}");
    let errors = [&plain, &channels, &variance].map(|fit| error(fit, &plain));
    println!(
        "plain {:.1}, channels {:.1}, variance {:.1}",
        errors[0], errors[1], errors[2]
    );
    assert!(errors[1] < 0.75 * errors[0] && errors[2] < 0.75 * errors[0]);
    // Both know the same in the end.
    assert!((errors[1] / errors[2] - 1.0).abs() < 0.2);
}

#[test]
fn a_robust_estimate_survives_spoilt_samples() {
    let path = arm("robust.csv", 1000, [0.2; 7], 0.05);
    let plain = identified(&path, &[]);
    let robust = identified(&path, &["--robust"]);
    assert!((number(&robust, "/estimator/robust/bound") - 1.345).abs() < 1e-12);
    let beyond = number(&robust, "/estimator/robust/beyond");
    assert!((0.15..0.35).contains(&beyond), "{beyond}");
    assert!(error(&robust, &plain) < 0.1 * error(&plain, &plain));
}

#[test]
fn nominal_values_and_bodies_that_can_be_help_where_the_recording_is_poor() {
    let path = arm("poor.csv", 300, [3.0; 7], 0.0);
    let plain = identified(&path, &[]);
    let prior = identified(&path, &["--prior", "0.1"]);
    let physical = identified(&path, &["--physical"]);
    let errors = [&plain, &prior, &physical].map(|fit| error(fit, &plain));
    println!(
        "plain {:.2}, prior {:.2}, physical {:.2}",
        errors[0], errors[1], errors[2]
    );
    assert!(errors[1] < 0.5 * errors[0] && errors[2] < errors[0]);
    let of = |name: String| -> f64 {
        let list = physical["estimator"]["physical"]["parameters"].as_array().unwrap();
        let one = list
            .iter()
            .find(|p| p["name"] == name)
            .unwrap_or_else(|| panic!("no {name}"));
        number(one, "/value")
    };
    for k in 1..=7 {
        let p = |name: &str| of(format!("{name}{k}"));
        // Positive definite about the centre of mass, and each principal moment at most the sum of the others: leading
        // minors of the pseudo-inertia, by hand.
        let (m, h) = (p("M"), [p("MX"), p("MY"), p("MZ")]);
        let inertia = [
            [p("XX"), p("XY"), p("XZ")],
            [p("XY"), p("YY"), p("YZ")],
            [p("XZ"), p("YZ"), p("ZZ")],
        ];
        let half = 0.5 * (inertia[0][0] + inertia[1][1] + inertia[2][2]);
        let s = |i: usize, j: usize| f64::from(u8::from(i == j)) * half - inertia[i][j] - h[i] * h[j] / m;
        let minor2 = s(0, 0) * s(1, 1) - s(0, 1) * s(1, 0);
        let minor3 = s(0, 0) * (s(1, 1) * s(2, 2) - s(1, 2) * s(2, 1))
            - s(0, 1) * (s(1, 0) * s(2, 2) - s(1, 2) * s(2, 0))
            + s(0, 2) * (s(1, 0) * s(2, 1) - s(1, 1) * s(2, 0));
        assert!(
            m > 0.0 && s(0, 0) > 0.0 && minor2 > 0.0 && minor3 > 0.0,
            "link {k}: {m}, {minor2}, {minor3}"
        );
    }
    // What the recording tells by itself are base parameters of one term; all others it tells in sums.
    let equations = json(&["equations", &model("panda.toml"), "--json"]);
    let base: Vec<&str> = equations["base"]
        .as_array()
        .unwrap()
        .iter()
        .map(|p| p["expression"].as_str().unwrap())
        .collect();
    let list = physical["estimator"]["physical"]["parameters"].as_array().unwrap();
    let mut combined = 0;
    for one in list {
        let name = one["name"].as_str().unwrap();
        assert_eq!(one["alone"], base.contains(&name), "{name}");
        combined += usize::from(one["alone"] == false && number(one, "/from_recording") > 0.01);
    }
    let text = printed(&["identify", &model("panda.toml"), "--data", &path, "--physical"]);
    assert!(combined > 10 && text.contains("only in combination: the recordings determine sums"));
    // One in every row, one in the sentence below.
    assert_eq!(text.matches("only in combination").count(), combined + 1);
    let essential = identified(&path, &["--essential"]);
    let dropped = essential["estimator"]["essential"]["dropped"].as_array().unwrap().len();
    println!("{dropped} of 43 are not essential");
    assert!((3..40).contains(&dropped));
    let left_out = essential["parameters"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|p| p["status"] == "not_essential");
    assert_eq!(left_out.count(), dropped);
    assert!(number(&essential, "/fit/nrms") < 1.1 * number(&plain, "/fit/nrms"));
    // A fit with parameters left out is a fit as any other.
    let file = scratch("essential.json");
    std::fs::write(&file, essential.to_string()).unwrap();
    json(&[
        "compare",
        &model("panda.toml"),
        "--data",
        &path,
        "--parameters",
        &file,
        "--json",
    ]);
}

#[test]
fn instruments_are_taken_from_the_reference_motion_of_a_real_axis() {
    let path = workspace("../shared/data/emps/emps_train.csv");
    if !path.is_file() {
        println!("Not tested: there are no recordings in ../shared/data/emps beside the workspace.");
        return;
    }
    let path = path.to_str().unwrap();
    let emps = model("emps.toml");
    let fit = json(&[
        "identify",
        &emps,
        "--data",
        path,
        "--order",
        "4",
        "--cutoff",
        "100",
        "--trim",
        "49",
        "--decimate",
        "10",
        "--instruments",
        path,
        "--instrument-map",
        "x=q_ref_m",
        "--json",
    ]);
    // On this axis the noise is small: instruments and least squares agree, and both with what is published.
    assert!(number(&fit, "/estimator/instruments/strength") > 0.8);
    for (k, published) in [95.1089, 203.5034, 20.3935, -3.1648].into_iter().enumerate() {
        let p = &fit["parameters"][k];
        let least_squares = number(&fit, &format!("/estimator/instruments/parameters/{k}/least_squares"));
        assert!((number(p, "/value") / published - 1.0).abs() < 0.01, "{p}");
        assert!((number(p, "/value") - least_squares).abs() < 2.0 * number(p, "/std"));
    }
}

#[test]
fn what_cannot_be_estimated_so_is_said() {
    let (spidermill, data) = (model("spidermill.toml"), run("with-rods-fit.csv"));
    let refused = |status: i32, options: &[&str]| {
        let mut args = vec!["identify", &spidermill, "--data", &data];
        args.extend(options);
        refused(status, &args)
    };
    assert!(refused(1, &["--weights", "variance"]).contains("spindle_left_var"));
    assert!(refused(2, &["--prior", "0"]).contains("positive"));
    assert!(refused(2, &["--robust", "-1"]).contains("positive"));
    assert!(refused(2, &["--prior", "0.1", "--physical"]).contains("cannot be used with"));
    assert!(refused(1, &["--instruments", "period=5"]).contains("one and a half periods"));
    assert!(refused(2, &["--instruments", "period=soon"]).contains("seconds"));
    assert!(
        refused(2, &["--instruments", "period=2", "--weights", "channels"]).contains("`--weights none` or `variance`")
    );
    let rows = std::fs::read_to_string(&data).unwrap();
    let short = scratch("two-rows.csv");
    std::fs::write(&short, rows.lines().take(3).collect::<Vec<_>>().join("\n")).unwrap();
    for option in [&["--physical"][..], &["--essential"], &["--prior", "0.2"]] {
        let args = [&["identify", &spidermill, "--data", &short], option].concat();
        assert!(crate::common::refused(1, &args).contains("degree of freedom"));
    }
    // Another motion with the same times is as good as no instruments.
    let other = run("with-rods-check.csv");
    let weak = ran(&[
        "identify",
        &spidermill,
        "--data",
        &data,
        "--instruments",
        &other,
        "--json",
    ]);
    assert!(
        weak.status == 0 && weak.err.contains("instruments are weak"),
        "{}",
        weak.err
    );
}

/// Options that the estimator of servo logs does not have are refused, and not ignored.
#[test]
fn options_without_effect_on_servo_logs_are_refused() {
    let model = scratch("servo.toml");
    let text = r#"
        schema = 1
        name = "servo"
        parameters = { J = { unit = "kg m^2" }, kp = { unit = "N m" } }
        coordinates = { q = { nominal = 0 } }
        frame = [{ name = "rod", on = "base", joint = { revolute = "q", axis = "z" } }]
        part = [{ on = "rod", linear = { ZZ = "J" } }]
        drive = [{ name = "motor", joint = "q" }]
        actuator = [{ drive = "motor", kind = "position_servo", kp = "kp", kd = 0.5 }]
    "#;
    std::fs::write(&model, text).expect("written");
    let data = scratch("servo.csv");
    let mut rows = "t,q,motor_command\n".to_owned();
    for k in 0..1000 {
        let t = 0.01 * f64::from(k);
        let (position, command) = ((2.0 * t).sin(), 1.1 * (2.0 * t + 0.1).sin());
        writeln!(rows, "{t},{position},{command}").expect("a line");
    }
    std::fs::write(&data, rows).expect("written");
    let says = refused(
        2,
        &["identify", &model, "--data", &data, "--robust", "--weights", "none"],
    );
    assert!(
        says.contains("--weights, --robust cannot be used with actuators"),
        "{says}"
    );
}
