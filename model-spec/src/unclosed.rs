//! Finds brackets that are opened in a value and never closed. A text of TOML goes in, the bracket comes out.
//!
//! The parser takes the rest of the file for the content of such a bracket and reports every line of it. A line that
//! consists of the header of a table only, `[name]` or `[[name]]`, cannot be part of a value, because values are not
//! bare words.

/// An opening bracket without its closing one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct UnclosedBracket {
    /// `{` or `[`.
    pub(crate) bracket: char,
    /// Its position in bytes.
    pub(crate) at: usize,
    /// Position of the outermost bracket that is open there, in bytes; it may be the same one.
    pub(crate) outermost: usize,
    /// Header of the table before which it should have been closed, as first byte and length; `None` at the end of
    /// the file.
    pub(crate) next: Option<(usize, usize)>,
}

/// The innermost bracket that is open at the header of the next table, or at the end of the file.
///
/// `None` if all brackets are closed, or if the text has another error first.
pub(crate) fn first_unclosed_bracket(text: &str) -> Option<UnclosedBracket> {
    // Positions of the brackets that are open, the innermost last.
    let mut open: Vec<(char, usize)> = Vec::new();
    let mut at = 0;
    // True while only blanks precede on the line.
    let mut starts_line = true;
    while at < text.len() {
        let rest = &text[at..];
        if starts_line && let Some(length) = head_of_table(rest) {
            if let Some((bracket, place)) = open.last() {
                return Some(UnclosedBracket {
                    bracket: *bracket,
                    at: *place,
                    outermost: open[0].1,
                    next: Some((at, length)),
                });
            }
            at += length;
            continue;
        }
        let first = rest.chars().next()?;
        starts_line = first == '\n' || (starts_line && first.is_whitespace());
        at += match first {
            // Comments and strings are skipped; brackets in them do not count.
            '#' => rest.find('\n').unwrap_or(rest.len()),
            '"' | '\'' => string_length(rest, first)?,
            '{' | '[' => {
                open.push((first, at));
                1
            }
            '}' | ']' => {
                // A closing bracket of the wrong kind is an error of its own.
                let (bracket, _) = open.pop()?;
                if (bracket == '{') != (first == '}') {
                    return None;
                }
                1
            }
            other => other.len_utf8(),
        };
    }
    open.last().map(|(bracket, at)| UnclosedBracket {
        bracket: *bracket,
        at: *at,
        outermost: open[0].1,
        next: None,
    })
}

/// The length of `[name]` or `[[name]]`, if the line contains nothing else except a comment.
fn head_of_table(rest: &str) -> Option<usize> {
    if !rest.starts_with('[') {
        return None;
    }
    let line = rest.lines().next()?;
    let line = line.split('#').next()?.trim_end();
    let name = line
        .strip_prefix("[[")
        .and_then(|inner| inner.strip_suffix("]]"))
        .or_else(|| line.strip_prefix('[')?.strip_suffix(']'))?
        .trim();
    let is_name = name.starts_with(|first: char| first.is_ascii_alphabetic() || first == '_')
        && name.chars().all(|c| c.is_ascii_alphanumeric() || "_-.".contains(c));
    // `[true]` on a line of its own can be an element of an array.
    let is_value = ["true", "false", "inf", "nan"].contains(&name);
    (is_name && !is_value).then_some(line.len())
}

/// The length of a string with its quotes; `None` if it is not closed, which is an error of its own.
fn string_length(rest: &str, quote: char) -> Option<usize> {
    let long: String = std::iter::repeat_n(quote, 3).collect();
    let (fence, several_lines) = if rest.starts_with(&long) {
        (long.as_str(), true)
    } else {
        (&long[..1], false)
    };
    // A backslash in a basic string escapes the next character; literal strings have no escapes.
    let mut at = fence.len();
    while at < rest.len() {
        let inner = &rest[at..];
        if inner.starts_with(fence) {
            return Some(at + fence.len());
        }
        let first = inner.chars().next()?;
        if first == '\n' && !several_lines {
            return None;
        }
        let escaped = if first == '\\' && quote == '"' {
            inner[1..].chars().next().map_or(0, char::len_utf8)
        } else {
            0
        };
        at += first.len_utf8() + escaped;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(text: &str, expected: Option<&str>) {
        let found = first_unclosed_bracket(text);
        assert_eq!(found.map(|open| &text[open.at..]), expected, "{text}");
    }

    #[test]
    fn brackets_without_partners_are_found() {
        check("a = { b = 1\n[c]\n", Some("{ b = 1\n[c]\n"));
        check("a = [1, 2\n\n[[c]] # x\nd = [1]", Some("[1, 2\n\n[[c]] # x\nd = [1]"));
        check("a = [{ b = [1, }]\n", None);
        check("a = [\n  [1],\n  [true]\n]\n[b]\nc = { d = \"}{\\\"{\" }", None);
        check("a = \'{\' # {\nb = \"\"\"{\n[c]\n\"\"\"", None);
        check("a = 1\nb = [", Some("["));
        check("a = \"x\nb = { [", None);
        check("é = { ü = \"ö\"", Some("{ ü = \"ö\""));
    }
}
