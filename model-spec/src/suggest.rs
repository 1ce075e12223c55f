//! The nearest known name to a misspelt one.
//!
//! Messages about unknown names use it for their advice.

/// Longer names are not compared: the table of distances grows with the square.
const LONGEST_COMPARED: usize = 60;

/// The candidate nearest to `name`, if it is near enough to be meant.
/// A name may differ in a third of its characters, but in at least one and at most four. Names longer than
/// [`LONGEST_COMPARED`] bytes have no suggestion.
pub(crate) fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    if name.len() > LONGEST_COMPARED {
        return None;
    }
    // Longer names may contain more errors.
    let allowed = (name.chars().count() / 3).clamp(1, 4);
    candidates
        .into_iter()
        .filter(|candidate| candidate.len() <= LONGEST_COMPARED)
        .map(|candidate| (distance(name, candidate), candidate))
        .filter(|&(steps, candidate)| steps <= allowed && steps < candidate.chars().count())
        // Among equally near names the shortest is preferred.
        .min_by_key(|&(steps, candidate)| (steps, candidate.len()))
        .map(|(_, candidate)| candidate)
}

/// `did you mean ...?` for the nearest candidate, or the complete list if it is short.
/// `what` names the sort of candidates in the plural. At most 16 of them are listed.
pub(crate) fn advice<'a>(name: &str, what: &str, candidates: impl IntoIterator<Item = &'a str> + Clone) -> String {
    if let Some(found) = nearest(name, candidates.clone()) {
        return format!("did you mean `{found}`?");
    }
    // Nothing is near enough, so all names are listed.
    let mut all: Vec<&str> = candidates.into_iter().collect();
    if all.is_empty() {
        return format!("the file declares no {what}");
    }
    let n = all.len();
    all.truncate(16);
    let list = all.iter().map(|one| format!("`{one}`")).collect::<Vec<_>>().join(", ");
    let more = if n > all.len() { ", ..." } else { "" };
    format!("known {what}: {list}{more}")
}

/// Number of insertions, deletions, substitutions and swaps of neighbours between two names; case counts half.
/// Damerau-Levenshtein distance in its restricted form: swapped neighbours are not edited again.
fn distance(one: &str, other: &str) -> usize {
    let one: Vec<char> = one.chars().collect();
    let other: Vec<char> = other.chars().collect();
    // Three rows of the table of distances are kept: the current one and the two before it.
    let mut before_last: Vec<usize> = Vec::new();
    let mut last: Vec<usize> = (0..=other.len()).collect();
    for i in 1..=one.len() {
        // The first entry of a row is the number of deletions.
        let mut row = vec![i];
        for j in 1..=other.len() {
            let same = one[i - 1].eq_ignore_ascii_case(&other[j - 1]);
            let mut best = (last[j - 1] + usize::from(!same)).min(last[j] + 1).min(row[j - 1] + 1);
            // Two neighbouring characters are swapped.
            if i > 1 && j > 1 && one[i - 1] == other[j - 2] && one[i - 2] == other[j - 1] {
                best = best.min(before_last[j - 2] + 1);
            }
            row.push(best);
        }
        before_last = std::mem::replace(&mut last, row);
    }
    last[other.len()]
}

#[cfg(test)]
mod tests {
    use super::nearest;

    #[test]
    fn the_nearest_name_is_the_one_meant() {
        let names = ["theta1", "theta2", "gamma1", "dc1", "g"];
        assert_eq!(nearest("theat1", names), Some("theta1"));
        assert_eq!(nearest("Theta2", names), Some("theta2"));
        assert_eq!(nearest("dc2", names), Some("dc1"));
        assert_eq!(nearest("mass", names), None);
        assert_eq!(nearest("", names), None);
    }
}
