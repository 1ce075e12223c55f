//! Arguments of `equations`, `generate` and `atlas`: what is written out of a model.

use std::path::PathBuf;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use modelmill::generate::{CodeLanguage, LanguageForm};

/// How equations are printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum EquationsFormat {
    /// Plain text for the terminal
    Text,
    /// Markdown with TeX formulas
    Markdown,
    /// A LaTeX document
    Latex,
    /// One self-contained page with MathML
    Html,
    /// One JSON object
    Json,
}

/// `equations`.
#[derive(Debug, Args)]
pub(crate) struct EquationsArgs {
    /// Model file (TOML)
    pub(crate) model: PathBuf,
    /// Form of the equations
    #[arg(long, value_enum, default_value = "text")]
    pub(crate) format: EquationsFormat,
    /// The same as --format json
    #[arg(long, conflicts_with = "format")]
    pub(crate) json: bool,
    /// Print the balances of forces and of moments of this part (or frame), cut free, instead of the reduced model
    #[arg(long, value_name = "PART")]
    pub(crate) balances: Option<String>,
    /// Write to this file instead of standard output
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
}

/// `generate`.
#[derive(Debug, Args)]
pub(crate) struct GenerateArgs {
    /// Model file (TOML)
    pub(crate) model: PathBuf,
    /// Write the source to this file instead of standard output; with --language c99, c or python, files to this folder
    #[arg(long, value_name = "FILE|DIR", required_if_eq_any(languages_in_folders()))]
    pub(crate) out: Option<PathBuf>,
    /// With the equation of motion: mass matrix, velocity terms, gravity, forward dynamics
    #[arg(long)]
    pub(crate) dynamics: bool,
    /// With reactions: forces and moments in all joints, and the forces that close loops
    #[arg(long)]
    pub(crate) reactions: bool,
    /// With a function `self_test` that compares the model in base parameters with the model in all parameters, for
    /// your own tests
    #[arg(long)]
    pub(crate) self_test: bool,
    /// What to write: a Rust or Julia module, sources in plain C99, or a crate that builds a C library with its header
    /// or a Python module
    #[arg(long, value_parser = languages(), default_value = CodeLanguage::default().name())]
    pub(crate) language: CodeLanguage,
}

/// Parser of `--language`: names of the languages, with their descriptions for the help.
fn languages() -> impl TypedValueParser<Value = CodeLanguage> {
    let all = CodeLanguage::all();
    let values = all.map(|language| PossibleValue::new(language.name()).help(language.about()));
    let parser = PossibleValuesParser::new(values);
    parser.map(|name| CodeLanguage::from_name(&name).expect("the parser knows these names alone"))
}

/// Languages that write several files, as pairs of option and value. With these `--out` is required.
fn languages_in_folders() -> Vec<(&'static str, &'static str)> {
    let others = CodeLanguage::all().filter(|language| language.form() != LanguageForm::Module);
    others.map(|language| ("language", language.name())).collect()
}

/// `atlas`.
#[derive(Debug, Args)]
pub(crate) struct AtlasArgs {
    /// Model files, and robot descriptions (URDF, MJCF, SDF). A robot description gets a row and a picture, but no
    /// page
    #[arg(required = true)]
    pub(crate) models: Vec<PathBuf>,
    /// Write `atlas.md`, `atlas.html` and the folder `atlas` into this folder
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
}
