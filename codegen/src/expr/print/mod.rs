//! Printers for people and for other programs.
