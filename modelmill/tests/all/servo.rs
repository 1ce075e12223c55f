//! Servo logs without forces: planted gains are recovered from simulations with closed-form dynamics, and what fixes
//! the scale is compared with an independent rank.

use modelmill::recording::{DerivativeSource, RecordingOptions, SmoothingMethod, StatePreparation};
use modelmill::servo::{ServoEstimator, ServoIdentification, ServoModel, ServoStatus};
use modelmill::{Model, RecordingNote};

use crate::draws::Draws;

/// A pendulum on a position servo. `{kp}`, `{mass}` and so on are replaced by numbers or names of parameters.
pub(crate) const PENDULUM: &str = r#"
schema = 1
name = "servo_pendulum"
gravity = ["0", "-g", "0"]
[constants]
g = { value = 9.81, unit = "m/s^2" }
[parameters]
J = { unit = "kg m^2" }
ml = { unit = "kg m" }
kp = { unit = "N m" }
kd = { unit = "N m s" }
[coordinates]
q = { nominal = 0 }
[[frame]]
name = "rod"
on = "base"
joint = { revolute = "q", axis = "z" }
[[part]]
on = "rod"
linear = { ZZ = "{J}", MY = "-{ml}" }
[[drive]]
name = "motor"
joint = "q"
[[effect]]
kind = "viscous_friction"
at = "motor"
[[effect]]
kind = "coulomb_friction"
at = "motor"
[[actuator]]
drive = "motor"
kind = "position_servo"
kp = "{kp}"
kd = "{kd}"
"#;

/// The text of the pendulum with some entries replaced by numbers.
pub(crate) fn pendulum(known: &[(&str, f64)]) -> String {
    let mut text = PENDULUM.to_owned();
    for name in ["J", "ml", "kp", "kd"] {
        let value = known.iter().find(|(one, _)| *one == name);
        let entry = value.map_or_else(|| name.to_owned(), |(_, value)| format!("{value}"));
        text = text.replace(&format!("{{{name}}}"), &entry);
        if value.is_some() {
            text = text
                .lines()
                .filter(|line| !line.starts_with(&format!("{name} = {{ unit")))
                .fold(String::new(), |kept, line| kept + line + "\n");
        }
    }
    text
}

/// Planted values of the pendulum.
#[derive(Clone, Copy)]
pub(crate) struct Planted {
    pub(crate) j: f64,
    pub(crate) ml: f64,
    pub(crate) kp: f64,
    pub(crate) kd: f64,
    pub(crate) viscous: f64,
    pub(crate) coulomb: f64,
    pub(crate) delay: f64,
}

/// Limits of the servo.
#[derive(Clone, Copy)]
pub(crate) struct PlantedLimits {
    /// Largest torque, N m.
    pub(crate) saturation: f64,
    /// Largest error without a torque, rad.
    pub(crate) dead_band: f64,
}

/// A servo without limits.
const UNLIMITED: PlantedLimits = PlantedLimits {
    saturation: f64::INFINITY,
    dead_band: 0.0,
};

/// A sum of sines.
fn command(t: f64, phases: &[f64]) -> f64 {
    let parts = [(0.6, 0.41), (0.4, 1.13), (0.25, 2.37), (0.1, 4.3)];
    parts
        .iter()
        .zip(phases)
        .map(|((a, f), phase)| a * (std::f64::consts::TAU * f * t + phase).sin())
        .sum()
}

/// Columns of a log by name.
pub(crate) type Columns = Vec<(String, Vec<f64>)>;

/// A log of a servo at 200 Hz: command and noisy position, simulated by small steps of the closed-form equation.
fn simulate(planted: &Planted, seed: u64, samples: usize) -> Columns {
    simulate_limited(planted, UNLIMITED, seed, samples)
}

/// As [`simulate`], of a servo with limits.
pub(crate) fn simulate_limited(planted: &Planted, limits: PlantedLimits, seed: u64, samples: usize) -> Columns {
    let mut draws = Draws::new(seed);
    let phases: Vec<f64> = (0..4).map(|_| std::f64::consts::TAU * draws.uniform()).collect();
    let (mut q, mut v) = (0.0, 0.0);
    let (mut time, mut position, mut given) = (Vec::new(), Vec::new(), Vec::new());
    let (step, inner) = (0.005, 200);
    let h = step / f64::from(inner);
    for k in 0..samples {
        let t = k as f64 * step;
        time.push(t);
        position.push(q + 5e-5 * draws.normal());
        given.push(command(t, &phases));
        for i in 0..inner {
            let now = t + f64::from(i) * h;
            let reference = command(now - planted.delay, &phases);
            let error = reference - q;
            let error = error.signum() * (error.abs() - limits.dead_band).max(0.0);
            let torque = (planted.kp * error - planted.kd * v).clamp(-limits.saturation, limits.saturation);
            let load = planted.ml * 9.81 * q.sin() + planted.viscous * v;
            // Stiction holds the pendulum where the torque is below the Coulomb friction.
            let free = torque - load;
            let next = v + h * (free - planted.coulomb * v.signum()) / planted.j;
            v = if v == 0.0 && free.abs() <= planted.coulomb || v * next < 0.0 {
                if free.abs() <= planted.coulomb {
                    0.0
                } else {
                    h * (free - planted.coulomb * free.signum()) / planted.j
                }
            } else {
                next
            };
            q += h * v;
        }
    }
    vec![
        ("t".to_owned(), time),
        ("q".to_owned(), position),
        ("motor_command".to_owned(), given),
    ]
}

/// The options that servo logs are read with.
fn options() -> RecordingOptions {
    RecordingOptions {
        preparation: StatePreparation {
            source: DerivativeSource::Positions,
            smoothing: SmoothingMethod::Butterworth,
            ..StatePreparation::default()
        },
        ..RecordingOptions::default()
    }
}

fn servo(text: &str) -> ServoModel {
    Model::from_text("servo.toml", text).unwrap().servo_model().unwrap()
}

fn identify(servo: &ServoModel, log: Columns) -> ServoIdentification {
    let run = servo.equations.recording_of_table("log", log, &options()).unwrap();
    servo.identify(&[&run], &[]).unwrap()
}

/// The value and the standard deviation of a base parameter by its expression.
fn value(found: &ServoIdentification, expression: &str) -> (f64, f64) {
    let one = found.parameters.iter().find(|p| p.expression == expression);
    let one = one.unwrap_or_else(|| panic!("{expression} in {:?}", found.parameters));
    (one.value, one.std.unwrap_or(0.0))
}

#[test]
fn gains_and_delay_are_recovered_with_a_known_gravity_load() {
    let servo = servo(&pendulum(&[("ml", 0.15)]));
    assert!(servo.scale.freedoms.is_empty());
    let (mut inside, mut all) = (0, 0);
    for seed in 0..10 {
        let mut draws = Draws::new(100 + seed);
        let planted = Planted {
            j: 0.03 + 0.05 * draws.uniform(),
            ml: 0.15,
            kp: 10.0 + 20.0 * draws.uniform(),
            kd: 0.3 + 0.6 * draws.uniform(),
            viscous: 0.05,
            coulomb: 0.05 + 0.1 * draws.uniform(),
            delay: 0.004 + 0.012 * draws.uniform(),
        };
        let found = identify(&servo, simulate(&planted, seed, 6000));
        let wanted = [
            ("kp", planted.kp),
            ("J", planted.j),
            ("Fc_motor", planted.coulomb),
            ("kd + Fv_motor", planted.kd + planted.viscous),
        ];
        for (expression, truth) in wanted {
            let (value, std) = value(&found, expression);
            println!("{seed} {expression} {value} +- {std} {truth}");
            all += 1;
            inside += i32::from((value - truth).abs() < (2.0 * std).max(0.05 * truth));
        }
        all += 1;
        let delay = &found.delays[0];
        inside += i32::from((delay.value - planted.delay).abs() < (2.0 * delay.std).max(0.0005));
    }
    println!("{inside} of {all}");
    assert!(inside >= all - 5, "{inside} of {all}");
}

/// The position as an encoder of 12 bits reads it.
pub(crate) fn by_encoder(mut log: Columns) -> Columns {
    let step = std::f64::consts::TAU / 4096.0;
    for (_, values) in log.iter_mut().filter(|(name, _)| name == "q") {
        for value in values {
            *value = step * (*value / step).round();
        }
    }
    log
}

/// Where the known load is small beside the forces of the servo, noise must not make all other values too small by one
/// factor, nor a delay too large.
#[test]
fn a_small_known_load_fixes_the_scale_without_bias() {
    let planted = Planted {
        j: 0.05,
        ml: 0.03,
        kp: 20.0,
        kd: 0.5,
        viscous: 0.05,
        coulomb: 0.1,
        delay: 0.012,
    };
    let servo = servo(&pendulum(&[("ml", planted.ml)]));
    for seed in 40..44 {
        let found = identify(&servo, by_encoder(simulate(&planted, seed, 6000)));
        for (expression, truth) in [("kp", planted.kp), ("J", planted.j)] {
            let (value, std) = value(&found, expression);
            assert!(std < 0.1 * truth, "{seed} {expression} {value} +- {std}");
            assert!(
                (value - truth).abs() < (3.0 * std).max(0.05 * truth),
                "{seed} {expression} {value} +- {std}"
            );
        }
        let delay = &found.delays[0];
        assert!((delay.value - planted.delay).abs() < 0.001, "{seed} {delay:?}");
    }
}

/// The filter of the motion rounds the jumps of dry friction. An estimate that ignores this grows as the cut-off falls.
#[test]
fn dry_friction_does_not_depend_on_the_cutoff() {
    let planted = Planted {
        j: 0.03,
        ml: 0.15,
        kp: 18.0,
        kd: 0.9,
        viscous: 0.2,
        coulomb: 0.15,
        delay: 0.012,
    };
    let servo = servo(&pendulum(&[("ml", planted.ml)]));
    let log = simulate(&planted, 7, 6000);
    for cutoff in [6.0, 9.0, 14.0] {
        let mut reading = options();
        reading.preparation.cutoff_hz = Some(cutoff);
        let run = servo
            .equations
            .recording_of_table("log", log.clone(), &reading)
            .unwrap();
        let found = servo.identify(&[&run], &[]).unwrap();
        for (expression, truth) in [("Fc_motor", planted.coulomb), ("J", planted.j), ("kp", planted.kp)] {
            let (value, std) = value(&found, expression);
            assert!(
                (value / truth - 1.0).abs() < 0.03,
                "{cutoff} Hz: {expression} {value} +- {std}"
            );
        }
    }
}

/// The equations of a stiff servo are nearly satisfied by a longer delay with a negative inertia, too.
#[test]
fn a_stiff_servo_gets_the_delay_with_a_possible_inertia() {
    let planted = Planted {
        j: 0.08,
        ml: 2.0,
        kp: 500.0,
        kd: 20.0,
        viscous: 1.0,
        coulomb: 0.8,
        delay: 0.012,
    };
    let servo = servo(&pendulum(&[("ml", planted.ml)]));
    for seed in 60..66 {
        let found = identify(&servo, by_encoder(simulate(&planted, seed, 5000)));
        let (inertia, std) = value(&found, "J");
        let delay = &found.delays[0];
        assert!(
            inertia > 0.0 && (inertia - planted.j).abs() < 3.0 * std,
            "{seed} {inertia} +- {std}"
        );
        assert!(
            (delay.value - planted.delay).abs() < (3.0 * delay.std).min(0.004),
            "{seed} {delay:?}"
        );
    }
}

/// A command in another turn than the position is the same command.
#[test]
fn full_turns_between_command_and_position_have_no_effect() {
    let planted = Planted {
        j: 0.05,
        ml: 0.15,
        kp: 20.0,
        kd: 0.4,
        viscous: 0.05,
        coulomb: 0.1,
        delay: 0.008,
    };
    let servo = servo(&pendulum(&[("ml", 0.15)]));
    let log = simulate(&planted, 3, 4000);
    let mut turned = log.clone();
    for (_, values) in turned.iter_mut().filter(|(name, _)| name == "motor_command") {
        for value in values {
            *value += 2.0 * std::f64::consts::TAU;
        }
    }
    let [here, there] = [log, turned].map(|log| value(&identify(&servo, log), "kp").0);
    assert!((here - there).abs() < 1e-6 * here, "{here} {there}");
}

/// A friction that the model lacks is no noise: the values come with a warning, and not where nothing is lacking.
#[test]
fn a_balance_with_large_errors_is_reported() {
    let text = pendulum(&[("ml", 0.15)]);
    let without_friction = text.replace("[[effect]]\nkind = \"coulomb_friction\"\nat = \"motor\"\n", "");
    assert!(without_friction.len() < text.len());
    let planted = Planted {
        j: 0.05,
        ml: 0.15,
        kp: 20.0,
        kd: 0.4,
        viscous: 0.05,
        coulomb: 1.0,
        delay: 0.005,
    };
    let log = simulate(&planted, 20, 6000);
    for (text, is_reported) in [(text, false), (without_friction, true)] {
        let found = identify(&servo(&text), log.clone());
        let misses = |note: &RecordingNote| note.says.in_library_words().contains("The balance of motor misses");
        assert_eq!(found.notes.iter().any(misses), is_reported, "{:?}", found.fit);
    }
}

/// A planar arm of two links in a vertical plane, with servos on both joints.
const ARM: &str = r#"
schema = 1
name = "servo_arm"
gravity = ["0", "-g", "0"]
[constants]
g = { value = 9.81, unit = "m/s^2" }
l = { value = 0.4, unit = "m" }
[parameters]
ZZ1 = { unit = "kg m^2" }
MX1 = { unit = "kg m" }
ZZ2 = { unit = "kg m^2" }
MX2 = { unit = "kg m" }
M2 = { unit = "kg" }
kd1 = { unit = "N m s" }
kp2 = { unit = "N m" }
kd2 = { unit = "N m s" }
[coordinates]
q1 = { nominal = -1.5 }
q2 = { nominal = 0.2 }
[[frame]]
name = "upper"
on = "base"
joint = { revolute = "q1", axis = "z" }
[[frame]]
name = "lower"
on = "upper"
transform = { xyz = ["l", 0, 0] }
joint = { revolute = "q2", axis = "z" }
[[part]]
on = "upper"
linear = { ZZ = "ZZ1", MX = "MX1" }
[[part]]
on = "lower"
linear = { ZZ = "ZZ2", MX = "MX2", M = "M2" }
[[drive]]
name = "shoulder"
joint = "q1"
[[drive]]
name = "elbow"
joint = "q2"
[[actuator]]
drive = "shoulder"
kind = "position_servo"
kp = 60
kd = "kd1"
delay = 0
[[actuator]]
drive = "elbow"
kind = "position_servo"
kp = "kp2"
kd = "kd2"
delay = 0
"#;

/// A log of the arm at 200 Hz; the equations are those of a textbook (Craig, "Introduction to Robotics", 6.7).
/// `planted` has ZZ1 + l^2 M2, MX1 + l M2, ZZ2, MX2, kp1, kd1, kp2, kd2.
fn simulate_arm(planted: &[f64; 8], seed: u64, samples: usize) -> Columns {
    let [a1, b1, zz2, mx2, kp1, kd1, kp2, kd2] = *planted;
    let mut draws = Draws::new(seed);
    let phases: Vec<Vec<f64>> = (0..2)
        .map(|_| (0..4).map(|_| std::f64::consts::TAU * draws.uniform()).collect())
        .collect();
    let (l, g) = (0.4, 9.81);
    let reference = |t: f64| [command(t, &phases[0]) - 1.5, command(1.2 * t, &phases[1]) + 0.2];
    let acceleration = |q: [f64; 2], v: [f64; 2], r: [f64; 2]| {
        let (c2, s2) = (q[1].cos(), q[1].sin());
        let (m11, m12, m22) = (a1 + zz2 + 2.0 * l * mx2 * c2, zz2 + l * mx2 * c2, zz2);
        let gravity = [
            b1 * g * q[0].cos() + mx2 * g * (q[0] + q[1]).cos(),
            mx2 * g * (q[0] + q[1]).cos(),
        ];
        let e0 = kp1 * (r[0] - q[0]) - kd1 * v[0] - gravity[0] + l * mx2 * s2 * (2.0 * v[0] * v[1] + v[1] * v[1]);
        let e1 = kp2 * (r[1] - q[1]) - kd2 * v[1] - gravity[1] - l * mx2 * s2 * v[0] * v[0];
        let det = m11 * m22 - m12 * m12;
        [(m22 * e0 - m12 * e1) / det, (m11 * e1 - m12 * e0) / det]
    };
    let [mut q, mut v] = [reference(0.0), [0.0, 0.0]];
    let mut log: [Vec<f64>; 5] = Default::default();
    let (step, inner) = (0.005, 20);
    let h = step / f64::from(inner);
    for k in 0..samples {
        let t = k as f64 * step;
        let r = reference(t);
        let row = [
            t,
            q[0] + 2e-5 * draws.normal(),
            q[1] + 2e-5 * draws.normal(),
            r[0],
            r[1],
        ];
        for (column, x) in log.iter_mut().zip(row) {
            column.push(x);
        }
        for i in 0..inner {
            // The midpoint rule: the simple Euler rule would add a damping of kp h / 2.
            let t = t + f64::from(i) * h;
            let a = acceleration(q, v, reference(t));
            let half = |x: [f64; 2], slope: [f64; 2]| [x[0] + 0.5 * h * slope[0], x[1] + 0.5 * h * slope[1]];
            let (middle, rate) = (half(q, v), half(v, a));
            let a = acceleration(middle, rate, reference(t + 0.5 * h));
            for j in 0..2 {
                q[j] += h * rate[j];
                v[j] += h * a[j];
            }
        }
    }
    let names = ["t", "q1", "q2", "shoulder_command", "elbow_command"];
    names.iter().map(|name| (*name).to_owned()).zip(log).collect()
}

#[test]
fn one_known_gain_determines_masses_and_gains_of_two_joints() {
    let servo = servo(ARM);
    assert!(servo.scale.freedoms.is_empty(), "{:?}", servo.scale);
    let (mut inside, mut all) = (0, 0);
    for seed in 0..5 {
        let planted = [0.9, 1.1, 0.2, 0.5, 60.0, 4.0, 25.0, 1.5];
        let found = identify(&servo, simulate_arm(&planted, seed, 4000));
        assert!(
            matches!(found.estimator, ServoEstimator::Instruments { .. }),
            "{:?}",
            found.estimator
        );
        let wanted = [
            ("ZZ2", planted[2]),
            ("MX2", planted[3]),
            ("kd1", planted[5]),
            ("kp2", planted[6]),
            ("kd2", planted[7]),
        ];
        for (expression, truth) in wanted {
            let (value, std) = value(&found, expression);
            println!("{seed} {expression} {value} +- {std} {truth}");
            assert!(std < 0.05 * truth, "{expression}: {std}");
            all += 1;
            inside += i32::from((value - truth).abs() < (2.0 * std).max(0.01 * truth));
        }
    }
    assert!(inside >= all - 2, "{inside} of {all}");
}

/// Without a known number the ratios are right, and the statement names what fixes them.
#[test]
fn without_a_known_number_only_ratios_are_reported() {
    let servo = servo(&pendulum(&[]));
    let [freedom] = servo.scale.freedoms.as_slice() else {
        panic!("{:?}", servo.scale);
    };
    let mut names = freedom.fixed_by.clone();
    names.sort();
    assert_eq!(names, ["J", "kp", "ml"]);
    for name in &names {
        let fixed = self::servo(&pendulum(&[(name, 0.5)]));
        assert!(fixed.scale.freedoms.is_empty(), "{name}: {:?}", fixed.scale);
    }
    // The damping stands in a sum with the friction, so that a number for it fixes nothing.
    let open = self::servo(&pendulum(&[("kd", 0.5)]));
    assert_eq!(open.scale.freedoms.len(), 1);
    let planted = Planted {
        j: 0.05,
        ml: 0.15,
        kp: 15.0,
        kd: 0.5,
        viscous: 0.05,
        coulomb: 0.1,
        delay: 0.008,
    };
    let found = identify(&servo, simulate(&planted, 3, 6000));
    let kp = found.parameters.iter().find(|p| p.expression == "kp").unwrap();
    assert_eq!(
        (kp.status, kp.value.to_bits()),
        (ServoStatus::Reference, 1.0_f64.to_bits())
    );
    for (expression, truth) in [("J", 0.05), ("ml", 0.15), ("Fc_motor", 0.1), ("kd + Fv_motor", 0.55)] {
        let (value, std) = value(&found, expression);
        let truth = truth / planted.kp;
        assert!(
            (value - truth).abs() < (2.5 * std).max(0.03 * truth),
            "{expression}: {value} +- {std}, {truth}"
        );
    }
}

/// Random states of a model: positions near the nominal ones, rates and accelerations, `[coordinate][sample]`.
fn random_states(model: &Model, draws: &mut Draws, n: usize) -> [Vec<Vec<f64>>; 3] {
    let mechanism = &model.derivation.mechanism;
    let nominal: Vec<f64> = mechanism
        .coordinates
        .iter()
        .filter(|c| !c.passive)
        .map(|c| c.nominal)
        .collect();
    [0.05, 2.0, 5.0].map(|range| {
        (nominal.iter())
            .map(|nominal| {
                let centre = if range < 1.0 { *nominal } else { 0.0 };
                (0..n).map(|_| centre + range * (2.0 * draws.uniform() - 1.0)).collect()
            })
            .collect()
    })
}

/// The factor of a gain at a position, a rate and a signal.
type GainColumn = fn(f64, f64, f64) -> f64;

/// An actuator of a test: its entry, and its columns at a position, a rate and a signal, one for each gain. Written
/// without the library of kinds.
fn test_actuator(kind: usize, drive: &str, name: &str) -> (String, Vec<GainColumn>) {
    // A kind with two signals has no common name for them.
    let signal = if kind == 5 {
        String::new()
    } else {
        format!("signal = \"{name}_signal\"\n")
    };
    let head = format!("[[actuator]]\ndrive = \"{drive}\"\ndelay = 0\n{signal}");
    let (entry, columns): (String, Vec<GainColumn>) = match kind {
        0 => (
            format!("kind = \"position_servo\"\nkp = \"{name}_a\"\nkd = \"{name}_b\"\n"),
            vec![|q, _, s| s - q, |_, v, _| -v],
        ),
        1 => (
            format!("kind = \"velocity_servo\"\nkv = \"{name}_a\"\n"),
            vec![|_, v, s| s - v],
        ),
        2 => (
            format!("kind = \"current\"\ntorque_constant = \"{name}_a\"\nratio = 20\nefficiency = 0.5\n"),
            vec![|_, _, s| 10.0 * s],
        ),
        3 => (
            format!(
                "kind = \"voltage\"\ntorque_constant = \"{name}_a\"\nresistance = 2\nback_emf = \"{name}_b\"\nratio = 3\n"
            ),
            vec![|_, _, s| 1.5 * s, |_, v, _| -4.5 * v],
        ),
        5 => (
            format!("kind = \"hydraulic_cylinder\"\narea_a = \"{name}_a\"\n"),
            vec![|_, _, s| s],
        ),
        _ => (
            format!("kind = \"duty\"\ntorque_constant = \"{name}_a\"\nresistance = 2\nsupply = 12\n"),
            vec![|_, _, s| 6.0 * s],
        ),
    };
    (head + &entry, columns)
}

/// Units of the gains `a` and `b` of a kind at a drive with a force or a torque.
fn units(kind: usize, force: &str) -> [&'static str; 2] {
    match (kind, force) {
        (0, "N") => ["N/m", "N s/m"],
        (0, _) => ["N m", "N m s"],
        (1, "N") => ["N s/m", "1"],
        (1, _) => ["N m s", "1"],
        (5, "N") => ["m^2", "1"],
        (5, _) => ["m^3", "1"],
        (_, "N") => ["N/A", "V s/m"],
        _ => ["N m/A", "V s"],
    }
}

/// Singular values that are not zero, of columns scaled to norm 1.
fn rank(columns: &[Vec<f64>]) -> usize {
    let scaled: Vec<Vec<f64>> = columns
        .iter()
        .map(|column| {
            let norm = column.iter().map(|x| x * x).sum::<f64>().sqrt();
            column
                .iter()
                .map(|x| if norm > 1e-10 { x / norm } else { 0.0 })
                .collect()
        })
        .collect();
    let matrix = nalgebra::DMatrix::from_fn(scaled[0].len(), scaled.len(), |i, j| scaled[j][i]);
    matrix.singular_values().iter().filter(|s| **s > 1e-9).count()
}

/// Base parameters with gains, and the number of open scales, against ranks of `[H, -S]` at random states: `H` from the
/// model without actuators, `S` and the signals that obey the equations by hand.
#[test]
fn base_parameters_with_gains_agree_with_independent_ranks() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../model-spec/models");
    let scratch = std::env::temp_dir().join(format!("modelmill-servo-{}", std::process::id()));
    std::fs::create_dir_all(&scratch).unwrap();
    let names = [
        "two_link",
        "scara",
        "four_bar",
        "five_bar",
        "slider_crank",
        "emps",
        "parallelogram",
        "spidermill",
        "three_rpr",
    ];
    for (m, name) in names.iter().enumerate() {
        let file = format!("{folder}/{name}.toml");
        let bare = Model::open(&file).unwrap();
        for offset in 0..6 {
            let (mut parameters, mut entries, mut columns) =
                (vec!["[parameters]\n".to_owned()], String::new(), Vec::new());
            for (d, drive) in bare.row_names().iter().enumerate() {
                let kind = (d + offset + m) % 6;
                let (entry, its) = test_actuator(kind, drive, &format!("gain{d}"));
                let [a, b] = units(kind, bare.force_unit(d));
                parameters.push(format!("gain{d}_a = {{ unit = \"{a}\" }}\n"));
                if its.len() > 1 {
                    parameters.push(format!("gain{d}_b = {{ unit = \"{b}\" }}\n"));
                }
                entries += &entry;
                columns.push(its);
            }
            let path = scratch.join("variant.toml");
            let parameters = parameters.concat();
            let text = format!("schema = 1\nname = \"variant\"\nextends = \"{file}\"\n{parameters}{entries}");
            std::fs::write(&path, text).unwrap();
            let model = Model::open(&path).unwrap_or_else(|error| panic!("{name} {offset}: {error}"));
            let servo = model.servo_model().unwrap();
            let (rank_of_all, rank_of_true) = ranks(&bare, &columns, 7 + m as u64);
            assert_eq!(servo.equations.base.len(), rank_of_all, "{name}, kinds from {offset}");
            let open: usize = servo.scale.freedoms.iter().map(|freedom| freedom.open).sum();
            assert_eq!(
                rank_of_all - open,
                rank_of_true,
                "{name}, kinds from {offset}: {:?}",
                servo.scale
            );
        }
    }
    std::fs::remove_dir_all(&scratch).unwrap();
}

/// The rank of `[H, -S]` at random states and signals, and at signals that obey the equations for random parameters.
fn ranks(bare: &Model, actuators: &[Vec<GainColumn>], seed: u64) -> (usize, usize) {
    let mut draws = Draws::new(seed);
    let n = 200;
    let [q, qd, qdd] = random_states(bare, &mut draws, n);
    let drives = bare.row_names().len();
    let load = vec![vec![0.0; n]; drives];
    let states = modelmill_codegen::MotionStates {
        q: q.iter().map(Vec::as_slice).collect(),
        qd: qd.iter().map(Vec::as_slice).collect(),
        qdd: qdd.iter().map(Vec::as_slice).collect(),
        load: load.iter().map(Vec::as_slice).collect(),
    };
    let evaluator = modelmill_codegen::ModelEvaluator::new(&bare.derivation);
    let h = evaluator.full_regressor(&states).unwrap();
    let motion = evaluator.drive_motion(&states).unwrap();
    let parameters: Vec<f64> = (0..h.ncols()).map(|_| 0.5 + draws.uniform()).collect();
    let gains: Vec<Vec<f64>> = actuators
        .iter()
        .map(|its| its.iter().map(|_| 0.5 + draws.uniform()).collect())
        .collect();
    let mut stacked: [Vec<Vec<f64>>; 2] = [Vec::new(), Vec::new()];
    for column in h.column_iter() {
        for all in &mut stacked {
            all.push(column.iter().copied().collect::<Vec<f64>>());
        }
    }
    for (d, its) in actuators.iter().enumerate() {
        let mut own = vec![vec![vec![0.0; n * drives]; its.len()]; 2];
        for sample in 0..n {
            let (position, rate) = (motion[d][sample], motion[drives + d][sample]);
            let row = sample * drives + d;
            let force: f64 = (0..h.ncols()).map(|k| h[(row, k)] * parameters[k]).sum();
            let actuated = |s: f64| {
                its.iter()
                    .zip(&gains[d])
                    .map(|(f, k)| k * f(position, rate, s))
                    .sum::<f64>()
            };
            let slope = actuated(1.0) - actuated(0.0);
            for (which, s) in [(0, 2.0 * draws.uniform() - 1.0), (1, (force - actuated(0.0)) / slope)] {
                for (column, f) in own[which].iter_mut().zip(its) {
                    column[row] = -f(position, rate, s);
                }
            }
        }
        for (all, own) in stacked.iter_mut().zip(own) {
            all.extend(own);
        }
    }
    (rank(&stacked[0]), rank(&stacked[1]))
}

/// A current that jumps is no fault of a sensor: it is used as it was recorded, and the torque constant is right.
#[test]
fn jumps_of_a_current_are_kept() {
    let text = pendulum(&[("ml", 0.15)])
        .replace("kp = { unit = \"N m\" }", "kt = { unit = \"N m/A\" }")
        .replace("kd = { unit = \"N m s\" }\n", "")
        .replace(
            "kind = \"position_servo\"\nkp = \"kp\"\nkd = \"kd\"",
            "kind = \"current\"\ntorque_constant = \"kt\"\ndelay = 0",
        );
    let servo = servo(&text);
    assert!(servo.scale.freedoms.is_empty());
    let current = |t: f64| (0.9 * t).sin() + if (4.4 * t).sin() > 0.0 { 1.5 } else { -1.5 };
    let (kt, j, coulomb, viscous) = (0.4, 0.05, 0.05, 0.15);
    let (mut q, mut v) = (0.0_f64, 0.0_f64);
    let mut log: [Vec<f64>; 3] = Default::default();
    let h = 2.5e-5;
    for k in 0..6000 {
        let t = 0.005 * f64::from(k);
        for (column, x) in log.iter_mut().zip([t, q, current(t)]) {
            column.push(x);
        }
        for i in 0..200 {
            let torque = kt * current(t + f64::from(i) * h);
            v += h * (torque - 0.15 * 9.81 * q.sin() - viscous * v - coulomb * v.signum()) / j;
            q += h * v;
        }
    }
    let names = ["t", "q", "motor_current"].map(str::to_owned);
    let found = identify(&servo, names.into_iter().zip(log).collect());
    assert!(
        matches!(found.estimator, ServoEstimator::LeastSquares { .. }),
        "{:?}",
        found.estimator
    );
    for (expression, truth) in [("kt", kt), ("J", j), ("Fv_motor", viscous), ("Fc_motor", coulomb)] {
        let (value, std) = value(&found, expression);
        assert!(
            (value - truth).abs() < (2.5 * std).max(0.03 * truth),
            "{expression}: {value} +- {std}, {truth}"
        );
    }
}

/// A cylinder with the pressures of both chambers: mass, friction and the area of the rod side from a known piston area.
#[test]
fn a_cylinder_is_identified_from_two_pressures() {
    let text = r#"
schema = 1
name = "cylinder"
[parameters]
M = { unit = "kg" }
rod_side = { unit = "m^2" }
[coordinates]
x = { nominal = 0 }
[[frame]]
name = "slide"
on = "base"
joint = { prismatic = "x", axis = "x" }
[[part]]
on = "slide"
mass = "M"
[[drive]]
name = "jack"
joint = "x"
[[effect]]
kind = "viscous_friction"
at = "jack"
[[actuator]]
drive = "jack"
kind = "hydraulic_cylinder"
area_a = 2e-3
area_b = "rod_side"
[recording.columns]
jack_pressure_a = "pa [bar]"
jack_pressure_b = "pb [bar]"
"#;
    let servo = servo(text);
    assert!(servo.scale.freedoms.is_empty(), "{:?}", servo.scale);
    let (mass, viscous, area) = (250.0, 900.0, 1.2e-3);
    let mut log: [Vec<f64>; 4] = Default::default();
    let (w1, w2) = (3.1, 7.3);
    for k in 0..3000 {
        let t = 0.005 * f64::from(k);
        let x = 0.2 * (w1 * t).sin() + 0.05 * (w2 * t).sin();
        let v = 0.2 * w1 * (w1 * t).cos() + 0.05 * w2 * (w2 * t).cos();
        let a = -0.2 * w1 * w1 * (w1 * t).sin() - 0.05 * w2 * w2 * (w2 * t).sin();
        let back = 6e5 + 2e5 * (1.7 * t).sin();
        let front = (mass * a + viscous * v + area * back) / 2e-3;
        for (column, value) in log.iter_mut().zip([t, x, front / 1e5, back / 1e5]) {
            column.push(value);
        }
    }
    let names = ["t", "x", "pa", "pb"].map(str::to_owned);
    let found = identify(&servo, names.into_iter().zip(log).collect());
    for (expression, truth) in [("M", mass), ("rod_side", area), ("Fv_jack", viscous)] {
        let (value, _) = value(&found, expression);
        assert!((value / truth - 1.0).abs() < 2e-3, "{expression}: {value}, {truth}");
    }
    assert!(
        found.delays.is_empty() || found.delays.iter().all(|delay| delay.value.abs() < 1e-12),
        "{:?}",
        found.delays
    );
    // Two signals have no common name, and their pressures contain all limits.
    for line in ["signal = \"p\"", "saturation = 5"] {
        let text = text.replace("area_a = 2e-3", &format!("area_a = 2e-3\n{line}"));
        let error = Model::from_text("cylinder.toml", &text)
            .err()
            .expect("an error")
            .to_string();
        assert!(error.contains("hydraulic_cylinder"), "{error}");
    }
}

/// A command beyond the rate that the servo follows: gains are those of the servo if the file states the limit, and wrong
/// otherwise.
#[test]
fn a_limited_rate_of_the_command_is_taken_into_account() {
    let (j, ml, kp, kd, limit) = (0.02, 0.15, 6.0, 0.25, 1.5);
    let (mut q, mut v, mut reached) = (0.0_f64, 0.0_f64, 0.0_f64);
    let mut log: [Vec<f64>; 3] = Default::default();
    let (step, inner) = (0.005, 50);
    let h = step / f64::from(inner);
    for k in 0..4000 {
        let t = f64::from(k) * step;
        // Steps between poses, as of a teach-in program.
        let wanted = 0.5 * (0.9 * t).sin().signum() + 0.3 * (2.3 * t).sin();
        if k > 0 {
            reached += (wanted - reached).clamp(-limit * step, limit * step);
        } else {
            reached = wanted;
        }
        for (column, value) in log.iter_mut().zip([t, q, wanted]) {
            column.push(value);
        }
        for _ in 0..inner {
            let torque = kp * (reached - q) - kd * v;
            v += h * (torque - ml * 9.81 * q.sin()) / j;
            q += h * v;
        }
    }
    let names = ["t", "q", "motor_command"].map(str::to_owned);
    let text = pendulum(&[("ml", ml)]);
    let limited = text.replace(
        "kind = \"position_servo\"",
        &format!("kind = \"position_servo\"\nrate_limit = {limit}"),
    );
    let error = |text: &str| {
        let found = identify(&servo(text), names.clone().into_iter().zip(log.clone()).collect());
        let (value, _) = value(&found, "kp");
        (value / kp - 1.0).abs()
    };
    let [with, without] = [error(&limited), error(&text)];
    assert!(
        with < 0.02 && without > 5.0 * with,
        "{with}, without the limit {without}"
    );
}

/// A feed-forward torque adds to a servo, and fixes its scale.
#[test]
fn a_feed_forward_torque_fixes_the_scale() {
    let forward = "[[actuator]]\ndrive = \"motor\"\nkind = \"current\"\ntorque_constant = 1\n";
    let servo = servo(&(pendulum(&[]) + forward));
    assert!(servo.scale.freedoms.is_empty(), "{:?}", servo.scale);
    assert_eq!(servo.actuators().len(), 2);
}

/// The EMPS axis with its voltage in place of the force, and with its mass as the known number: the force per volt is
/// that of the data set, 35.15 N/V, and friction is that of the published least squares on forces.
#[test]
fn the_emps_axis_is_identified_from_its_voltage() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/emps");
    let [train, pulses] = ["emps_train.csv", "emps_pulses.csv"].map(|name| format!("{folder}/{name}"));
    if !std::path::Path::new(&train).exists() {
        println!("skipped: {train} is absent");
        return;
    }
    let text = r#"
schema = 1
name = "emps_voltage"
[parameters]
gain = { unit = "N/A" }
[coordinates]
x = { nominal = 0 }
[[frame]]
name = "carriage"
on = "base"
joint = { prismatic = "x", axis = "x" }
[[part]]
on = "carriage"
mass = "95.1089"
[[drive]]
name = "screw"
joint = "x"
[[effect]]
kind = "viscous_friction"
at = "screw"
[[effect]]
kind = "coulomb_friction"
at = "screw"
[[effect]]
kind = "force_offset"
at = "screw"
[[actuator]]
drive = "screw"
kind = "voltage"
torque_constant = "gain"
resistance = 1
delay = 0
[recording.columns]
t = "t_s"
x = "q_meas_m"
screw_voltage = "u_V"
"#;
    let servo = servo(text);
    let [fit, check] = [train, pulses].map(|path| servo.equations.recording(path, &options()).unwrap());
    let found = servo.identify(&[&fit], &[&check]).unwrap();
    for (expression, published, share) in [
        ("gain", 35.150_651_882, 0.02),
        ("Fv_screw", 203.503_4, 0.04),
        ("Fc_screw", 20.393_5, 0.04),
    ] {
        let (value, std) = value(&found, expression);
        println!("{expression} {value} +- {std}, published {published}");
        assert!(
            (value - published).abs() < share * published,
            "{expression}: {value} +- {std}"
        );
    }
    for row in found.fit.iter().chain(&found.check) {
        println!("{row:?}");
        assert!(row.error < 0.09 * row.force, "{row:?}");
    }
}
