//! Laws that a diagnosis proposes for the residual, as JSON for scripts and as text for people.

use crate::text::wrap::wrap_words;
use std::fmt::Write as _;

use super::findings::{estimate_answers, values_text};
use crate::answers::{LawAnswer, LawHypothesisAnswer};
use crate::diagnose::{NamedLaw, NamedLawProposal, words};
use crate::model::Model;
use crate::print::StepWording;
use crate::text::TerminalStyle;
use crate::text::table::percent;

/// The caution that goes with every law.
pub(crate) const HYPOTHESIS: &str =
    "A hypothesis that these recordings suggest, not a finding: nothing proves that the machine has it.";
/// Name of the file that the text suggests for the entry of a library.
pub(crate) const LIBRARY: &str = "laws.toml";
/// Why a law with memory has no entry.
pub(crate) const PATH_DEPENDENT_NOTE: &str = "It depends on the earlier motion, which no formula of a library can express. It is reported so that you can search for the cause.";

/// Laws, the best first, each with its alternatives.
pub(super) fn law_answers(
    laws: &[NamedLawProposal],
    model: &Model,
    wording: &dyn StepWording,
) -> Vec<LawHypothesisAnswer> {
    let one = |hypothesis: &NamedLawProposal| {
        let ties = hypothesis.near_ties.iter();
        LawHypothesisAnswer {
            law: law_answer(&hypothesis.law, model, wording),
            near_ties: ties.clone().map(NamedLaw::label).collect(),
            ties: ties.map(|tie| law_answer(tie, model, wording)).collect(),
            says: HYPOTHESIS.to_owned(),
        }
    };
    laws.iter().map(one).collect()
}

/// A law with its entry for a library and the step that adds it.
fn law_answer(law: &NamedLaw, model: &Model, wording: &dyn StepWording) -> LawAnswer {
    let entry = law.entry.as_ref();
    LawAnswer {
        expression: law.expression.clone(),
        at: [law.at.clone()],
        gain: law.gain,
        parameters: estimate_answers(&law.parameters),
        instead_of: law.instead_of.clone(),
        in_addition_to: law.in_addition_to.clone(),
        entry: entry.map(|entry| entry.text.clone()),
        kind: entry.map(|entry| entry.effect.kind.clone()),
        places: entry.map(|entry| entry.effect.at.clone()),
        command: entry.map(|entry| wording.format_effect_of_library(model, &entry.effect, LIBRARY)),
    }
}

/// Laws as lines of text.
pub(super) fn text(
    laws: &[NamedLawProposal],
    model: &Model,
    style: TerminalStyle,
    wording: &dyn StepWording,
) -> Vec<String> {
    let mut lines = Vec::new();
    if laws.is_empty() {
        return lines;
    }
    lines.push(String::new());
    lines.push(style.bold("Laws that would explain the residual (hypotheses, to be tested)"));
    for hypothesis in laws {
        // Expression, values, and the share that it explains.
        let law = &hypothesis.law;
        lines.push(format!("  {}", law.label()));
        lines.push(format!("    {}", values_text(&law.parameters)));
        let wrapped = wrap_words(&gain(law), 96);
        lines.extend(wrapped.iter().map(|line| format!("    {line}")));
        if !hypothesis.near_ties.is_empty() {
            let these = if hypothesis.near_ties.len() == 1 {
                "This law explains"
            } else {
                "These laws explain"
            };
            lines.push(format!("    {these} the recordings equally well:"));
            for tie in &hypothesis.near_ties {
                lines.push(format!("      {}", tie.label()));
            }
        }
        // A law without memory has an entry for a library and the step that adds it.
        match &law.entry {
            Some(entry) => {
                lines.push(format!("    Append to the library file {LIBRARY}:"));
                lines.extend(entry.text.lines().map(|line| style.dim(&format!("      {line}"))));
                lines.push("    To add the law to the model:".to_owned());
                let command = wording.format_effect_of_library(model, &entry.effect, LIBRARY);
                lines.push(format!("      {command}"));
            }
            None => {
                let wrapped = wrap_words(PATH_DEPENDENT_NOTE, 96);
                lines.extend(wrapped.iter().map(|line| format!("    {line}")));
            }
        }
    }
    lines
}

/// Which share of the residual a law explains, and which effects it makes unnecessary.
pub(crate) fn gain(law: &NamedLaw) -> String {
    let mut says = format!(
        "explains {} of the squared residual on data that were not fitted",
        percent(Some(law.gain))
    );
    // A law may replace several effects that approximate it.
    if !law.instead_of.is_empty() {
        says.push_str(", and makes these candidates unnecessary: ");
        says.push_str(&words::effects(&law.instead_of));
    }
    says.push('.');
    if !law.in_addition_to.is_empty() {
        let these = words::effects(&law.in_addition_to);
        let _ = write!(
            says,
            " Its values were estimated together with {these} at the same place, whose values change with the law: identify \
             again after adding it."
        );
    }
    says
}
