//! `generate`: a model as code.

use std::fmt;

use modelmill_emit::{EmissionRequest, LANGUAGES, OutputForm};

use crate::error::{Error, Outcome};
use crate::model::Model;

pub use modelmill_emit::{EmittedFile, OutputForm as LanguageForm};

/// A language that models are emitted for: an entry of [`Self::all`], the first of which is the default.
#[derive(Clone, Copy)]
pub struct CodeLanguage(&'static dyn modelmill_emit::OutputLanguage);

impl CodeLanguage {
    /// All languages.
    pub fn all() -> impl Iterator<Item = Self> {
        LANGUAGES.into_iter().map(Self)
    }

    /// The language of a name, such as `rust`, `c99`, `c` and `python`.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::all().find(|language| language.name() == name)
    }

    /// What it is called.
    pub fn name(self) -> &'static str {
        self.0.name()
    }

    /// What is made in it, in a few words.
    pub fn about(self) -> &'static str {
        self.0.description()
    }

    /// What its files are.
    pub fn form(self) -> OutputForm {
        self.0.output_form()
    }

    /// Whether it can have reactions and a self-test.
    pub fn has_all(self) -> bool {
        self.0.has_reactions_and_self_test()
    }
}

impl Default for CodeLanguage {
    fn default() -> Self {
        Self(LANGUAGES[0])
    }
}

impl PartialEq for CodeLanguage {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl Eq for CodeLanguage {}

impl fmt::Debug for CodeLanguage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// What is emitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CodeOptions {
    /// For which language.
    pub language: CodeLanguage,
    /// With the equation of motion: mass matrix, velocity terms, gravity, forward dynamics.
    pub dynamics: bool,
    /// With what the joints transmit: forces and moments in all joints, and the forces that close loops.
    pub reactions: bool,
    /// With a function that holds base parameters against all parameters, for a test of one's own.
    pub self_test: bool,
}

impl Model {
    /// The model as source files: one module in Rust, a header and a source in C99, or a crate with a copy of the runtime, so that its folder can go
    /// anywhere. Paths are relative to that folder.
    ///
    /// Fails when a language lacks something that is asked for, or the mechanism has no such equations.
    pub fn generate(&self, code: &CodeOptions) -> Outcome<Vec<EmittedFile>> {
        let more = [
            ("reactions", code.reactions),
            ("a self-test", code.self_test),
        ];
        if let Some((what, _)) = more.iter().find(|(_, asked)| *asked)
            && !code.language.has_all()
        {
            let able = CodeLanguage::all().filter(|language| language.has_all());
            let able: Vec<&str> = able.map(CodeLanguage::name).collect();
            return Err(Error::options(format!(
                "only {} can have {what}",
                able.join(" and ")
            )));
        }
        let what = format!("writing the code of {}", self.name);
        self.host().run_job(&what, 0, |_| self.emit_files(*code))?
    }

    fn emit_files(&self, code: CodeOptions) -> Outcome<Vec<EmittedFile>> {
        let derivation = &self.derivation;
        let fault = |error| Error::derivation(&self.path, error);
        let dynamics = code.dynamics.then(|| derivation.dynamics()).transpose();
        let reactions = code.reactions.then(|| derivation.reactions()).transpose();
        let (dynamics, reactions) = (dynamics.map_err(fault)?, reactions.map_err(fault)?);
        let files = code.language.0.emit_files(&EmissionRequest {
            derivation,
            dynamics: dynamics.as_ref(),
            reactions: reactions.as_ref(),
            self_test: code.self_test,
        });
        Ok(match code.language.form() {
            OutputForm::Crate { .. } => with_runtime(files),
            OutputForm::Module | OutputForm::Sources => files,
        })
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
