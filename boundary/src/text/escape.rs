//! Escapes free text for each kind of output, so that it has no special meaning there.

use std::borrow::Cow;
use std::fmt::Write;

use super::plain;

/// Text of an HTML page, in an element or in an attribute in double quotes; line ends are kept.
pub fn html(text: &str) -> Cow<'_, str> {
    escape_characters(super::lines(text), |c, out| match c {
        '&' => out.push_str("&amp;"),
        '<' => out.push_str("&lt;"),
        '>' => out.push_str("&gt;"),
        '"' => out.push_str("&quot;"),
        c => out.push(c),
    })
}

/// Text of a Markdown paragraph, heading or table cell; links, images, formulas, tags and marks are escaped.
///
/// ```
/// use modelmill_boundary::text::markdown;
/// assert_eq!(markdown("[a](javascript:b)"), r"\[a\](javascript:b)");
/// ```
pub fn markdown(text: &str) -> Cow<'_, str> {
    escape_characters(plain(text), |c, out| {
        if matches!(c, '\\' | '`' | '*' | '_' | '|' | '<' | '$' | '[' | ']' | '&' | '~') {
            out.push('\\');
        }
        out.push(c);
    })
}

/// Text as code in a line of Markdown, with its backquotes; it can be used in a table cell.
pub fn code_in_markdown(text: &str) -> String {
    let text = plain(text).replace('|', "\\|");
    // The fence must be longer than any run of backquotes in the text.
    let longest = text.split(|c| c != '`').map(str::len).max().unwrap_or(0);
    let fence = "`".repeat(longest + 1);
    // A backquote at an end would join the fence.
    let blank = if text.starts_with('`') || text.ends_with('`') {
        " "
    } else {
        ""
    };
    format!("{fence}{blank}{text}{blank}{fence}")
}

/// Text of a LaTeX document; characters that are not in the plain fonts become question marks.
pub fn latex(text: &str) -> Cow<'_, str> {
    escape_characters(plain(text), |c, out| match c {
        '\\' => out.push_str("\\textbackslash{}"),
        '^' => out.push_str("\\textasciicircum{}"),
        '~' => out.push_str("\\textasciitilde{}"),
        '{' | '}' | '$' | '&' | '#' | '_' | '%' => {
            out.push('\\');
            out.push(c);
        }
        c if (c as u32) < 0x250 => out.push(c),
        _ => out.push('?'),
    })
}

/// Text of a comment in C, Rust or Python of any style. It neither ends the comment nor begins one in it, joins no
/// lines, and ends no documentation string. On a page of `rustdoc` it makes neither a tag nor a link.
///
/// A backslash at the end of a line joins lines and begins escapes in a Python string, and three characters can stand
/// for one in C (`??/`). Therefore a backslash becomes a slash, and the other characters are separated by a blank.
///
/// ```
/// use modelmill_boundary::text::comment;
/// assert_eq!(comment("five-bar, d1*d2"), "five-bar, d1*d2");
/// assert_eq!(comment("*\\\n/ int evil; /*"), "* / / int evil; / *");
/// ```
pub fn comment(text: &str) -> Cow<'_, str> {
    let mut before = '\0';
    escape_characters(plain(text), |c, out| {
        let c = if c == '\\' { '/' } else { c };
        // Pairs of characters with a meaning in one of the languages.
        let joins = match before {
            '*' => c == '/',
            '/' => c == '*',
            '?' => c == '?',
            '<' => c.is_ascii_alphabetic() || matches!(c, '/' | '!' | '?'),
            ']' => matches!(c, '(' | '[' | ':'),
            _ => false,
        };
        if joins {
            out.push(' ');
        }
        // Three of them end a documentation string.
        out.push(if c == '"' && before == '"' { '\'' } else { c });
        before = c;
    })
}

/// A field of CSV text, in quotes if needed; spreadsheets do not read it as a formula.
///
/// ```
/// use modelmill_boundary::text::{csv_field, csv_name};
/// assert_eq!(csv_field("=cmd()"), "\"'=cmd()\"");
/// assert_eq!(csv_name("'=cmd()"), "=cmd()");
/// ```
pub fn csv_field(text: &str) -> Cow<'_, str> {
    let text = plain(text);
    // Numbers with a sign are not formulas.
    let is_formula = is_spreadsheet_formula(&text) && text.parse::<f64>().is_err();
    if !is_formula && !text.contains(['"', ',', ';']) && text.trim() == text {
        return text;
    }
    let mark = if is_formula { "'" } else { "" };
    Cow::Owned(format!("\"{mark}{}\"", text.replace('"', "\"\"")))
}

/// The original name of a field that [`csv_field`] wrote, without quotes.
pub fn csv_name(field: &str) -> &str {
    let unmarked = field.strip_prefix('\'');
    unmarked.filter(|text| is_spreadsheet_formula(text)).unwrap_or(field)
}

/// Whether a spreadsheet would read a text as a formula, or such a text is marked already.
fn is_spreadsheet_formula(text: &str) -> bool {
    text.trim_start_matches('\'').starts_with(['=', '+', '-', '@'])
}

/// JSON that a terminal can show: harmful characters in strings are written as `\u` and four digits, with the same
/// meaning.
pub fn json(text: &str) -> Cow<'_, str> {
    escape_characters(Cow::Borrowed(text), |c, out| {
        if c == '\n' || !super::is_harmful(c) {
            return out.push(c);
        }
        // Characters outside of the basic plane need two units.
        let mut units = [0; 2];
        for unit in c.encode_utf16(&mut units) {
            let _ = write!(out, "\\u{unit:04x}");
        }
    })
}

/// The text with each character written by `write`; not copied if nothing changes.
fn escape_characters(text: Cow<'_, str>, mut write: impl FnMut(char, &mut String)) -> Cow<'_, str> {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        write(c, &mut out);
    }
    if out == text { text } else { Cow::Owned(out) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_comment_cannot_be_left() {
        for hostile in [
            "*/ int evil;",
            "*\\/ int evil;",
            "*\\\n/",
            "*??/\n/",
            "/*/",
            "**//**/",
            "/\\*",
            "ends with \\",
            "\"\"\" import os",
            "\"\"\"\"\"\"",
            "a\rint evil;",
            "a\u{2028}int evil;",
            "<script>alert(1)</script>",
            "[a](javascript:b)",
        ] {
            let text = comment(hostile);
            for sign in ["*/", "/*", "??", "\\", "\"\"", "\n", "\r", "</", "]("] {
                assert!(!text.contains(sign), "{hostile:?} became {text:?}");
            }
        }
    }

    #[test]
    fn code_has_a_fence_that_it_does_not_hold() {
        assert_eq!(code_in_markdown("m1*d1"), "`m1*d1`");
        assert_eq!(code_in_markdown("a``b|c"), "```a``b\\|c```");
        assert_eq!(code_in_markdown("`"), "`` ` ``");
    }

    #[test]
    fn fields_stay_fields() {
        assert_eq!(csv_field("theta1"), "theta1");
        assert_eq!(csv_field("-1.5"), "-1.5");
        assert_eq!(csv_field("a,\"b\""), "\"a,\"\"b\"\"\"");
        assert_eq!(csv_field("=1+1"), "\"'=1+1\"");
        assert_eq!(csv_name("'tis"), "'tis");
    }

    #[test]
    fn json_keeps_its_meaning() {
        assert_eq!(
            json("{\n\"a\": \"\u{202e}\u{e0041}\u{9b}\"}"),
            "{\n\"a\": \"\\u202e\\udb40\\udc41\\u009b\"}"
        );
    }
}
