//! Pages of Markdown: marks that the program states, and text from files, which has no meaning as Markdown.

use std::fmt::Write;

use super::{code_in_markdown, markdown};

/// A text in Markdown that is written piece by piece. Only constants of the program enter it as they are; any other
/// text is escaped.
///
/// ```
/// use modelmill_boundary::text::MarkdownText;
/// let mut page = MarkdownText::default();
/// page.marks("# ").text("<b>").marks("\n").link("a", "](b).md");
/// assert_eq!(page.into_string(), "# \\<b>\n[a](%5D%28b%29.md)");
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MarkdownText(String);

impl MarkdownText {
    /// Adds Markdown of the program.
    pub fn marks(&mut self, marks: &'static str) -> &mut Self {
        self.0.push_str(marks);
        self
    }

    /// Adds any text.
    pub fn text(&mut self, text: &str) -> &mut Self {
        self.0.push_str(&markdown(text));
        self
    }

    /// Adds any text as code.
    pub fn code(&mut self, text: &str) -> &mut Self {
        self.0.push_str(&code_in_markdown(text));
        self
    }

    /// Adds a link to a file, by a path relative to the page.
    pub fn link(&mut self, text: &str, path: &str) -> &mut Self {
        self.marks("[").text(text).marks("](").path(path).marks(")")
    }

    /// Adds a link whose text is code.
    pub fn code_link(&mut self, text: &str, path: &str) -> &mut Self {
        self.marks("[").code(text).marks("](").path(path).marks(")")
    }

    /// Adds a picture of a file, by a path relative to the page.
    pub fn picture(&mut self, text: &str, path: &str) -> &mut Self {
        self.marks("!").link(text, path)
    }

    /// The page.
    pub fn into_string(self) -> String {
        self.0
    }

    /// Adds a path as a relative address: it has no scheme, such as `javascript:`, and no host, and ends where the path
    /// ends.
    fn path(&mut self, path: &str) -> &mut Self {
        for (k, byte) in path.bytes().enumerate() {
            if byte.is_ascii_alphanumeric() || b"-._".contains(&byte) || (byte == b'/' && k > 0) {
                self.0.push(char::from(byte));
            } else {
                let _ = write!(self.0, "%{byte:02X}");
            }
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_of_files_stay_texts() {
        let mut page = MarkdownText::default();
        let hostile = "</h1><script>[x](javascript:alert(1))\n\n# | ![y](z) `id` \u{202e}\u{1b}[31m";
        page.text(hostile).marks("\n");
        page.code(hostile).marks("\n");
        page.link("x", "javascript:alert(1)").picture("y", "//host/a b\"");
        let page = page.into_string();
        assert_eq!(page.lines().count(), 3, "{page}");
        let first = page.lines().next().unwrap();
        for (at, c) in first.char_indices() {
            if matches!(c, '<' | '[' | ']' | '|' | '`') {
                assert!(first[..at].ends_with('\\'), "{first}");
            }
        }
        assert!(!page.contains(['\u{202e}', '\u{1b}']), "{page}");
        assert!(
            page.ends_with("[x](javascript%3Aalert%281%29)![y](%2F/host/a%20b%22)"),
            "{page}"
        );
    }
}
