//! Everything that crosses the edge of modelmill, and nothing else: files that are read with a cap and written whole
//! ([`files`]), free text of users on its way to a terminal, a page or source code, and messages with advice that each front end
//! spells in its own words ([`text`]).
//!
//! All other crates stand on this one; it knows no models and depends on nothing.

pub mod files;
pub mod text;
