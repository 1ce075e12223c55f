//! What each kind of output takes for a sign of its own.

use std::borrow::Cow;
use std::fmt::Write;

use super::plain;

/// Text of an HTML page, in an element or in an attribute between double quotes; lines stay lines.
pub fn html(text: &str) -> Cow<'_, str> {
    escape_characters(super::lines(text), |c, out| match c {
        '&' => out.push_str("&amp;"),
        '<' => out.push_str("&lt;"),
        '>' => out.push_str("&gt;"),
        '"' => out.push_str("&quot;"),
        c => out.push(c),
    })
}

/// Text of a Markdown paragraph, heading or table cell: no links, images, formulas, tags or marks.
///
/// ```
/// use modelmill_boundary::text::markdown;
/// assert_eq!(markdown("[a](javascript:b)"), r"\[a\](javascript:b)");
/// ```
pub fn markdown(text: &str) -> Cow<'_, str> {
    escape_characters(plain(text), |c, out| {
        if matches!(
            c,
            '\\' | '`' | '*' | '_' | '|' | '<' | '$' | '[' | ']' | '&' | '~'
        ) {
            out.push('\\');
        }
        out.push(c);
    })
}

/// Text as code within a line of Markdown, with its fences; fit for a table's cell.
pub fn code_in_markdown(text: &str) -> String {
    let text = plain(text).replace('|', "\\|");
    let longest = text.split(|c| c != '`').map(str::len).max().unwrap_or(0);
    let fence = "`".repeat(longest + 1);
    // A grave accent at an end would be taken for the fence.
    let blank = if text.starts_with('`') || text.ends_with('`') {
        " "
    } else {
        ""
    };
    format!("{fence}{blank}{text}{blank}{fence}")
}

/// Text of a LaTeX document; characters that the plain fonts lack become question marks.
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

/// Text of a comment in C, Rust or Python, whichever sort: it neither ends the comment nor begins one in it, joins no
/// lines, ends no documentation string, and is neither tag nor link where `rustdoc` makes a page of it.
///
/// A backslash joins lines at their end and begins escapes in a Python string, and three signs stand for one in C
/// (`??/`); a backslash becomes a slash, and a blank goes between the others.
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
        // Three of them end a documentation string, whatever stands behind.
        out.push(if c == '"' && before == '"' { '\'' } else { c });
        before = c;
    })
}

/// A field of CSV text, in quotes where it needs them; a spreadsheet does not take it for a formula.
///
/// ```
/// use modelmill_boundary::text::{csv_field, csv_name};
/// assert_eq!(csv_field("=cmd()"), "\"'=cmd()\"");
/// assert_eq!(csv_name("'=cmd()"), "=cmd()");
/// ```
pub fn csv_field(text: &str) -> Cow<'_, str> {
    let text = plain(text);
    let is_formula = is_spreadsheet_formula(&text) && text.parse::<f64>().is_err();
    if !is_formula && !text.contains(['"', ',', ';']) && text.trim() == text {
        return text;
    }
    let mark = if is_formula { "'" } else { "" };
    Cow::Owned(format!("\"{mark}{}\"", text.replace('"', "\"\"")))
}

/// A name as [`csv_field`] was given it, of a field without its quotes.
pub fn csv_name(field: &str) -> &str {
    let unmarked = field.strip_prefix('\'');
    unmarked
        .filter(|text| is_spreadsheet_formula(text))
        .unwrap_or(field)
}

/// Whether a spreadsheet would take a text for a formula, or such a text is marked already.
fn is_spreadsheet_formula(text: &str) -> bool {
    text.trim_start_matches('\'')
        .starts_with(['=', '+', '-', '@'])
}

/// JSON as a terminal may show it: what does harm within its strings is written as `\u` and four digits, which means the
/// same.
pub fn json(text: &str) -> Cow<'_, str> {
    escape_characters(Cow::Borrowed(text), |c, out| {
        if c == '\n' || !super::is_harmful(c) {
            return out.push(c);
        }
        let mut units = [0; 2];
        for unit in c.encode_utf16(&mut units) {
            let _ = write!(out, "\\u{unit:04x}");
        }
    })
}

/// The text with each character written as `write` does; not copied where that changes nothing.
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
