//! How the reader of a text asks for what the text advises: on a command line, in a notebook, in Rust.
//!
//! [`RemedySpelling`] spells remedies inside of messages, [`StepSpelling`] whole steps with a model.

use std::fmt::Write as _;

pub use modelmill_boundary::text::{
    CommandName, LibrarySpelling, Message, OptionName, OptionSetting, Remedy, RemedySpelling,
};
use modelmill_spec::edit::NewEffect;

use crate::diagnose::SeparationProposal;
use crate::model::Model;

/// How the reader of a text asks for the steps that a diagnosis advises. The program spells commands, a notebook calls.
pub trait StepSpelling: RemedySpelling {
    /// Adds an effect to the file of a model.
    fn spell_effect(&self, model: &Model, effect: &NewEffect) -> String;

    /// Adds an effect of a kind that a further library holds, which is kept in a file of some name.
    fn spell_effect_of_library(&self, model: &Model, effect: &NewEffect, library: &str) -> String {
        let effect = self.spell_effect(model, effect);
        format!("{effect}, with the library {library}")
    }

    /// Identifies a model once more from the same recordings.
    fn spell_identification(&self, model: &Model) -> String;

    /// Seeks motion along which effects differ; `None` where that cannot be asked for.
    fn spell_separation(&self, model: &Model, separation: &SeparationProposal) -> Option<String>;
}

/// Plain words, for whoever calls the library.
impl StepSpelling for LibrarySpelling {
    fn spell_effect(&self, model: &Model, effect: &NewEffect) -> String {
        let mut says = format!(
            "{}: add {} at {}",
            model.name,
            effect.kind,
            effect.at.join(", ")
        );
        let parameters = effect.parameters.iter();
        let values = parameters.filter_map(|p| Some((p.symbol.as_str(), p.nominal?)));
        let constants = effect.constants.iter().map(|(s, v)| (s.as_str(), *v));
        for (k, (symbol, value)) in values.chain(constants).enumerate() {
            let joint = if k == 0 { " with" } else { "," };
            let _ = write!(says, "{joint} {symbol} = {value}");
        }
        says
    }

    fn spell_identification(&self, model: &Model) -> String {
        format!("{}: identify again", model.name)
    }

    fn spell_separation(&self, model: &Model, separation: &SeparationProposal) -> Option<String> {
        let effect = &separation.effect.effect;
        let rivals: Vec<&str> = separation.rivals.iter().map(|r| r.kind.as_str()).collect();
        Some(format!(
            "{}: seek motion that tells {} at {} from {}",
            model.name,
            effect.kind,
            effect.at.join(", "),
            rivals.join(", ")
        ))
    }
}
