//! `add`: adds an effect to a model file. A kind with its places and values goes in; the difference of the text comes
//! out. The new model must be valid and derivable before it is written.

use modelmill::Host;
use modelmill::add::new_effect;
use modelmill::edit::EditedModel;
use modelmill::print::edit;
use serde_json::json;

use crate::args::effects::AddArgs;
use crate::failure::CommandOutcome;
use crate::flags::FlagWording;
use crate::output::{self, OutputFile};
use crate::{commands, terminal};

/// Edits the model file, prints the difference, and writes the result to `--out` or, with `--in-place`, to the model
/// file.
pub(crate) fn run(host: &Host, args: &AddArgs) -> CommandOutcome {
    // The file is read without printing its warnings; those of the result are printed below.
    let before = commands::load_quietly(host, &args.model)?;
    let target = args
        .out
        .as_ref()
        .map(|path| OutputFile::new(path, before.sources.paths()))
        .transpose()?;
    let old = before.sources.files.first();
    let old = old.map_or("", |file| &file.text);
    let places = if args.at.is_empty() { &args.at_each } else { &args.at };
    let mut effect = new_effect(&before.kinds, &args.kind, places, &args.set)?;
    effect.is_at_each = args.at.is_empty();
    effect.name.clone_from(&args.name);
    effect.without = args.without.iter().map(|symbol| symbol.trim().to_owned()).collect();
    effect.comment.clone_from(&args.comment);
    let path = args.model.display().to_string();
    let edited = host.edit(&path, old, &effect)?;
    let edited = reload_at_target(host, edited, target.as_ref())?;
    if !edited.loaded.warnings.is_empty() {
        let warnings = edited.loaded.render_for(terminal::is_stderr_coloured(), &FlagWording);
        terminal::print_to_stderr(warnings.trim_end());
    }
    // As in `check`: a valid file can still fail in the derivation.
    let derived = commands::derive_model(host, &path, edited.loaded)?;
    // Nothing is written without --out or --in-place, so the command can be used to preview a change.
    let written = match (&target, args.in_place) {
        (Some(target), _) => {
            target.write(&edited.text)?;
            Some(target.path().display().to_string())
        }
        (None, true) => {
            output::replace(&args.model, &edited.text)?;
            Some(path.clone())
        }
        (None, false) => None,
    };
    let name = written.as_deref().unwrap_or(&path);
    // The difference has the names of the file before and after.
    let difference = edit::difference(old, &edited.text, [&path, name]);
    if args.json {
        // With --json nothing else is printed on standard output.
        return terminal::print_json(&json!({
            "model": derived.name,
            "effect": edit::effect_json(&edited.effect),
            "diff": difference,
            "written": written,
        }));
    }
    terminal::print(&edit::colour_diff(&difference, terminal::style()))?;
    match written {
        Some(name) => terminal::note(&format!(
            "{name} is written; `modelmill diff` reports what the effect changes"
        )),
        None => terminal::note(
            "nothing is written; add --in-place to change the model file, or --out FILE to write another one",
        ),
    }
    Ok(())
}

/// Reads the new text as a file at the target, since relative paths in it start from the folder of the file.
fn reload_at_target(host: &Host, edited: EditedModel, target: Option<&OutputFile>) -> CommandOutcome<EditedModel> {
    let Some(target) = target else {
        return Ok(edited);
    };
    let loaded = host.load_text(target.path(), &edited.text)?;
    Ok(EditedModel { loaded, ..edited })
}
