//! `generate`: a model as code.

use modelmill_codegen::{C99, Language as _, RustModule, Source, emit_c, emit_python};

use crate::error::{Error, Outcome};
use crate::model::Model;

pub use modelmill_codegen::EmittedFile;

/// Languages that models are emitted for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Language {
    /// One module for `no_std` and `std`.
    #[default]
    Rust,
    /// A header and a source of plain C99, without a Rust toolchain.
    C99,
    /// A crate that builds a static and a shared library, and their header.
    C,
    /// A crate that builds a Python module for numpy arrays.
    Python,
}

/// What is emitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Code {
    /// For which language.
    pub language: Language,
    /// With the equation of motion: mass matrix, velocity terms, gravity, forward dynamics.
    pub dynamics: bool,
    /// With what the joints transmit: forces and moments in all joints, and the forces that close loops.
    pub reactions: bool,
    /// With a function that holds base parameters against all parameters, for a test of one's own.
    pub self_test: bool,
}

impl Model {
    /// The model as source files: one module in Rust, or a crate with a copy of the runtime, so that its folder can go
    /// anywhere. Paths are relative to that folder.
    ///
    /// Fails when a language lacks something that is asked for, or the mechanism has no such equations.
    pub fn generate(&self, code: &Code) -> Outcome<Vec<EmittedFile>> {
        let more = [
            ("reactions", code.reactions),
            ("a self-test", code.self_test),
        ];
        if let Some((what, _)) = more.iter().find(|(_, asked)| *asked)
            && !matches!(code.language, Language::Rust | Language::C99)
        {
            return Err(Error::options(format!(
                "only the Rust module and C99 can have {what}"
            )));
        }
        let what = format!("writing the code of {}", self.name);
        self.host().watched(&what, 0, |_| {
            let derivation = &self.derivation;
            let fault = |error| Error::derivation(&self.path, error);
            let dynamics = code.dynamics.then(|| derivation.dynamics()).transpose();
            let reactions = code.reactions.then(|| derivation.reactions()).transpose();
            let (dynamics, reactions) = (dynamics.map_err(fault)?, reactions.map_err(fault)?);
            let source = Source {
                derivation,
                dynamics: dynamics.as_ref(),
                reactions: reactions.as_ref(),
                self_test: code.self_test,
            };
            Ok(match code.language {
                Language::Rust => RustModule.write(&source),
                Language::C99 => C99.write(&source),
                Language::C => with_runtime(emit_c(&source)),
                Language::Python => with_runtime(emit_python(&source)),
            })
        })?
    }
}

/// A crate with a copy of the runtime.
fn with_runtime(mut files: Vec<EmittedFile>) -> Vec<EmittedFile> {
    let runtime = modelmill_runtime::source::FILES;
    files.extend(runtime.map(|(path, text)| EmittedFile {
        path: format!("modelmill-runtime/{path}"),
        text: text.to_owned(),
    }));
    files
}
