//! What a fit of a servo log is for: it is read again, the model with it moves as the machine does under the same commands,
//! and its positions are verified. The machine is the closed-form pendulum of `servo.rs`.

use modelmill::forward::SimulationInput;
use modelmill::print::RustWording;
use modelmill::recording::{PreparedRecording, RecordingOptions};
use modelmill::servo::ServoModel;
use modelmill::verify::{CheckScope, CheckState, VerificationLimits};
use modelmill::{Host, Model};

use crate::servo::{Columns, Planted, PlantedLimits, pendulum, simulate_limited};
use crate::servo_diagnosis::{self, NONE as UNLIMITED, PLANTED, model, values};

fn prepare(model: &Model, log: Columns) -> PreparedRecording {
    servo_diagnosis::prepare(model, log).unwrap()
}

/// Rms difference of the position of a simulation under the commands of a log and the position of the log, rad.
fn position_error(model: &Model, values: &[f64], log: &Columns) -> f64 {
    let run = prepare(model, log.clone());
    let made = model.simulate_motion(&run, values).unwrap();
    assert_eq!(made.input, SimulationInput::Commands);
    let start = log[0].1.iter().position(|t| *t >= made.time[0] - 1e-9).unwrap();
    let errors = made.q[0].iter().zip(&log[1].1[start..]).map(|(a, b)| (a - b).powi(2));
    (errors.sum::<f64>() / made.samples() as f64).sqrt()
}

const KNOWN: [(&str, f64); 4] = [("J", 0.05), ("ml", 0.15), ("kp", 20.0), ("kd", 0.4)];

#[test]
fn a_servo_moves_as_its_commands_say() {
    let log = simulate_limited(&PLANTED, UNLIMITED, 3, 4000);
    let exact = model(&pendulum(&KNOWN[2..]));
    let error = position_error(&exact, &values(&exact, &PLANTED), &log);
    assert!(error < 1e-3, "{error}");
    // The motion has 0.5 rad; a softer servo moves otherwise.
    let soft = model(&pendulum(&[("kp", 10.0), ("kd", 0.4)]));
    let error = position_error(&soft, &values(&soft, &PLANTED), &log);
    assert!(error > 1e-2, "{error}");
}

#[test]
fn limits_of_a_servo_act_in_a_simulation() {
    let limits = PlantedLimits {
        saturation: 1.0,
        dead_band: 0.01,
    };
    let log = simulate_limited(&PLANTED, limits, 5, 4000);
    let limited = pendulum(&KNOWN[2..]) + "saturation = 1.0\ndead_band = 0.01\ndelay = 0.008\n";
    let limited = model(&limited);
    let error = position_error(&limited, &values(&limited, &PLANTED), &log);
    assert!(error < 3e-3, "{error}");
    let other = pendulum(&KNOWN[2..]) + "saturation = 0.7\ndead_band = 0.03\ndelay = 0.008\n";
    let other = model(&other);
    let error = position_error(&other, &values(&other, &PLANTED), &log);
    assert!(error > 2e-2, "{error}");
}

/// The fit of a log, as the file that the program writes.
fn fit_text(text: &str, log: &Columns) -> String {
    let servo = model(text).servo_model().unwrap();
    let options = ServoModel::reading(&RecordingOptions::default());
    let run = servo
        .equations
        .recording_of_table("log", log.clone(), &options)
        .unwrap();
    let found = servo.identify(&[&run], &[]).unwrap();
    found.json(&RustWording).to_string()
}

#[test]
fn a_fit_from_commands_is_read_again_with_its_gains() {
    let log = simulate_limited(&PLANTED, UNLIMITED, 1, 6000);
    let text = pendulum(&[("ml", 0.15)]);
    let fit = Host::new().fit_of_text(&fit_text(&text, &log), "fit.json").unwrap();
    let unknown = model(&text);
    let read = unknown.values_of(&fit, "fit.json").unwrap();
    let gain = |name: &str| read.gains.iter().find(|(one, _)| one == name).unwrap().1;
    let base = |expression: &str| {
        let k = unknown
            .base
            .iter()
            .position(|base| base.expression == expression)
            .unwrap();
        read.values[k]
    };
    let near = |value: f64, truth: f64| assert!((value - truth).abs() < 0.03 * truth, "{value} instead of {truth}");
    near(gain("kp"), PLANTED.kp);
    near(base("J"), PLANTED.j);
    near(base("Fc_motor"), PLANTED.coulomb);
    // The signals determine only this sum.
    near(gain("kd") + base("Fv_motor"), PLANTED.kd + PLANTED.viscous);
    assert!(fit.covariance.is_some());
    // The model with the fit moves as the machine does under other commands.
    let fitted = unknown.with_fit(&read);
    let other = simulate_limited(&PLANTED, UNLIMITED, 2, 4000);
    let error = position_error(&fitted, &fitted.values, &other);
    assert!(error < 3e-3, "{error}");
    // The adopted file says the same.
    let adopted = unknown.adopt(&fit, "fit.json").unwrap();
    let adopted = model(&adopted.text);
    let error = position_error(&adopted, &adopted.values, &other);
    assert!(error < 3e-3, "{error}");
}

/// A nominal gain that friction hides is kept, and the friction is the rest.
#[test]
fn a_nominal_gain_separates_its_friction() {
    let log = simulate_limited(&PLANTED, UNLIMITED, 1, 6000);
    let text =
        pendulum(&[("ml", 0.15)]).replace("kd = { unit = \"N m s\" }", "kd = { unit = \"N m s\", nominal = 0.4 }");
    let fit = Host::new().fit_of_text(&fit_text(&text, &log), "fit.json").unwrap();
    let kd = fit.gains.iter().find(|gain| gain.name == "kd").unwrap();
    assert_eq!((kd.value, kd.std), (0.4, None));
    let viscous = fit.parameters.iter().find(|one| one.expression == "Fv_motor").unwrap();
    let std = viscous.std.unwrap();
    assert!(
        (viscous.value - PLANTED.viscous).abs() < 3.0 * std.max(0.005),
        "{viscous:?}"
    );
}

/// The friction of the file is not a part of the gain that is identified with it.
#[test]
fn a_gain_without_a_value_leaves_out_the_friction_of_the_file() {
    let log = simulate_limited(&PLANTED, UNLIMITED, 1, 6000);
    let friction = "kind = \"viscous_friction\"\nat = \"motor\"\n";
    let text = pendulum(&[("ml", 0.15), ("kp", 20.0)]).replace(
        friction,
        &format!("{friction}parameters = {{ Fv = {{ nominal = 0.2 }} }}\n"),
    );
    let planted = Planted {
        kd: 0.25,
        viscous: 0.2,
        ..PLANTED
    };
    let unknown = model(&text);
    let run = prepare(&unknown, log.clone());
    let compared = unknown.compare(&[&run], &values(&unknown, &planted)).unwrap();
    let error = compared.figures.nrms.unwrap();
    assert!(error < 0.06, "{error}");
    // A fit has the same gain, and the friction with the uncertainty of the sum.
    let fit = Host::new().fit_of_text(&fit_text(&text, &log), "fit.json").unwrap();
    let kd = &fit.gains[0];
    assert!((kd.value - 0.25).abs() < 0.02 && kd.std.is_none(), "{kd:?}");
    let viscous = fit.parameters.iter().find(|one| one.expression == "Fv_motor").unwrap();
    assert!(
        (viscous.value - 0.2).abs() < 1e-9 && viscous.std.is_some_and(|std| std > 0.0),
        "{viscous:?}"
    );
    assert!(fit.covariance.is_some());
}

#[test]
fn a_fit_with_ratios_only_is_refused() {
    let log = simulate_limited(&PLANTED, UNLIMITED, 1, 3000);
    let text = fit_text(&pendulum(&[]), &log);
    let error = Host::new().fit_of_text(&text, "fit.json").unwrap_err().to_string();
    assert!(error.contains("only ratios"), "{error}");
}

#[test]
fn positions_are_verified_over_their_horizon() {
    let log = simulate_limited(&PLANTED, UNLIMITED, 3, 4000);
    let state = |text: &str, limits: &str| {
        let model = model(text);
        let model = model.with_values(&values(&model, &PLANTED));
        let run = prepare(&model, log.clone());
        let limits = VerificationLimits::parse(&model, limits, "verify.toml").unwrap();
        let verified = model.verify(&[&run], &limits).unwrap();
        let mut checks = verified
            .checks
            .into_iter()
            .filter(|one| one.scope == CheckScope::Position);
        let check = checks.next().unwrap();
        assert_eq!(
            (check.at.as_str(), check.unit.as_str(), checks.next()),
            ("q", "rad", None)
        );
        assert_eq!(check.state == CheckState::Fail, check.cause.is_some(), "{check:?}");
        (check.state, check.says)
    };
    let exact = pendulum(&KNOWN[2..]);
    let (passes, says) = state(&exact, "[positions.q]\nerror = 0.002\nhorizon = 2.0\n");
    assert!(passes == CheckState::Pass && says.contains("over 2.00 s"), "{says}");
    let (fails, says) = state(
        &pendulum(&[("kp", 12.0), ("kd", 0.4)]),
        "[all_positions]\nerror = 0.002\n",
    );
    assert!(
        fails == CheckState::Fail && says.contains("recorded commands over 1.00 s"),
        "{says}"
    );
}

#[test]
fn wrong_limits_of_positions_name_their_line() {
    let model = model(&pendulum(&KNOWN[2..]));
    let says = |text: &str| {
        let error = VerificationLimits::parse(&model, text, "verify.toml").unwrap_err();
        error.to_string()
    };
    assert!(says("[positions.p]\nerror = 1.0\n").contains("line 1: servo.toml has no independent coordinate `p`"));
    assert!(says("[positions.q]\nlimit = 1.0\n").contains("line 2: there is no limit `limit` of a position"));
    assert!(says("[positions.q]\nhorizon = 1.0\n").contains("[positions.q] has no `error`"));
    assert!(says("[all_positions]\nhorizon = 1.0\n").contains("[all_positions] has no `error`"));
    assert!(says("[all_positions]\nhorizon = -1\n").contains("line 2: `horizon` is a number above 0"));
}
