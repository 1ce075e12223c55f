//! Marks of answers: `truth.json` and the JSON of an answer go in; a mark comes out.

use regex_lite::RegexBuilder;
use serde_json::Value;

/// The mark of an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mark {
    /// Verdict, effects, places and disturbance agree with the truth.
    Right,
    /// The verdict is that something is unexplained, and all claims are true.
    Honest,
    /// It misses something, or reports something where only noise is.
    Wrong,
    /// It claims an effect that is not present, or a wrong place.
    False,
}

impl Mark {
    /// The mark as it is printed.
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::Right => "right",
            Self::Honest => "honest",
            Self::Wrong => "wrong",
            Self::False => "FALSE",
        }
    }
}

/// A kind at one place.
type Placed = (String, String);

/// Marks an answer, the JSON of `diagnose`, by the truth of its case.
pub(crate) fn judge(truth: &Value, answer: &Value) -> Mark {
    let Some(verdict) = answer["verdict"].as_str() else {
        return Mark::Wrong;
    };
    let there: Vec<Placed> = list(&truth["effects"])
        .map(|effect| (text(&effect["kind"]), text(&effect["at"])))
        .collect();
    let pairs = |name: &str| -> Vec<Placed> {
        list(&truth[name])
            .map(|pair| (text(&pair[0]), text(&pair[1])))
            .collect()
    };
    let also = pairs("also_named_as");
    let mut allowed = there.clone();
    allowed.extend(also.iter().cloned());
    if verdict == "unexplained" {
        allowed.extend(pairs("tolerated"));
    }
    let mut named: Vec<Placed> = Vec::new();
    for claim in list(&answer["effects"]) {
        let own = placed(claim);
        let group = list(&claim["indistinguishable_from"]).map(placed);
        let mut ways = std::iter::once(own).chain(group);
        match ways.find(|way| way.iter().all(|one| allowed.contains(one))) {
            Some(way) => named.extend(way),
            None => return Mark::False,
        }
    }
    let names_disturbance = names(truth, answer) || named.iter().any(|one| also.contains(one));
    let must = truth["must_be_named"].as_bool() == Some(true);
    let has = |name: &str| list(&truth["verdict"][name]).any(|one| one == verdict);
    let is_right = has("right") || names_disturbance && named.iter().any(|one| also.contains(one));
    let finds_all = there.iter().all(|one| named.contains(one));
    let says_where = list(&truth["law"]["at"])
        .all(|place| verdict != "unexplained" || list(&answer["where"]).any(|one| one["channel"] == *place));
    if is_right && finds_all && says_where && (names_disturbance || !must) {
        return if is_silent(truth, answer, names_disturbance) {
            Mark::Wrong
        } else {
            Mark::Right
        };
    }
    // If there is only noise, the verdict `unexplained` is a false alarm, which neither list contains.
    if verdict == "unexplained" && (has("right") || has("honest"))
        || has("honest") && !is_silent(truth, answer, names_disturbance)
    {
        return Mark::Honest;
    }
    Mark::Wrong
}

/// Whether an answer leaves an error on the validation run above twice the true noise without a cause or `unexplained`.
fn is_silent(truth: &Value, answer: &Value, names_disturbance: bool) -> bool {
    let floor = truth["runs"]["check"]["floor"]["relative"].as_f64();
    let last = list(&answer["steps"]).last().and_then(|step| step["check"].as_f64());
    let is_above = matches!((floor, last), (Some(floor), Some(last)) if last > 2.0 * floor);
    answer["verdict"] != "unexplained" && is_above && !names_disturbance
}

/// Whether the answer names the disturbance or law with one of the accepted words.
fn names(truth: &Value, answer: &Value) -> bool {
    // Remarks on data and places are part of every answer, so they are not searched.
    let said: Vec<String> = ["disturbances", "laws"]
        .iter()
        .flat_map(|part| list(&answer[*part]))
        .map(|one| {
            let words = ["kind", "says", "expression"].map(|name| text(&one[name]));
            words.join(" ").replace('_', " ")
        })
        .collect();
    list(&truth["named_by"]).any(|pattern| {
        let pattern = RegexBuilder::new(&text(pattern)).case_insensitive(true).build();
        pattern.is_ok_and(|pattern| said.iter().any(|one| pattern.is_match(one)))
    })
}

/// An answer in one line: verdict, first and last validation error, effects and disturbances.
pub(crate) fn summary(answer: &Value) -> String {
    let effects: Vec<String> = list(&answer["effects"])
        .map(|one| {
            let places: Vec<String> = list(&one["at"]).map(text).collect();
            format!("{}({})", text(&one["kind"]), places.join(","))
        })
        .collect();
    let disturbances: Vec<String> = list(&answer["disturbances"])
        .map(|one| {
            let places: Vec<String> = list(&one["at"]).map(text).collect();
            format!("{}({})", text(&one["kind"]), places.join(","))
        })
        .collect();
    let percent = |value: Option<&Value>| {
        let check = value.and_then(|step| step["check"].as_f64());
        check.map_or_else(|| "-".to_owned(), |check| format!("{:.2}", 100.0 * check))
    };
    format!(
        "{} {}..{} % effects [{}] disturbances [{}]",
        text(&answer["verdict"]),
        percent(list(&answer["steps"]).next()),
        percent(list(&answer["steps"]).last()),
        effects.join(" "),
        disturbances.join(" ")
    )
}

/// The kind of an effect at each of its places.
fn placed(effect: &Value) -> Vec<Placed> {
    let kind = text(&effect["kind"]);
    list(&effect["at"]).map(|place| (kind.clone(), text(place))).collect()
}

/// The elements of a list; none for other values.
fn list(value: &Value) -> impl DoubleEndedIterator<Item = &Value> {
    value.as_array().into_iter().flatten()
}

/// The text of a string; empty for other values.
fn text(value: &Value) -> String {
    value.as_str().unwrap_or_default().to_owned()
}
