//! `generate`: writes a model as source code.

use std::fmt;

use modelmill_emit::{EmissionRequest, LANGUAGES, OutputForm};

use crate::error::{Error, Outcome};
use crate::model::Model;

pub use modelmill_emit::{EmittedFile, OutputForm as LanguageForm};

/// A target language of the generator: an entry of [`Self::all`], the first of which is the default.
#[derive(Clone, Copy)]
pub struct CodeLanguage(&'static dyn modelmill_emit::OutputLanguage);

impl CodeLanguage {
    /// All target languages.
    pub fn all() -> impl Iterator<Item = Self> {
        LANGUAGES.into_iter().map(Self)
    }

    /// The language with a name, such as `rust`, `c99`, `c`, `python` and `julia`; `None` if there is none.
    ///
    /// ```
    /// use modelmill::generate::CodeLanguage;
    ///
    /// assert_eq!(CodeLanguage::from_name("c99").map(CodeLanguage::name), Some("c99"));
    /// assert!(CodeLanguage::from_name("cobol").is_none());
    /// ```
    pub fn from_name(name: &str) -> Option<Self> {
        Self::all().find(|language| language.name() == name)
    }

    /// Its name, as [`Self::from_name`] reads it.
    pub fn name(self) -> &'static str {
        self.0.name()
    }

    /// A short description of what is generated in it.
    pub fn about(self) -> &'static str {
        self.0.description()
    }

    /// Form of its files: one module, several sources, or a crate.
    pub fn form(self) -> OutputForm {
        self.0.output_form()
    }

    /// Whether all optional functions can be generated in this language: joint reactions and a self-test.
    pub fn has_all(self) -> bool {
        self.0.has_reactions_and_self_test()
    }
}

impl Default for CodeLanguage {
    fn default() -> Self {
        Self(LANGUAGES[0])
    }
}

// A language is identified by its name, since the entries are trait objects.
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

/// Options of the generated code.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CodeOptions {
    /// Target language.
    pub language: CodeLanguage,
    /// Whether to include the equation of motion: mass matrix, velocity terms, gravity, forward dynamics.
    pub dynamics: bool,
    /// Whether to include reactions: forces and moments in all joints, and the forces that close loops.
    pub reactions: bool,
    /// Whether to include a function that compares forces from base parameters with forces from all parameters, for a
    /// test on the target.
    pub self_test: bool,
}

impl Model {
    /// The model as source files, in the form that the target language has ([`CodeLanguage::form`]): one module,
    /// several sources (such as header and source in C99), or a Rust crate. A crate contains a copy of the runtime
    /// library, so that its folder can be moved freely. Paths of the files are relative to the folder of the generated
    /// code.
    ///
    /// Fails when the language lacks a requested part, or the equations cannot be derived for the mechanism.
    ///
    /// ```
    /// use modelmill::Model;
    /// use modelmill::generate::{CodeLanguage, CodeOptions};
    ///
    /// let arm = Model::open("../model-spec/models/two_link.toml")?;
    /// let language = CodeLanguage::from_name("c99").unwrap();
    /// let files = arm.generate(&CodeOptions { language, ..CodeOptions::default() })?;
    /// assert!(files.iter().any(|file| file.path.ends_with(".h")));
    /// # Ok::<(), modelmill::Error>(())
    /// ```
    pub fn generate(&self, code: &CodeOptions) -> Outcome<Vec<EmittedFile>> {
        // Not all languages can express reactions and the self-test; the error names those that can.
        let more = [("reactions", code.reactions), ("a self-test", code.self_test)];
        if let Some((what, _)) = more.iter().find(|(_, is_requested)| *is_requested)
            && !code.language.has_all()
        {
            let able = CodeLanguage::all().filter(|language| language.has_all());
            let able: Vec<&str> = able.map(CodeLanguage::name).collect();
            return Err(Error::options(format!("only {} can have {what}", able.join(" and "))));
        }
        let what = format!("writing the code of {}", self.name);
        self.host().run_job(&what, 0, |_| self.emit_files(*code))?
    }

    /// Derives the requested programs and writes them in the target language.
    ///
    /// Fails when a derivation fails.
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
        // A crate must build anywhere, so that the runtime is copied into it.
        Ok(match code.language.form() {
            OutputForm::Crate { .. } => with_runtime(files),
            OutputForm::Module | OutputForm::Sources => files,
        })
    }
}

/// Adds a copy of the runtime to the files of a crate, in the folder `modelmill-runtime`.
fn with_runtime(mut files: Vec<EmittedFile>) -> Vec<EmittedFile> {
    let runtime = modelmill_runtime::source::FILES;
    files.extend(runtime.map(|(path, text)| EmittedFile {
        path: format!("modelmill-runtime/{path}"),
        text: text.to_owned(),
    }));
    files
}
