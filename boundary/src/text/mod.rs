//! Free text of users (titles, notes, headers of recordings, names of files) for output.
//!
//! Text from a file may contain anything: control sequences of terminals, marks that change the direction of writing,
//! the end of a comment. Each kind of output has one function that keeps ordinary text and makes the rest harmless.
//! [`Message`] is text of the program with typed remedies.

mod escape;
mod markdown_text;
mod message;
mod remedy;

use std::borrow::Cow;

pub use escape::{code_in_markdown, comment, csv_field, csv_name, html, json, latex, markdown};
pub use markdown_text::MarkdownText;
pub use message::Message;
#[doc(hidden)]
pub use message::{MessageArgument, MessageSink, MessageSlot};
pub use remedy::{CommandName, OptionName, OptionSetting, Remedy, RemedyWording, RustWording};

/// Text on one line. Line ends and tabs become blanks. Control characters of terminals and of the direction of
/// writing become the replacement character.
///
/// ```
/// use modelmill_boundary::text::plain;
/// assert_eq!(plain("a crank, 0.3 m \u{2013} \u{3b8}"), "a crank, 0.3 m \u{2013} \u{3b8}");
/// assert_eq!(plain("two\r\nlines\u{1b}[2J"), "two lines\u{fffd}[2J");
/// ```
pub fn plain(text: &str) -> Cow<'_, str> {
    filter_characters(text, &[])
}

/// Like [`plain`], but line ends and tabs are kept; line ends of other systems become line feeds.
pub fn lines(text: &str) -> Cow<'_, str> {
    filter_characters(text, &['\n', '\t'])
}

/// Text for a terminal or standard output. It is treated as by [`lines`], but if `coloured`, marks for bold, dim or
/// coloured text are kept.
pub fn terminal(text: &str, coloured: bool) -> Cow<'_, str> {
    if !coloured || !text.contains('\u{1b}') {
        return lines(text);
    }
    let mut out = String::with_capacity(text.len());
    // Escape characters that do not start an allowed mark are replaced.
    let mut rest = text;
    while let Some(at) = rest.find('\u{1b}') {
        out.push_str(&lines(&rest[..at]));
        let mark = colour_mark_length(&rest[at..]).unwrap_or(0);
        if mark == 0 {
            out.push(char::REPLACEMENT_CHARACTER);
        }
        out.push_str(&rest[at..at + mark]);
        rest = &rest[at + mark.max(1)..];
    }
    out.push_str(&lines(rest));
    Cow::Owned(out)
}

/// Length of the mark for bold, dim or coloured text at the start of a text: `ESC [ numbers m`. Marks that hide text
/// do not count.
fn colour_mark_length(text: &str) -> Option<usize> {
    let numbers = text.strip_prefix("\u{1b}[")?;
    let end = numbers.find(|c: char| !c.is_ascii_digit() && c != ';')?;
    // Allowed are styles that show the text, and the usual colours.
    let is_shown = numbers[..end]
        .split(';')
        .all(|n| matches!(n.parse::<u8>(), Ok(0..=4 | 22..=24 | 30..=39 | 90..=97)) || n.is_empty());
    (numbers[end..].starts_with('m') && is_shown).then_some(2 + end + 1)
}

/// Replaces harmful characters, except for those in `kept`.
fn filter_characters<'a>(text: &'a str, kept: &[char]) -> Cow<'a, str> {
    if text.chars().all(|c| kept.contains(&c) || !is_harmful(c)) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len());
    let mut chars = text.chars().peekable();
    while let Some(c) = chars.next() {
        out.push(match c {
            c if kept.contains(&c) || !is_harmful(c) => c,
            // The carriage return of a pair is dropped, and the line feed becomes a blank.
            '\r' if chars.peek() == Some(&'\n') => continue,
            '\r' | '\n' | '\t' | '\u{b}' | '\u{c}' | '\u{85}' | '\u{2028}' | '\u{2029}' => ' ',
            _ => char::REPLACEMENT_CHARACTER,
        });
    }
    Cow::Owned(out)
}

/// Whether a character moves a cursor, ends a line, changes the direction of writing, or is invisible.
fn is_harmful(c: char) -> bool {
    c.is_control() || is_direction_control(c) || matches!(c, '\u{2028}' | '\u{2029}')
}

/// Whether a character changes the direction of writing, or is invisible and has a meaning for programs only.
fn is_direction_control(c: char) -> bool {
    matches!(
        c,
        '\u{61c}'
            | '\u{200e}'
            | '\u{200f}'
            | '\u{202a}'..='\u{202e}'
            | '\u{2066}'..='\u{206f}'
            | '\u{feff}'
            | '\u{fff9}'..='\u{fffb}'
            | '\u{e0000}'..='\u{e007f}'
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Everything that ever did harm, in one text.
    const HOSTILE: &str = "a\u{1b}]0;title\u{7}b\rc\u{202e}d\u{2066}e\u{2028}f\u{85}g\u{9b}31mh\u{feff}i\0j\u{e0041}k";

    #[test]
    fn nothing_that_steers_is_left() {
        assert_eq!(
            plain(HOSTILE),
            "a\u{fffd}]0;title\u{fffd}b c\u{fffd}d\u{fffd}e f g\u{fffd}31mh\u{fffd}i\u{fffd}j\u{fffd}k"
        );
        for one in [
            plain(HOSTILE),
            lines(HOSTILE),
            terminal(HOSTILE, true),
            html(HOSTILE),
            markdown(HOSTILE),
            latex(HOSTILE),
            comment(HOSTILE),
            csv_field(HOSTILE),
            json(HOSTILE),
        ] {
            let left = one.chars().find(|c| is_harmful(*c));
            assert_eq!(left, None, "{one:?}");
        }
    }

    #[test]
    fn colours_reach_a_terminal_that_wants_them_and_nothing_else_does() {
        let red = "\u{1b}[1;31mred\u{1b}[0m\tnext\r\nline";
        assert_eq!(terminal(red, true), "\u{1b}[1;31mred\u{1b}[0m\tnext\nline");
        assert_eq!(terminal(red, false), "\u{fffd}[1;31mred\u{fffd}[0m\tnext\nline");
        for other in [
            "\u{1b}[8mhidden",
            "\u{1b}[2Jcleared",
            "\u{1b}]8;;link",
            "\u{1b}[",
            "\u{1b}\u{1b}[999m",
        ] {
            assert!(!terminal(other, true).contains('\u{1b}'), "{other:?}");
        }
    }

    #[test]
    fn ordinary_text_is_not_even_copied() {
        for text in ["", "m1 = 3 kg, \u{3b8}\u{307} \u{2013} \u{65e5}\u{672c} \u{1f980}"] {
            assert!(matches!(plain(text), Cow::Borrowed(_)));
            assert!(matches!(html(text), Cow::Borrowed(_)));
            assert!(matches!(comment(text), Cow::Borrowed(_)));
        }
    }
}
