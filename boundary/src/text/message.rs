//! Messages: plain text with typed remedies in it, which each front end writes in its own words.
//!
//! The library states a remedy as a value (an option, a command, an entry of the model file), so that no program must
//! find it in a finished sentence. A front end changes remedies only. Names of files and columns and texts of users
//! are plain text, whatever they contain.
//!
//! A message and a remedy have no `Display`. Code that formats one into a text must choose a wording, or make a
//! message of the complete text by [`message!`](crate::message), which keeps remedies.

use std::cell::RefCell;
use std::fmt::{self, Write as _};

use super::remedy::{Remedy, RemedyWording, RustWording};
use crate::files::FileError;

/// A text for users with typed remedies in it.
///
/// ```
/// use modelmill_boundary::message;
/// use modelmill_boundary::text::{RustWording, OptionName, Remedy};
/// let file = "run.csv";
/// let map = Remedy::option(OptionName::Columns).with_value("q=angle [deg]");
/// let text = message!("{file}: check the unit: {}", map);
/// assert_eq!(text.format_for(&RustWording), "run.csv: check the unit: option `columns` = `q=angle [deg]`");
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Message {
    /// Pieces in order; two texts never follow each other.
    pieces: Vec<MessagePiece>,
}

/// A piece of a message.
#[derive(Clone, Debug, PartialEq, Eq)]
enum MessagePiece {
    /// Text that stays unchanged.
    Text(String),
    /// A remedy, which each front end words for itself.
    Remedy(Remedy),
}

impl Message {
    /// A message without any text.
    pub fn new() -> Self {
        Self::default()
    }

    /// Whether it has neither text nor remedies.
    pub fn is_empty(&self) -> bool {
        self.pieces.is_empty()
    }

    /// Appends plain text.
    pub fn push_text(&mut self, text: &str) {
        match self.pieces.last_mut() {
            _ if text.is_empty() => {}
            Some(MessagePiece::Text(last)) => last.push_str(text),
            _ => self.pieces.push(MessagePiece::Text(text.to_owned())),
        }
    }

    /// Appends a remedy.
    pub fn push_remedy(&mut self, remedy: Remedy) {
        self.pieces.push(MessagePiece::Remedy(remedy));
    }

    /// Appends a text, a remedy or another message.
    pub fn push(&mut self, other: impl Into<Self>) {
        for piece in other.into().pieces {
            match piece {
                MessagePiece::Text(text) => self.push_text(&text),
                MessagePiece::Remedy(remedy) => self.push_remedy(remedy),
            }
        }
    }

    /// Joins messages, with a text between each two of them.
    pub fn join(messages: impl IntoIterator<Item = Self>, between: &str) -> Self {
        let mut all = Self::new();
        for (k, message) in messages.into_iter().enumerate() {
            if k > 0 {
                all.push_text(between);
            }
            all.push(message);
        }
        all
    }

    /// The text with remedies written for the reader's front end.
    pub fn format_for(&self, wording: &dyn RemedyWording) -> String {
        let mut text = String::new();
        for piece in &self.pieces {
            match piece {
                MessagePiece::Text(words) => text.push_str(words),
                MessagePiece::Remedy(remedy) => text.push_str(&remedy.format_for(wording)),
            }
        }
        text
    }

    /// The text with remedies written for the library.
    pub fn in_library_words(&self) -> String {
        self.format_for(&RustWording)
    }
}

impl From<String> for Message {
    fn from(text: String) -> Self {
        let mut message = Self::new();
        message.push_text(&text);
        message
    }
}

impl From<&str> for Message {
    fn from(text: &str) -> Self {
        text.to_owned().into()
    }
}

impl From<&String> for Message {
    fn from(text: &String) -> Self {
        text.clone().into()
    }
}

impl From<FileError> for Message {
    fn from(error: FileError) -> Self {
        error.to_string().into()
    }
}

impl From<Remedy> for Message {
    fn from(remedy: Remedy) -> Self {
        Self {
            pieces: vec![MessagePiece::Remedy(remedy)],
        }
    }
}

/// Makes a [`Message`](crate::text::Message) as `format!` makes a text. Arguments behind the text may be messages and
/// remedies, which are kept as such. All others, and names in braces, become plain text.
#[macro_export]
macro_rules! message {
    ($format:literal $(, $argument:expr)* $(,)?) => {{
        let sink = $crate::text::MessageSink::default();
        sink.write(format_args!($format $(, $crate::text::MessageSlot::new(&sink, &$argument))*));
        sink.into_message()
    }};
}

/// Collects a message while its text is formatted, for [`message!`](crate::message).
#[doc(hidden)]
#[derive(Debug, Default)]
pub struct MessageSink {
    /// A cell, because formatting has only shared access.
    message: RefCell<Message>,
}

impl MessageSink {
    /// Formats a text; arguments that are messages or remedies append themselves.
    ///
    /// # Panics
    ///
    /// When the formatting of a value fails, as with `format!`.
    pub fn write(&self, arguments: fmt::Arguments<'_>) {
        let written = TextEnd(self).write_fmt(arguments);
        written.expect("a value that is formatted returns no error");
    }

    /// The collected message.
    pub fn into_message(self) -> Message {
        self.message.into_inner()
    }
}

/// Appends formatted plain text to a sink.
struct TextEnd<'a>(&'a MessageSink);

impl fmt::Write for TextEnd<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0.message.borrow_mut().push_text(text);
        Ok(())
    }
}

/// An argument of [`message!`](crate::message) at its position in the text.
#[doc(hidden)]
pub struct MessageSlot<'a, T: ?Sized> {
    /// The sink of the message.
    sink: &'a MessageSink,
    /// The argument.
    argument: &'a T,
}

impl<'a, T: ?Sized> MessageSlot<'a, T> {
    /// An argument for a message that is collected in a sink.
    pub fn new(sink: &'a MessageSink, argument: &'a T) -> Self {
        Self { sink, argument }
    }
}

impl<T: MessageArgument + ?Sized> fmt::Display for MessageSlot<'_, T> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.argument.write(self.sink, formatter)
    }
}

impl<T: fmt::Debug + ?Sized> fmt::Debug for MessageSlot<'_, T> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.argument.fmt(formatter)
    }
}

/// Types of arguments of [`message!`](crate::message).
#[doc(hidden)]
pub trait MessageArgument {
    /// Appends the argument to the sink; plain text goes through the formatter.
    fn write(&self, sink: &MessageSink, formatter: &mut fmt::Formatter<'_>) -> fmt::Result;
}

// Anything with `Display` is plain text; `Message` and `Remedy` have no `Display`.
impl<T: fmt::Display + ?Sized> MessageArgument for T {
    fn write(&self, _: &MessageSink, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.fmt(formatter)
    }
}

impl MessageArgument for Message {
    fn write(&self, sink: &MessageSink, _: &mut fmt::Formatter<'_>) -> fmt::Result {
        sink.message.borrow_mut().push(self.clone());
        Ok(())
    }
}

impl MessageArgument for &Message {
    fn write(&self, sink: &MessageSink, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        (**self).write(sink, formatter)
    }
}

impl MessageArgument for Remedy {
    fn write(&self, sink: &MessageSink, _: &mut fmt::Formatter<'_>) -> fmt::Result {
        sink.message.borrow_mut().push_remedy(self.clone());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::remedy::{CommandName, OptionName, OptionSetting};
    use super::*;

    struct UpperCase;

    impl RemedyWording for UpperCase {
        fn format_options(&self, settings: &[OptionSetting]) -> String {
            let one = |setting: &OptionSetting| {
                let value = setting.value.as_deref().map(|value| format!("({value})"));
                setting.name.name().to_uppercase() + &value.unwrap_or_default()
            };
            settings.iter().map(one).collect::<Vec<_>>().join("+")
        }

        fn format_command(&self, command: CommandName) -> String {
            format!("<{}>", command.name())
        }
    }

    #[test]
    fn remedies_are_worded_and_the_rest_stays() {
        let file = "verb `identify`, option `columns`.toml";
        let between = Remedy::option(OptionName::Between).with_value("1,2");
        let identify = Remedy::command(CommandName::Identify);
        let message = message!(
            "{file}: give {} with {}, {:.2} of {:?}",
            identify,
            between,
            0.125,
            "option `prior`"
        );
        let expected = format!("{file}: give <identify> with BETWEEN(1,2), 0.12 of \"option `prior`\"");
        assert_eq!(message.format_for(&UpperCase), expected);
        assert_eq!(
            message.in_library_words(),
            format!("{file}: give verb `identify` with option `between` = `1,2`, 0.12 of \"option `prior`\"")
        );
    }

    #[test]
    fn messages_keep_their_remedies_inside_of_others() {
        let prior = Message::from(Remedy::option(OptionName::Prior));
        let both = Message::join([prior.clone(), "nothing".into()], " or ");
        let mut says = message!("{{}} {}: {}", &prior, both);
        says.push(".");
        assert_eq!(says.format_for(&UpperCase), "{} PRIOR: PRIOR or nothing.");
        assert!(!says.is_empty() && message!("").is_empty());
        // Pieces of text side by side are one, so that equal messages are equal.
        assert_eq!(message!("{}b", "a"), Message::from("ab"));
    }

    #[test]
    fn options_side_by_side_are_one_remedy() {
        let maps = ["q=a", "w=b"].map(|map| OptionSetting::new(OptionName::Columns, map));
        let message = message!("say {}", Remedy::options(maps));
        assert_eq!(message.format_for(&UpperCase), "say COLUMNS(q=a)+COLUMNS(w=b)");
        assert_eq!(
            message.in_library_words(),
            "say option `columns` = `q=a` option `columns` = `w=b`"
        );
    }
}
