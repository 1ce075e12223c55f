//! `excite --separate`: motion that tells an effect from its doubles. Figures are computed once more by other means, and the
//! loop is closed: what one recording cannot tell apart, a recording along the computed trajectory does.

use std::f64::consts::PI;
use std::fmt::Write as _;

use crate::common::{json, model, number, printed, refused, run, scratch, workspace};
use modelmill_codegen::{ModelEvaluator, MotionStates};
use nalgebra::{DMatrix, DVector};
use serde_json::Value;

const LEFT: &str = "coulomb_friction@spindle_left:Fc=12";
/// Dry friction from friction by load, beside noise of 2 N.
const FROM_LOAD: [&str; 6] = [
    "--separate",
    LEFT,
    "--from",
    "load_friction@spindle_left",
    "--noise",
    "2",
];

/// Columns of a trajectory without its times: `theta1, theta2`, their rates, their accelerations.
fn states(path: &str) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(path).expect("a trajectory");
    let rows: Vec<Vec<f64>> = text
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(|x| x.parse().expect("a number")).collect())
        .collect();
    (1..7).map(|k| rows.iter().map(|row| row[k]).collect()).collect()
}

/// Root mean square of what a least squares fit of columns leaves of a force, by singular values.
fn left(force: &DVector<f64>, columns: &[DVector<f64>]) -> f64 {
    let norms: Vec<DVector<f64>> = columns.iter().map(|c| c / c.norm()).collect();
    let w = DMatrix::from_columns(&norms);
    let x = w.clone().svd(true, true).solve(force, 1e-12).expect("both sides");
    (force - w * x).norm() / (force.len() as f64).sqrt()
}

/// Dry friction against friction by load: rates of the spindle by a geometry written out here, base columns and load from the
/// evaluator, least squares by singular values.
#[test]
fn the_difference_is_what_least_squares_leaves() {
    let out = scratch("separate-once-more.csv");
    let file = model("spidermill.toml");
    let search = ["--random", "100", "--starts", "1", "--out", &out, "--json"];
    let found = json(&[&["excite", &file], &FROM_LOAD[..], &search].concat());
    assert_eq!(found["violations"], 0);
    assert_eq!(found["criterion"], "separation");
    let columns = states(&out);
    let samples = columns[0].len();
    let path = workspace("model-spec/models/spidermill.toml");
    let loaded = modelmill_spec::load_file(&path).expect("the model");
    let derivation = modelmill_codegen::derive(&loaded.mechanism).expect("derived");
    let slices = |from: usize| columns[from..from + 2].iter().map(Vec::as_slice).collect();
    let along = MotionStates {
        q: slices(0),
        qd: slices(2),
        qdd: slices(4),
        load: Vec::new(),
    };
    let evaluator = ModelEvaluator::new(&derivation);
    let base = evaluator.regressor(&along).expect("poses");
    let load = evaluator
        .inverse_dynamics(&along, &derivation.nominal_base_values())
        .expect("poses");
    // Rows of the regressor take turns between both drives.
    let on_left = |value: &dyn Fn(usize) -> f64| {
        DVector::from_fn(2 * samples, |row, _| if row % 2 == 0 { value(row / 2) } else { 0.0 })
    };
    let direction = |i: usize| {
        let (theta, rate) = (columns[0][i], columns[2][i]);
        let contact = [0.45 * theta.cos(), 0.45 * theta.sin()];
        let along = [contact[0] + 0.75, contact[1] - 0.05];
        (rate * (contact[0] * along[1] - contact[1] * along[0])).signum()
    };
    let dry = on_left(&|i| 12.0 * direction(i));
    let by_load = on_left(&|i| load[0][i].abs() * direction(i));
    let mut fitted: Vec<DVector<f64>> = base.column_iter().map(nalgebra::Matrix::into_owned).collect();
    let beyond = left(&dry, &fitted);
    fitted.push(by_load);
    let apart = left(&dry, &fitted);
    let said = |name: &str| number(&found, &format!("/separation/{name}"));
    println!(
        "apart {apart:.6} N, of {:.6} N in the best of 100 random trajectories: {:.3} times; beyond the base {beyond:.6} N",
        said("best_random"),
        apart / said("best_random")
    );
    assert!((said("trajectory/apart") / apart - 1.0).abs() < 1e-9);
    assert!((said("trajectory/beyond_base") / beyond - 1.0).abs() < 1e-9);
    assert!((said("trajectory/effect") - 12.0 / 2.0_f64.sqrt()).abs() < 1e-9);
    // The search sees fewer samples than the file has.
    assert!((number(&found, "/value") / apart - 1.0).abs() < 0.02);
    assert!(apart > 1.1 * said("best_random"));
    let deviations = apart / 2.0 * (2.0 * samples as f64).sqrt();
    assert!((said("trajectory/deviations") / deviations - 1.0).abs() < 1e-9);
    // Both sides have one column, so that it is the same either way.
    assert!((said("trajectory/reverse") / apart - 1.0).abs() < 1e-6);
}

/// A trajectory of the SpiderMill, 250 samples per second.
fn trajectory(name: &str, motion: impl Fn(f64) -> [f64; 2]) -> String {
    let path = scratch(name);
    let mut text = "t,theta1,theta2\n".to_owned();
    for i in 0..1823 {
        let t = 0.004 * f64::from(i);
        let [one, other] = motion(t);
        let _ = writeln!(text, "{t},{one},{other}");
    }
    std::fs::write(&path, text).expect("written");
    path
}

/// Small motion around the nominal pose.
fn small(t: f64) -> [f64; 2] {
    let w = 2.0 * PI / 7.29;
    [
        1.80 + 0.02 * ((w * t).sin() + 0.5 * (3.0 * w * t).cos()),
        1.341_593 + 0.02 * ((2.0 * w * t).sin() + 0.5 * (w * t).cos()),
    ]
}

/// Both cranks go one way only, at changing speeds.
fn one_way(t: f64) -> [f64; 2] {
    let w = 2.0 * PI / 7.29;
    [
        1.60 + 0.045 * t + 0.02 * (2.0 * w * t).sin(),
        1.20 + 0.035 * t + 0.01 * (3.0 * w * t).sin(),
    ]
}

/// Two recordings along a trajectory of the whole robot with an effect, and what is said of them.
fn diagnosed(name: &str, rig: &str, trajectory: &str) -> (Value, [String; 2]) {
    let runs = ["1", "2"].map(|seed| {
        let run = scratch(&format!("separate-{name}-{seed}.csv"));
        printed(&[
            "simulate",
            rig,
            "--trajectory",
            trajectory,
            "--out",
            &run,
            "--seed",
            seed,
        ]);
        run
    });
    let spidermill = model("spidermill.toml");
    let answer = json(&[
        "diagnose",
        &spidermill,
        "--data",
        &runs[0],
        "--check",
        &runs[1],
        "--json",
    ]);
    (answer, runs)
}

/// Kinds with places of the one effect that was found, and of what cannot be told from it.
fn group(answer: &Value) -> (String, Vec<String>) {
    let name = |effect: &Value| {
        let at: Vec<&str> = effect["at"]
            .as_array()
            .unwrap()
            .iter()
            .map(|p| p.as_str().unwrap())
            .collect();
        format!("{}@{}", effect["kind"].as_str().unwrap(), at.join(","))
    };
    let [found] = &answer["effects"].as_array().unwrap()[..] else {
        panic!("one effect, not {:#}", answer["effects"]);
    };
    let doubles = found["indistinguishable_from"].as_array().unwrap();
    (name(found), doubles.iter().map(name).collect())
}

/// On a poor trajectory truth and double are one; the command that `diagnose` prints gives one on which they are two, `gain`
/// times as far apart as on the best random one.
fn check_loop(name: &str, kind: &str, value: &str, motion: fn(f64) -> [f64; 2], double: &str, gain: f64) {
    let rig = scratch(&format!("separate-{name}.toml"));
    let parent = workspace("model-spec/rigs/spidermill-full.toml")
        .canonicalize()
        .expect("the rig");
    let text = format!(
        "schema = 1\nname = \"hidden\"\nextends = '{}'\n[sampling]\nrate = 250.0\nderivatives = true\n\
         [[effect]]\nkind = \"{kind}\"\nat = [\"spindle_left\"]\nvalues = {{ {value} }}\n\
         [[force_sensor]]\nof = [\"spindle_left\", \"spindle_right\"]\nnoise = 1.0\n",
        parent.display()
    );
    std::fs::write(&rig, text).expect("written");
    let truth = format!("{kind}@spindle_left");
    let poor = trajectory(&format!("separate-{name}-poor.csv"), motion);
    let (answer, runs) = diagnosed(&format!("{name}-poor"), &rig, &poor);
    let (found, doubles) = group(&answer);
    println!("{name}: on the poor trajectory {found} is not told from {doubles:?}");
    let mut all = doubles.clone();
    all.push(found);
    assert!(all.contains(&truth) && all.iter().any(|one| one == double), "{all:?}");

    // The command as it is printed, with a shorter search.
    let command = answer["effects"][0]["separate_command"].as_str().expect("a command");
    println!("{command}");
    let words: Vec<&str> = command.split(' ').collect();
    assert_eq!(words[0], "modelmill");
    assert!(command.contains(&runs[0]), "{command}");
    let out = scratch(&format!("separate-{name}-apart.csv"));
    let mut args: Vec<&str> = words[1..words.len() - 1].to_vec();
    args.extend([
        out.as_str(),
        "--random",
        "200",
        "--starts",
        "1",
        "--rate",
        "250",
        "--json",
    ]);
    let excited = json(&args);
    assert_eq!(excited["violations"], 0);
    let figure = |name: &str| number(&excited, &format!("/separation/{name}"));
    println!(
        "{name}: {:.3} N apart, {:.3} N in the best of 200 random trajectories ({:.2} times), {:.5} N in the recording",
        figure("trajectory/apart"),
        figure("best_random"),
        figure("trajectory/apart") / figure("best_random"),
        figure("recordings/apart"),
    );
    assert!(figure("trajectory/apart") > gain * figure("best_random"));
    assert!(figure("trajectory/apart") > 10.0 * figure("recordings/apart"));
    // No more can be left of an effect than there is.
    assert!(figure("trajectory/apart") < figure("trajectory/effect"));
    // Three deviations are what `diagnose` asks for.
    assert!(figure("recordings/deviations") < 4.0 && figure("trajectory/deviations") > 20.0);

    let (answer, _) = diagnosed(&format!("{name}-apart"), &rig, &out);
    let (found, doubles) = group(&answer);
    assert_eq!((found, doubles), (truth, Vec::new()));
}

#[test]
fn dry_friction_of_a_spindle_is_told_from_that_of_its_joint() {
    check_loop(
        "dry",
        "coulomb_friction",
        "Fc = 12",
        small,
        "coulomb_friction@theta1",
        1.1,
    );
}

#[test]
fn viscous_friction_of_a_spindle_is_told_from_that_of_its_joint() {
    check_loop(
        "viscous",
        "viscous_friction",
        "Fv = 300",
        small,
        "viscous_friction@theta1",
        1.3,
    );
}

/// Wherever the motion goes both ways these are far apart, so that random motions have nearly all there is.
#[test]
fn dry_friction_is_told_from_an_offset() {
    check_loop(
        "one-way",
        "coulomb_friction",
        "Fc = 12",
        one_way,
        "force_offset@spindle_left",
        1.0,
    );
}

/// What a search says that must end with some status and write nothing.
fn refusal(status: i32, more: &[&str]) -> String {
    let out = scratch(&format!("separate-refused-{status}.csv"));
    let spidermill = model("spidermill.toml");
    let mut args = vec!["excite", &spidermill, "--random", "20", "--starts", "1", "--out", &out];
    args.extend(more);
    let says = refused(status, &args);
    assert!(!std::path::Path::new(&out).exists());
    says
}

/// Effects that are fitted in either case count: dry friction and an offset are together what differs by direction.
#[test]
fn what_no_motion_tells_apart_is_refused_with_its_reason() {
    let directional = "directional_coulomb_friction@spindle_left";
    let says = refusal(1, &["--separate", LEFT, "--from", directional]);
    assert!(says.contains("no experiment distinguishes coulomb friction"), "{says}");
    let values = format!("{directional}:Fcp=20:Fcn=10");
    let offset = ["--beside", "force_offset@spindle_left"];
    let says = refusal(
        1,
        &[
            "--separate",
            &values,
            "--from",
            "coulomb_friction@spindle_left",
            offset[0],
            offset[1],
        ],
    );
    assert!(says.contains("no experiment") && says.contains("--beside"), "{says}");
    // The elbows' mass is a parameter of the model already.
    let says = refusal(
        1,
        &[
            "--separate",
            "point_mass@R2m:m=1",
            "--beside",
            "point_mass@R4m",
            "--from",
            LEFT,
        ],
    );
    assert!(
        says.contains("base parameters absorb") && says.contains("point mass (R2m)"),
        "{says}"
    );
}

#[test]
fn what_is_misspelt_is_said() {
    let directional = "directional_coulomb_friction@spindle_left";
    for (more, expected) in [
        (
            vec!["--separate", "coulom_friction@spindle_left", "--from", LEFT],
            "did you mean `coulomb_friction`",
        ),
        (
            vec!["--separate", LEFT, "--from", "viscous_friction@spindle_lef"],
            "did you mean `spindle_left`",
        ),
        (
            vec!["--separate", LEFT, "--from", "coulomb_friction@spindle_left"],
            "named twice",
        ),
        (
            vec!["--separate", LEFT, "--from", "time_delay@force"],
            "only delays all forces",
        ),
        (
            vec!["--separate", "force_ripple@spindle_left", "--from", LEFT],
            "pitch=VALUE",
        ),
        (
            vec!["--separate", "spring@spindle_left:kk=1", "--from", LEFT],
            "no parameter or constant `kk`",
        ),
    ] {
        let says = refusal(1, &more);
        assert!(says.contains(expected), "{says}");
    }
    for more in [
        vec!["--separate", "coulomb_friction", "--from", LEFT],
        vec!["--separate", LEFT],
        vec!["--from", LEFT],
        vec!["--separate", LEFT, "--from", directional, "--noise", "0"],
        vec!["--separate", LEFT, "--from", directional, "--criterion", "condition"],
    ] {
        refusal(2, &more);
    }
}

/// Friction that differs by direction holds dry friction: one way it can be told, the other way only simplicity speaks.
#[test]
fn a_special_case_is_told_one_way() {
    let out = scratch("separate-special.csv");
    let args = |more: &str| {
        let text = format!(
            "excite {} --separate directional_coulomb_friction@spindle_left:Fcp=20:Fcn=10 --from coulomb_friction@spindle_left \
             --random 30 --starts 1 --harmonics 3 --out {out}{more}",
            model("spidermill.toml")
        );
        text.split(' ').map(str::to_owned).collect::<Vec<_>>()
    };
    let args: [Vec<String>; 2] = [args(""), args(" --json")];
    let [text, object] = args
        .each_ref()
        .map(|a| a.iter().map(String::as_str).collect::<Vec<_>>());
    let text = printed(&text);
    assert!(text.contains("special case"), "{text}");
    let found = json(&object);
    assert!(found["separation"]["trajectory"]["reverse"].is_null());
    // What is left is a constant of (20 - 10)/2 N in one of two drives, less what the base takes up.
    let apart = number(&found, "/separation/trajectory/apart");
    assert!(apart > 0.3 && apart < 5.0 / 2.0_f64.sqrt(), "{apart}");
}

/// The command that a diagnosis prints names a recording; where the model has no limits of positions, motion keeps to those of
/// the recording.
#[test]
fn a_model_without_limits_keeps_to_what_was_recorded() {
    let text = std::fs::read_to_string(model("spidermill.toml")).expect("a model");
    let mut is_limit = false;
    let bare: Vec<&str> = text
        .lines()
        .filter(|line| {
            if line.starts_with('[') {
                is_limit = line.starts_with("[limits");
            }
            !is_limit
        })
        .collect();
    assert!(bare.len() < text.lines().count());
    let file = scratch("without-limits.toml");
    std::fs::write(&file, bare.join("\n")).expect("a model");
    let recording = run("with-rods-fit.csv");
    let out = scratch("within-the-recording.csv");
    let search = ["--random", "40", "--starts", "1", "--out", &out];
    let asked = [&["excite", &file], &FROM_LOAD[..], &search].concat();
    let says = refused(1, &asked);
    assert!(says.contains("have no limits"), "{says}");
    let with_data: Vec<&str> = asked.into_iter().chain(["--data", &recording]).collect();
    printed(&with_data);
    let positions = |path: &str| -> Vec<[f64; 2]> {
        let text = std::fs::read_to_string(path).expect("a table");
        let names: Vec<&str> = text.lines().next().expect("a head").split(',').collect();
        let range = |name: &str| {
            let k = names.iter().position(|one| *one == name).expect("a column");
            let values = text.lines().skip(1);
            let values = values.map(|line| -> f64 {
                let value = line.split(',').nth(k).expect("a value");
                value.parse().expect("a number")
            });
            values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
                [low.min(x), high.max(x)]
            })
        };
        ["theta1", "theta2"].map(range).to_vec()
    };
    for (made, recorded) in positions(&out).iter().zip(positions(&recording)) {
        assert!(
            made[0] > recorded[0] - 1e-6 && made[1] < recorded[1] + 1e-6,
            "{made:?} {recorded:?}"
        );
        assert!(made[1] - made[0] > 0.05, "{made:?}");
    }
}
