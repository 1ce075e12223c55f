//! Emission: a derivation goes in, source files in one output language come out.
//!
//! `tree` turns the lowered programs into statements, the same for all languages. `language` prints them, and `wrap`
//! adds interfaces for other languages to the printed Rust module.

mod fingerprint;
mod identifier;
mod language;
mod languages;
mod tree;
mod vectors;
mod wrap;

pub use language::rust::{EmittedModule, emit, emit_with_dynamics, module_name};
pub use language::{EmissionRequest, EmittedFile, OutputForm, OutputLanguage};
pub use languages::LANGUAGES;
pub use vectors::vectors_c;
