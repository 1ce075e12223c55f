//! What was found as entries of a model file: edits in memory, and the commands that make them in the file.

use std::path::{Path, PathBuf};

use modelmill_identify::diagnose::FoundEffect;
use modelmill_spec::edit::{EditFailure, NewEffect, NewParameter, add_to_model};
use modelmill_spec::{EffectKind, Loaded};

use crate::diagnosis::Answer;

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
    found
        .filter_map(|found| {
            let kinds = &answer.candidates.kinds;
            let kind = kinds.iter().find(|kind| kind.name == found.effect.kind)?;
            Some(entry(found, kind, answer))
        })
        .collect()
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
        command.push_str(&format!(" --set {symbol}={value}"));
    }
    command.push_str(" --in-place");
    command
}

/// A word as a shell takes it.
pub(crate) fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./,=+:".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
