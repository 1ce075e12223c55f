//! `adopt`: replaces nominal values of a model file by those of a fit. The difference of the text comes out.

use std::path::Path;

use modelmill::Host;
use modelmill::print::edit;
use serde_json::json;

use crate::args::AdoptArgs;
use crate::failure::CommandOutcome;
use crate::output::{self, OutputFile};
use crate::{commands, terminal};

/// Edits the model file, prints the difference, and writes the result to `--out` or, with `--in-place`, to the model
/// file.
pub(crate) fn run(host: &Host, args: &AdoptArgs) -> CommandOutcome {
    let model = commands::model(host, &args.model)?;
    let inputs = model.files().chain(std::iter::once::<&Path>(args.fit.as_ref()));
    let target = args
        .out
        .as_ref()
        .map(|path| OutputFile::new(path, inputs))
        .transpose()?;
    // The fit is matched to the model by the expressions of its base parameters.
    let fit = host.fit(&args.fit)?;
    let adoption = model.adopt(&fit, &args.fit.display().to_string())?;
    for note in &adoption.notes {
        terminal::remark(note);
    }
    let path = args.model.display().to_string();
    // The new text must be valid at its target, since relative paths in it start from the folder of the file.
    let loaded = match &target {
        Some(target) => host.load_text(target.path(), &adoption.text)?,
        None => adoption.loaded,
    };
    commands::derive_model(host, &path, loaded)?;
    // Nothing is written without --out or --in-place, so the command can be used to preview a change.
    let written = match (&target, args.in_place) {
        (Some(target), _) => {
            target.write(&adoption.text)?;
            Some(target.path().display().to_string())
        }
        (None, true) => {
            output::replace(&args.model, &adoption.text)?;
            Some(path.clone())
        }
        (None, false) => None,
    };
    let name = written.as_deref().unwrap_or(&path);
    // The difference has the names of the file before and after.
    let difference = edit::difference(model.text(), &adoption.text, [&path, name]);
    if args.json {
        return terminal::print_json(&json!({
            "model": model.name,
            "parameters": adoption.adopted.parameters.len(),
            "base": adoption.adopted.base.len(),
            "diff": difference,
            "written": written,
        }));
    }
    terminal::print(&edit::colour_diff(&difference, terminal::style()))?;
    terminal::note(&match written {
        Some(name) => format!("{name} is written; its nominal values are now those of the fit"),
        None => {
            "nothing is written; add --in-place to change the model file, or --out FILE to write another one".to_owned()
        }
    });
    Ok(())
}
