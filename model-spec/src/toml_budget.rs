//! Limits of TOML that hold before it is parsed: bytes, marks that begin or end something, and nested brackets. Two passes
//! over the text.
//!
//! The parser calls itself for each bracket that is open. It has a limit of its own, but brackets that close nothing, as in
//! `a = { [b]`, lower its count, so that some thousand unclosed lines overflowed the stack.
//!
//! The parser keeps some hundred bytes for each mark. A file of line ends or commas only would take a hundred times its
//! size in memory.

use modelmill_boundary::nesting::NestingLevel;
use toml_parser::Source;
use toml_parser::lexer::TokenKind;

use crate::document::LARGEST_FILE;

/// Most marks of a text: brackets, braces, quotes, and signs between keys, values and lines. Model files and rigs of
/// this project have at most 3400; this many take some 40 MB while they are parsed.
const MOST_MARKS: usize = 200_000;

/// Most brackets and braces that are open at one place: the limit of the parser itself. Model files have at most 8; this many
/// take less than 0.1 MB of the stack, of which threads have 2 MB.
const MOST_OPEN: usize = 80;

/// What a text has too much of: the first byte beyond the limit, the fault, and the limit in words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TomlExcess {
    /// The byte at which the limit is exceeded; 0 for the size of the file.
    pub at: usize,
    /// The fault in one line.
    pub fault: &'static str,
    /// The limit in words.
    pub limit: &'static str,
}

/// Checks the limits of a TOML text; none if it is within them.
pub fn find_toml_excess(text: &str) -> Option<TomlExcess> {
    if text.len() > LARGEST_FILE {
        return Some(TomlExcess {
            at: 0,
            fault: "this file is too large",
            limit: "a file has at most 4194304 bytes",
        });
    }
    let is_mark = |byte: u8| {
        matches!(
            byte,
            b'\n' | b',' | b'=' | b'.' | b'"' | b'\'' | b'[' | b']' | b'{' | b'}'
        )
    };
    let mut marks = text.bytes().enumerate().filter(|(_, byte)| is_mark(*byte));
    if let Some((at, _)) = marks.nth(MOST_MARKS) {
        return Some(TomlExcess {
            at,
            fault: "this file has too many lines, brackets and entries",
            limit: "a file has at most 200000 of them together",
        });
    }
    find_deep_bracket(text).map(|at| TomlExcess {
        at,
        fault: "brackets are nested too deeply, or many are not closed",
        limit: "they are at most 80 deep",
    })
}

/// The byte of the first bracket that is nested too deeply. A closing bracket of another kind than the last open one closes
/// nothing: the parser is never deeper than this count.
fn find_deep_bracket(text: &str) -> Option<usize> {
    let mut level = NestingLevel::top(MOST_OPEN);
    let mut open = Vec::new();
    for token in Source::new(text).lex() {
        match token.kind() {
            kind @ (TokenKind::LeftSquareBracket | TokenKind::LeftCurlyBracket) => {
                let Ok(inner) = level.enter() else {
                    return Some(token.span().start());
                };
                level = inner;
                open.push(kind);
            }
            TokenKind::RightSquareBracket => close(TokenKind::LeftSquareBracket, &mut open, &mut level),
            TokenKind::RightCurlyBracket => close(TokenKind::LeftCurlyBracket, &mut open, &mut level),
            _ => {}
        }
    }
    None
}

/// Closes the last open bracket if it is of this kind.
fn close(kind: TokenKind, open: &mut Vec<TokenKind>, level: &mut NestingLevel) {
    if open.last() == Some(&kind) {
        open.pop();
        *level = level.leave();
    }
}

#[cfg(test)]
mod tests {
    use toml::de::DeTable;

    use super::*;

    #[test]
    fn nested_and_unclosed_brackets_are_refused_before_they_use_up_the_stack() {
        let deep = |n: usize| format!("a = {}1{}\n", "[".repeat(n), "]".repeat(n));
        assert_eq!(find_toml_excess(&deep(MOST_OPEN)), None);
        let found = find_toml_excess(&deep(MOST_OPEN + 1)).unwrap();
        assert_eq!(
            (found.at, found.limit.contains(&MOST_OPEN.to_string())),
            (4 + MOST_OPEN, true)
        );
        // Closing brackets that close nothing lower the parser's own count.
        for line in [
            "a = { b = \"c\n[d]\n",
            "a = { [b] ",
            "[{]",
            "a = [{[b]\n",
            "a = { [b}]\n",
        ] {
            let found = find_toml_excess(&line.repeat(5000));
            assert!(found.is_some(), "{line:?}");
        }
        // Just below the limit the parser has room on the smallest stack of a thread.
        let text = "a = { [b] ".repeat(MOST_OPEN - 1);
        assert_eq!(find_toml_excess(&text), None);
        let parse = move || DeTable::parse_recoverable(&text).1.len();
        let thread = std::thread::Builder::new().stack_size(1 << 20).spawn(parse).unwrap();
        assert!(thread.join().unwrap() > 0);
        // Brackets in texts and comments are none.
        let text = "a = \"[\" # {\nb = '''\n{[\n'''\n".repeat(2 * MOST_OPEN);
        assert_eq!(find_toml_excess(&text), None);
    }

    #[test]
    fn sizes_in_words_are_those_that_are_checked() {
        assert_eq!(find_toml_excess(&"\n".repeat(MOST_MARKS)), None);
        let many = find_toml_excess(&"\n".repeat(MOST_MARKS + 1)).unwrap();
        assert_eq!(many.at, MOST_MARKS);
        assert!(many.limit.contains(&MOST_MARKS.to_string()));
        assert_eq!(find_toml_excess(&"a".repeat(LARGEST_FILE)), None);
        let large = find_toml_excess(&"a".repeat(LARGEST_FILE + 1)).unwrap();
        assert!(large.limit.contains(&LARGEST_FILE.to_string()));
    }
}
