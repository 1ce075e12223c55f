//! What was found as entries of a model file: edits in memory, and the commands that make them in the file.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use modelmill_identify::diagnose::{Effect, FoundEffect};
use modelmill_spec::edit::{EditFailure, NewEffect, NewParameter, add_to_model};
use modelmill_spec::{EffectKind, Loaded};

use crate::diagnosis::Answer;
use crate::model;

/// Significant digits of estimates that go into a model file.
const DIGITS: usize = 5;

/// A model file with everything that was found, not yet written.
pub(crate) struct Added {
    /// Its text.
    pub(crate) text: String,
    /// What it means.
    pub(crate) loaded: Loaded,
}

/// The effects that were found, as entries with the estimates for nominal values.
pub(crate) fn entries(answer: &Answer) -> Vec<NewEffect> {
    let found = answer.diagnosis.effects.iter();
    let entries = found.filter_map(|found| {
        let kinds = &answer.candidates.kinds;
        let kind = kinds.iter().find(|kind| kind.name == found.effect.kind)?;
        Some((entry(found, kind, answer), kind.places == Some(2)))
    });
    // What couples two places may couple each with a third, and is no sum at either.
    let (pairs, others): (Vec<_>, Vec<_>) = entries.partition(|(_, couples)| *couples);
    let only = |entries: Vec<(NewEffect, bool)>| entries.into_iter().map(|(entry, _)| entry);
    let mut made = apart(only(others).collect());
    made.extend(only(pairs));
    made
}

/// Entries of one kind that share places, such as friction at both drives and more of it at one, as entries that do not:
/// a model file has a kind once at a place. Their parameters add up, since their columns are the same there.
fn apart(entries: Vec<NewEffect>) -> Vec<NewEffect> {
    let mut made: Vec<NewEffect> = Vec::new();
    for entry in entries {
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
        let groups = [
            of(&|first, second| first && !second, &other),
            of(&|first, second| first && second, &sum(&other, &entry)),
            of(&|first, second| second && !first, &entry),
        ];
        made.splice(k..k, groups.into_iter().filter(|one| !one.at.is_empty()));
    }
    made
}

/// An estimate may belong to a parameter, to a constant that was found linearly, or to the product of both.
fn entry(found: &FoundEffect, kind: &EffectKind, answer: &Answer) -> NewEffect {
    let parameters = &answer.problem.candidates[found.candidate].parameters;
    let mut effect = NewEffect {
        kind: kind.name.clone(),
        at: found.effect.at.clone(),
        constants: found.constants.clone(),
        ..NewEffect::default()
    };
    let estimates = parameters.iter().zip(&found.estimates);
    for (parameter, value) in estimates.clone() {
        let symbol = parameter.symbol.as_str();
        if let Some((factor, constant)) = symbol.split_once('*') {
            let of = estimates.clone().find(|(p, _)| p.symbol == factor);
            if let Some((_, of)) = of
                && *of != 0.0
            {
                effect
                    .constants
                    .push((constant.to_owned(), rounded(value / of)));
            }
        } else if kind.constants.iter().any(|c| c.symbol == symbol) {
            effect.constants.push((symbol.to_owned(), rounded(*value)));
        } else if kind.parameters.iter().any(|p| p.symbol == symbol) {
            effect.parameters.push(NewParameter {
                symbol: symbol.to_owned(),
                nominal: Some(rounded(*value)),
                ..NewParameter::default()
            });
        }
    }
    for (_, value) in &mut effect.constants {
        *value = rounded(*value);
    }
    effect
}

/// Both effects at one place.
fn sum(one: &NewEffect, other: &NewEffect) -> NewEffect {
    let mut both = one.clone();
    for more in &other.parameters {
        let known = both.parameters.iter_mut().find(|p| p.symbol == more.symbol);
        match known {
            Some(p) => {
                p.nominal = match (p.nominal, more.nominal) {
                    (Some(a), Some(b)) => Some(rounded(a + b)),
                    (a, b) => a.or(b),
                }
            }
            None => both.parameters.push(more.clone()),
        }
    }
    both
}

fn rounded(value: f64) -> f64 {
    let text = format!("{value:.*e}", DIGITS - 1);
    text.parse().unwrap_or(value)
}

/// Adds entries to the text of a model file, one after the other.
pub(crate) fn add(
    path: &Path,
    libraries: &[PathBuf],
    effects: &[NewEffect],
) -> Result<Added, String> {
    let mut text =
        std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let name = path.display().to_string();
    let mut last = None;
    for effect in effects {
        let mut read = modelmill_spec::read_limited;
        let edited =
            add_to_model(&name, &text, effect, libraries, &mut read).map_err(|failure| {
                match failure {
                    EditFailure::Effect(says) => says,
                    EditFailure::Model(failure) => failure.render(false),
                }
            })?;
        text = edited.text;
        last = Some(edited.loaded);
    }
    let loaded = last.ok_or("there is nothing to add")?;
    Ok(Added { text, loaded })
}

/// The command that adds an effect to a model file.
pub(crate) fn command(model: &str, effect: &NewEffect) -> String {
    let mut command = format!(
        "modelmill add {} {} --at {}",
        quoted(model),
        effect.kind,
        quoted(&effect.at.join(","))
    );
    let parameters = effect.parameters.iter();
    let values = parameters.filter_map(|p| Some((p.symbol.as_str(), p.nominal?)));
    let constants = effect.constants.iter().map(|(s, v)| (s.as_str(), *v));
    for (symbol, value) in values.chain(constants) {
        let _ = write!(command, " --set {symbol}={value}");
    }
    command.push_str(" --in-place");
    command.push_str(&with_libraries());
    command
}

/// Libraries of kinds of one's own, as the command line has them.
fn with_libraries() -> String {
    let option = |path: &PathBuf| format!(" --library {}", quoted(&path.display().to_string()));
    model::libraries().iter().map(option).collect()
}

/// The command that looks for motion along which effects differ; values and constants are those of the effect and of what
/// is there in either case.
pub(crate) fn separating(
    model: &str,
    effect: &NamedEffect<'_>,
    rivals: &[Effect],
    beside: &[NamedEffect<'_>],
    more: &str,
) -> String {
    let mut command = format!(
        "modelmill excite {} --separate {}",
        quoted(model),
        quoted(&named(effect))
    );
    for rival in rivals {
        let _ = write!(command, " --from {}", quoted(&named(&(rival, Vec::new()))));
    }
    for one in beside {
        let _ = write!(command, " --beside {}", quoted(&named(one)));
    }
    let _ = write!(command, "{more}{} --out separate.csv", with_libraries());
    command
}

/// An effect with values by their symbols.
pub(crate) type NamedEffect<'a> = (&'a Effect, Vec<(String, f64)>);

/// `KIND@PLACE,PLACE:NAME=VALUE`.
fn named((effect, values): &NamedEffect<'_>) -> String {
    let mut text = format!("{}@{}", effect.kind, effect.at.join(","));
    for (symbol, value) in values {
        let _ = write!(text, ":{symbol}={}", rounded(*value));
    }
    text
}

/// A word as a shell takes it.
pub(crate) fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./,=+:@".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
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
        let made = apart(vec![
            friction(&["a", "b", "c"], 25.0),
            friction(&["c"], 15.0),
        ]);
        assert_eq!(made, [friction(&["a", "b"], 25.0), friction(&["c"], 40.0)]);
        // The force at each place is what it was, whatever the order.
        let made = apart(vec![
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

    #[test]
    fn commands_say_what_is_added() {
        let effect = NewEffect {
            kind: "spring".to_owned(),
            at: vec!["a".to_owned(), "b".to_owned()],
            parameters: vec![NewParameter {
                symbol: "k".to_owned(),
                nominal: Some(rounded(12.345_678)),
                ..NewParameter::default()
            }],
            constants: vec![("q0".to_owned(), 0.5)],
            comment: None,
        };
        assert_eq!(
            command("my arm.toml", &effect),
            "modelmill add 'my arm.toml' spring --at a,b --set k=12.346 --set q0=0.5 --in-place"
        );
    }
}
