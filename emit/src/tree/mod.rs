//! The statement tree: a lowered program with names and sections, as every language prints it.
//!
//! A [`StraightLineProgram`] goes in, a [`StatementRoutine`] comes out: what is computed once, and what is computed at every state. Values that are
//! used once stand inside the formula that uses them, values with a meaning carry its name, the others are numbered: `k1`
//! is computed once, `x1` at every state.

mod angles;
mod build;
mod expression;
mod once;
mod order;
mod pose;
mod scope;
mod sections;

pub(crate) use expression::{CodeExpression, OperatorPrecedence};
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
    /// What is computed once for a geometry and its parameters.
    pub(crate) once: Vec<CodeStatement>,
    /// Names of the values that are kept of it.
    pub(crate) kept: Vec<String>,
    /// What is computed at every state; outputs that are zero throughout are never put.
    pub(crate) state: Vec<CodeStatement>,
    /// Inputs that are read once.
    pub(crate) read_once: BTreeSet<Atom>,
    /// Inputs that are read at every state.
    pub(crate) read: BTreeSet<Atom>,
    /// What the outputs are called after all statements, for programs without a state.
    pub(crate) results: Vec<CodeExpression>,
    /// How many outputs there are.
    pub(crate) n_outputs: usize,
}

impl StatementRoutine {
    /// Whether there are poses without an answer.
    pub(crate) fn can_fail(&self) -> bool {
        self.has_statement(&|statement| matches!(statement, CodeStatement::Guard(_)))
    }

    /// Outputs that are zero throughout.
    pub(crate) fn zero_outputs(&self) -> Vec<usize> {
        let is_put = |k: usize| {
            self.has_statement(
                &|statement| matches!(statement, CodeStatement::Put { output, .. } if *output == k),
            )
        };
        (0..self.n_outputs).filter(|k| !is_put(*k)).collect()
    }

    /// Whether a statement of a state is such.
    fn has_statement(&self, is_such: &dyn Fn(&CodeStatement) -> bool) -> bool {
        fn has_statement_in(
            statements: &[CodeStatement],
            is_such: &dyn Fn(&CodeStatement) -> bool,
        ) -> bool {
            statements.iter().any(|statement| match statement {
                CodeStatement::Group { statements, .. } => has_statement_in(statements, is_such),
                statement => is_such(statement),
            })
        }
        has_statement_in(&self.state, is_such)
    }
}

/// One statement.
#[derive(Clone, Debug)]
pub(crate) enum CodeStatement {
    /// What follows, for the reader.
    Section(String),
    /// A value by its name.
    Let {
        name: String,
        value: CodeExpression,
        /// What it is, for the reader.
        note: Option<String>,
    },
    /// Angles whose sines and cosines are asked for later, by names.
    Angles(Vec<RequestedAngle>),
    /// Sine and cosine of an angle, or of one of [`Self::Angles`]; what is not needed has no name.
    SinCos {
        sine: Option<String>,
        cosine: Option<String>,
        angle: CodeExpression,
        /// Which of [`Self::Angles`] it is.
        requested: Option<usize>,
    },
    /// What must hold for the model to have an answer.
    Guard(PoseCheck),
    /// A result.
    Put {
        output: usize,
        value: CodeExpression,
    },
    /// A part of a long program that hands on what later parts need.
    Group {
        statements: Vec<CodeStatement>,
        exported: Vec<String>,
    },
}

/// An angle whose sine and cosine are asked for later.
#[derive(Clone, Debug)]
pub(crate) struct RequestedAngle {
    /// The angle.
    pub(crate) value: CodeExpression,
    /// Whether it is an input as it stands.
    pub(crate) plain: bool,
}

/// What must hold at a pose.
#[derive(Clone, Debug)]
pub(crate) enum PoseCheck {
    /// The value is not negative, or the pose is out of reach.
    Reachable(CodeExpression),
    /// The value does not vanish beside the second one, or the pose is singular.
    Regular(CodeExpression, CodeExpression),
    /// The value is a finite number, or a term of the model is undefined.
    Finite(CodeExpression),
}

/// Whether forces depend on what drives carry, so that a state says it.
pub(crate) fn uses_load(derivation: &Derivation) -> bool {
    let programs = &derivation.programs;
    [&programs.regressor, &programs.inverse_dynamics]
        .iter()
        .any(|p| {
            p.ops
                .iter()
                .any(|op| matches!(op, ProgramOp::Input(Atom::Load(_))))
        })
}

/// Inputs of a program in order: the state, then passive coordinates that are found first.
pub(crate) fn inputs_of_state(derivation: &Derivation, with_passive: bool) -> Vec<Atom> {
    let (active, passive) = derivation.coordinates();
    let mut atoms: Vec<Atom> = active.iter().map(|i| Atom::Coordinate(*i)).collect();
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

/// Whether a program needs passive coordinates that Newton's method finds.
pub(crate) fn reads_passive(derivation: &Derivation, program: &StraightLineProgram) -> bool {
    let (_, passive) = derivation.coordinates();
    matches!(
        derivation.programs.passive_position,
        PassivePosition::Newton(_)
    ) && program
        .ops
        .iter()
        .any(|op| matches!(op, ProgramOp::Input(Atom::Coordinate(i)) if passive.contains(i)))
}

/// Base parameters as eq. (16) gives them, term by term.
pub(crate) struct BaseParameterCode {
    /// Sums that they refer to, each after those that it needs.
    pub(crate) sums: Vec<(String, CodeExpression)>,
    pub(crate) values: Vec<CodeExpression>,
    pub(crate) divisors: Vec<GuardedDivisor>,
    /// What values and divisors read.
    pub(crate) read: BTreeSet<Atom>,
}

/// A denominator that must not vanish beside its size.
pub(crate) struct GuardedDivisor {
    pub(crate) text: String,
    pub(crate) value: CodeExpression,
    pub(crate) size: CodeExpression,
}

/// The base parameters of a derivation, by the names of a scope.
pub(crate) fn base_parameters(derivation: &Derivation, scope: &NameScope) -> BaseParameterCode {
    let mechanism = &derivation.mechanism;
    let constants = mechanism.constants.iter().enumerate();
    let parameters = mechanism.parameters.iter().enumerate();
    let atoms: BTreeMap<&str, Atom> = constants
        .map(|(i, c)| (c.name.as_str(), Atom::Constant(i)))
        .chain(parameters.map(|(i, p)| (p.name.as_str(), Atom::Parameter(i))))
        .chain([("pi", Atom::Pi)])
        .collect();
    let called: BTreeMap<&str, Atom> = atoms.values().map(|a| (scope.input_name(*a), *a)).collect();
    let mut read = BTreeSet::new();
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
