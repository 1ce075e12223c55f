//! Standard output and standard error. Results go to standard output, warnings and notes to standard error.
//! Colours are used on a terminal only. A closed output is not an error.

pub(crate) mod plot;
pub(crate) mod progress;
pub(crate) mod time_limit;

use std::borrow::Cow;
use std::io::{self, ErrorKind, IsTerminal, Write};
use std::sync::LazyLock;

use modelmill::text::TerminalStyle;
use modelmill::{NoteSeverity, RecordingNote};
use modelmill_boundary::text::{self, plain};

use crate::failure::{CommandFailure, CommandOutcome};
use crate::flags::FlagWording;

/// Whether the user allows colours at all: `NO_COLOR` (no-color.org) and dumb terminals forbid them.
fn is_colour_allowed() -> bool {
    let set = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty());
    set("NO_COLOR").is_none() && set("TERM").is_none_or(|term| term != "dumb")
}

/// Colours for what goes to standard output.
pub(crate) fn style() -> TerminalStyle {
    style_for(is_colour_allowed() && io::stdout().is_terminal())
}

/// The style with or without colours.
fn style_for(in_colour: bool) -> TerminalStyle {
    if in_colour {
        TerminalStyle::COLOURED
    } else {
        TerminalStyle::PLAIN
    }
}

/// Whether messages on standard error may be coloured.
pub(crate) fn is_stderr_coloured() -> bool {
    is_colour_allowed() && io::stderr().is_terminal()
}

/// Writes the result of a command to standard output, with one line feed at its end.
pub(crate) fn print(text: &str) -> CommandOutcome {
    // Names from files may contain control characters; these must not reach the terminal.
    let text = join_lines_of_arguments(text);
    let text = text::terminal(&text, is_colour_allowed() && io::stdout().is_terminal());
    let mut out = io::stdout().lock();
    let end = if text.ends_with('\n') { "" } else { "\n" };
    out.write_all(text.as_bytes())
        .and_then(|()| out.write_all(end.as_bytes()))
        .and_then(|()| out.flush())
        .map_err(|error| match error.kind() {
            ErrorKind::BrokenPipe => CommandFailure::BrokenPipe,
            _ => CommandFailure::Input(format!("standard output cannot be written: {error}")),
        })
}

/// Prints one JSON object to standard output.
pub(crate) fn print_json(value: &serde_json::Value) -> CommandOutcome {
    print(&text::json(&format!("{value:#}")))
}

/// The text with the arguments of the command line on one line each. The name of a file may contain line ends, and the
/// rest of it would look like a message of this program.
fn join_lines_of_arguments(text: &str) -> Cow<'_, str> {
    static WITH_LINE_ENDS: LazyLock<Vec<String>> = LazyLock::new(|| {
        let arguments = std::env::args_os().map(|argument| argument.to_string_lossy().into_owned());
        arguments.filter(|argument| argument.contains(['\n', '\r'])).collect()
    });
    join_lines_of(text, &WITH_LINE_ENDS)
}

/// The text with each of these names on one line, wherever it occurs.
fn join_lines_of<'a>(text: &'a str, names: &[String]) -> Cow<'a, str> {
    let mut text = Cow::Borrowed(text);
    for name in names {
        if text.contains(name.as_str()) {
            text = Cow::Owned(text.replace(name.as_str(), &plain(name)));
        }
    }
    text
}

/// Writes to standard error; a closed standard error is ignored.
pub(crate) fn print_to_stderr(text: &str) {
    let text = join_lines_of_arguments(text);
    let text = text::terminal(&text, is_stderr_coloured());
    let _ = writeln!(io::stderr(), "{text}");
}

/// A warning on standard error.
pub(crate) fn warn(text: &str) {
    let style = style_for(is_stderr_coloured());
    print_to_stderr(&format!("{} {text}", style.yellow("warning:")));
}

/// A remark on standard error.
pub(crate) fn note(text: &str) {
    let style = style_for(is_stderr_coloured());
    print_to_stderr(&format!("{} {text}", style.bold("note:")));
}

/// A remark of the library on standard error.
pub(crate) fn remark(note: &RecordingNote) {
    let says = note.says.format_for(&FlagWording);
    match note.severity {
        NoteSeverity::Warning => warn(&says),
        NoteSeverity::Info => self::note(&says),
    }
}

/// An error on standard error.
pub(crate) fn error(text: &str) {
    let style = style_for(is_stderr_coloured());
    print_to_stderr(&format!("{} {text}", style.bold_red("error:")));
}
