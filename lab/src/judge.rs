//! Right or wrong: truth, answer, and what the noise-free motion says can be told apart go in; a mark comes out.

use std::collections::BTreeSet;

use crate::answer::ProgramAnswer;
use crate::placed::{EffectAtom, HOLDS, PlacedEffect, atoms};

/// Two explanations whose squared errors differ by less, in units of the noise's variance, cannot be told apart: three
/// standard deviations.
pub const SAME: f64 = 9.0;
/// How much above the noise floor the error on the check run may stay.
pub const FALL: f64 = 1.3;

/// What is hidden in a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CaseClass {
    /// One effect of the library.
    One,
    /// Two of them.
    Two,
    /// Nothing, or what base parameters take up.
    None,
    /// Something that no library holds.
    Outside,
}

impl CaseClass {
    /// All of them, in the order of tables.
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

    /// The share of right answers that is asked for, %.
    pub fn target(self) -> f64 {
        match self {
            Self::One => 95.0,
            Self::Two => 85.0,
            Self::None => 98.0,
            Self::Outside => 90.0,
        }
    }
}

/// How an answer did.
#[derive(Clone, Debug, PartialEq)]
pub enum AnswerMark {
    /// All effects with their places and no others; or the verdict that is true.
    Right,
    /// Another effect stands in for the true one; it is named as its alias, and nobody could tell them apart.
    Alias,
    /// Right effects, but the verdict is another than `missing_effect`.
    WrongVerdict,
    /// Nothing was found.
    Missed,
    /// Some of the effects were found, and nothing else.
    Partly,
    /// The right kind at another place.
    WrongPlace,
    /// Another kind.
    WrongKind,
    /// All true effects, and others besides.
    Extra,
    /// Nothing was hidden.
    FalseAlarm,
    /// Something outside the library was taken for an effect of it.
    Guess,
    /// It is outside the library, and was taken for noise.
    Overlooked,
    /// The program failed, or its JSON is not that of `cli.md`.
    Failed(String),
}

impl AnswerMark {
    /// Whether it counts as right.
    pub fn is_right(&self) -> bool {
        matches!(self, Self::Right | Self::Alias)
    }

    /// In words.
    pub fn in_words(&self) -> String {
        match self {
            Self::Right => "right",
            Self::Alias => "right, by an honest alias",
            Self::WrongVerdict => "right effects, wrong verdict",
            Self::Missed => "missed",
            Self::Partly => "found in part",
            Self::WrongPlace => "wrong place",
            Self::WrongKind => "wrong kind",
            Self::Extra => "extra effects",
            Self::FalseAlarm => "false alarm",
            Self::Guess => "a guess dressed as a finding",
            Self::Overlooked => "taken for noise",
            Self::Failed(why) => return format!("failed: {why}"),
        }
        .to_owned()
    }
}

/// Marks an answer. `excess` gives the squared error, in units of the noise's variance, that a set of claimed effects
/// leaves of the true forces without noise; infinite for kinds that it does not know. `disturbance` is what something outside
/// the library is called among the disturbances of recordings: named so, the model lacks nothing.
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

fn mark_answer(
    hidden: &[PlacedEffect],
    answer: &ProgramAnswer,
    excess: &mut dyn FnMut(&[PlacedEffect]) -> f64,
) -> AnswerMark {
    let truth = atoms(hidden);
    let claims: Vec<PlacedEffect> = answer.effects.iter().map(|c| c.effect.clone()).collect();
    let claimed = atoms(&claims);
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
    // A stand-in must be named as what it is, by the claim itself, and be one that nobody could tell from the truth.
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
    // What holds the truth among other things is the less simple answer, and no stand-in.
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
    let kinds =
        |set: &BTreeSet<&EffectAtom>| -> BTreeSet<String> { set.iter().map(|(kind, _)| kind.clone()).collect() };
    if kinds(&lacking) == kinds(&others) {
        AnswerMark::WrongPlace
    } else {
        AnswerMark::WrongKind
    }
}

/// How many aliases an answer names, and how many of them leave no more of the true forces than the claims themselves
/// would, so that nobody could tell them apart.
pub fn aliases(answer: &ProgramAnswer, excess: &mut dyn FnMut(&[PlacedEffect]) -> f64) -> [usize; 2] {
    let claims: Vec<PlacedEffect> = answer.effects.iter().map(|c| c.effect.clone()).collect();
    let mut counts = [0, 0];
    if answer.effects.iter().all(|claim| claim.aliases.is_empty()) {
        return counts;
    }
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
