//! Limits of TOML that hold before it is parsed: bytes, and marks that begin or end something. One pass over the text.
//!
//! The parser keeps some hundred bytes for each mark. A file of line ends or commas only would take a hundred times its
//! size in memory.

use crate::document::LARGEST_FILE;

/// Most marks of a text: brackets, braces, quotes, and signs between keys, values and lines. Model files and rigs of
/// this project have at most 3400; this many take some 40 MB while they are parsed.
const MOST_MARKS: usize = 200_000;

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
    marks.nth(MOST_MARKS).map(|(at, _)| TomlExcess {
        at,
        fault: "this file has too many lines, brackets and entries",
        limit: "a file has at most 200000 of them together",
    })
}

#[cfg(test)]
mod tests {
    use super::*;

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
