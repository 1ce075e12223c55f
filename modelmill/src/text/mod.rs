//! Text for people: tables, numbers, marks for a terminal.

pub mod style;
pub mod table;

pub use style::Style;
