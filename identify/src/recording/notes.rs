//! What a user should know about the data although it is no error: notes that go to the
//! terminal and into the JSON (`"data": [{"severity", "says"}]`), and nearest names for messages.

use serde::{Deserialize, Serialize};

/// How much a [`Note`] matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Said for the record: a choice that was made, a column that was prepared.
    Info,
    /// Likely to harm the result; worth a look before trusting it.
    Warning,
}

/// One remark about a recording or its preparation.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Note {
    /// How much it matters.
    pub severity: Severity,
    /// One or two full sentences.
    pub says: String,
}

impl Note {
    /// A remark for the record.
    pub fn info(says: impl Into<String>) -> Self {
        Self {
            severity: Severity::Info,
            says: says.into(),
        }
    }

    /// A remark that asks for attention.
    pub fn warning(says: impl Into<String>) -> Self {
        Self {
            severity: Severity::Warning,
            says: says.into(),
        }
    }
}

/// `1 gap`, `2 gaps`.
pub(crate) fn count_of(n: usize, one: &str, many: &str) -> String {
    if n == 1 {
        format!("1 {one}")
    } else {
        format!("{n} {many}")
    }
}

/// Seven significant digits, and powers of ten where a plain number would be long.
pub(crate) fn short(value: f64) -> String {
    let rounded: f64 = format!("{value:.6e}").parse().unwrap_or(value);
    if rounded != 0.0 && !(1e-4..1e7).contains(&rounded.abs()) {
        format!("{rounded:e}")
    } else {
        rounded.to_string()
    }
}

/// The candidate that is spelt most like `wanted`, if any comes close enough to be a likely slip.
pub(crate) fn nearest<'a>(
    wanted: &str,
    candidates: impl IntoIterator<Item = &'a str>,
) -> Option<&'a str> {
    let lower = wanted.to_lowercase();
    candidates
        .into_iter()
        .map(|candidate| {
            let other = candidate.to_lowercase();
            // A name with a unit behind it (`t_s` for `t`) is a likely meaning as well.
            let extends = other.starts_with(&format!("{lower}_"))
                || (lower.len() > 2 && other.starts_with(&lower));
            let distance = if extends {
                1
            } else {
                edit_distance(&lower, &other)
            };
            (distance, candidate)
        })
        // Two names of one letter have nothing in common.
        .filter(|(distance, candidate)| {
            *distance <= 1.max(wanted.chars().count() / 3) && *distance < candidate.chars().count()
        })
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
}

/// Levenshtein's distance in characters.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let substitute = diagonal + usize::from(x != *y);
            diagonal = row[j + 1];
            row[j + 1] = substitute.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::nearest;

    #[test]
    fn a_slip_of_the_pen_is_found_and_a_stranger_is_not() {
        let names = ["t_s", "theta1", "theta2", "spindle_left"];
        assert_eq!(nearest("t", names), Some("t_s"));
        assert_eq!(nearest("spindel_left", names), Some("spindle_left"));
        assert_eq!(nearest("Theta1", names), Some("theta1"));
        assert_eq!(nearest("gearbox", names), None);
        assert_eq!(nearest("q", ["t", "x"]), None);
        assert_eq!(nearest("q", ["t", "Q"]), Some("Q"));
        assert_eq!(nearest("q", ["t", "q1"]), Some("q1"));
    }
}
