//! `equations`: the reduced model for people and programs.

use modelmill_codegen::review::{Equations, Format, NumericRank, page};

use crate::args::{EquationsArgs, EquationsFormat};
use crate::failure::Outcome;
use crate::model::{self, Model};
use crate::output::Target;
use crate::sampled_rank::judged_rank;
use crate::terminal;

/// Prints the equations, or writes them to a file.
pub(crate) fn run(args: &EquationsArgs) -> Outcome {
    let model = model::derive(&args.model)?;
    let target = args
        .out
        .as_ref()
        .map(|path| Target::new(path, model.files.iter().map(AsRef::as_ref)))
        .transpose()?;
    let rank = numeric_rank(&model);
    let format = if args.json {
        EquationsFormat::Json
    } else {
        args.format
    };
    let text = match format {
        EquationsFormat::Text => page(&model.derivation, Format::Text, rank.as_ref()),
        EquationsFormat::Markdown => page(&model.derivation, Format::Markdown, rank.as_ref()),
        EquationsFormat::Latex => page(&model.derivation, Format::Latex, rank.as_ref()),
        EquationsFormat::Html => page(&model.derivation, Format::Html, rank.as_ref()),
        EquationsFormat::Json => json(&model, rank.as_ref()),
    };
    match target {
        Some(target) => target.write(&text),
        None => terminal::print(&text),
    }
}

/// The equations as the contract of the program's JSON has them.
fn json(model: &Model, rank: Option<&NumericRank>) -> String {
    let mut equations = Equations::new(&model.derivation, rank);
    equations.model.clone_from(&model.name);
    equations.json()
}

/// The equations of a model as one self-contained page.
pub(crate) fn html(model: &Model) -> String {
    page(
        &model.derivation,
        Format::Html,
        numeric_rank(model).as_ref(),
    )
}

/// Eq. (9) on the file's values, with a warning where it says something else than exact reduction.
fn numeric_rank(model: &Model) -> Option<NumericRank> {
    let (found, says) = judged_rank(model);
    if let Some(says) = says {
        terminal::warn(&format!("{}: {says}", model.path));
    }
    found
}
