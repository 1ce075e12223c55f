//! Text for people: tables, numbers, marks for a terminal, pictures.

pub mod csv;
pub mod style;
pub mod svg;
pub mod table;

pub use style::TerminalStyle;
