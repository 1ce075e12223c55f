//! Everything that crosses the boundary of modelmill: files that are read with a limit and written atomically
//! ([`files`]), the depth of nested structures in them ([`nesting`]), free text of users on its way to a terminal, a
//! page or source code, and messages with advice that each front end writes in its own words ([`text`]).
//!
//! All other crates depend on this one; it knows no models and has no dependencies.

pub mod files;
pub mod nesting;
pub mod text;
