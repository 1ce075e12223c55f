//! Expressions that have no value at the constants of the file: divisions by zero, roots of negative numbers, numbers
//! beyond what a float can hold.
//!
//! A parsed expression goes in, the innermost piece of it at fault comes out; what depends on the motion or on dynamic
//! parameters has no value of its own and is looked into only.

use num_traits::ToPrimitive;

use crate::diagnostic::{Diagnostic, Span};
use crate::exact::Function;
use crate::formula::{Ast, AstKind};

/// A piece of an expression without a value.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fault<'a> {
    /// The divisor, the operand of the root, or the whole that is too large.
    pub(crate) piece: &'a Ast,
    /// Its value.
    pub(crate) value: f64,
    pub(crate) why: Why,
}

/// Why there is no value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Why {
    /// The piece is zero, and something is divided by it.
    Divides,
    /// The piece is negative, and its root is taken.
    Root,
    /// The piece is too large.
    TooLarge,
}

/// The value of an expression; `None` where it depends on names whose value is not known.
pub(crate) fn value<'a>(
    ast: &'a Ast,
    known: &dyn Fn(&str) -> Option<f64>,
) -> Result<Option<f64>, Fault<'a>> {
    let fault = |piece: &'a Ast, value: f64, why: Why| Err(Fault { piece, value, why });
    let found = match &ast.kind {
        AstKind::Rational(value) => value.to_f64(),
        AstKind::Pi => Some(std::f64::consts::PI),
        AstKind::Name(name) => known(name),
        AstKind::Sum(terms) => fold(terms, known, 0.0, |a, b| a + b)?,
        AstKind::Product(factors) => fold(factors, known, 1.0, |a, b| a * b)?,
        AstKind::Quotient(above, below) => {
            let (above, divisor) = (value(above, known)?, value(below, known)?);
            if divisor == Some(0.0) {
                return fault(below, 0.0, Why::Divides);
            }
            above.zip(divisor).map(|(a, b)| a / b)
        }
        AstKind::Negative(inner) => value(inner, known)?.map(|x| -x),
        AstKind::Power(base, exponent) => {
            let x = value(base, known)?;
            if x == Some(0.0) && *exponent < 0 {
                return fault(base, 0.0, Why::Divides);
            }
            x.map(|x| x.powi(*exponent))
        }
        AstKind::Apply(function, inner) => {
            let x = value(inner, known)?;
            if let (Function::Sqrt, Some(x)) = (function, x)
                && x < 0.0
            {
                return fault(inner, x, Why::Root);
            }
            x.map(|x| match function {
                Function::Sin => x.sin(),
                Function::Cos => x.cos(),
                Function::Sqrt => x.sqrt(),
                Function::Abs => x.abs(),
                Function::Sign if x == 0.0 => 0.0,
                Function::Sign => x.signum(),
                Function::Tanh => x.tanh(),
                Function::Exp => x.exp(),
            })
        }
    };
    match found {
        Some(x) if !x.is_finite() => fault(ast, x, Why::TooLarge),
        found => Ok(found),
    }
}

/// All operands are looked into, also behind one that is not known.
fn fold<'a>(
    operands: &'a [Ast],
    known: &dyn Fn(&str) -> Option<f64>,
    start: f64,
    join: impl Fn(f64, f64) -> f64,
) -> Result<Option<f64>, Fault<'a>> {
    let mut total = Some(start);
    for operand in operands {
        let found = value(operand, known)?;
        total = total.zip(found).map(|(a, b)| join(a, b));
    }
    Ok(total)
}

impl Fault<'_> {
    /// The finding; `declared` is where the name at fault is, if the piece is a name alone.
    pub(crate) fn report(&self, declared: Option<Span>) -> Diagnostic {
        let (message, help) = match self.why {
            Why::Divides => (
                "this divides by zero",
                "change the constants in it, or leave away what is divided",
            ),
            Why::Root => (
                "this is the root of a negative number",
                "check the sign, and the values of the constants in it",
            ),
            Why::TooLarge => (
                "this has no finite value",
                "check the values and units of the constants in it",
            ),
        };
        let label = match self.why {
            Why::TooLarge => "it is too large with the constants of this file".to_owned(),
            _ => format!("this is {} with the constants of this file", self.value),
        };
        let found = Diagnostic::error(self.piece.span, message)
            .label(label)
            .help(help);
        match (declared, &self.piece.kind) {
            (Some(declared), AstKind::Name(_)) => found.related(declared, "its value stands here"),
            _ => found,
        }
    }
}

/// Whether an expression mentions a name.
pub(crate) fn mentions(ast: &Ast, name: &str) -> bool {
    match &ast.kind {
        AstKind::Rational(_) | AstKind::Pi => false,
        AstKind::Name(found) => found == name,
        AstKind::Sum(inner) | AstKind::Product(inner) => {
            inner.iter().any(|one| mentions(one, name))
        }
        AstKind::Quotient(above, below) => mentions(above, name) || mentions(below, name),
        AstKind::Negative(inner) | AstKind::Power(inner, _) | AstKind::Apply(_, inner) => {
            mentions(inner, name)
        }
    }
}
