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
    let page = match format {
        EquationsFormat::Text => PageFormat::Text,
        EquationsFormat::Markdown => PageFormat::Markdown,
        EquationsFormat::Latex => PageFormat::Latex,
        EquationsFormat::Html => PageFormat::Html,
        EquationsFormat::Json => PageFormat::Json,
    };
    // Long expressions can take seconds.
    let text = match (&args.balances, format) {
        (Some(part), _) => model.balances(part, page)?,
        (None, EquationsFormat::Json) => model.equations_json()?.text,
        (None, _) => model.equations(page)?.text,
    };
    match target {
        Some(target) => target.write(&text),
        None => terminal::print(&text),
    }
}
