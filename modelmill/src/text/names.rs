//! Names as parts of a sentence.

/// Names as a list whose last entry is joined by `and`.
pub(crate) fn joined_by_and(names: &[String]) -> String {
    match names {
        [] => "nothing".to_owned(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}
