//! Formats remedies and recommended next steps for the reader: as commands, as Python calls, or in words for a caller
//! of the Rust library.
//!
//! [`RemedyWording`] formats remedies within messages, [`StepWording`] complete steps with a model.

use std::fmt::Write as _;

pub use modelmill_boundary::text::{
    CommandName, Message, OptionName, OptionSetting, Remedy, RemedyWording, RustWording,
};
use modelmill_spec::edit::NewEffect;

use crate::diagnose::SeparationProposal;
use crate::model::Model;

/// Formats the recommended next steps after a diagnosis for the reader. The program writes commands, the Python package
/// writes calls. Each method returns the text of one step and does not perform it.
pub trait StepWording: RemedyWording {
    /// Step: add an effect to the file of a model.
    fn format_effect(&self, model: &Model, effect: &NewEffect) -> String;

    /// Step: add an effect whose kind is defined in the library file `library`.
    fn format_effect_of_library(&self, model: &Model, effect: &NewEffect, library: &str) -> String {
        let effect = self.format_effect(model, effect);
        format!("{effect}, with the library {library}")
    }

    /// Whether the effects found were added already. Adding them is then not listed as a next step.
    fn has_added_effects(&self) -> bool {
        false
    }

    /// Step: add all effects found at once.
    fn format_completion(&self) -> String;

    /// Step: identify a model again from the same recordings.
    fn format_identification(&self, model: &Model) -> String;

    /// Step: plan a motion that distinguishes effects; `None` if the reader has no command for it.
    fn format_separation(&self, model: &Model, separation: &SeparationProposal) -> Option<String>;
}

/// Plain words for a caller of the Rust library `modelmill`.
impl StepWording for RustWording {
    fn format_effect(&self, model: &Model, effect: &NewEffect) -> String {
        let mut says = format!("{}: add {} at {}", model.name, effect.kind, effect.at.join(", "));
        let parameters = effect.parameters.iter();
        let values = parameters.filter_map(|p| Some((p.symbol.as_str(), p.nominal?)));
        let constants = effect.constants.iter().map(|(s, v)| (s.as_str(), *v));
        for (k, (symbol, value)) in values.chain(constants).enumerate() {
            let joint = if k == 0 { " with" } else { "," };
            let _ = write!(says, "{joint} {symbol} = {value}");
        }
        says
    }

    fn format_completion(&self) -> String {
        "`DiagnosisFindings::completed_model` has all of them".to_owned()
    }

    fn format_identification(&self, model: &Model) -> String {
        format!("{}: identify again", model.name)
    }

    fn format_separation(&self, model: &Model, separation: &SeparationProposal) -> Option<String> {
        let effect = &separation.effect.effect;
        let rivals: Vec<&str> = separation.rivals.iter().map(|r| r.kind.as_str()).collect();
        Some(format!(
            "{}: plan a motion that distinguishes {} at {} from {}",
            model.name,
            effect.kind,
            effect.at.join(", "),
            rivals.join(", ")
        ))
    }
}
