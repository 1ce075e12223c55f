//! `equations`: the reduced model for people and programs.

use crate::args::EquationsArgs;
use crate::failure::Outcome;
use crate::model::Model;

/// Pages that the tour writes.
pub(crate) struct Pages {
    /// One self-contained page.
    pub(crate) html: String,
    /// The same as Markdown.
    pub(crate) markdown: String,
}

pub(crate) fn run(_args: &EquationsArgs) -> Outcome {
    Ok(())
}

/// The pages of a model.
pub(crate) fn pages(_model: &Model) -> Outcome<Pages> {
    Ok(Pages {
        html: String::new(),
        markdown: String::new(),
    })
}
