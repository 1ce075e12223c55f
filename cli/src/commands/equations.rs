//! `equations`: the equations of the reduced model as text, Markdown, LaTeX, HTML or JSON.

use modelmill::Host;
use modelmill::model::PageFormat;

use crate::args::{EquationsArgs, EquationsFormat};
use crate::failure::CommandOutcome;
use crate::output::OutputFile;
use crate::{commands, terminal};

/// Prints the equations, or writes them to a file.
pub(crate) fn run(host: &Host, args: &EquationsArgs) -> CommandOutcome {
    let model = commands::model(host, &args.model)?;
    let target = args
        .out
        .as_ref()
        .map(|path| OutputFile::new(path, model.files()))
        .transpose()?;
    let format = if args.json { EquationsFormat::Json } else { args.format };
    // Long expressions can take seconds.
    let written = match format {
        EquationsFormat::Text => model.equations(PageFormat::Text),
        EquationsFormat::Markdown => model.equations(PageFormat::Markdown),
        EquationsFormat::Latex => model.equations(PageFormat::Latex),
        EquationsFormat::Html => model.equations(PageFormat::Html),
        EquationsFormat::Json => model.equations_json(),
    }?;
    match target {
        Some(target) => target.write(&written.text),
        None => terminal::print(&written.text),
    }
}
