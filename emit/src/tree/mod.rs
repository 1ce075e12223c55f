//! The statement tree: a lowered program with names and sections, as every language prints it.
//!
//! A [`StraightLineProgram`] goes in, a [`StatementRoutine`] comes out: precomputed values and statements per state.
//! Values that are used once are inlined, values with a meaning carry its name, all others are numbered: `k1` is
//! computed once, `x1` at every state.

mod angles;
mod build;
mod expression;
mod functions;
mod once;
mod order;
mod pose;
mod regroup;
mod scope;
mod sections;

pub(crate) use expression::{CodeExpression, OperatorPrecedence};
pub(crate) use functions::{ProgramFunction, model_functions};
pub(crate) use once::PrecomputedValues;
pub(crate) use order::order as in_order;
pub(crate) use pose::SharedPose;
pub(crate) use scope::NameScope;

use std::collections::{BTreeMap, BTreeSet};

use modelmill_codegen::expr::Atom;
use modelmill_codegen::expr::print::PrintedFormula;
use modelmill_codegen::{Derivation, PassivePosition, ProgramOp, StraightLineProgram};

/// A program as statements.
#[derive(Clone, Debug)]
pub(crate) struct StatementRoutine {
    /// Statements that are computed once per geometry and parameters.
    pub(crate) once: Vec<CodeStatement>,
    /// Names of the precomputed values that statements of a state read.
    pub(crate) kept: Vec<String>,
    /// Statements of a state; an output that is always zero has no `Put`.
    pub(crate) state: Vec<CodeStatement>,
    /// Inputs that the precomputed statements read.
    pub(crate) read_once: BTreeSet<Atom>,
    /// Inputs that the statements of a state read.
    pub(crate) read: BTreeSet<Atom>,
    /// Expressions of the outputs after all statements, for programs without a state.
    pub(crate) results: Vec<CodeExpression>,
    /// Number of outputs.
    pub(crate) n_outputs: usize,
}

impl StatementRoutine {
    /// The same with names for its outputs, which comments state where a value is stored.
    pub(crate) fn with_entry_names(mut self, names: &[String]) -> Self {
        fn name_entries(statements: &mut [CodeStatement], names: &[String]) {
            for statement in statements {
                match statement {
                    CodeStatement::Put { output, value, entry } => {
                        let name = names.get(*output).cloned().unwrap_or_default();
                        let is_value = matches!(value, CodeExpression::Name(value) if *value == name);
                        *entry = if is_value { String::new() } else { name };
                    }
                    CodeStatement::Group { statements, .. } => name_entries(statements, names),
                    _ => {}
                }
            }
        }
        name_entries(&mut self.state, names);
        self
    }

    /// Whether the program has guards, so that a pose may have no solution.
    pub(crate) fn can_fail(&self) -> bool {
        self.has_statement(&|statement| matches!(statement, CodeStatement::Guard(_)))
    }

    /// Outputs that are always zero.
    pub(crate) fn zero_outputs(&self) -> Vec<usize> {
        // Whether any statement stores output k.
        let is_put = |k: usize| {
            self.has_statement(&|statement| matches!(statement, CodeStatement::Put { output, .. } if *output == k))
        };
        (0..self.n_outputs).filter(|k| !is_put(*k)).collect()
    }

    /// Whether any statement of a state satisfies `is_such`, inside groups too.
    fn has_statement(&self, is_such: &dyn Fn(&CodeStatement) -> bool) -> bool {
        fn has_statement_in(statements: &[CodeStatement], is_such: &dyn Fn(&CodeStatement) -> bool) -> bool {
            statements.iter().any(|statement| match statement {
                CodeStatement::Group { statements, .. } => has_statement_in(statements, is_such),
                statement => is_such(statement),
            })
        }
        has_statement_in(&self.state, is_such)
    }
}

/// One statement of the tree.
#[derive(Clone, Debug)]
pub(crate) enum CodeStatement {
    /// A heading, printed as a comment.
    Section(String),
    /// Defines a name.
    Let {
        /// The name.
        name: String,
        /// Its value.
        value: CodeExpression,
        /// A comment behind the statement.
        note: Option<String>,
    },
    /// Angles whose sines and cosines are computed together and read later by index.
    Angles(Vec<RequestedAngle>),
    /// Sine and cosine of an angle, or of one of [`Self::Angles`]; a value that is not needed has no name.
    SinCos {
        /// Name of the sine.
        sine: Option<String>,
        /// Name of the cosine.
        cosine: Option<String>,
        /// The angle, rad.
        angle: CodeExpression,
        /// Its index in [`Self::Angles`].
        requested: Option<usize>,
    },
    /// Ends the program if the check fails.
    Guard(PoseCheck),
    /// Stores a value in an output.
    Put {
        /// Index of the output.
        output: usize,
        /// The value.
        value: CodeExpression,
        /// Name of the output, such as `H_2_4`; empty if it has none or if the value has the same name.
        entry: String,
    },
    /// A part of a long program, as a block that exports names to later parts.
    Group {
        /// The statements of the part.
        statements: Vec<CodeStatement>,
        /// Names that later parts read.
        exported: Vec<String>,
    },
}

/// An angle whose sine and cosine are computed together with others.
#[derive(Clone, Debug)]
pub(crate) struct RequestedAngle {
    /// The angle, rad.
    pub(crate) value: CodeExpression,
    /// Whether it is an unchanged input.
    pub(crate) plain: bool,
}

/// A condition on a pose.
#[derive(Clone, Debug)]
pub(crate) enum PoseCheck {
    /// The value is not negative, or the pose is out of reach.
    Reachable(CodeExpression),
    /// The first value is not small relative to the second one, or the pose is singular.
    Regular(CodeExpression, CodeExpression),
    /// The value is a finite number, or a term of the model is undefined.
    Finite(CodeExpression),
}

/// Whether forces depend on the forces that drives transmit, which are then part of the state.
pub(crate) fn uses_load(derivation: &Derivation) -> bool {
    let programs = &derivation.programs;
    [&programs.regressor, &programs.inverse_dynamics]
        .iter()
        .any(|p| p.ops.iter().any(|op| matches!(op, ProgramOp::Input(Atom::Load(_)))))
}

/// Names of the entries of a matrix with `n_rows` rows, row by row and counted from 1: `H_1_1`, `H_1_2`, ...
pub(crate) fn matrix_entry_names(letter: &str, n_rows: usize, n_columns: usize) -> Vec<String> {
    (1..=n_rows)
        .flat_map(|row| (1..=n_columns).map(move |column| format!("{letter}_{row}_{column}")))
        .collect()
}

/// Inputs of a program in order: positions, rates, accelerations, loads, then passive coordinates if they are solved
/// for first.
pub(crate) fn inputs_of_state(derivation: &Derivation, with_passive: bool) -> Vec<Atom> {
    let (active, passive) = derivation.coordinates();
    let mut atoms: Vec<Atom> = active.iter().map(|i| Atom::Coordinate(*i)).collect();
    // The order is that of `State` in emitted code.
    atoms.extend(active.iter().map(|i| Atom::Rate(*i)));
    atoms.extend(active.iter().map(|i| Atom::Acceleration(*i)));
    if uses_load(derivation) {
        atoms.extend((0..derivation.mechanism.drives.len()).map(Atom::Load));
    }
    if with_passive {
        atoms.extend(passive.iter().map(|i| Atom::Coordinate(*i)));
    }
    atoms
}

/// Whether a program reads passive coordinates that Newton's method solves for.
pub(crate) fn reads_passive(derivation: &Derivation, program: &StraightLineProgram) -> bool {
    let (_, passive) = derivation.coordinates();
    matches!(derivation.programs.passive_position, PassivePosition::Newton(_))
        && program
            .ops
            .iter()
            .any(|op| matches!(op, ProgramOp::Input(Atom::Coordinate(i)) if passive.contains(i)))
}

/// Base parameters by eq. (16), expanded term by term.
pub(crate) struct BaseParameterCode {
    /// Named sums that the base parameters refer to, each after those that it needs.
    pub(crate) sums: Vec<(String, CodeExpression)>,
    /// Expressions of the base parameters, in order.
    pub(crate) values: Vec<CodeExpression>,
    /// Denominators, to be checked before any value is computed.
    pub(crate) divisors: Vec<GuardedDivisor>,
    /// Constants and parameters that values and denominators read.
    pub(crate) read: BTreeSet<Atom>,
}

/// A denominator that must not be small relative to its terms.
pub(crate) struct GuardedDivisor {
    /// The denominator as printed in messages.
    pub(crate) text: String,
    /// Its value.
    pub(crate) value: CodeExpression,
    /// Magnitude of its terms.
    pub(crate) size: CodeExpression,
}

/// The base parameters of a derivation, with the names of a scope.
pub(crate) fn base_parameters(derivation: &Derivation, scope: &NameScope) -> BaseParameterCode {
    let mechanism = &derivation.mechanism;
    let constants = mechanism.constants.iter().enumerate();
    let parameters = mechanism.parameters.iter().enumerate();
    // Formulas refer to names of the model file; expressions need the names of the scope.
    let atoms: BTreeMap<&str, Atom> = constants
        .map(|(i, c)| (c.name.as_str(), Atom::Constant(i)))
        .chain(parameters.map(|(i, p)| (p.name.as_str(), Atom::Parameter(i))))
        .chain([("pi", Atom::Pi)])
        .collect();
    // From names of the scope back to inputs.
    let called: BTreeMap<&str, Atom> = atoms.values().map(|a| (scope.input_name(*a), *a)).collect();
    let mut read = BTreeSet::new();
    // Collects what the expressions read.
    let mut expression = |formula: &PrintedFormula| {
        let value = CodeExpression::from_formula(formula, &|name| match atoms.get(name) {
            Some(atom) => scope.input_name(*atom).to_owned(),
            None => name.to_owned(),
        });
        value.for_each_name(&mut |name| read.extend(called.get(name)));
        value
    };
    let formulas = derivation.base_formulas();
    let sums = (formulas.sums.iter())
        .map(|(name, formula)| (name.clone(), expression(formula)))
        .collect();
    let values = formulas.values.iter().map(&mut expression).collect();
    let divisors = (formulas.denominators.into_iter())
        .map(|denominator| GuardedDivisor {
            value: expression(&denominator.value),
            size: expression(&denominator.size),
            text: denominator.text,
        })
        .collect();
    BaseParameterCode {
        sums,
        values,
        divisors,
        read,
    }
}
