//! The information criterion by which the search compares sets of effects: a fitted set goes in, a number comes out.

use super::bench::{ScoredEffectSet, SelectedEffect};
use super::problem::DiagnosisProblem;
use super::thresholds::PLACE_PRICE;

/// Information criterion of a set (less is better), with `worth` independent equations. Sets that are physically
/// impossible come last.
pub(crate) fn criterion(problem: &DiagnosisProblem, trial: &ScoredEffectSet, worth: f64) -> f64 {
    let wrong = if trial.is_possible() { 0.0 } else { 1e12 };
    worth * trial.squares.max(f64::MIN_POSITIVE).ln()
        + trial.freedoms as f64 * worth.ln().max(1.0)
        + overlap(problem, &trial.picks)
        + wrong
}

/// Small penalty for sets in which one kind acts twice at a place, which a simpler set describes as well, and for many
/// places.
fn overlap(problem: &DiagnosisProblem, picks: &[SelectedEffect]) -> f64 {
    let effect = |pick: &SelectedEffect| &problem.candidates[pick.candidate].effect;
    // Number of later effects of the same kind that share a place.
    let twice = |(i, one): (usize, &SelectedEffect)| {
        let others = picks[i + 1..].iter().filter(|other| {
            effect(one).kind == effect(other).kind
                && effect(one).at.iter().any(|place| effect(other).at.contains(place))
        });
        others.count() as f64
    };
    let places: usize = picks.iter().map(|pick| effect(pick).at.len()).sum();
    picks.iter().enumerate().map(twice).sum::<f64>() + PLACE_PRICE * places as f64
}
