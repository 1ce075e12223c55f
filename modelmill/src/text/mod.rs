//! Formatting of text for users: tables, numbers, terminal styles, figures.

pub mod csv;
pub(crate) mod names;
pub mod style;
pub mod svg;
pub mod table;
pub mod wrap;

pub use style::TerminalStyle;
