//! Options and verbs that a text of the library advises, spelled as each program does.
//!
//! The library names an option by its field, as in "leave out option `robust`", with a value as in
//! "option `columns` = `q=angle [deg]`", and a verb as in "verb `identify`". These words are all that a program looks for.

use std::borrow::Cow;

/// What a text advises.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AdviceItem<'a> {
    /// An option, with its value where the text gives one.
    Option(&'a str, Option<&'a str>),
    /// A verb.
    Verb(&'a str),
}

/// The text with everything that it advises spelled in another manner.
///
/// ```
/// use modelmill_boundary::text::{Advised, spelled};
/// let text = "check the unit: option `columns` = `q=q [deg]`";
/// let flags = |advised: Advised| match advised {
///     Advised::Option(name, Some(value)) => format!("--{name} '{value}'"),
///     Advised::Option(name, None) | Advised::Verb(name) => name.to_owned(),
/// };
/// assert_eq!(spelled(text, flags), "check the unit: --columns 'q=q [deg]'");
/// ```
pub fn format_advice(text: &str, mut spell: impl FnMut(AdviceItem) -> String) -> Cow<'_, str> {
    let mut out = String::new();
    let mut rest = text;
    while let Some((before, advised, behind)) = next_advice(rest) {
        out.push_str(before);
        out.push_str(&spell(advised));
        rest = behind;
    }
    if out.is_empty() && rest.len() == text.len() {
        return Cow::Borrowed(text);
    }
    out.push_str(rest);
    Cow::Owned(out)
}

/// The first thing that a text advises, with the text before and behind it.
fn next_advice(text: &str) -> Option<(&str, AdviceItem<'_>, &str)> {
    let mut from = 0;
    while let Some(found) = text[from..].find(['o', 'v']) {
        let at = from + found;
        let begins_a_word = !text[..at].ends_with(char::is_alphanumeric);
        if begins_a_word && let Some((advised, behind)) = leading_advice(&text[at..]) {
            return Some((&text[..at], advised, behind));
        }
        from = at + 1;
    }
    None
}

/// What a text begins with, if it is advice, and the text behind it.
fn leading_advice(text: &str) -> Option<(AdviceItem<'_>, &str)> {
    if let Some(rest) = text.strip_prefix("verb") {
        let (name, behind) = backquoted_word(rest)?;
        return Some((AdviceItem::Verb(name), behind));
    }
    let (name, behind) = backquoted_word(text.strip_prefix("option")?)?;
    let value = behind.trim_start().strip_prefix('=').and_then(backquoted_word);
    Some(match value {
        Some((value, behind)) => (AdviceItem::Option(name, Some(value)), behind),
        None => (AdviceItem::Option(name, None), behind),
    })
}

/// A word between grave accents behind white space, which may hold a line's end where the text was wrapped.
fn backquoted_word(text: &str) -> Option<(&str, &str)> {
    let word = text.trim_start();
    let is_apart = word.len() < text.len();
    word.strip_prefix('`').filter(|_| is_apart)?.split_once('`')
}

#[cfg(test)]
mod tests {
    use super::*;

    fn upper(advised: AdviceItem) -> String {
        match advised {
            AdviceItem::Option(name, None) => name.to_uppercase(),
            AdviceItem::Option(name, Some(value)) => format!("{}({value})", name.to_uppercase()),
            AdviceItem::Verb(name) => format!("<{name}>"),
        }
    }

    #[test]
    fn all_that_is_advised_is_spelled_and_the_rest_stays() {
        let text = "Give verb `identify` with option `between` = `1,2`, or leave out option `prior`; verb `compare` reads it.";
        assert_eq!(
            format_advice(text, upper),
            "Give <identify> with BETWEEN(1,2), or leave out PRIOR; <compare> reads it."
        );
        assert!(matches!(
            format_advice("an option without a name", upper),
            Cow::Borrowed(_)
        ));
        assert_eq!(
            format_advice("with option\n  `noise` =\n  `0.1`", upper),
            "with NOISE(0.1)"
        );
        assert!(matches!(format_advice("adoption `x`", upper), Cow::Borrowed(_)));
        // A mark that is cut off is text like any other.
        assert_eq!(format_advice("option `pri", upper), "option `pri");
    }
}
