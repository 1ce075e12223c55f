//! Machines that move on their own: an acrobot's free joint, a cart-pole, an arm on a body that hangs on nothing. Motion is
//! simulated under forces of the drives alone, recorded as poses and forces without columns for what nothing drives, and
//! identified again.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use modelmill::Model;
use modelmill::diagnose::{DiagnosisOptions, DiagnosisVerdict};
use modelmill::identify::EstimatorOptions;
use modelmill::recording::RecordingOptions;
use modelmill::variants::VariantComparison;
use modelmill_codegen::{DynamicsPrograms, ModelEvaluator, MotionStates};
use modelmill_spec::{FrameStep, FreeBody, TwistAxes};

use crate::draws::Draws;

const PENDUBOT: &str = r#"
schema = 1
name = "pendubot"
gravity = [0, "-g", 0]
[constants]
L = { value = 0.3, unit = "m" }
g = { value = 9.81, unit = "m/s^2" }
[coordinates]
q1 = { nominal = 0.3 }
q2 = { nominal = 0.2, driven = false }
[[frame]]
name = "upper"
on = "base"
modified_dh = { theta = "q1" }
[[frame]]
name = "lower"
on = "upper"
modified_dh = { a = "L", theta = "q2" }
[[part]]
on = "upper"
linear = { planar = "1", nominal = { ZZ = 0.03, MX = 0.15, MY = 0.01, M = 1.2 } }
[[part]]
on = "lower"
linear = { planar = "2", nominal = { ZZ = 0.012, MX = 0.06, MY = -0.004, M = 0.5 } }
[[drive]]
name = "shoulder"
joint = "q1"
[[effect]]
kind = "viscous_friction"
at = ["q2"]
parameters = { Fv = { name = "Fv2", nominal = 0.008 } }
"#;

const CART_POLE: &str = r#"
schema = 1
name = "cart_pole"
gravity = [0, 0, "-g"]
[constants]
g = { value = 9.81, unit = "m/s^2" }
[coordinates]
s = { nominal = 0 }
phi = { nominal = 0.4, driven = false }
[[frame]]
name = "cart"
on = "base"
joint = { prismatic = "s", axis = "x" }
[[frame]]
name = "pole"
on = "cart"
joint = { revolute = "phi", axis = "y" }
[[part]]
on = "cart"
mass = "m"
[[part]]
on = "pole"
linear = { all = "2", nominal = { YY = 0.03, MZ = -0.12, MX = 0.01, M = 0.4 } }
[parameters]
m = { nominal = 1.5, unit = "kg" }
[[drive]]
name = "motor"
joint = "s"
"#;

fn free_arm(order: &str, coordinates: &str, twist: &str) -> String {
    format!(
        r#"
schema = 1
name = "free_arm"
gravity = [0, 0, "-g"]
[constants]
L = {{ value = 0.3, unit = "m" }}
g = {{ value = 9.81, unit = "m/s^2" }}
[coordinates]
x = {{}}
y = {{}}
z = {{}}
{coordinates}
q1 = {{ nominal = 0.2 }}
q2 = {{ nominal = -0.4 }}
[[frame]]
name = "trunk"
on = "base"
joint = {{ free = ["x", "y", "z", {order}], quaternion = "{}", twist = "{twist}" }}
[[frame]]
name = "upper"
on = "trunk"
transform = {{ xyz = [0, 0, "L"] }}
joint = {{ revolute = "q1", axis = "x" }}
[[frame]]
name = "lower"
on = "upper"
transform = {{ xyz = [0, "L", 0] }}
joint = {{ revolute = "q2", axis = "z" }}
[[part]]
on = "trunk"
linear = {{ all = "0", nominal = {{ XX = 0.11, YY = 0.13, ZZ = 0.09, XY = 0.004, XZ = -0.006, YZ = 0.003, MX = 0.02, MY = 0.05, MZ = -0.06, M = 2.0 }} }}
[[part]]
on = "upper"
linear = {{ all = "1", nominal = {{ XX = 0.04, YY = 0.012, ZZ = 0.038, XY = 0.001, XZ = 0.002, YZ = -0.001, MX = 0.01, MY = 0.12, MZ = 0.02, M = 0.8 }} }}
[[part]]
on = "lower"
linear = {{ all = "2", nominal = {{ XX = 0.02, YY = 0.018, ZZ = 0.03, XY = -0.002, XZ = 0.001, YZ = 0.001, MX = 0.07, MY = 0.03, MZ = 0.01, M = 0.5 }} }}
[[drive]]
name = "shoulder"
joint = "q1"
[[drive]]
name = "elbow"
joint = "q2"
"#,
        if order.starts_with("\"qw") { "wxyz" } else { "xyzw" }
    )
}

fn free_body(model: &Model) -> Option<FreeBody> {
    let frames = &model.derivation.mechanism.frames;
    let mut steps = frames.iter().flat_map(|frame| &frame.steps);
    steps.find_map(|step| match step {
        FrameStep::Free(body) => Some(*body),
        _ => None,
    })
}

/// A plant: accelerations from the model's own equation of motion, poses from rates.
struct Plant<'a> {
    model: &'a Model,
    evaluator: ModelEvaluator<'a>,
    dynamics: DynamicsPrograms,
    body: Option<FreeBody>,
}

impl Plant<'_> {
    fn accelerations(&self, q: &[f64], qd: &[f64], forces: &[f64]) -> Vec<f64> {
        let still = vec![0.0; q.len()];
        let one = |values: &'_ [f64]| -> Vec<Vec<f64>> { values.iter().map(|x| vec![*x]).collect() };
        let (q, qd, qdd, load) = (one(q), one(qd), one(&still), one(forces));
        let slices = |all: &'_ [Vec<f64>]| -> Vec<Vec<f64>> { all.to_vec() };
        let (q, qd, qdd, load) = (slices(&q), slices(&qd), slices(&qdd), slices(&load));
        let states = MotionStates {
            q: q.iter().map(Vec::as_slice).collect(),
            qd: qd.iter().map(Vec::as_slice).collect(),
            qdd: qdd.iter().map(Vec::as_slice).collect(),
            load: load.iter().map(Vec::as_slice).collect(),
        };
        let forces: Vec<&[f64]> = load.iter().map(Vec::as_slice).collect();
        let found = self
            .evaluator
            .forward_dynamics(&self.dynamics, &states, &self.model.values, &forces)
            .expect("accelerations");
        found.into_iter().map(|a| a[0]).collect()
    }

    /// Derivatives of the coordinates: those of a pose by the twist.
    fn poses(&self, q: &[f64], qd: &[f64]) -> Vec<f64> {
        let mut change = qd.to_vec();
        let Some(body) = self.body else { return change };
        let [w, x, y, z] = body.quaternion.map(|i| q[i.0]);
        let [_, a, b, c] = body.quaternion.map(|i| qd[i.0]);
        // q' = q w / 2 in body axes, w q / 2 in those of the world.
        let half = match body.angular {
            TwistAxes::Body => [
                -x * a - y * b - z * c,
                w * a + y * c - z * b,
                w * b + z * a - x * c,
                w * c + x * b - y * a,
            ],
            TwistAxes::World => [
                -x * a - y * b - z * c,
                w * a + z * b - y * c,
                w * b + x * c - z * a,
                w * c + y * a - x * b,
            ],
        };
        for (i, d) in body.quaternion.iter().zip(half) {
            change[i.0] = 0.5 * d;
        }
        if body.linear == TwistAxes::Body {
            let v = body.position.map(|i| qd[i.0]);
            let u = [x, y, z];
            let cross = |a: [f64; 3], b: [f64; 3]| -> [f64; 3] {
                std::array::from_fn(|i| {
                    let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                    a[j] * b[k] - a[k] * b[j]
                })
            };
            let once = cross(u, v);
            let twice = cross(u, once);
            for (k, i) in body.position.iter().enumerate() {
                change[i.0] = v[k] + 2.0 * (w * once[k] + twice[k]);
            }
        }
        change
    }
}

/// Noise of the forces beside their amplitude.
const NOISE: f64 = 1e-3;

/// How a recording is made.
struct Made {
    push: f64,
    seed: u64,
    /// What an encoder counts in, rad or m; exact without one.
    step: Option<f64>,
}

/// Simulates by Runge and Kutta and writes poses and the drives' forces; every other quaternion has the other sign.
fn recording(model: &Model, name: &str, made: &Made) -> PathBuf {
    const SAMPLES: usize = 4000;
    const STEP: f64 = 0.001;
    let push = made.push;
    let mechanism = &model.derivation.mechanism;
    let body = free_body(model);
    let plant = Plant {
        model,
        evaluator: ModelEvaluator::new(&model.derivation),
        dynamics: model.derivation.dynamics().expect("an equation of motion"),
        body,
    };
    let mut draws = Draws::new(made.seed);
    let waves: Vec<Vec<[f64; 3]>> = mechanism
        .drives
        .iter()
        .map(|_| (0..4).map(|_| [0; 3].map(|_| draws.uniform())).collect())
        .collect();
    let force = |d: usize, t: f64| -> f64 {
        if !mechanism.drives[d].is_driven {
            return 0.0;
        }
        let of = waves[d].iter();
        of.map(|[a, f, p]| push * (0.5 + a) * ((3.0 + 12.0 * f) * t + 6.3 * p).sin())
            .sum()
    };
    let mut q: Vec<f64> = mechanism.coordinates.iter().map(|c| c.nominal).collect();
    let mut qd = vec![0.0; q.len()];
    if let Some(body) = body {
        for (k, i) in body.position.iter().chain(&body.quaternion[1..]).enumerate() {
            qd[i.0] = 0.3 * (k as f64 - 2.0);
        }
    }
    let names: Vec<&str> = mechanism.coordinates.iter().map(|c| c.name.as_str()).collect();
    let driven: Vec<usize> = (0..mechanism.drives.len())
        .filter(|d| mechanism.drives[*d].is_driven)
        .collect();
    let mut text = format!("t,{}", names.join(","));
    for d in &driven {
        let _ = write!(text, ",{}", mechanism.drives[*d].name);
    }
    for k in 0..SAMPLES {
        let t = STEP * k as f64;
        let _ = write!(text, "\n{t}");
        for (i, value) in q.iter().enumerate() {
            let turned = k % 2 == 1 && mechanism.coordinates[i].motion.is_quaternion();
            let read = made.step.map_or(*value, |step| (value / step).round() * step);
            let _ = write!(text, ",{}", if turned { -read } else { read });
        }
        let forces = |t: f64| -> Vec<f64> { (0..waves.len()).map(|d| force(d, t)).collect() };
        for d in &driven {
            let _ = write!(text, ",{}", force(*d, t) + NOISE * push * draws.normal());
        }
        let slope = |q: &[f64], qd: &[f64], t: f64| (plant.poses(q, qd), plant.accelerations(q, qd, &forces(t)));
        let moved = |x: &[f64], by: &[f64], h: f64| -> Vec<f64> { x.iter().zip(by).map(|(x, d)| x + h * d).collect() };
        let h = STEP;
        let a = slope(&q, &qd, t);
        let b = slope(&moved(&q, &a.0, h / 2.0), &moved(&qd, &a.1, h / 2.0), t + h / 2.0);
        let c = slope(&moved(&q, &b.0, h / 2.0), &moved(&qd, &b.1, h / 2.0), t + h / 2.0);
        let d = slope(&moved(&q, &c.0, h), &moved(&qd, &c.1, h), t + h);
        for i in 0..q.len() {
            q[i] += h / 6.0 * (a.0[i] + 2.0 * b.0[i] + 2.0 * c.0[i] + d.0[i]);
            qd[i] += h / 6.0 * (a.1[i] + 2.0 * b.1[i] + 2.0 * c.1[i] + d.1[i]);
        }
    }
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("undriven-{name}.csv"));
    std::fs::write(&file, text + "\n").expect("a recording");
    file
}

/// Base parameters that come back, each beside the largest of its unit.
#[track_caller]
fn check(name: &str, text: &str, push: f64, accuracy: f64) {
    let model = Model::from_text(name, text).expect("the model");
    let made = Made {
        push,
        seed: 17,
        step: None,
    };
    let file = recording(&model, name, &made);
    let recording = model
        .recording(&file, &RecordingOptions::default())
        .expect("a recording");
    let found = model
        .identify(&[&recording], &[], &EstimatorOptions::default())
        .expect("an identification");
    assert_eq!(found.fit.parameters.len(), model.base.len());
    for (k, parameter) in found.fit.parameters.iter().enumerate() {
        let alike = model.base.iter().zip(&model.values);
        let alike = alike.filter(|(base, _)| base.unit == model.base[k].unit);
        let largest = alike.map(|(_, x)| x.abs()).fold(0.0, f64::max);
        let error = (parameter.value - model.values[k]).abs() / largest;
        assert!(
            error < accuracy,
            "{name}, {}: {} instead of {}, error {error:.1e}",
            model.base[k].expression,
            parameter.value,
            model.values[k]
        );
    }
}

#[test]
fn a_pendubot_is_identified_with_the_row_of_its_free_joint() {
    check("pendubot", PENDUBOT, 1.0, 2e-3);
}

#[test]
fn a_cart_pole_is_identified() {
    check("cart_pole", CART_POLE, 3.0, 2e-3);
}

#[test]
fn an_arm_on_a_free_body_is_identified_in_any_axes() {
    let scalar_last = "qx = {}\nqy = {}\nqz = {}\nqw = {}";
    let scalar_first = "qw = {}\nqx = {}\nqy = {}\nqz = {}";
    for (name, order, coordinates, twist) in [
        ("body", "\"qx\", \"qy\", \"qz\", \"qw\"", scalar_last, "body"),
        ("mixed", "\"qw\", \"qx\", \"qy\", \"qz\"", scalar_first, "mixed"),
        ("world", "\"qx\", \"qy\", \"qz\", \"qw\"", scalar_last, "world"),
    ] {
        check(name, &free_arm(order, coordinates, twist), 1.0, 2e-2);
    }
}

/// What a diagnosis says of recordings by encoders, of a machine that is that of the model but for an effect.
#[track_caller]
fn told(name: &str, text: &str, effect: &str, push: f64) -> Vec<(String, Vec<String>)> {
    let model = Model::from_text(name, text).expect("the model");
    let machine = Model::from_text(name, &format!("{text}{effect}")).expect("the machine");
    let run = |seed: u64| {
        let made = Made {
            push,
            seed,
            step: Some(1e-4),
        };
        let file = recording(&machine, &format!("{name}-{}-{seed}", effect.len()), &made);
        (model.recording(&file, &RecordingOptions::default())).expect("a recording")
    };
    let (fit, check) = (run(17), run(29));
    let found = (model.diagnose(&[&fit], &[&check], &DiagnosisOptions::default())).expect("a diagnosis");
    let diagnosis = found.diagnosis;
    let error = diagnosis.steps[0].check;
    assert!(!effect.is_empty() || error < 0.15, "{name}: {error}");
    let expected = if effect.is_empty() {
        DiagnosisVerdict::Adequate
    } else {
        DiagnosisVerdict::MissingEffect
    };
    assert_eq!(diagnosis.verdict, expected, "{name}");
    let effects = diagnosis.effects.into_iter();
    let named = effects.map(|found| (found.effect.kind, found.effect.at));
    named.collect()
}

/// Of a joint that nothing drives no force is read: zeros say nothing of a gain, and do not count more than all else.
#[test]
fn nothing_is_missing_where_a_joint_has_no_drive() {
    for (name, text, push) in [("pendubot-told", PENDUBOT, 1.0), ("cart_pole-told", CART_POLE, 3.0)] {
        assert_eq!(told(name, text, "", push), []);
    }
}

#[test]
fn friction_is_found_beside_a_joint_without_a_drive() {
    let friction = r#"
[[effect]]
kind = "viscous_friction"
at = ["motor"]
parameters = { Fv = { name = "Fv", nominal = 1.5 } }
"#;
    let found = told("cart_pole-rubs", CART_POLE, friction, 3.0);
    assert_eq!(found, [("viscous_friction".to_owned(), vec!["motor".to_owned()])]);
    // The equation of the free joint is not believed more than that of the drive, whose friction is not known yet.
    let both = format!(
        "{friction}{}",
        friction
            .replace("motor", "phi")
            .replace("\"Fv\"", "\"Fv_phi\"")
            .replace("1.5", "0.01")
    );
    let mut found = told("cart_pole-rubs-twice", CART_POLE, &both, 3.0);
    found.sort();
    let expected = ["motor", "phi"].map(|at| ("viscous_friction".to_owned(), vec![at.to_owned()]));
    assert_eq!(found, expected);
}

const CABLES: &str = r#"
schema = 1
name = "cables"
gravity = [0, "-g", 0]
[constants]
w = { value = 2.0, unit = "m" }
h = { value = 1.5, unit = "m" }
b = { value = 0.1, unit = "m" }
g = { value = 9.81, unit = "m/s^2" }
[coordinates]
x = { nominal = 1.0 }
y = { nominal = 0.7 }
a = { nominal = 0.0 }
[[frame]]
name = "carriage"
on = "base"
joint = { prismatic = "x", axis = "x" }
[[frame]]
name = "slider"
on = "carriage"
joint = { prismatic = "y", axis = "y" }
[[frame]]
name = "platform"
on = "slider"
joint = { revolute = "a", axis = "z" }
[[part]]
on = "platform"
linear = { planar = "", nominal = { ZZ = 0.02, MX = 0.03, MY = -0.02, M = 1.3 } }
[[point]]
name = "A1"
on = "base"
at = [0, 0, 0]
[[point]]
name = "A2"
on = "base"
at = ["w", 0, 0]
[[point]]
name = "A3"
on = "base"
at = ["w", "h", 0]
[[point]]
name = "A4"
on = "base"
at = [0, "h", 0]
[[point]]
name = "B1"
on = "platform"
at = ["b", "-b", 0]
[[point]]
name = "B2"
on = "platform"
at = ["-b", "b", 0]
[[drive]]
name = "cable1"
linear = { from = "A1", to = "B1" }
[[drive]]
name = "cable2"
linear = { from = "A2", to = "B1" }
[[drive]]
name = "cable3"
linear = { from = "A3", to = "B2" }
[[drive]]
name = "cable4"
linear = { from = "A4", to = "B2" }
"#;

/// Four cables hold three freedoms: the rows are those of the coordinates, and any tensions that make up the forces there will
/// do.
#[test]
fn cables_are_more_than_freedoms() {
    let model = Model::from_text("cables", CABLES).expect("the model");
    assert_eq!(model.row_names(), ["on_x", "on_y", "on_a"]);
    let (samples, step) = (1500, 0.004);
    let motion = |k: usize, order: usize| -> [f64; 3] {
        let t = step * k as f64;
        [(1.0, 0.4, 2.3), (0.7, 0.25, 3.1), (0.0, 0.5, 4.7)].map(|(at, size, rate): (f64, f64, f64)| {
            let (sin, cos) = (rate * t).sin_cos();
            match order {
                0 => at + size * sin,
                1 => size * rate * cos,
                _ => -size * rate * rate * sin,
            }
        })
    };
    let column = |order: usize, i: usize| -> Vec<f64> { (0..samples).map(|k| motion(k, order)[i]).collect() };
    let columns: Vec<Vec<Vec<f64>>> = (0..3).map(|o| (0..3).map(|i| column(o, i)).collect()).collect();
    let slices = |o: usize| -> Vec<&[f64]> { columns[o].iter().map(Vec::as_slice).collect() };
    let states = MotionStates {
        q: slices(0),
        qd: slices(1),
        qdd: slices(2),
        load: Vec::new(),
    };
    let forces = ModelEvaluator::new(&model.derivation)
        .inverse_dynamics(&states, &model.values)
        .expect("forces");
    let mut text = "t,x,y,a,cable1,cable2,cable3,cable4".to_owned();
    for k in 0..samples {
        let [x, y, a] = motion(k, 0);
        let (s, c) = f64::sin_cos(a);
        let turned = |u: f64, v: f64| [u * c - v * s, u * s + v * c];
        let jacobian = nalgebra::DMatrix::from_fn(4, 3, |cable, i| {
            let anchor = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.5], [0.0, 1.5]][cable];
            let arm = if cable < 2 {
                turned(0.1, -0.1)
            } else {
                turned(-0.1, 0.1)
            };
            let along = [x + arm[0] - anchor[0], y + arm[1] - anchor[1]];
            let length = along[0].hypot(along[1]);
            match i {
                0 | 1 => along[i] / length,
                _ => (arm[0] * along[1] - arm[1] * along[0]) / length,
            }
        });
        let wanted = nalgebra::DVector::from_fn(3, |i, _| forces[i][k]);
        // The least tensions, and an inner one that changes nothing.
        let transposed = jacobian.transpose();
        let least = transposed
            .clone()
            .svd(true, true)
            .solve(&wanted, 1e-12)
            .expect("tensions");
        let full = transposed.clone().insert_rows(3, 1, 0.0).svd(true, true);
        let inner = full.v_t.expect("asked for").row(3).transpose() * 5.0;
        let tensions = least + inner;
        let _ = write!(text, "\n{},{x},{y},{a}", step * k as f64);
        for tension in tensions.iter() {
            let _ = write!(text, ",{tension}");
        }
    }
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("undriven-cables.csv");
    std::fs::write(&file, text + "\n").expect("a recording");
    let recording = model
        .recording(&file, &RecordingOptions::default())
        .expect("a recording");
    let found = model
        .identify(&[&recording], &[], &EstimatorOptions::default())
        .expect("a fit");
    for (parameter, truth) in found.fit.parameters.iter().zip(&model.values) {
        let error = (parameter.value - truth).abs() / 0.05;
        assert!(error < 1e-2, "{} instead of {truth}", parameter.value);
    }

    // Beside a variant, figures are those of the rows.
    let found =
        VariantComparison::along_recordings([&model, &model.clone()], [&[&recording], &[&recording]]).expect("figures");
    let drives: Vec<&str> = found.drives.iter().map(|one| &*one.drive).collect();
    assert_eq!(drives, model.row_names());
    assert!(
        found.notes[0].says.in_library_words().contains("more drives than"),
        "{:?}",
        found.notes
    );
}
