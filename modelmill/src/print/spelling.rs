//! How the reader of a text asks for what the text advises: on a command line, in a notebook, in Rust.

use std::borrow::Cow;
use std::fmt::Write as _;

pub use modelmill_boundary::text::{AdviceItem, format_advice};
use modelmill_spec::edit::NewEffect;

use crate::diagnose::SeparationProposal;
use crate::model::Model;

/// How the reader of a text asks for what it advises. The program spells its flags, a notebook its keywords.
pub trait AdviceFormatter {
    /// Adds an effect to the file of a model.
    fn add_effect(&self, model: &Model, effect: &NewEffect) -> String;

    /// Adds an effect of a kind that a further library holds, which is kept in a file of some name.
    fn add_effect_from_library(&self, model: &Model, effect: &NewEffect, library: &str) -> String {
        format!("{}, with the library {library}", self.add_effect(model, effect))
    }

    /// Identifies a model once more from the same recordings.
    fn identify(&self, model: &Model) -> String;

    /// Seeks motion along which effects differ; `None` where that cannot be asked for.
    fn separate_effects(&self, model: &Model, separation: &SeparationProposal) -> Option<String>;

    /// Holds all parameters at their nominal values in a diagnosis.
    fn fix_parameters(&self) -> String;

    /// A text of the library, which names options by their fields ("option `columns` = `q=angle`") and verbs by their
    /// names ("verb `identify`"); [`spelled`] finds them.
    fn format_text<'a>(&self, text: &'a str) -> Cow<'a, str> {
        Cow::Borrowed(text)
    }
}

/// Plain words, for whoever calls the library.
#[derive(Clone, Copy, Debug, Default)]
pub struct PlainAdvice;

impl AdviceFormatter for PlainAdvice {
    fn add_effect(&self, model: &Model, effect: &NewEffect) -> String {
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

    fn identify(&self, model: &Model) -> String {
        format!("{}: identify again", model.name)
    }

    fn separate_effects(&self, model: &Model, separation: &SeparationProposal) -> Option<String> {
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

    fn fix_parameters(&self) -> String {
        "`Question::held`".to_owned()
    }
}
