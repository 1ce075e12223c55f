//! What values and expressions of a model file may be.

use modelmill_spec::{Exact, Function, Mechanism, Symbol};

use crate::DeriveError;

/// That every value of a mechanism is a finite number.
pub(crate) fn check_values(mechanism: &Mechanism) -> Result<(), DeriveError> {
    let constants = mechanism.constants.iter().map(|c| (&c.name, c.value));
    let parameters = mechanism.parameters.iter().map(|p| (&p.name, p.nominal));
    let coordinates = mechanism.coordinates.iter().map(|c| (&c.name, c.nominal));
    let mut values = constants.chain(parameters).chain(coordinates);
    values
        .find(|(_, value)| !value.is_finite())
        .map_or(Ok(()), |(name, value)| {
            Err(DeriveError::NotFinite {
                what: format!("the value of `{name}`, {value},"),
                todo: "give it another one",
            })
        })
}

/// Whether effects have terms that are not defined, or not finite, at every finite state: quotients, roots and
/// exponentials of what moves.
pub(crate) fn may_be_undefined(mechanism: &Mechanism) -> bool {
    let mut terms = mechanism.effects.iter().flat_map(|effect| &effect.terms);
    terms.any(|term| is_partial(&term.expression))
}

fn is_partial(expression: &Exact) -> bool {
    match expression {
        Exact::Rational(_) | Exact::Pi | Exact::Symbol(_) => false,
        Exact::Sum(operands) | Exact::Product(operands) => operands.iter().any(is_partial),
        Exact::Quotient(a, b) => is_partial(a) || is_partial(b) || moves(b),
        Exact::Negative(a) => is_partial(a),
        Exact::Power(a, n) => is_partial(a) || (*n < 0 && moves(a)),
        Exact::Apply(function, a) => {
            is_partial(a) || (matches!(function, Function::Sqrt | Function::Exp) && moves(a))
        }
    }
}

fn moves(expression: &Exact) -> bool {
    match expression {
        Exact::Rational(_) | Exact::Pi => false,
        Exact::Symbol(symbol) => matches!(symbol, Symbol::Place(_) | Symbol::Coordinate(_)),
        Exact::Sum(operands) | Exact::Product(operands) => operands.iter().any(moves),
        Exact::Quotient(a, b) => moves(a) || moves(b),
        Exact::Negative(a) | Exact::Power(a, _) | Exact::Apply(_, a) => moves(a),
    }
}
