//! Laws that a diagnosis proposes, as JSON and for people.

use serde_json::{Value, json};

use super::findings::estimates;
use crate::diagnose::{LawHypothesis, ProposedLaw, words};
use crate::model::Model;
use crate::print::StepSpelling;
use crate::text::TerminalStyle;
use crate::text::table::{number, percent, significant};

/// What is said of every law.
pub(crate) const HYPOTHESIS: &str =
    "A hypothesis that these recordings suggest, no finding: nothing says that the machine has it.";
/// What an entry of a library needs to be known, and where the law cannot be written down.
pub(crate) const LIBRARY: &str = "laws.toml";
pub(crate) const PATH_DEPENDENT_NOTE: &str = "It depends on the way there, which no formula of a library says; it is told so that it can be looked for.";

/// Laws as scripts read them.
pub(super) fn laws(
    laws: &[LawHypothesis],
    model: &Model,
    spelling: &dyn StepSpelling,
) -> Vec<Value> {
    let one = |hypothesis: &LawHypothesis| {
        let mut told = law(&hypothesis.law, model, spelling);
        let ties = hypothesis.near_ties.iter();
        told["near_ties"] = ties.clone().map(|tie| json!(tie.label())).collect();
        told["ties"] = ties.map(|tie| law(tie, model, spelling)).collect();
        told["says"] = json!(HYPOTHESIS);
        told
    };
    laws.iter().map(one).collect()
}

fn law(law: &ProposedLaw, model: &Model, spelling: &dyn StepSpelling) -> Value {
    let entry = law.entry.as_ref();
    json!({
        "expression": law.expression,
        "at": [law.at],
        "gain": law.gain,
        "parameters": estimates(&law.parameters),
        "instead_of": law.instead_of,
        "entry": entry.map(|entry| &entry.text),
        "kind": entry.map(|entry| &entry.effect.kind),
        "places": entry.map(|entry| &entry.effect.at),
        "command": entry.map(|entry| spelling.spell_effect_of_library(model, &entry.effect, LIBRARY)),
    })
}

/// Laws for people, line by line.
pub(super) fn text(
    laws: &[LawHypothesis],
    model: &Model,
    style: TerminalStyle,
    spelling: &dyn StepSpelling,
) -> Vec<String> {
    let mut lines = Vec::new();
    if laws.is_empty() {
        return lines;
    }
    lines.push(String::new());
    lines.push(style.bold("which law would explain what is left: a hypothesis, to be tried"));
    for hypothesis in laws {
        let law = &hypothesis.law;
        lines.push(format!("  {}", law.label()));
        lines.push(format!("    {}", values(law)));
        let wrapped = words::lines(&gain(law), 96);
        lines.extend(wrapped.iter().map(|line| format!("    {line}")));
        if !hypothesis.near_ties.is_empty() {
            lines.push("    As near to these recordings are".to_owned());
            for tie in &hypothesis.near_ties {
                lines.push(format!("      {}", tie.label()));
            }
        }
        match &law.entry {
            Some(entry) => {
                lines.push(format!("    As a library, {LIBRARY}:"));
                lines.extend(
                    entry
                        .text
                        .lines()
                        .map(|line| style.dim(&format!("      {line}"))),
                );
                lines.push("    and with it".to_owned());
                let command = spelling.spell_effect_of_library(model, &entry.effect, LIBRARY);
                lines.push(format!("      {command}"));
            }
            None => {
                let wrapped = words::lines(PATH_DEPENDENT_NOTE, 96);
                lines.extend(wrapped.iter().map(|line| format!("    {line}")));
            }
        }
    }
    lines
}

/// Parameters with their deviations and units.
pub(crate) fn values(law: &ProposedLaw) -> String {
    let value = |p: &crate::diagnose::EffectEstimate| {
        let deviation =
            (p.std).map_or_else(String::new, |std| format!(" ± {}", significant(std, 2)));
        let unit = if p.unit == "1" { "" } else { &p.unit };
        let said = format!("{} = {}{deviation} {unit}", p.name, number(p.value));
        said.trim_end().to_owned()
    };
    let all: Vec<String> = law.parameters.iter().map(value).collect();
    all.join(", ")
}

/// What it takes off, and what it makes needless.
pub(crate) fn gain(law: &ProposedLaw) -> String {
    let mut says = format!(
        "takes off {} of the squared error that is left where it was not fitted",
        percent(Some(law.gain))
    );
    if !law.instead_of.is_empty() {
        says.push_str(", and then the recordings need no ");
        says.push_str(&words::effects(&law.instead_of));
    }
    says.push('.');
    says
}
