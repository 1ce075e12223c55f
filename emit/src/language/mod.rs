//! Languages that print the statement tree.
//!
//! A language is one entry of [`LANGUAGES`](super::LANGUAGES): what it is called, what its files are, and how it writes a
//! model. Adding one touches its own folder, this file and that list, which the library and the program read.

use modelmill_codegen::{Derivation, DynamicsPrograms, ReactionPrograms};

pub(crate) mod c99;
pub(crate) mod rust;
mod syntax;

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
pub struct EmissionRequest<'a> {
    /// The model: regressor, inverse dynamics, drives, passive coordinates.
    pub derivation: &'a Derivation,
    /// Its equation of motion, if that is wanted.
    pub dynamics: Option<&'a DynamicsPrograms>,
    /// What its joints transmit, if that is wanted.
    pub reactions: Option<&'a ReactionPrograms>,
    /// Whether a test of the base parameters is wanted.
    pub self_test: bool,
}

/// What the files of a language are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputForm {
    /// One file.
    Module,
    /// Source files for a folder.
    Sources,
    /// A crate, which needs the runtime in its folder `modelmill-runtime`.
    Crate {
        /// What it makes, and how it is built.
        makes: &'static str,
    },
}

/// A language in which models are written.
pub trait OutputLanguage: Sync {
    /// What it is called.
    fn name(&self) -> &'static str;
    /// What is made in it, in a few words.
    fn description(&self) -> &'static str;
    /// What its files are.
    fn output_form(&self) -> OutputForm;
    /// Whether it has reactions and a self-test, if a source asks for them.
    fn has_reactions_and_self_test(&self) -> bool {
        true
    }
    /// The files of a model.
    fn emit_files(&self, source: &EmissionRequest<'_>) -> Vec<EmittedFile>;
}

/// A module of Rust.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RustModule;

impl OutputLanguage for RustModule {
    fn name(&self) -> &'static str {
        "rust"
    }

    fn description(&self) -> &'static str {
        "A module for `no_std` and `std`"
    }

    fn output_form(&self) -> OutputForm {
        OutputForm::Module
    }

    fn emit_files(&self, source: &EmissionRequest<'_>) -> Vec<EmittedFile> {
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
pub(crate) struct C99Sources;

impl OutputLanguage for C99Sources {
    fn name(&self) -> &'static str {
        "c99"
    }

    fn description(&self) -> &'static str {
        "A header and a source of plain C99"
    }

    fn output_form(&self) -> OutputForm {
        OutputForm::Sources
    }

    fn emit_files(&self, source: &EmissionRequest<'_>) -> Vec<EmittedFile> {
        c99::emit_sources(source)
    }
}
