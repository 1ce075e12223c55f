//! Marks in text for a terminal: bold, dim, colours.

/// Marks text for the terminal, or leaves it as it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TerminalStyle(bool);

impl TerminalStyle {
    /// With ANSI escape sequences for colours.
    pub const COLOURED: Self = Self(true);
    /// Without any mark.
    pub const PLAIN: Self = Self(false);

    fn paint(self, code: &str, text: &str) -> String {
        if self.0 {
            format!("\x1b[{code}m{text}\x1b[0m")
        } else {
            text.to_owned()
        }
    }

    /// What deserves attention.
    pub fn yellow(self, text: &str) -> String {
        self.paint("1;33", text)
    }

    /// What went wrong.
    pub fn bold_red(self, text: &str) -> String {
        self.paint("1;31", text)
    }

    /// Headings.
    pub fn bold(self, text: &str) -> String {
        self.paint("1", text)
    }

    /// What is there for reference.
    pub fn dim(self, text: &str) -> String {
        self.paint("2", text)
    }

    /// What got better or was added.
    pub fn green(self, text: &str) -> String {
        self.paint("32", text)
    }

    /// What got worse or was removed.
    pub fn red(self, text: &str) -> String {
        self.paint("31", text)
    }

    /// What draws the eye.
    pub fn cyan(self, text: &str) -> String {
        self.paint("36", text)
    }
}
