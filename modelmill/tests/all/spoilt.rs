//! Recordings of bundled models that are spoilt in one way: the fault is named with its kind and place, and a sound
//! recording has none.

use std::fmt::Write as _;

use crate::made::{Made, SAMPLES, STEP, bundled, run};
use modelmill::Model;
use modelmill::diagnose::{DiagnosisOptions, DiagnosisVerdict};
use modelmill::faults::RecordingFaultKind;
use modelmill::recording::{PreparedRecording, RecordingOptions};

/// A table of numbers with a header.
#[derive(Clone)]
struct Table {
    names: Vec<String>,
    rows: Vec<Vec<f64>>,
}

impl Table {
    /// The recording of a bundled model along a motion of its own.
    fn made(name: &str, seed: u64) -> Self {
        let text = std::fs::read_to_string(run(name, seed, Made::Nothing)).expect("a recording");
        let mut lines = text.lines();
        let names = lines.next().expect("a header").split(',').map(str::to_owned).collect();
        let row = |line: &str| line.split(',').map(|x| x.parse().expect("a number")).collect();
        Self {
            names,
            rows: lines.map(row).collect(),
        }
    }

    fn place(&self, name: &str) -> usize {
        self.names.iter().position(|other| other == name).expect("a column")
    }

    fn scaled(&self, name: &str, factor: f64) -> Self {
        self.changed(name, &|_, x| factor * x)
    }

    /// Each number of a column becomes a function of the sample and itself.
    fn changed(&self, name: &str, change: &dyn Fn(usize, f64) -> f64) -> Self {
        let mut table = self.clone();
        let place = self.place(name);
        for (k, row) in table.rows.iter_mut().enumerate() {
            row[place] = change(k, row[place]);
        }
        table
    }

    fn exchanged(&self, one: &str, other: &str) -> Self {
        let mut table = self.clone();
        let places = [one, other].map(|name| self.place(name));
        table.names.swap(places[0], places[1]);
        table
    }

    fn read(&self, model: &Model) -> PreparedRecording {
        let mut text = self.names.join(",");
        for row in &self.rows {
            text.push('\n');
            for (k, x) in row.iter().enumerate() {
                let comma = if k > 0 { "," } else { "" };
                write!(text, "{comma}{x}").expect("text");
            }
        }
        let read = model.recording_of_bytes("run.csv", text.into_bytes(), &RecordingOptions::default());
        read.expect("a recording")
    }
}

#[track_caller]
fn check(table: &Table, model: &Model, expected: Option<(RecordingFaultKind, &str)>) {
    let read = table.read(model);
    let found = read.suspected_fault();
    let named = found.map(|fault| (fault.kind, fault.at.join(" ")));
    match expected {
        None => assert_eq!(named, None),
        Some((kind, place)) => {
            let fault = found.expect("a fault");
            assert!(
                fault.kind == kind && fault.at.iter().any(|at| at == place),
                "{fault:#?}"
            );
            assert!(fault.is_correctable(), "{fault:#?}");
        }
    }
}

/// Units, signs and exchanges of an arm whose joints are coupled, over several motions.
#[test]
fn a_wrong_column_of_an_arm_is_named() {
    use RecordingFaultKind::{ExchangedColumns, TimeBase, Units, WrongSign};

    let model = Model::open(bundled("puma560")).expect("a model");
    for seed in 0..2 {
        let sound = Table::made("puma560", seed);
        check(&sound, &model, None);
        let names = model.active_coordinates();
        let drives = model.row_names();
        let degrees = 1.0_f64.to_degrees();
        check(&sound.scaled(&names[2], degrees), &model, Some((Units, &names[2])));
        check(&sound.scaled(&names[1], -1.0), &model, Some((WrongSign, &names[1])));
        check(&sound.scaled(&drives[2], -1.0), &model, Some((WrongSign, &drives[2])));
        check(&sound.scaled(&drives[1], 1e3), &model, Some((Units, &drives[1])));
        check(
            &sound.exchanged(&drives[1], &drives[2]),
            &model,
            Some((ExchangedColumns, &drives[1])),
        );
        check(
            &sound.exchanged(&names[1], &names[2]),
            &model,
            Some((ExchangedColumns, &names[1])),
        );
        check(&sound.scaled("t", 1e3), &model, Some((TimeBase, "t")));
    }
}

/// Intervals without a force are found to a tenth of a second, and leave nothing else to report.
#[test]
fn forces_that_were_not_measured_are_left_out() {
    let model = Model::open(bundled("two_link")).expect("a model");
    let drives = model.row_names();
    let sound = Table::made("two_link", 5);
    let kinds = |read: &PreparedRecording| -> Vec<String> {
        let faults = read.segments.iter().flat_map(|one| &one.faults);
        faults.map(|fault| fault.kind.clone()).collect()
    };
    assert_eq!(kinds(&sound.read(&model)), [""; 0]);
    let (from, to) = (SAMPLES / 2, SAMPLES * 3 / 4);
    let place = sound.place(&drives[1]);
    for (level, kind) in [(0.0, "dead_channel"), (sound.rows[from][place], "frozen_force")] {
        let spoilt = sound.changed(&drives[1], &|k, x| if (from..to).contains(&k) { level } else { x });
        let read = spoilt.read(&model);
        assert_eq!(kinds(&read), [kind]);
        let fault = &read.segments[0].faults[0];
        let [start, end] = fault.interval.expect("a time");
        assert!(
            (start - STEP * from as f64).abs() < 0.1 && (end - STEP * to as f64).abs() < 0.1,
            "{fault:?}"
        );
        assert_eq!(fault.at, [drives[1].clone()]);
        let run = &read.segments[0].run;
        let is_in = |k: &usize| (start..end).contains(&run.time[*k]);
        let lost = (0..run.samples()).filter(is_in).all(|k| !run.is_force_measured(1, k));
        assert!(lost && (0..run.samples()).all(|k| run.is_force_measured(0, k)));
    }
}

/// A reading that repeats one number is stuck, also while its joint moves so little that friction could hold it.
#[test]
fn a_number_that_repeats_is_stuck_though_the_joint_hardly_moves() {
    let model = Model::open(bundled("two_link")).expect("a model");
    let (names, drives) = (model.active_coordinates(), model.row_names());
    let sound = Table::made("two_link", 5);
    let (position, force) = (sound.place(&names[1]), sound.place(&drives[1]));
    let travel = |rows: &[Vec<f64>]| {
        let q = rows.iter().map(|row| row[position]);
        q.clone().fold(f64::MIN, f64::max) - q.fold(f64::MAX, f64::min)
    };
    // About the turning point at which the joint moves least.
    let length = 50;
    let starts = (SAMPLES / 4..SAMPLES * 3 / 4).min_by(|a, b| {
        let [a, b] = [*a, *b].map(|k| travel(&sound.rows[k..k + length]));
        a.total_cmp(&b)
    });
    let from = starts.expect("a turning point");
    let share = travel(&sound.rows[from..from + length]) / travel(&sound.rows);
    assert!((0.002..0.05).contains(&share), "{share}");
    let level = sound.rows.iter().map(|row| row[force]).fold(f64::MIN, f64::max);
    let spoilt = sound.changed(&drives[1], &|k, x| {
        if (from..from + length).contains(&k) {
            0.8 * level
        } else {
            x
        }
    });
    let read = spoilt.read(&model);
    let faults: Vec<&str> = (read.segments.iter().flat_map(|one| &one.faults))
        .map(|fault| fault.kind.as_str())
        .collect();
    assert_eq!(faults, ["frozen_force"]);
}

/// A reading that is cut off is a limit, and the samples there are left out; commands at a limit that the model explains
/// are none.
#[test]
fn a_force_that_is_cut_off_is_left_out_at_its_limit() {
    let model = Model::open(bundled("two_link")).expect("a model");
    let drives = model.row_names();
    let sound = Table::made("two_link", 5);
    let place = sound.place(&drives[1]);
    let mut sizes: Vec<f64> = sound.rows.iter().map(|row| row[place].abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let limit = sizes[sizes.len() * 85 / 100];
    let read = sound.changed(&drives[1], &|_, x| x.clamp(-limit, limit)).read(&model);
    let faults: Vec<&str> = (read.segments.iter().flat_map(|one| &one.faults))
        .map(|fault| fault.kind.as_str())
        .collect();
    assert!(
        !faults.is_empty() && faults.iter().all(|kind| *kind == "saturation"),
        "{faults:?}"
    );
    let run = &read.segments[0].run;
    let lost = (0..run.samples()).filter(|k| !run.is_force_measured(1, *k)).count();
    assert!(lost as f64 > 0.1 * run.samples() as f64, "{lost}");
}

/// A clock that runs slow or fast shows in the forces if no rate is recorded. With a single length in the model it cannot be
/// distinguished from an error of that length by twice the share, so that each names the other. A sound clock is not named.
#[test]
fn a_wrong_clock_is_named_with_its_size() {
    let model = Model::open(bundled("two_link")).expect("a model");
    for factor in [1.0, 1.03, 0.97] {
        let mut table = Table::made("two_link", 5);
        let kept: Vec<usize> = (0..table.names.len())
            .filter(|k| !table.names[*k].contains("_d"))
            .collect();
        table.names = kept.iter().map(|k| table.names[*k].clone()).collect();
        for row in &mut table.rows {
            *row = kept.iter().map(|k| row[*k]).collect();
        }
        let read = table.scaled("t", factor).read(&model);
        let found = model
            .diagnose(&[&read], &[], &DiagnosisOptions::default())
            .expect("a diagnosis");
        let share = factor - 1.0_f64;
        if share.abs() < 1e-6 {
            assert!(found.missing.is_empty());
            assert!(found.diagnosis.disturbances.iter().all(|one| one.kind != "time_base"));
            continue;
        }
        let clock = found.diagnosis.disturbances.iter().find(|one| one.kind == "time_base");
        if let Some(clock) = clock {
            assert!(found.missing.is_empty());
            assert!((clock.estimates[0].value - share).abs() < 0.005, "{factor}: {clock:?}");
            let says = clock.description.as_deref().unwrap_or_default();
            assert!(says.contains("lengths of the model that are all"), "{says}");
            continue;
        }
        let [length] = found.missing.as_slice() else {
            panic!(
                "{factor}: neither a clock nor one length: {:?}",
                found.diagnosis.effects
            );
        };
        let effect = &length.effect;
        assert_eq!(
            (effect.kind.as_str(), effect.at.join(" ").as_str()),
            ("constant_error", "L")
        );
        let value = length.estimates[0].value;
        let expected = 0.5 * (factor * factor - 1.0);
        assert!(
            (value - expected).abs() < 0.1 * expected.abs(),
            "{factor}: {value} for {expected}"
        );
        assert!(length.indistinguishable_from.iter().any(|one| one.kind == "time_base"));
    }
}

/// Recordings with gaps are diagnosed with the segments that are long enough.
#[test]
fn short_segments_between_gaps_are_left_out_of_a_diagnosis() {
    let model = Model::open(bundled("two_link")).expect("a model");
    let mut table = Table::made("two_link", 5);
    // The segment between both gaps has 40 samples.
    let middle = SAMPLES / 3;
    table.rows.drain(middle + 70..middle + 100);
    table.rows.drain(middle..middle + 30);
    let read = table.read(&model);
    let found = model
        .diagnose(&[&read], &[], &DiagnosisOptions::default())
        .expect("a diagnosis");
    assert!(found.missing.is_empty(), "{:?}", found.missing.len());
}

/// The verdict names the fault, the rest holds for the corrected recording, and two faults are both found.
#[test]
fn a_diagnosis_runs_on_the_corrected_recordings() {
    let model = Model::open(bundled("two_link")).expect("a model");
    let (names, drives) = (model.active_coordinates(), model.row_names());
    let [fit, check] = [3, 4].map(|seed| Table::made("two_link", seed));
    let spoilt = |table: &Table| table.scaled(&names[1], 1.0_f64.to_degrees()).scaled(&drives[0], 1e3);
    let diagnose = |fit: &Table, check: &Table| {
        let [fit, check] = [fit, check].map(|table| table.read(&model));
        model
            .diagnose(&[&fit], &[&check], &DiagnosisOptions::default())
            .expect("a diagnosis")
    };
    let sound = diagnose(&fit, &check);
    assert!(sound.corrected.is_empty(), "{:?}", sound.corrected);
    let found = diagnose(&spoilt(&fit), &spoilt(&check));
    let kinds: Vec<RecordingFaultKind> = found.corrected.iter().map(|fault| fault.kind).collect();
    assert_eq!(kinds, [RecordingFaultKind::Units; 2], "{:?}", found.corrected);
    assert!(found.unresolved.is_empty() && found.missing.len() == sound.missing.len());
    assert_ne!(found.diagnosis.verdict, DiagnosisVerdict::Adequate);
    let says = found.verdict_text();
    assert!(says.contains("With these corrected, the model"), "{says}");
    // Errors are those of the sound recordings.
    let last = |one: &modelmill::diagnose::DiagnosisFindings| one.diagnosis.steps.last().expect("a step").check;
    assert!(
        (last(&found) / last(&sound) - 1.0).abs() < 0.05,
        "{} {}",
        last(&found),
        last(&sound)
    );
}
