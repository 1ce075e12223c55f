//! `equations`: the reduced model for people and programs.

use modelmill_codegen::review::{Equations, Format, page};

use crate::args::{EquationsArgs, EquationsFormat};
use crate::failure::Outcome;
use crate::model::{self, Model};
use crate::output::Target;
use crate::progress::watched;
use crate::sampled_rank::{SampledRank, judged_rank};
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
        EquationsFormat::Text => written(&model, Format::Text, rank.as_ref()),
        EquationsFormat::Markdown => written(&model, Format::Markdown, rank.as_ref()),
        EquationsFormat::Latex => written(&model, Format::Latex, rank.as_ref()),
        EquationsFormat::Html => written(&model, Format::Html, rank.as_ref()),
        EquationsFormat::Json => json(&model, rank.as_ref()),
    };
    match target {
        Some(target) => target.write(&text),
        None => terminal::print(&text),
    }
}

/// The equations as the contract of the program's JSON has them; `check --json` says what the numeric rank rests on.
fn json(model: &Model, rank: Option<&SampledRank>) -> String {
    let mut equations = Equations::new(&model.derivation, rank.map(|rank| &rank.shown));
    equations.model.clone_from(&model.name);
    equations.json()
}

/// The equations of a model as one self-contained page.
pub(crate) fn html(model: &Model) -> String {
    written(model, Format::Html, numeric_rank(model).as_ref())
}

/// The equations for people. Writing those of a long chain takes seconds.
fn written(model: &Model, format: Format, rank: Option<&SampledRank>) -> String {
    watched(
        &format!("writing the equations of {}", model.name),
        0,
        |_| page(&model.derivation, format, rank.map(|rank| &rank.shown)),
    )
}

/// Eq. (9) on the file's values, with a warning where it says something else than exact reduction.
fn numeric_rank(model: &Model) -> Option<SampledRank> {
    let judged = judged_rank(model);
    for says in &judged.warnings {
        terminal::warn(&format!("{}: {says}", model.path));
    }
    if let Some(says) = judged.found.as_ref().and_then(SampledRank::remark) {
        terminal::note(&format!("{}: {says}", model.path));
    }
    judged.found
}
