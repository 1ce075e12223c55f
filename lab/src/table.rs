//! The scores as text: marked cases go in; a table per class, the misses and totals come out.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::time::Duration;

use crate::answer::ProgramAnswer;
use crate::judge::{AnswerMark, CaseClass, FALL};

/// A case with its mark.
pub struct CaseScore {
    /// Number of the case, from 1.
    pub number: u64,
    /// Class of what is hidden.
    pub class: CaseClass,
    /// Label of its row in the table.
    pub label: String,
    /// What is hidden, as text.
    pub truth: String,
    /// Motion, columns and noise of the recordings, as text.
    pub recording: String,
    /// The drive on which a force outside the library acts.
    pub drive: Option<&'static str>,
    /// Errors of a model without the effects, relative to the force: fit and validation run.
    pub errors: [f64; 2],
    /// True noise floor of the validation run, relative to the force.
    pub floor: f64,
    /// Answer of the program; `None` if it failed.
    pub answer: Option<ProgramAnswer>,
    /// Mark of the answer.
    pub mark: AnswerMark,
    /// Number of aliases in the answer, and number of those that are indistinguishable.
    pub aliases: [usize; 2],
    /// Run time of the program.
    pub took: Duration,
}

impl CaseScore {
    /// Error on the validation run after the last step, relative to the noise floor; `None` if the effects are missed.
    pub fn fall(&self) -> Option<f64> {
        let effects = matches!(self.class, CaseClass::One | CaseClass::Two);
        let last = self.answer.as_ref()?.steps.last()?;
        (effects && self.mark.is_right()).then_some(last.check / self.floor)
    }
}

/// The text for standard output: table, misses, and totals compared with their targets.
pub fn report(scores: &[CaseScore], seed: u64) -> String {
    let mut text = String::new();
    let _ = writeln!(
        text,
        "{:<9}{:<52}{:>4}{:>7}{:>7}{:>7}{:>7}{:>7}{:>7}  check/floor",
        "class", "hidden", "n", "right", "kind", "place", "missed", "extra", "other"
    );
    // One row per label, then one for the class. All cases with two effects have one row.
    for class in CaseClass::ALL {
        let mut rows: BTreeMap<&str, Vec<&CaseScore>> = BTreeMap::new();
        let of_class: Vec<&CaseScore> = scores.iter().filter(|s| s.class == class).collect();
        for score in &of_class {
            let label = if class == CaseClass::Two {
                "two effects"
            } else {
                score.label.as_str()
            };
            rows.entry(label).or_default().push(score);
        }
        for (label, row) in rows {
            line(&mut text, class.name(), label, &row);
        }
        if !of_class.is_empty() {
            line(&mut text, class.name(), "all", &of_class);
        }
    }
    misses(&mut text, scores, seed);
    let _ = writeln!(text);
    // Share of right answers per class.
    for class in CaseClass::ALL {
        let of_class: Vec<&CaseScore> = scores.iter().filter(|s| s.class == class).collect();
        let right = of_class.iter().filter(|s| s.mark.is_right()).count();
        if !of_class.is_empty() {
            let _ = writeln!(
                text,
                "{:<8} {:>5.1} % right, {right} of {}; target {} %",
                class.name(),
                percent(right, of_class.len()),
                of_class.len(),
                class.target()
            );
        }
    }
    // Right answers should reduce the error on the validation run almost to the noise floor.
    let falls: Vec<f64> = scores.iter().filter_map(CaseScore::fall).collect();
    let fallen = falls.iter().filter(|fall| **fall <= FALL).count();
    if !falls.is_empty() {
        let _ = writeln!(
            text,
            "fall     {:>5.1} % of {} found with a validation error within {FALL} times the noise floor; target 100 %",
            percent(fallen, falls.len()),
            falls.len()
        );
    }
    // For unexplained forces, the answer should name the drive on which they act.
    let unexplained = |s: &&CaseScore| s.class == CaseClass::Outside && s.mark.is_right();
    let outside: Vec<&CaseScore> = scores.iter().filter(unexplained).collect();
    if !outside.is_empty() {
        let located = |s: &&&CaseScore| s.answer.as_ref().and_then(|a| a.channel.as_deref()) == s.drive;
        let _ = writeln!(
            text,
            "located  {} of {} unexplained forces reported first in the drive on which they act",
            outside.iter().filter(located).count(),
            outside.len()
        );
    }
    let [named, honest] = [0, 1].map(|k| scores.iter().map(|s| s.aliases[k]).sum::<usize>());
    let by_alias = scores.iter().filter(|s| s.mark == AnswerMark::Alias).count();
    let _ = writeln!(
        text,
        "aliases  {honest} of {named} reported aliases are indistinguishable from the claim; {by_alias} cases right by an alias"
    );
    let mut times: Vec<Duration> = scores.iter().map(|s| s.took).collect();
    times.sort();
    if let (Some(middle), Some(last)) = (times.get(times.len() / 2), times.last()) {
        let _ = writeln!(
            text,
            "time     median {:.2} s, maximum {:.2} s",
            middle.as_secs_f64(),
            last.as_secs_f64()
        );
    }
    text
}

/// A part relative to a total, %.
fn percent(part: usize, whole: usize) -> f64 {
    100.0 * part as f64 / whole as f64
}

/// Appends a row of the table: number of cases per mark, and mean of the validation error over the noise floor.
fn line(text: &mut String, class: &str, label: &str, row: &[&CaseScore]) {
    let count = |of: &dyn Fn(&AnswerMark) -> bool| row.iter().filter(|s| of(&s.mark)).count();
    let right = count(&AnswerMark::is_right);
    let kind = count(&|m| *m == AnswerMark::WrongKind);
    let place = count(&|m| *m == AnswerMark::WrongPlace);
    let missed = count(&|m| matches!(m, AnswerMark::Missed | AnswerMark::Partly));
    let extra = count(&|m| *m == AnswerMark::Extra);
    // All marks without a column of their own.
    let other = row.len() - right - kind - place - missed - extra;
    let falls: Vec<f64> = row.iter().filter_map(|s| s.fall()).collect();
    let mean = if falls.is_empty() {
        "-".to_owned()
    } else {
        format!("{:.3}", falls.iter().sum::<f64>() / falls.len() as f64)
    };
    let _ = writeln!(
        text,
        "{class:<9}{label:<52}{:>4}{right:>7}{kind:>7}{place:>7}{missed:>7}{extra:>7}{other:>7}  {mean}",
        row.len()
    );
}

/// Appends every case with a wrong answer or a large error, with truth and answer.
fn misses(text: &mut String, scores: &[CaseScore], seed: u64) {
    let missed = |s: &&CaseScore| !s.mark.is_right() || s.fall().is_some_and(|fall| fall > FALL);
    for (k, score) in scores.iter().filter(missed).enumerate() {
        if k == 0 {
            let _ = writeln!(text, "\nmisses");
        }
        let reason = match score.fall() {
            Some(fall) => format!("the validation error is {fall:.2} times the noise floor"),
            None => score.mark.in_words(),
        };
        let _ = writeln!(
            text,
            "- seed {seed} case {} ({}): {reason}\n  truth   {}\n  without {:.2} % on fit, {:.2} % on validation; floor {:.3} %; {}",
            score.number,
            score.class.name(),
            score.truth,
            100.0 * score.errors[0],
            100.0 * score.errors[1],
            100.0 * score.floor,
            score.recording
        );
        let Some(answer) = &score.answer else {
            continue;
        };
        let claims: Vec<String> = answer
            .effects
            .iter()
            .map(|claim| {
                let aliases: Vec<String> = claim.aliases.iter().map(ToString::to_string).collect();
                if aliases.is_empty() {
                    claim.effect.to_string()
                } else {
                    format!("{} (or {})", claim.effect, aliases.join(" or "))
                }
            })
            .collect();
        let _ = writeln!(text, "  answer  {}: {}", answer.verdict, claims.join(", "));
        let steps: Vec<String> = answer
            .steps
            .iter()
            .map(|step| {
                let added = step.added.as_ref().map(|added| format!("{added} "));
                format!(
                    "{}{:.3}/{:.3}",
                    added.unwrap_or_default(),
                    100.0 * step.fit,
                    100.0 * step.check
                )
            })
            .collect();
        let _ = writeln!(text, "  steps   {} (% on fit/validation)", steps.join(" -> "));
    }
}
