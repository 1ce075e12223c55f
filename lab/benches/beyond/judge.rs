//! Marks of answers on recordings with faults: `truth.json` and the JSON of an answer go in; a mark comes out.

use regex_lite::Regex;
use serde_json::Value;

/// Largest relative error of a value that counts as found.
const VALUE_TOLERANCE: f64 = 0.15;
/// The same in standard deviations of the estimate.
const VALUE_DEVIATIONS: f64 = 3.0;
/// Disturbances that every sensor has: they are no claim.
const HARMLESS: [&str; 6] = [
    "coloured_noise",
    "quantised_force",
    "outliers",
    "time_jitter",
    "load_noise",
    "encoder_steps",
];

/// The mark of an answer, the worst last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FaultMark {
    /// Every effect and every fault is named, and nothing else.
    Right,
    /// Nothing false is claimed, and it states that something is unexplained.
    Honest,
    /// Nothing false is claimed, but it is content with less than is there.
    Silent,
    /// It claims something that is not there.
    False,
    /// The program failed.
    Failed,
}

/// All marks with their words.
pub(crate) const MARKS: [(FaultMark, &str); 5] = [
    (FaultMark::Right, "right"),
    (FaultMark::Honest, "honest"),
    (FaultMark::Silent, "silent"),
    (FaultMark::False, "FALSE"),
    (FaultMark::Failed, "failed"),
];

/// A judged answer.
pub(crate) struct JudgedAnswer {
    /// Its mark.
    pub(crate) mark: FaultMark,
    /// Claims that are false, as text with their probability.
    pub(crate) false_claims: Vec<String>,
}

/// Marks an answer by the truth of its case.
pub(crate) fn judge(truth: &Value, answer: Option<&Value>) -> JudgedAnswer {
    let Some(answer) = answer else {
        return JudgedAnswer {
            mark: FaultMark::Failed,
            false_claims: Vec::new(),
        };
    };
    let faults: Vec<Vec<&str>> = list(&truth["faults_of_the_recordings"]).map(words).collect();
    let missing: Vec<&Value> = list(&truth["missing_effects"]).collect();
    let disturbances: Vec<&Value> = list(&answer["disturbances"]).collect();
    let mut named: Vec<&str> = disturbances.iter().filter_map(|one| one["kind"].as_str()).collect();
    let mut found = vec![false; missing.len()];
    let mut false_claims = Vec::new();
    for claim in list(&answer["effects"]) {
        let ways: Vec<&Value> = std::iter::once(claim)
            .chain(list(&claim["indistinguishable_from"]))
            .collect();
        let mut is_true = false;
        for way in &ways {
            let kind = text(&way["kind"]);
            for (k, effect) in missing.iter().enumerate() {
                if !list(&way["at"]).all(|place| list(&effect["at"]).any(|at| at == place)) {
                    continue;
                }
                let is_kind = list(&effect["kinds"]).any(|one| one == kind);
                is_true |= is_kind || list(&effect["partly"]).any(|one| one == kind);
                // Only the first way has estimates.
                found[k] |= is_kind && (!std::ptr::eq(*way, claim) || has_value(claim, &effect["value"]));
            }
            if faults.iter().flatten().any(|fault| *fault == kind) {
                named.push(kind);
                is_true = true;
            }
            is_true |= is_tolerated(truth, way);
        }
        if !is_true {
            false_claims.push(format!(
                "{} {} ({:.2})",
                text(&claim["kind"]),
                words(&claim["at"]).join(","),
                claim["probability"].as_f64().unwrap_or(1.0)
            ));
        }
    }
    let of_effects: Vec<&str> = missing
        .iter()
        .flat_map(|effect| words(&effect["kinds"]).into_iter().chain(words(&effect["partly"])))
        .collect();
    for one in &disturbances {
        let kind = text(&one["kind"]);
        let is_true = HARMLESS.contains(&kind)
            || faults.iter().flatten().any(|fault| *fault == kind)
            || of_effects.contains(&kind)
            || is_tolerated(truth, one);
        if !is_true {
            false_claims.push(format!("disturbance {kind} {}", words(&one["at"]).join(",")));
        }
    }
    let verdict = text(&answer["verdict"]);
    let names_all = faults.iter().all(|fault| fault.iter().any(|kind| named.contains(kind)));
    let is_verdict = list(&truth["verdict"]).any(|one| one == verdict);
    let mark = if !false_claims.is_empty() {
        FaultMark::False
    } else if names_all && found.iter().all(|found| *found) && is_verdict {
        FaultMark::Right
    } else if verdict == "unexplained" {
        FaultMark::Honest
    } else {
        FaultMark::Silent
    };
    JudgedAnswer { mark, false_claims }
}

/// Whether an estimate of a claim has the true value; true if the truth states none.
fn has_value(claim: &Value, value: &Value) -> bool {
    let Some(value) = value.as_f64().map(f64::abs) else {
        return true;
    };
    list(&claim["estimates"]).any(|one| {
        let estimate = one["value"].as_f64().unwrap_or(f64::NAN).abs();
        let deviation = one["std"].as_f64().unwrap_or(0.0);
        (estimate - value).abs() < (VALUE_TOLERANCE * value).max(VALUE_DEVIATIONS * deviation)
    })
}

/// Whether a claim is one of those that the truth lets pass: patterns of kind and place.
fn is_tolerated(truth: &Value, claim: &Value) -> bool {
    let places = words(&claim["at"]);
    list(&truth["may_be_named_too"]).any(|pair| {
        let [kind, place] = [0, 1].map(|k| Regex::new(&format!("^(?:{})$", text(&pair[k]))));
        let (Ok(kind), Ok(place)) = (kind, place) else {
            return false;
        };
        kind.is_match(text(&claim["kind"])) && places.iter().any(|at| place.is_match(at))
    })
}

/// The elements of a list; none for other values.
fn list(value: &Value) -> impl Iterator<Item = &Value> {
    value.as_array().into_iter().flatten()
}

/// The texts of a list.
fn words(value: &Value) -> Vec<&str> {
    list(value).filter_map(Value::as_str).collect()
}

/// The text of a string; empty for other values.
fn text(value: &Value) -> &str {
    value.as_str().unwrap_or_default()
}
