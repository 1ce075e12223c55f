//! Marks of answers: truth, answer and residual without noise go in; a mark comes out.
//!
//! The residual decides whether a wrong claim is indistinguishable from the truth on these recordings.

use std::collections::BTreeSet;

use crate::answer::ProgramAnswer;
use crate::placed::{EffectAtom, HOLDS, PlacedEffect, atoms};

/// Two explanations are indistinguishable if their squared errors differ by less, in units of the noise variance. It is
/// the square of three standard deviations.
pub const SAME: f64 = 9.0;
/// Largest acceptable error on the validation run, relative to the noise floor.
pub const FALL: f64 = 1.3;

/// Class of what is hidden in a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CaseClass {
    /// One effect of the library.
    One,
    /// Two effects of the library.
    Two,
    /// Nothing, or changes that base parameters represent.
    None,
    /// A force that no effect of the library represents.
    Outside,
}

impl CaseClass {
    /// All classes, in the order of tables.
    pub const ALL: [Self; 4] = [Self::One, Self::Two, Self::None, Self::Outside];

    /// Its name in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::One => "one",
            Self::Two => "two",
            Self::None => "none",
            Self::Outside => "outside",
        }
    }

    /// Target for the share of right answers, %.
    pub fn target(self) -> f64 {
        match self {
            Self::One => 95.0,
            Self::Two => 85.0,
            Self::None => 98.0,
            Self::Outside => 90.0,
        }
    }
}

/// The mark of an answer.
#[derive(Clone, Debug, PartialEq)]
pub enum AnswerMark {
    /// All effects with their places and no others; without effects, the true verdict.
    Right,
    /// Another effect replaces the true one. The answer names the true one as alias, and both are indistinguishable.
    Alias,
    /// Right effects, but another verdict than `missing_effect`.
    WrongVerdict,
    /// No effect is claimed.
    Missed,
    /// Some of the true effects are claimed, and no others.
    Partly,
    /// The right kind at another place.
    WrongPlace,
    /// Another kind.
    WrongKind,
    /// All true effects and others in addition.
    Extra,
    /// An effect is claimed, or the verdict is not `adequate`, but nothing was hidden.
    FalseAlarm,
    /// A force outside the library was identified as an effect of the library.
    Guess,
    /// A force outside the library was treated as noise: the verdict is `adequate`.
    Overlooked,
    /// The program failed, or its JSON differs from the format in `cli.md`.
    Failed(String),
}

impl AnswerMark {
    /// Whether it counts as right.
    pub fn is_right(&self) -> bool {
        matches!(self, Self::Right | Self::Alias)
    }

    /// The mark as text, as the table prints it.
    pub fn in_words(&self) -> String {
        match self {
            Self::Right => "right",
            Self::Alias => "right, by an indistinguishable alias",
            Self::WrongVerdict => "right effects, wrong verdict",
            Self::Missed => "missed",
            Self::Partly => "some effects missed",
            Self::WrongPlace => "wrong place",
            Self::WrongKind => "wrong kind",
            Self::Extra => "extra effects",
            Self::FalseAlarm => "false alarm",
            Self::Guess => "effect claimed for a force outside the library",
            Self::Overlooked => "force outside the library treated as noise",
            Self::Failed(why) => return format!("failed: {why}"),
        }
        .to_owned()
    }
}

/// Marks an answer.
///
/// `excess` returns the squared residual of the true forces without noise for a set of claimed effects, in units of the
/// noise variance; it is infinite for unknown kinds. `disturbance` is the kind of disturbance that describes a force
/// outside the library. An answer that reports it with the verdict `adequate` is right.
pub fn judge(
    class: CaseClass,
    hidden: &[PlacedEffect],
    disturbance: Option<&str>,
    answer: &ProgramAnswer,
    excess: &mut dyn FnMut(&[PlacedEffect]) -> f64,
) -> AnswerMark {
    match class {
        CaseClass::None => {
            if answer.verdict == "adequate" && answer.effects.is_empty() {
                AnswerMark::Right
            } else {
                AnswerMark::FalseAlarm
            }
        }
        CaseClass::Outside => match answer.verdict.as_str() {
            "unexplained" => AnswerMark::Right,
            "adequate" if disturbance.is_some_and(|kind| answer.disturbances.iter().any(|one| one == kind)) => {
                AnswerMark::Right
            }
            "adequate" => AnswerMark::Overlooked,
            _ => AnswerMark::Guess,
        },
        CaseClass::One | CaseClass::Two => {
            let mark = mark_answer(hidden, answer, excess);
            if mark.is_right() && answer.verdict != "missing_effect" {
                return AnswerMark::WrongVerdict;
            }
            mark
        }
    }
}

/// Compares claimed with true effects, kind by place; the verdict is marked elsewhere.
fn mark_answer(
    hidden: &[PlacedEffect],
    answer: &ProgramAnswer,
    excess: &mut dyn FnMut(&[PlacedEffect]) -> f64,
) -> AnswerMark {
    let truth = atoms(hidden);
    let claims: Vec<PlacedEffect> = answer.effects.iter().map(|c| c.effect.clone()).collect();
    let claimed = atoms(&claims);
    // Answers that differ from the truth in one direction only.
    if truth == claimed {
        return AnswerMark::Right;
    }
    if claimed.is_empty() {
        return AnswerMark::Missed;
    }
    let lacking: BTreeSet<&EffectAtom> = truth.difference(&claimed).collect();
    let others: BTreeSet<&EffectAtom> = claimed.difference(&truth).collect();
    if lacking.is_empty() {
        return AnswerMark::Extra;
    }
    if others.is_empty() {
        return AnswerMark::Partly;
    }
    // A wrong claim counts only if it names the true effect as its alias and is indistinguishable from it.
    let stand_ins = answer
        .effects
        .iter()
        .filter(|claim| atoms([&claim.effect]).iter().any(|a| others.contains(a)));
    let named: BTreeSet<EffectAtom> = stand_ins
        .clone()
        .flat_map(|claim| &claim.aliases)
        .flat_map(|alias| atoms([alias]))
        .collect();
    let each_names = stand_ins.clone().all(|claim| {
        claim
            .aliases
            .iter()
            .any(|alias| atoms([alias]).iter().any(|a| lacking.contains(a)))
    });
    // A claim that contains the truth is the more complex answer, and is not accepted in its place.
    let holds = others.iter().any(|(kind, place)| {
        let less = HOLDS.iter().find(|(more, _)| more == kind);
        less.is_some_and(|(_, less)| lacking.contains(&((*less).to_owned(), place.clone())))
    });
    if !holds
        && lacking.iter().all(|atom| named.contains(*atom))
        && each_names
        && stand_ins.count() <= hidden.len()
        && excess(&claims) < SAME
    {
        return AnswerMark::Alias;
    }
    // The right kinds at other places are a smaller error than other kinds.
    let kinds =
        |set: &BTreeSet<&EffectAtom>| -> BTreeSet<String> { set.iter().map(|(kind, _)| kind.clone()).collect() };
    if kinds(&lacking) == kinds(&others) {
        AnswerMark::WrongPlace
    } else {
        AnswerMark::WrongKind
    }
}

/// Number of aliases in an answer, and number of those that are indistinguishable from their claim.
///
/// An alias is indistinguishable if its squared residual exceeds that of the replaced claim by less than [`SAME`].
pub fn aliases(answer: &ProgramAnswer, excess: &mut dyn FnMut(&[PlacedEffect]) -> f64) -> [usize; 2] {
    let claims: Vec<PlacedEffect> = answer.effects.iter().map(|c| c.effect.clone()).collect();
    let mut counts = [0, 0];
    if answer.effects.iter().all(|claim| claim.aliases.is_empty()) {
        return counts;
    }
    // Each alias in turn replaces its claim, and the residuals are compared.
    let with_claims = excess(&claims);
    for (k, claim) in answer.effects.iter().enumerate() {
        for alias in &claim.aliases {
            let mut others = claims.clone();
            others[k] = alias.clone();
            counts[0] += 1;
            counts[1] += usize::from(excess(&others) < with_claims + SAME);
        }
    }
    counts
}
