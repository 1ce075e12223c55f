//! `add`: an effect goes into a model file; the difference is shown, and the result must be sound before it is written.

use std::path::Path;

use modelmill_spec::EffectKind;
use modelmill_spec::edit::{EditFailure, Edited, NewEffect, NewParameter, add_to_model};
use serde_json::{Value, json};
use similar::TextDiff;

use crate::effect_args::{AddArgs, Said};
use crate::failure::{Failure, Outcome};
use crate::model;
use crate::output::{self, Target};
use crate::terminal;

/// Lines around a change that the difference shows.
const CONTEXT: usize = 3;

/// Edits the model file, prints the difference, and writes the result where the user asks for it.
pub(crate) fn run(args: &AddArgs) -> Outcome {
    let before = model::load_quietly(&args.model)?;
    let target = args
        .out
        .as_ref()
        .map(|path| Target::new(path, before.sources.paths().map(AsRef::as_ref)))
        .transpose()?;
    let old = std::fs::read_to_string(&args.model)
        .map_err(|error| Failure::Input(format!("{}: {error}", args.model.display())))?;
    let effect = new_effect(args, &before.kinds)?;
    let path = args.model.display().to_string();
    let mut read = |path: &Path| std::fs::read_to_string(path);
    let edited = add_to_model(&path, &old, &effect, model::libraries(), &mut read)
        .map_err(|failure| refused(&path, failure))?;
    let edited = elsewhere(edited, target.as_ref())?;
    if !edited.loaded.warnings.is_empty() {
        let warnings = edited.loaded.render(terminal::errors_in_colour());
        terminal::say(warnings.trim_end());
    }
    // What `check` would say beyond the file itself: whether the model can be derived.
    let derived = model::derive_loaded(&path, &edited.loaded)?;
    let written = match (&target, args.in_place) {
        (Some(target), _) => {
            target.write(&edited.text)?;
            Some(target.path().display().to_string())
        }
        (None, true) => {
            output::write(&args.model, &edited.text)?;
            Some(path.clone())
        }
        (None, false) => None,
    };
    let name = written.as_deref().unwrap_or(&path);
    let difference = difference(&old, &edited.text, [&path, name]);
    if args.json {
        return terminal::print_json(&json!({
            "model": derived.name,
            "effect": described(&edited.effect),
            "diff": difference,
            "written": written,
        }));
    }
    terminal::print(&coloured(&difference))?;
    match written {
        Some(name) => terminal::note(&format!(
            "{name} is written; `modelmill diff` says what the effect changes"
        )),
        None => terminal::note(
            "nothing is written; add --in-place to change the model file, or --out FILE to write another one",
        ),
    }
    Ok(())
}

/// The effect that the command line describes. What is set is a parameter or a constant, as the kind has it.
fn new_effect(args: &AddArgs, kinds: &[EffectKind]) -> Outcome<NewEffect> {
    let mut effect = NewEffect {
        kind: args.kind.clone(),
        at: args.at.iter().map(|name| name.trim().to_owned()).collect(),
        comment: args.comment.clone(),
        ..NewEffect::default()
    };
    // An unknown kind is said when the effect is added.
    let Some(kind) = kinds.iter().find(|kind| kind.name == args.kind) else {
        return Ok(effect);
    };
    let parameters: Vec<&str> = kind.parameters.iter().map(|p| p.symbol.as_str()).collect();
    let constants: Vec<&str> = kind.constants.iter().map(|c| c.symbol.as_str()).collect();
    for setting in &args.set {
        let symbol = setting.symbol.as_str();
        if parameters.contains(&symbol) {
            let known = effect.parameters.iter().position(|p| p.symbol == symbol);
            let at = known.unwrap_or_else(|| {
                effect.parameters.push(NewParameter {
                    symbol: symbol.to_owned(),
                    ..NewParameter::default()
                });
                effect.parameters.len() - 1
            });
            let parameter = &mut effect.parameters[at];
            match &setting.said {
                Said::Value(value) => parameter.nominal = Some(*value),
                Said::Name(name) => parameter.name = Some(name.clone()),
            }
            continue;
        }
        match (&setting.said, constants.contains(&symbol)) {
            (Said::Value(value), true) => {
                effect.constants.retain(|(known, _)| known != symbol);
                effect.constants.push((symbol.to_owned(), *value));
            }
            (Said::Name(_), true) => {
                return Err(Failure::Input(format!(
                    "--set {symbol}.name: `{symbol}` is a constant of `{}`, which has a value and no name",
                    kind.name
                )));
            }
            (_, false) => {
                let known: Vec<&str> = parameters.iter().chain(&constants).copied().collect();
                return Err(Failure::Input(format!(
                    "--set {symbol}: `{}` has no `{symbol}`; known are {}",
                    kind.name,
                    known.join(", ")
                )));
            }
        }
    }
    Ok(effect)
}

/// The model as it would be read from where it is written: paths in it start from its folder.
fn elsewhere(edited: Edited, target: Option<&Target>) -> Outcome<Edited> {
    let Some(target) = target else {
        return Ok(edited);
    };
    let path = target.path().display().to_string();
    let mut read = |path: &Path| std::fs::read_to_string(path);
    let loaded = modelmill_spec::load_with(&path, &edited.text, model::libraries(), &mut read)
        .map_err(|failure| Failure::Rendered(failure.render(terminal::errors_in_colour())))?;
    Ok(Edited { loaded, ..edited })
}

fn refused(path: &str, failure: EditFailure) -> Failure {
    match failure {
        EditFailure::Effect(says) => Failure::Input(format!("{path}: {says}")),
        EditFailure::Model(failure) => {
            Failure::Rendered(failure.render(terminal::errors_in_colour()))
        }
    }
}

/// The change as a unified diff.
pub(crate) fn difference(old: &str, new: &str, [before, after]: [&str; 2]) -> String {
    TextDiff::from_lines(old, new)
        .unified_diff()
        .context_radius(CONTEXT)
        .header(before, after)
        .to_string()
}

/// A diff for the terminal.
pub(crate) fn coloured(difference: &str) -> String {
    let style = terminal::style();
    let lines = difference.lines().map(|line| {
        if line.starts_with("+++") || line.starts_with("---") {
            style.bold(line)
        } else if line.starts_with('+') {
            style.green(line)
        } else if line.starts_with('-') {
            style.red(line)
        } else if line.starts_with("@@") {
            style.cyan(line)
        } else {
            line.to_owned()
        }
    });
    lines.collect::<Vec<_>>().join("\n")
}

fn described(effect: &NewEffect) -> Value {
    let parameters = effect.parameters.iter().map(|one| {
        let said = json!({ "name": one.name, "nominal": one.nominal });
        (one.symbol.clone(), said)
    });
    let constants = effect.constants.iter();
    json!({
        "kind": effect.kind,
        "at": effect.at,
        "parameters": parameters.collect::<serde_json::Map<String, Value>>(),
        "constants": constants.map(|(s, v)| (s.clone(), json!(v))).collect::<serde_json::Map<String, Value>>(),
    })
}
