//! Numbers as the page prints them: largest and least values over runs, shares, and errors with rounding marked as
//! such.

use crate::PaperExperiment;
use crate::study::TreatmentRun;
use modelmill::text::table::significant;

/// A smaller error is rounding: its digits differ between machines and are meaningless.
const ROUNDING: f64 = 1e-8;

/// A parameter's value in the left column of Table 1.
pub(crate) fn nominal(experiment: &PaperExperiment, name: &str) -> f64 {
    let parameters = &experiment.paper.derivation.mechanism.parameters;
    let found = parameters.iter().find(|p| p.name == name);
    found.map_or(f64::NAN, |p| p.nominal)
}

/// The largest value of `of` over runs and drives.
pub(crate) fn largest(runs: &[TreatmentRun], of: impl Fn(&TreatmentRun, usize) -> f64) -> f64 {
    run_values(runs, of).fold(f64::NEG_INFINITY, f64::max)
}

/// The least value of `of` over runs and drives.
pub(crate) fn least(runs: &[TreatmentRun], of: impl Fn(&TreatmentRun, usize) -> f64) -> f64 {
    run_values(runs, of).fold(f64::INFINITY, f64::min)
}

/// The least and the largest value of `of` over runs and drives, as per cent.
pub(crate) fn range(runs: &[TreatmentRun], of: impl Fn(&TreatmentRun, usize) -> f64) -> String {
    format!("{} to {}", percent(least(runs, &of)), percent(largest(runs, &of)))
}

/// Values of `of` for all runs and drives.
fn run_values<'a>(
    runs: &'a [TreatmentRun],
    of: impl Fn(&TreatmentRun, usize) -> f64 + 'a,
) -> impl Iterator<Item = f64> + 'a {
    let pairs = runs
        .iter()
        .flat_map(|along| (0..along.measured.len()).map(move |d| (along, d)));
    pairs.map(move |(along, d)| of(along, d))
}

/// The share of the error that the placement explains, in squares: the least of all runs.
pub(crate) fn explained_text(runs: &[TreatmentRun]) -> String {
    let most = runs
        .iter()
        .map(|along| along.explained_error().remains)
        .fold(0.0, f64::max);
    share(1.0 - most * most)
}

/// A share near one as per cent.
pub(crate) fn share(value: f64) -> String {
    if 1.0 - value < 1e-6 {
        return "more than 99.9999 %".to_owned();
    }
    format!("{:.2} %", 100.0 * value)
}

/// An error as per cent, or a statement that it is rounding.
pub(crate) fn rounding(value: f64) -> String {
    if value < ROUNDING {
        "better than a part in 10^8".to_owned()
    } else {
        percent(value)
    }
}

/// A change relative to something, or a statement that it is rounding.
pub(crate) fn change(value: f64) -> String {
    if value < ROUNDING {
        "less than a part in 10^8".to_owned()
    } else {
        percent(value)
    }
}

/// A length in whole millimetres.
pub(crate) fn millimetres(metres: f64) -> String {
    format!("{:.0}", 1000.0 * metres)
}

/// A number as per cent with three digits; rounding errors are printed as zero.
pub(crate) fn percent(value: f64) -> String {
    if value < ROUNDING {
        return "0.0000 %".to_owned();
    }
    format!("{} %", significant(100.0 * value, 3))
}

/// Four decimals, without the sign of a rounded zero.
pub(crate) fn decimals(value: f64) -> String {
    let rounded = (1e4 * value).round() / 1e4;
    format!("{:.4}", if rounded == 0.0 { 0.0 } else { rounded })
}
