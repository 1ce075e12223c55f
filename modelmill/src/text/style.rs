//! Styles of text in a terminal: bold, dim, colours.

/// Styles text for a terminal, or returns it unchanged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TerminalStyle(bool);

impl TerminalStyle {
    /// With ANSI escape sequences for colours.
    pub const COLOURED: Self = Self(true);
    /// Without styles.
    pub const PLAIN: Self = Self(false);

    /// Text between the escape sequence of a code and the reset, if styles are on.
    fn paint(self, code: &str, text: &str) -> String {
        if self.0 {
            format!("\x1b[{code}m{text}\x1b[0m")
        } else {
            text.to_owned()
        }
    }

    /// Warnings.
    pub fn yellow(self, text: &str) -> String {
        self.paint("1;33", text)
    }

    /// Errors.
    pub fn bold_red(self, text: &str) -> String {
        self.paint("1;31", text)
    }

    /// Headings.
    pub fn bold(self, text: &str) -> String {
        self.paint("1", text)
    }

    /// Details for reference.
    pub fn dim(self, text: &str) -> String {
        self.paint("2", text)
    }

    /// Improvements and added lines.
    pub fn green(self, text: &str) -> String {
        self.paint("32", text)
    }

    /// Deteriorations and removed lines.
    pub fn red(self, text: &str) -> String {
        self.paint("31", text)
    }

    /// Commands and positions.
    pub fn cyan(self, text: &str) -> String {
        self.paint("36", text)
    }
}
