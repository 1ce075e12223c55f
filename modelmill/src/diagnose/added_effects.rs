//! The effects found, as entries of a model file, and the edit of the file in memory.

use modelmill_identify::diagnose::IdentifiedEffect;
use modelmill_spec::edit::{NewEffect, NewParameter};
use modelmill_spec::{EffectKind, LoadedModel};

use crate::error::{Error, Outcome};
use crate::model::Model;

use super::estimates::{effect_estimates, round_significant};
use super::places::candidate_places;
use super::problem::DiagnosisSolution;
use super::thresholds::ESTIMATE_MOST_DIGITS;

/// A model file with the effects found, not yet written to disk.
#[derive(Clone, Debug)]
pub struct CompletedModelFile {
    /// Text of the file.
    pub text: String,
    /// The loaded model.
    pub loaded: LoadedModel,
}

/// The effects found, as entries whose nominal values are the estimates.
pub(crate) fn entries(model: &Model, answer: &DiagnosisSolution) -> Vec<NewEffect> {
    // An effect that has no place in a model file is no entry.
    let spots = candidate_places(&model.derivation.mechanism);
    let found = answer.diagnosis.effects.iter();
    let entries = found.filter_map(|found| {
        let kinds = &answer.candidates.kinds;
        let kind = kinds.iter().find(|kind| kind.name == found.effect.kind)?;
        // A delay of one drive is a fault of the recording; only a delay of all forces is an entry of a model file.
        let may_act = |name: &String| {
            let mut of_name = spots.iter().filter(|spot| spot.name == *name);
            of_name.any(|spot| kind.on.contains(&spot.sort))
        };
        found.effect.at.first().filter(|name| may_act(name))?;
        Some((entry(found, kind, answer), kind.places == Some(2)))
    });
    // Effects that couple two places are kept apart: a place may be coupled with several others.
    let (pairs, others): (Vec<_>, Vec<_>) = entries.partition(|(_, couples)| *couples);
    let only = |entries: Vec<(NewEffect, bool)>| entries.into_iter().map(|(entry, _)| entry);
    let mut made = split_shared_places(only(others).collect());
    // Couplings come last, after the effects of single places.
    made.extend(only(pairs));
    made
}

/// Splits entries of one kind that share places, such as friction at both drives and more at one, into entries
/// that do not: a model file has a kind once at a place. At shared places the parameters add up, since the
/// columns are the same.
fn split_shared_places(entries: Vec<NewEffect>) -> Vec<NewEffect> {
    let mut made: Vec<NewEffect> = Vec::new();
    for entry in entries {
        // Constants must be equal, since the columns of other constants differ.
        let meets = |one: &NewEffect| {
            one.kind == entry.kind
                && one.constants == entry.constants
                && one.at.iter().any(|place| entry.at.contains(place))
        };
        let Some(k) = made.iter().position(meets) else {
            made.push(entry);
            continue;
        };
        let other = made.remove(k);
        // The places of both entries, without repetition.
        let more = entry.at.iter().filter(|p| !other.at.contains(p));
        let places: Vec<String> = other.at.iter().chain(more).cloned().collect();
        let of = |wanted: &dyn Fn(bool, bool) -> bool, effect: &NewEffect| NewEffect {
            at: places
                .iter()
                .filter(|p| wanted(other.at.contains(p), entry.at.contains(p)))
                .cloned()
                .collect(),
            ..effect.clone()
        };
        // Three groups keep the force at each place: only the first entry, both, only the second.
        let groups = [
            of(&|first, second| first && !second, &other),
            of(&|first, second| first && second, &sum(&other, &entry)),
            of(&|first, second| second && !first, &entry),
        ];
        made.splice(k..k, groups.into_iter().filter(|one| !one.at.is_empty()));
    }
    made
}

/// An effect as an entry, with the values that the findings state.
fn entry(found: &IdentifiedEffect, kind: &EffectKind, answer: &DiagnosisSolution) -> NewEffect {
    let mut effect = NewEffect {
        kind: kind.name.clone(),
        at: found.effect.at.clone(),
        ..NewEffect::default()
    };
    for estimate in effect_estimates(answer, found) {
        if kind.parameters.iter().any(|p| p.symbol == estimate.name) {
            effect.parameters.push(NewParameter {
                symbol: estimate.name,
                nominal: Some(estimate.value),
                ..NewParameter::default()
            });
        } else if kind.constants.iter().any(|c| c.symbol == estimate.name) {
            effect.constants.push((estimate.name, estimate.value));
        }
    }
    effect
}

/// The sum of two effects of one kind at the same place.
fn sum(one: &NewEffect, other: &NewEffect) -> NewEffect {
    let mut both = one.clone();
    for more in &other.parameters {
        let known = both.parameters.iter_mut().find(|p| p.symbol == more.symbol);
        match known {
            Some(p) => {
                // Parameters of equal columns add up.
                p.nominal = match (p.nominal, more.nominal) {
                    (Some(a), Some(b)) => Some(round_significant(a + b, ESTIMATE_MOST_DIGITS)),
                    (a, b) => a.or(b),
                }
            }
            None => both.parameters.push(more.clone()),
        }
    }
    both
}

/// Adds entries to the text of a model's file, one after the other.
///
/// Fails when an entry contradicts the file, or when there is none.
pub(crate) fn add_entries(model: &Model, effects: &[NewEffect]) -> Outcome<CompletedModelFile> {
    let mut text = model.text().to_owned();
    let mut last = None;
    // Each edit starts from the text of the previous one.
    for effect in effects {
        let edited = model.host().edit(&model.path, &text, effect)?;
        text = edited.text;
        last = Some(edited.loaded);
    }
    let loaded = last.ok_or_else(|| Error::input("no effect was given to add"))?;
    Ok(CompletedModelFile { text, loaded })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn friction(at: &[&str], size: f64) -> NewEffect {
        NewEffect {
            kind: "coulomb_friction".to_owned(),
            at: at.iter().map(|p| (*p).to_owned()).collect(),
            parameters: vec![NewParameter {
                symbol: "Fc".to_owned(),
                nominal: Some(size),
                ..NewParameter::default()
            }],
            ..NewEffect::default()
        }
    }

    #[test]
    fn what_acts_twice_at_a_place_is_added_up_there() {
        let made = split_shared_places(vec![friction(&["a", "b", "c"], 25.0), friction(&["c"], 15.0)]);
        assert_eq!(made, [friction(&["a", "b"], 25.0), friction(&["c"], 40.0)]);
        // The force at each place is what it was, whatever the order.
        let made = split_shared_places(vec![
            friction(&["c"], 15.0),
            friction(&["a", "b"], 1.0),
            friction(&["a", "b", "c"], 25.0),
        ]);
        let at = |place: &str| -> f64 {
            let here = made.iter().filter(|e| e.at.iter().any(|p| p == place));
            here.map(|e| e.parameters[0].nominal.unwrap()).sum()
        };
        for (place, force) in [("a", 26.0), ("b", 26.0), ("c", 40.0)] {
            assert!((at(place) - force).abs() < 1e-9, "{made:?}");
        }
    }
}
