//! Finds expressions without a finite value at the constants of the file: divisions by zero, roots of negative
//! numbers, and numbers beyond the range of a float.
//!
//! A parsed expression goes in, the innermost faulty part of it comes out. Parts that depend on the motion or on
//! dynamic parameters have no value, but the expressions inside of them are checked.

use num_traits::ToPrimitive;

use crate::diagnostic::{Diagnostic, SourceSpan};
use crate::exact::ExactFunction;
use crate::formula::{FormulaAst, FormulaAstKind};

/// A part of an expression without a finite value.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ValueFault<'a> {
    /// The divisor, the operand of the root, or the expression that is too large.
    pub(crate) piece: &'a FormulaAst,
    /// Its value.
    pub(crate) value: f64,
    /// Why there is no finite value.
    pub(crate) cause: ValueFaultCause,
}

/// Why there is no finite value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ValueFaultCause {
    /// The part is zero and a divisor.
    Divides,
    /// The part is negative and the operand of a square root.
    Root,
    /// The part is too large.
    TooLarge,
}

/// The value of an expression; `None` if it depends on names without a known value.
///
/// `known` gives the values of names. Fails with the innermost part that has no finite value.
pub(crate) fn value<'a>(
    ast: &'a FormulaAst,
    known: &dyn Fn(&str) -> Option<f64>,
) -> Result<Option<f64>, ValueFault<'a>> {
    let fault = |piece: &'a FormulaAst, value: f64, why: ValueFaultCause| {
        Err(ValueFault {
            piece,
            value,
            cause: why,
        })
    };
    let found = match &ast.kind {
        FormulaAstKind::Rational(value) => value.to_f64(),
        FormulaAstKind::Pi => Some(std::f64::consts::PI),
        FormulaAstKind::Name(name) => known(name),
        FormulaAstKind::Sum(terms) => fold(terms, known, 0.0, |a, b| a + b)?,
        FormulaAstKind::Product(factors) => fold(factors, known, 1.0, |a, b| a * b)?,
        FormulaAstKind::Quotient(above, below) => {
            // Both sides are evaluated, so that a fault in either is found.
            let (above, divisor) = (value(above, known)?, value(below, known)?);
            if divisor == Some(0.0) {
                return fault(below, 0.0, ValueFaultCause::Divides);
            }
            above.zip(divisor).map(|(a, b)| a / b)
        }
        FormulaAstKind::Negative(inner) => value(inner, known)?.map(|x| -x),
        FormulaAstKind::Power(base, exponent) => {
            let x = value(base, known)?;
            if x == Some(0.0) && *exponent < 0 {
                return fault(base, 0.0, ValueFaultCause::Divides);
            }
            x.map(|x| x.powi(*exponent))
        }
        FormulaAstKind::Apply(function, inner) => {
            let x = value(inner, known)?;
            // A root of a negative number has no real value.
            if let (ExactFunction::Sqrt, Some(x)) = (function, x)
                && x < 0.0
            {
                return fault(inner, x, ValueFaultCause::Root);
            }
            x.map(|x| match function {
                ExactFunction::Sin => x.sin(),
                ExactFunction::Cos => x.cos(),
                ExactFunction::Sqrt => x.sqrt(),
                ExactFunction::Abs => x.abs(),
                ExactFunction::Sign if x == 0.0 => 0.0,
                ExactFunction::Sign => x.signum(),
                ExactFunction::Tanh => x.tanh(),
                ExactFunction::Exp => x.exp(),
            })
        }
    };
    // Every part is checked here, so the innermost one is reported.
    match found {
        Some(x) if !x.is_finite() => fault(ast, x, ValueFaultCause::TooLarge),
        found => Ok(found),
    }
}

/// Combines the values of operands. All of them are evaluated, also after one that is unknown.
fn fold<'a>(
    operands: &'a [FormulaAst],
    known: &dyn Fn(&str) -> Option<f64>,
    start: f64,
    join: impl Fn(f64, f64) -> f64,
) -> Result<Option<f64>, ValueFault<'a>> {
    let mut total = Some(start);
    for operand in operands {
        let found = value(operand, known)?;
        total = total.zip(found).map(|(a, b)| join(a, b));
    }
    Ok(total)
}

impl ValueFault<'_> {
    /// The diagnostic; `declared` is the place of the faulty name, if the part is a name only.
    pub(crate) fn report(&self, declared: Option<SourceSpan>) -> Diagnostic {
        // What was found, and what to do about it.
        let (message, help) = match self.cause {
            ValueFaultCause::Divides => (
                "this divides by zero",
                "change the constants in it, or omit the quotient",
            ),
            ValueFaultCause::Root => (
                "this is the root of a negative number",
                "check the sign, and the values of the constants in it",
            ),
            ValueFaultCause::TooLarge => (
                "this has no finite value",
                "check the values and units of the constants in it",
            ),
        };
        let label = match self.cause {
            ValueFaultCause::TooLarge => "it is too large with the constants of this file".to_owned(),
            _ => format!("this is {} with the constants of this file", self.value),
        };
        let found = Diagnostic::error(self.piece.span, message).label(label).help(help);
        match (declared, &self.piece.kind) {
            (Some(declared), FormulaAstKind::Name(_)) => found.related(declared, "its value stands here"),
            _ => found,
        }
    }
}

/// Whether an expression contains a name.
pub(crate) fn mentions(ast: &FormulaAst, name: &str) -> bool {
    match &ast.kind {
        FormulaAstKind::Rational(_) | FormulaAstKind::Pi => false,
        FormulaAstKind::Name(found) => found == name,
        FormulaAstKind::Sum(inner) | FormulaAstKind::Product(inner) => inner.iter().any(|one| mentions(one, name)),
        FormulaAstKind::Quotient(above, below) => mentions(above, name) || mentions(below, name),
        FormulaAstKind::Negative(inner) | FormulaAstKind::Power(inner, _) | FormulaAstKind::Apply(_, inner) => {
            mentions(inner, name)
        }
    }
}
