//! Languages that print the statement tree.
//!
//! A language is one entry of [`LANGUAGES`]: what it is called, and how it writes a model. Adding one touches its own file and
//! that list.

mod c99;
pub(in crate::emit) mod rust;
mod syntax;

use crate::{Derivation, Dynamics, Reactions};

/// A text file of what is emitted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EmittedFile {
    /// Its place in the folder, with `/` between folders.
    pub path: String,
    /// What it holds.
    pub text: String,
}

/// What is written of a model.
#[derive(Clone, Copy)]
pub struct Source<'a> {
    /// The model: regressor, inverse dynamics, drives, passive coordinates.
    pub derivation: &'a Derivation,
    /// Its equation of motion, if that is wanted.
    pub dynamics: Option<&'a Dynamics>,
    /// What its joints transmit, if that is wanted.
    pub reactions: Option<&'a Reactions>,
    /// Whether a test of the base parameters is wanted.
    pub self_test: bool,
}

/// A language in which models are written.
pub trait Language: Sync {
    /// What it is called.
    fn name(&self) -> &'static str;
    /// The files of a model.
    fn write(&self, source: &Source<'_>) -> Vec<EmittedFile>;
}

/// All languages.
pub const LANGUAGES: [&dyn Language; 2] = [&RustModule, &C99];

/// A module of Rust.
#[derive(Clone, Copy, Debug)]
pub struct RustModule;

impl Language for RustModule {
    fn name(&self) -> &'static str {
        "rust"
    }

    fn write(&self, source: &Source<'_>) -> Vec<EmittedFile> {
        let mut emitted = rust::emit(source.derivation);
        if let Some(dynamics) = source.dynamics {
            emitted = emitted.with_dynamics(source.derivation, dynamics);
        }
        if let Some(reactions) = source.reactions {
            emitted = emitted.with_reactions(source.derivation, reactions);
        }
        if source.self_test {
            emitted = emitted.with_self_test(source.derivation);
        }
        vec![EmittedFile {
            path: format!("{}.rs", rust::module_name(&emitted.name)),
            text: emitted.file(),
        }]
    }
}

/// Plain C99, one header and one source.
#[derive(Clone, Copy, Debug)]
pub struct C99;

impl Language for C99 {
    fn name(&self) -> &'static str {
        "c99"
    }

    fn write(&self, source: &Source<'_>) -> Vec<EmittedFile> {
        c99::write(source)
    }
}
