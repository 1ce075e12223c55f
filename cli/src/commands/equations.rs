//! `equations`: the reduced model for people and programs.

use modelmill::Host;
use modelmill::model::Format;

use crate::args::{EquationsArgs, EquationsFormat};
use crate::failure::Outcome;
use crate::output::Target;
use crate::{commands, terminal};

/// Prints the equations, or writes them to a file.
pub(crate) fn run(host: &Host, args: &EquationsArgs) -> Outcome {
    let model = commands::model(host, &args.model)?;
    let target = args
        .out
        .as_ref()
        .map(|path| Target::new(path, model.files()))
        .transpose()?;
    let format = if args.json {
        EquationsFormat::Json
    } else {
        args.format
    };
    let written = match format {
        EquationsFormat::Text => model.equations(Format::Text),
        EquationsFormat::Markdown => model.equations(Format::Markdown),
        EquationsFormat::Latex => model.equations(Format::Latex),
        EquationsFormat::Html => model.equations(Format::Html),
        EquationsFormat::Json => model.equations_json(),
    }?;
    match target {
        Some(target) => target.write(&written.text),
        None => terminal::print(&written.text),
    }
}
