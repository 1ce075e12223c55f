//! Laws over random mechanisms. A failure names the kind and the seed: `random::tree(17, Matter::Anything)` makes
//! `tree_17` again.

use std::sync::LazyLock;

use modelmill_tests::laws::Case;
use modelmill_tests::random::{self, Matter};

const TREES: u64 = 200;
const LOOPS: u64 = 100;
const PHYSICAL: u64 = 40;

/// Derived cases, or why there is none.
type Cases = Vec<Result<Case, String>>;

fn trees_of(matter: Matter, n: u64) -> Cases {
    (0..n)
        .map(|seed| Case::new(&random::tree(seed, matter), 120, 3.0))
        .collect()
}

fn loops_of(matter: Matter, n: u64) -> Cases {
    (0..n)
        .map(|seed| Case::new(&random::planar_loop(seed, matter), 120, 0.4))
        .collect()
}

static TREES_OF_ANYTHING: LazyLock<Cases> = LazyLock::new(|| trees_of(Matter::Anything, TREES));
static LOOPS_OF_ANYTHING: LazyLock<Cases> = LazyLock::new(|| loops_of(Matter::Anything, LOOPS));
static PHYSICAL_TREES: LazyLock<Cases> = LazyLock::new(|| trees_of(Matter::Physical, PHYSICAL));
static PHYSICAL_LOOPS: LazyLock<Cases> = LazyLock::new(|| loops_of(Matter::Physical, PHYSICAL));

/// Checks a law on all cases; reports every breach, and prints the law's figures: an error, or the gap of a rank.
#[track_caller]
fn check(cases: &[&Cases], law: impl Fn(&Case) -> Result<f64, String>) {
    let mut breaches = Vec::new();
    let mut figures: Vec<f64> = Vec::new();
    for case in cases.iter().flat_map(|c| c.iter()) {
        match case.as_ref().map_err(Clone::clone).and_then(&law) {
            Ok(figure) => figures.push(figure),
            Err(breach) => breaches.push(breach),
        }
    }
    println!(
        "{} mechanisms keep the law; figures from {:.1e} to {:.1e}",
        figures.len(),
        figures.iter().copied().fold(f64::INFINITY, f64::min),
        figures.iter().copied().fold(0.0, f64::max)
    );
    assert!(
        breaches.is_empty(),
        "{} of {} mechanisms break the law:\n{}",
        breaches.len(),
        breaches.len() + figures.len(),
        breaches.join("\n")
    );
}

fn everything() -> [&'static Cases; 4] {
    [&TREES_OF_ANYTHING, &LOOPS_OF_ANYTHING, &PHYSICAL_TREES, &PHYSICAL_LOOPS]
}

#[test]
fn the_exact_rank_is_the_rank_of_a_large_sample() {
    check(&everything(), Case::exact_rank_is_numeric_rank);
}

#[test]
fn reduction_keeps_the_forces() {
    check(&everything(), Case::reduction_keeps_the_forces);
}

#[test]
fn forces_satisfy_dalemberts_principle() {
    check(&everything(), |case| case.forces_satisfy_dalembert(5));
}

#[test]
fn loops_stay_closed_with_their_rates_and_accelerations() {
    check(&[&LOOPS_OF_ANYTHING, &PHYSICAL_LOOPS], Case::loops_stay_closed);
}

#[test]
fn power_of_the_drives_is_the_rate_of_energy() {
    check(&[&PHYSICAL_TREES, &PHYSICAL_LOOPS], Case::power_is_the_rate_of_energy);
}

#[test]
fn the_mass_matrix_of_real_bodies_is_symmetric_and_positive_definite() {
    check(
        &[&PHYSICAL_TREES, &PHYSICAL_LOOPS],
        Case::mass_matrix_is_symmetric_and_positive_definite,
    );
}

#[test]
fn forces_do_not_depend_on_the_base_frame() {
    check(
        &[&PHYSICAL_TREES, &PHYSICAL_LOOPS],
        Case::the_base_frame_does_not_matter,
    );
}
