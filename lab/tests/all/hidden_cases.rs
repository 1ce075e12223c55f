//! Cases of the benchmark of hidden effects: recordings are reproducible, effects have the requested size, and the
//! residual of the truth is noise.

use modelmill_lab::case::{HiddenCase, class_of};
use modelmill_lab::coloured::{SpectrumFall, noise};
use modelmill_lab::judge::{CaseClass, SAME};
use modelmill_lab::plant::{DRIVES, PlantMotion, SpidermillPlant};
use modelmill_lab::random::CaseRandom;
use modelmill_lab::span::{ColumnSpan, norm};
use modelmill_lab::{columns, record, span};

const SEED: u64 = 3;

fn plant() -> SpidermillPlant {
    SpidermillPlant::load().expect("rig and model")
}

fn column(csv: &str, name: &str) -> Vec<f64> {
    let mut lines = csv.lines();
    let header = lines.next().expect("a header");
    let at = header.split(',').position(|n| n == name).expect("the column");
    let field = |line: &str| line.split(',').nth(at).expect("a field").parse().expect("a number");
    lines.map(field).collect()
}

#[test]
fn classes_come_in_the_shares_that_are_promised() {
    let of = |class| (1..=240).filter(|n| class_of(*n).0 == class).count();
    assert_eq!(CaseClass::ALL.map(of), [120, 48, 36, 36]);
    assert_eq!(class_of(1), (CaseClass::One, 0));
    assert_eq!(class_of(21), (CaseClass::One, 10));
}

/// In the first cases, the hidden effects explain the forces, and a model without effects does not.
#[test]
fn the_truth_explains_its_recording() {
    let plant = plant();
    for number in [1, 2, 3, 5] {
        let case = HiddenCase::draw(&plant, SEED, number).expect("a case");
        let truth = case.placed();
        assert!(!truth.is_empty());
        let left = case.excess(&plant, &truth).expect("columns of the library");
        assert!(left < SAME, "{}: {left}", case.truth());
        let nothing = case.excess(&plant, &[]).expect("no columns");
        assert!(nothing > 100.0 * SAME, "{}: {nothing}", case.truth());
        let [fit, _] = case.errors;
        assert!((0.01..0.35).contains(&fit), "{}: {fit}", case.truth());
    }
}

/// The residual of the model is the noise from which the noise floor is computed.
#[test]
fn a_recording_with_nothing_hidden_is_the_model_and_noise() {
    let plant = plant();
    let number = (1..100)
        .find(|n| class_of(*n).0 == CaseClass::None)
        .expect("such a class");
    let case = HiddenCase::draw(&plant, SEED, number).expect("a case");
    let recorded = record::record(&case, SEED, 0).expect("a recording");
    let again = record::record(&case, SEED, 0).expect("a recording");
    assert_eq!(recorded.csv, again.csv);
    let times = column(&recorded.csv, "t");
    let along = PlantMotion::new(&case.rig, &case.courses[0], times).expect("the same motion");
    let [left, right] = DRIVES.map(|drive| column(&recorded.csv, drive));
    let measured: Vec<f64> = left.into_iter().zip(right).flat_map(|(l, r)| [l, r]).collect();
    let span = ColumnSpan::from_columns(along.base(&plant.derivation).expect("columns"));
    let left = norm(&span.rest(&measured));
    let share = left / norm(&measured) / recorded.floor;
    assert!((share - 1.0).abs() < 2e-3, "{share}");
    let deviation = left / (measured.len() as f64).sqrt() / case.noise;
    assert!((deviation - 1.0).abs() < 0.05, "{deviation}");
}

/// A force outside the library has a residual even if all columns of the library are fitted together.
#[test]
fn no_library_says_what_is_outside() {
    let plant = plant();
    for number in (1..100).filter(|n| class_of(*n).0 == CaseClass::Outside).take(2) {
        let case = HiddenCase::draw(&plant, SEED, number).expect("a case");
        let along = &case.coarse[0];
        let forces = case.forces(along, &case.courses[0]).expect("forces");
        let mut all = ColumnSpan::from_columns(along.base(&plant.derivation).expect("columns"));
        all.extend(columns::library(along));
        let rest = span::rms(&all.rest(&forces));
        assert!(rest > 1.9 * case.noise, "{}: {rest}", case.truth());
    }
}

/// For a bilinear low-pass of first order, the correlation of neighbouring samples is the mean of 1 and the pole.
#[test]
fn coloured_noise_has_the_size_and_the_memory_that_are_asked_for() {
    let (rate, corner) = (250.0, 15.0);
    let values = noise(
        &mut CaseRandom::new(SEED, 1, 2),
        200_000,
        rate,
        2.0,
        Some((corner, SpectrumFall::Gentle)),
    );
    let product = |lag: usize| -> f64 {
        let pairs = values.iter().zip(&values[lag..]);
        pairs.map(|(a, b)| a * b).sum::<f64>() / values.len() as f64
    };
    let k = (std::f64::consts::PI * corner / rate).tan();
    let neighbours = 0.5 * (1.0 + (1.0 - k) / (1.0 + k));
    assert!((product(0).sqrt() - 2.0).abs() < 0.05, "{}", product(0));
    assert!((product(1) / product(0) - neighbours).abs() < 0.01);
}
