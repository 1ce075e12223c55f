//! Comparison and diagnosis of servo logs without forces: what is planted in a pendulum on a position servo is found, and
//! nothing is found where nothing is planted.

use std::f64::consts::TAU;

use modelmill::diagnose::{DiagnosisFindings, DiagnosisOptions};
use modelmill::recording::{PreparedRecording, RecordingOptions};
use modelmill::{Error, Model};

use crate::servo::{Columns, Planted, PlantedLimits, pendulum, simulate_limited};

const KNOWN: [(&str, f64); 2] = [("kp", 20.0), ("kd", 0.4)];
pub(crate) const PLANTED: Planted = Planted {
    j: 0.05,
    ml: 0.15,
    kp: 20.0,
    kd: 0.4,
    viscous: 0.05,
    coulomb: 0.1,
    delay: 0.008,
};
pub(crate) const NONE: PlantedLimits = PlantedLimits {
    saturation: f64::INFINITY,
    dead_band: 0.0,
};

pub(crate) fn model(text: &str) -> Model {
    Model::from_text("servo.toml", text).unwrap()
}

/// A log as a recording with the forces of the actuator.
pub(crate) fn prepare(model: &Model, log: Columns) -> Result<PreparedRecording, Error> {
    let options = RecordingOptions::default();
    let read = model.read_recording_of_table("log", log, &options);
    let [mut fit, _] = model.prepare_together(model.add_actuator_forces([vec![read], Vec::new()]));
    fit.remove(0)
}

/// The diagnosis of a log of 25 s.
fn diagnose(text: &str, planted: &Planted, limits: PlantedLimits) -> DiagnosisFindings {
    let model = model(text);
    let run = prepare(&model, simulate_limited(planted, limits, 7, 5000)).unwrap();
    model.diagnose(&[&run], &[], &DiagnosisOptions::default()).unwrap()
}

/// What a diagnosis claims: effects, then limits of servos.
fn claims(findings: &DiagnosisFindings) -> Vec<String> {
    let effects = findings.missing.iter().map(|one| one.effect.kind.clone());
    let limits = findings.diagnosis.disturbances.iter().map(|one| one.kind.clone());
    // Faults of force sensors are false where forces are computed.
    let of_servos = [
        "servo_saturation",
        "servo_dead_band",
        "signal_delay",
        "saturation",
        "frozen_force",
        "dead_channel",
    ];
    effects
        .chain(limits.filter(|kind| of_servos.contains(&kind.as_str())))
        .collect()
}

/// A log whose position is that of an encoder of 12 bits.
fn by_encoder(mut log: Columns) -> Columns {
    let step = std::f64::consts::TAU / 4096.0;
    for (_, values) in log.iter_mut().filter(|(name, _)| name == "q") {
        for value in values {
            *value = step * (*value / step).round();
        }
    }
    log
}

/// The values of the base parameters of the pendulum, by their expressions.
pub(crate) fn values(model: &Model, planted: &Planted) -> Vec<f64> {
    let value = |expression: &str| match expression {
        "J" => planted.j,
        "ml" => planted.ml,
        "Fv_motor" => planted.viscous,
        "Fc_motor" => planted.coulomb,
        // Numbers of the file.
        "1" => 1.0,
        other => panic!("{other}"),
    };
    model.base.iter().map(|base| value(&base.expression)).collect()
}

#[test]
fn forces_follow_from_commands_and_gains() {
    let model = model(&pendulum(&KNOWN));
    let run = prepare(&model, simulate_limited(&PLANTED, NONE, 1, 5000)).unwrap();
    assert!(run.has_forces());
    let compared = model.compare(&[&run], &values(&model, &PLANTED)).unwrap();
    let error = compared.figures.nrms.unwrap();
    assert!(error < 0.06, "{error}");
    let says: Vec<String> = run.notes().map(|note| note.says.in_library_words()).collect();
    assert!(
        says.iter().any(|text| text.contains("computed from the signals")),
        "{says:?}"
    );
}

/// A command of 350 degrees and one of -10 degrees are the same pose: neither constant turns nor angles that are wrapped to
/// one turn change a force.
#[test]
fn commands_that_differ_by_full_turns_give_the_same_forces() {
    let model = model(&pendulum(&KNOWN));
    let log = simulate_limited(&PLANTED, NONE, 1, 5000);
    let error_and_notes = |change: &dyn Fn(f64) -> f64| {
        let mut changed = log.clone();
        for (_, values) in changed.iter_mut().filter(|(name, _)| name == "motor_command") {
            for value in values {
                *value = change(*value);
            }
        }
        let run = prepare(&model, changed).unwrap();
        let compared = model.compare(&[&run], &values(&model, &PLANTED)).unwrap();
        let notes: Vec<String> = run.notes().map(|note| note.says.in_library_words()).collect();
        (compared.figures.nrms.unwrap(), notes.join("\n"))
    };
    let (expected, plain) = error_and_notes(&|q| q);
    assert!(!plain.contains("full turns"), "{plain}");
    let (turned, says) = error_and_notes(&|q| q - 2.0 * TAU);
    assert!(says.contains("full turns (2) were added to `motor_command`"), "{says}");
    let (wrapped, _) = error_and_notes(&|q| q.rem_euclid(TAU));
    for error in [turned, wrapped] {
        assert!((error / expected - 1.0).abs() < 1e-6, "{error} {expected}");
    }
}

#[test]
fn a_lacking_friction_is_found_without_forces_and_nothing_else() {
    let text = pendulum(&KNOWN);
    assert_eq!(claims(&diagnose(&text, &PLANTED, NONE)), Vec::<String>::new());
    let without = text.replace("[[effect]]\nkind = \"coulomb_friction\"\nat = \"motor\"\n", "");
    assert!(without.len() < text.len());
    assert_eq!(claims(&diagnose(&without, &PLANTED, NONE)), ["coulomb_friction"]);
}

#[test]
fn limits_of_a_servo_are_found_with_their_size_and_respected_from_the_file() {
    let saturated = PlantedLimits {
        saturation: 1.6,
        ..NONE
    };
    let idle = PlantedLimits {
        dead_band: 0.02,
        ..NONE
    };
    let text = pendulum(&KNOWN);
    for (limits, kind, size, entry) in [
        (saturated, "servo_saturation", 1.6, "saturation = 1.6"),
        (idle, "servo_dead_band", 0.02, "dead_band = 0.02"),
    ] {
        let found = diagnose(&text, &PLANTED, limits);
        assert_eq!(claims(&found), [kind]);
        let limit = found
            .diagnosis
            .disturbances
            .iter()
            .find(|one| one.kind == kind)
            .unwrap();
        let value = limit.estimates[0].value;
        // A saturation is estimated roughly, and forces about it are left out.
        let most = if kind == "servo_saturation" { 0.4 } else { 0.15 };
        assert!((value - size).abs() < most * size, "{kind} {value}");
        // With the limit in the file nothing is left to find.
        let with_limit = text.replace("kd = \"0.4\"", &format!("kd = \"0.4\"\n{entry}"));
        assert_eq!(claims(&diagnose(&with_limit, &PLANTED, limits)), Vec::<String>::new());
    }
}

/// The noise of a coarse encoder, and jumps of the friction above the cut-off of the positions, are no effects.
#[test]
fn clean_logs_of_coarse_encoders_give_no_claims() {
    let model = model(&pendulum(&KNOWN));
    for seed in 11..15 {
        let run = prepare(&model, by_encoder(simulate_limited(&PLANTED, NONE, seed, 5000))).unwrap();
        let findings = model.diagnose(&[&run], &[], &DiagnosisOptions::default()).unwrap();
        assert_eq!(claims(&findings), Vec::<String>::new(), "seed {seed}");
    }
}

/// A delay that the file gives is not estimated, so that a wrong one is reported with its size.
#[test]
fn a_wrong_delay_of_the_file_is_reported() {
    let text = pendulum(&KNOWN).replace("kd = \"0.4\"", "kd = \"0.4\"\ndelay = 0.003");
    let found = diagnose(&text, &PLANTED, NONE);
    assert_eq!(claims(&found), ["signal_delay"]);
    let disturbances = &found.diagnosis.disturbances;
    let delay = disturbances.iter().find(|one| one.kind == "signal_delay").unwrap();
    let shift = delay.estimates[0].value;
    assert!((shift - 0.005).abs() < 0.0005, "{shift}");
}

#[test]
fn unknown_gains_without_a_scale_are_refused_with_the_reason() {
    let text = pendulum(&[]);
    let says = match prepare(&model(&text), simulate_limited(&PLANTED, NONE, 3, 3000)) {
        Err(error) => error.message().in_library_words(),
        Ok(_) => panic!("forces without a scale"),
    };
    assert!(says.contains("kp") && says.contains("only ratios"), "{says}");
}

#[test]
fn unknown_gains_are_identified_where_a_number_fixes_the_scale() {
    let model = model(&pendulum(&[("ml", 0.15)]));
    let run = prepare(&model, simulate_limited(&PLANTED, NONE, 4, 5000)).unwrap();
    assert!(run.has_forces());
    let findings = model.diagnose(&[&run], &[], &DiagnosisOptions::default()).unwrap();
    assert_eq!(claims(&findings), Vec::<String>::new());
}
