//! Languages that print the statement tree.
//!
//! A language is one entry of [`LANGUAGES`](super::LANGUAGES): its name, the form of its files, and how it writes a
//! model. A new one touches its own folder, this file and that list, which library and program read.

use modelmill_codegen::{Derivation, DynamicsPrograms, ReactionPrograms};

pub(crate) mod c99;
pub(crate) mod julia;
pub(crate) mod rust;
mod syntax;

/// A text file of the output.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EmittedFile {
    /// Path in the output folder, with `/` between folders.
    pub path: String,
    /// Its content.
    pub text: String,
}

/// What to write of a model.
#[derive(Clone, Copy)]
pub struct EmissionRequest<'a> {
    /// The model: regressor, inverse dynamics, drives, passive coordinates.
    pub derivation: &'a Derivation,
    /// Its equation of motion, if requested.
    pub dynamics: Option<&'a DynamicsPrograms>,
    /// The reactions in its joints, if requested.
    pub reactions: Option<&'a ReactionPrograms>,
    /// Whether to add a test of the base parameters.
    pub self_test: bool,
}

/// The form of a language's output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputForm {
    /// One file.
    Module,
    /// Source files for a folder.
    Sources,
    /// A crate, which needs the runtime in its folder `modelmill-runtime`.
    Crate {
        /// What building it gives, and the command.
        makes: &'static str,
    },
}

/// An output language.
pub trait OutputLanguage: Sync {
    /// Its name in options.
    fn name(&self) -> &'static str;
    /// Its output in a few words, for lists.
    fn description(&self) -> &'static str;
    /// The form of its output.
    fn output_form(&self) -> OutputForm;
    /// Whether it can write reactions and a self-test, if a request has them.
    fn has_reactions_and_self_test(&self) -> bool {
        true
    }
    /// The files of a model.
    fn emit_files(&self, source: &EmissionRequest<'_>) -> Vec<EmittedFile>;
}

/// A Rust module.
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
        // Optional structs are appended in a fixed order.
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

/// A Julia module.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JuliaFile;

impl OutputLanguage for JuliaFile {
    fn name(&self) -> &'static str {
        "julia"
    }

    fn description(&self) -> &'static str {
        "A module for Julia"
    }

    fn output_form(&self) -> OutputForm {
        OutputForm::Module
    }

    fn has_reactions_and_self_test(&self) -> bool {
        false
    }

    fn emit_files(&self, source: &EmissionRequest<'_>) -> Vec<EmittedFile> {
        julia::emit_module(source)
    }
}
