//! Words for messages: counts with nouns, lists of names, numbers with a number of digits, and the nearest name.

/// A count with its noun: `1 gap`, `2 gaps`.
pub(crate) fn count_of(n: usize, one: &str, many: &str) -> String {
    if n == 1 {
        format!("1 {one}")
    } else {
        format!("{n} {many}")
    }
}

/// A number with seven significant digits, in powers of ten if it would be long otherwise.
pub(crate) fn seven_digits(value: f64) -> String {
    // Rounding through a text gives the shortest form of the rounded number.
    let rounded: f64 = format!("{value:.6e}").parse().unwrap_or(value);
    if rounded != 0.0 && !(1e-4..1e7).contains(&rounded.abs()) {
        format!("{rounded:e}")
    } else {
        rounded.to_string()
    }
}

/// A number with this many significant digits, without trailing zeros.
pub(crate) fn with_digits(value: f64, digits: usize) -> String {
    let scientific = format!("{value:.*e}", digits - 1);
    scientific
        .parse::<f64>()
        .map_or(scientific, |rounded| rounded.to_string())
}

/// The candidate that is spelt most like `wanted`, if it is near enough to be a likely mistake; case does not matter.
pub(crate) fn nearest_name<'a>(wanted: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let lower = wanted.to_lowercase();
    candidates
        .into_iter()
        .map(|candidate| {
            let other = candidate.to_lowercase();
            // A name with a unit behind it (`t_s` for `t`) is also likely.
            let extends = other.starts_with(&format!("{lower}_")) || (lower.len() > 2 && other.starts_with(&lower));
            let distance = if extends { 1 } else { edit_distance(&lower, &other) };
            (distance, candidate)
        })
        // Two different names of one letter are not similar.
        .filter(|(distance, candidate)| {
            *distance <= 1.max(wanted.chars().count() / 3) && *distance < candidate.chars().count()
        })
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
}

/// Levenshtein distance in characters.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    // One row of the table of distances, which is updated in place.
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

/// Names in backquotes, separated by commas; of a long list the first 40 and the number of the others.
pub(crate) fn backquoted_list(names: &[String]) -> String {
    const SHOWN: usize = 40;
    let shown: Vec<String> = names.iter().take(SHOWN).map(|name| format!("`{name}`")).collect();
    if names.len() > SHOWN {
        format!("{} and {} more", shown.join(", "), names.len() - SHOWN)
    } else {
        shown.join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::nearest_name;

    #[test]
    fn a_slip_of_the_pen_is_found_and_a_stranger_is_not() {
        let names = ["t_s", "theta1", "theta2", "spindle_left"];
        assert_eq!(nearest_name("t", names), Some("t_s"));
        assert_eq!(nearest_name("spindel_left", names), Some("spindle_left"));
        assert_eq!(nearest_name("Theta1", names), Some("theta1"));
        assert_eq!(nearest_name("gearbox", names), None);
        assert_eq!(nearest_name("q", ["t", "x"]), None);
        assert_eq!(nearest_name("q", ["t", "Q"]), Some("Q"));
        assert_eq!(nearest_name("q", ["t", "q1"]), Some("q1"));
    }
}
