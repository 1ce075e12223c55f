//! Faults of a fit file, each with a remedy.

use std::fmt;

use modelmill_boundary::message;
use modelmill_boundary::text::{CommandName, Message, OptionName, Remedy};

use crate::words::backquoted_list;

/// Why a fit file cannot be used.
#[derive(Debug, Clone, PartialEq)]
pub struct FitFileError {
    /// The file as the user named it.
    pub file: String,
    /// What is wrong.
    pub fault: FitFault,
}

/// The kinds of faults of a fit file.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum FitFault {
    /// The file cannot be opened or read.
    Unreadable {
        /// Message of the operating system.
        reason: String,
    },
    /// The fit is from signals that determine only ratios of parameters.
    OnlyRatios,
    /// The text is not the JSON of `identify`.
    NotAFit {
        /// Line of the fault.
        line: usize,
        /// Column of the fault.
        column: usize,
        /// What is wrong there.
        reason: String,
    },
    /// The text is not JSON: possibly a recording or a model file.
    NoJson,
    /// A parameter of the model is not in the file.
    MissingParameter {
        /// Name of the parameter.
        name: String,
        /// The closest name in the file.
        nearest: Option<String>,
        /// The names in the file.
        present: Vec<String>,
    },
    /// The file has parameters that the model does not have.
    UnknownParameters {
        /// Names of these parameters.
        names: Vec<String>,
    },
    /// The file has a parameter twice.
    DuplicateParameter {
        /// Name of the parameter.
        name: String,
    },
    /// A constant in an expression of the base parameters has another value.
    ConstantDiffers {
        /// Name of the constant.
        name: String,
        /// Its value in the file.
        file: f64,
        /// Its value in the model.
        model: f64,
    },
    /// A parameter has the same name but another expression.
    ExpressionDiffers {
        /// Name of the parameter.
        name: String,
        /// The expression in the file.
        file: String,
        /// The expression of the model.
        model: String,
    },
    /// The model has the same base parameters, but other equations.
    EquationsDiffer {
        /// Name of a drive whose forces differ.
        drive: String,
        /// The force at the state in the file, N or N m.
        file: f64,
        /// The force of the model at the same state; `None` if it does not exist there.
        model: Option<f64>,
    },
    /// The model has other numbers of coordinates or drives.
    DrivesDiffer,
}

impl FitFileError {
    /// What is wrong, and what to do.
    pub fn message(&self) -> Message {
        let file = &self.file;
        let identify = Remedy::command(CommandName::Identify);
        match &self.fault {
            FitFault::Unreadable { reason } => message!(
                "{file}: the fit cannot be read: {reason}; create it with {} ({})",
                identify,
                Remedy::option(OptionName::Out).with_value(file)
            ),
            FitFault::NotAFit { line, column, reason } => message!(
                "{file}, line {line}, column {column}: this is not the JSON that {} writes: \
                 {reason}",
                identify
            ),
            FitFault::OnlyRatios => message!(
                "{file} has only ratios of parameters: no number of the model file fixed the scale; give one of those that {} names, \
                 and identify again",
                identify
            ),
            FitFault::NoJson => message!(
                "{file} is not a fit: the JSON that {} writes is expected; pass recordings to {}",
                identify,
                Remedy::option(OptionName::Data)
            ),
            FitFault::MissingParameter { name, nearest, present } => {
                let nearest = nearest.as_ref().map(|near| format!(" (the closest is `{near}`)"));
                message!(
                    "{file}: the model's parameter `{name}` is not in the fit{}, which has {}; identify this model again",
                    nearest.unwrap_or_default(),
                    backquoted_list(present)
                )
            }
            FitFault::UnknownParameters { names } => message!(
                "{file}: the fit has {}, which the model does not have; identify this model again",
                backquoted_list(names)
            ),
            FitFault::DuplicateParameter { name } => {
                message!("{file}: the fit has `{name}` twice; remove one")
            }
            FitFault::ConstantDiffers {
                name,
                file: theirs,
                model,
            } => message!(
                "{file}: the fit was made with {name} = {theirs}, but the model has {name} = {model}, and base parameters \
                 depend on it: identify again"
            ),
            FitFault::ExpressionDiffers {
                name,
                file: theirs,
                model,
            } => message!(
                "{file}: `{name}` is `{theirs}` in the fit but `{model}` in the model; \
                 the fit belongs to another model or to an earlier state of it: identify again"
            ),
            FitFault::EquationsDiffer {
                drive,
                file: theirs,
                model,
            } => {
                let ours = model.map_or_else(|| "no solution".to_owned(), |force| format!("the force {force}"));
                message!(
                    "{file}: the model has other equations than when the fit was made: at the fit's `equation_sample`, drive \
                     `{drive}` had the force {theirs} and has {ours} now; the values would be wrong: identify again"
                )
            }
            FitFault::DrivesDiffer => message!(
                "{file}: the model has other coordinates or drives than when the fit was made; the values would be wrong: \
                 identify again"
            ),
        }
    }
}

impl fmt::Display for FitFileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message().in_library_words())
    }
}

impl std::error::Error for FitFileError {}
