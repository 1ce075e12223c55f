//! Emission: a derivation goes in, source comes out, in one language or another: each is an entry of [`LANGUAGES`].
//!
//! `tree` makes statements of the lowered programs, once for all languages; `language` prints them; `wrap` puts faces for
//! other languages around the Rust that is printed.

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
