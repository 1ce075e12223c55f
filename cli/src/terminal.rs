//! Standard output and standard error: colours only on a terminal, warnings beside the result,
//! quiet when the reader goes away.

use std::io::{self, ErrorKind, IsTerminal, Write};

use crate::failure::{Failure, Outcome};

/// Whether the user allows colours at all: `NO_COLOR` (no-color.org) and dumb terminals forbid them.
fn colours_allowed() -> bool {
    let set = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty());
    set("NO_COLOR").is_none() && set("TERM").is_none_or(|term| term != "dumb")
}

/// Colours for what goes to standard output.
pub(crate) fn style() -> Style {
    Style(colours_allowed() && io::stdout().is_terminal())
}

/// Whether messages on standard error may be coloured.
pub(crate) fn errors_in_colour() -> bool {
    colours_allowed() && io::stderr().is_terminal()
}

/// Marks text for the terminal, or leaves it as it is.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Style(pub(crate) bool);

impl Style {
    fn paint(self, code: &str, text: &str) -> String {
        if self.0 {
            format!("\x1b[{code}m{text}\x1b[0m")
        } else {
            text.to_owned()
        }
    }

    /// Headings.
    pub(crate) fn bold(self, text: &str) -> String {
        self.paint("1", text)
    }

    /// What is there for reference.
    pub(crate) fn dim(self, text: &str) -> String {
        self.paint("2", text)
    }

    /// What got better or was added.
    pub(crate) fn green(self, text: &str) -> String {
        self.paint("32", text)
    }

    /// What got worse or was removed.
    pub(crate) fn red(self, text: &str) -> String {
        self.paint("31", text)
    }

    /// What draws the eye.
    pub(crate) fn cyan(self, text: &str) -> String {
        self.paint("36", text)
    }
}

/// Writes the result of a command to standard output, with one line feed at its end.
pub(crate) fn print(text: &str) -> Outcome {
    let mut out = io::stdout().lock();
    let end = if text.ends_with('\n') { "" } else { "\n" };
    out.write_all(text.as_bytes())
        .and_then(|()| out.write_all(end.as_bytes()))
        .and_then(|()| out.flush())
        .map_err(|error| match error.kind() {
            ErrorKind::BrokenPipe => Failure::BrokenPipe,
            _ => Failure::Input(format!("standard output cannot be written: {error}")),
        })
}

/// Prints one JSON object to standard output.
pub(crate) fn print_json(value: &serde_json::Value) -> Outcome {
    print(&format!("{value:#}"))
}

/// Writes to standard error; who does not read it is not bothered.
pub(crate) fn say(text: &str) {
    let _ = writeln!(io::stderr(), "{text}");
}

/// A warning on standard error.
pub(crate) fn warn(text: &str) {
    let style = Style(errors_in_colour());
    say(&format!("{} {text}", style.paint("1;33", "warning:")));
}

/// A remark on standard error.
pub(crate) fn note(text: &str) {
    let style = Style(errors_in_colour());
    say(&format!("{} {text}", style.paint("1", "note:")));
}

/// An error on standard error.
pub(crate) fn error(text: &str) {
    let style = Style(errors_in_colour());
    say(&format!("{} {text}", style.paint("1;31", "error:")));
}
