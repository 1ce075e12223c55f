//! `generate`: the model as Rust source.

use std::path::PathBuf;

use crate::args::GenerateArgs;
use crate::failure::{Failure, Outcome};
use crate::model;
use crate::output::Target;
use crate::table::count;
use crate::terminal;

/// Writes the source that `cargo build` makes of the model.
pub(crate) fn run(args: &GenerateArgs) -> Outcome {
    let model = model::derive(&args.model)?;
    let target = args
        .out
        .as_ref()
        .map(|path| Target::new(path, model.files.iter().map(PathBuf::as_path)))
        .transpose()?;
    let derivation = &model.derivation;
    let source = if args.dynamics {
        let dynamics = derivation
            .dynamics()
            .map_err(|error| Failure::Input(format!("{}: {error}", model.path)))?;
        modelmill_codegen::emit_with_dynamics(derivation, &dynamics).file()
    } else {
        modelmill_codegen::emit(derivation).file()
    };
    match target {
        Some(target) => {
            target.write(&source)?;
            terminal::note(&format!(
                "{}: {}, the module `{}`",
                target.path().display(),
                count(source.lines().count(), "line", "lines"),
                model.derivation.mechanism.name
            ));
            Ok(())
        }
        None => terminal::print(&source),
    }
}
