//! Checks of the values and expressions of a model file.

use modelmill_spec::{ExactExpression, ExactFunction, Mechanism, ModelSymbol};

use crate::DeriveError;

/// Checks that every value of a mechanism is a finite number.
///
/// # Errors
/// [`DeriveError::NotFinite`] for the first value that is not.
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
                todo: "set it to a finite number",
            })
        })
}

/// Whether effects have terms that are not defined, or not finite, at every finite state: quotients, roots and
/// exponentials of quantities that move.
pub(crate) fn may_be_undefined(mechanism: &Mechanism) -> bool {
    let mut terms = mechanism.effects.iter().flat_map(|effect| &effect.terms);
    terms.any(|term| is_partial(&term.expression))
}

/// Whether an expression may have no finite value at some state.
fn is_partial(expression: &ExactExpression) -> bool {
    match expression {
        ExactExpression::Rational(_) | ExactExpression::Pi | ExactExpression::Symbol(_) => false,
        ExactExpression::Sum(operands) | ExactExpression::Product(operands) => operands.iter().any(is_partial),
        ExactExpression::Quotient(a, b) => is_partial(a) || is_partial(b) || has_motion(b),
        ExactExpression::Negative(a) => is_partial(a),
        ExactExpression::Power(a, n) => is_partial(a) || (*n < 0 && has_motion(a)),
        ExactExpression::Apply(function, a) => {
            is_partial(a) || (matches!(function, ExactFunction::Sqrt | ExactFunction::Exp) && has_motion(a))
        }
    }
}

/// Whether an expression depends on a coordinate or on a quantity of a place.
fn has_motion(expression: &ExactExpression) -> bool {
    match expression {
        ExactExpression::Rational(_) | ExactExpression::Pi => false,
        ExactExpression::Symbol(symbol) => {
            matches!(symbol, ModelSymbol::Place(_) | ModelSymbol::Coordinate(_))
        }
        ExactExpression::Sum(operands) | ExactExpression::Product(operands) => operands.iter().any(has_motion),
        ExactExpression::Quotient(a, b) => has_motion(a) || has_motion(b),
        ExactExpression::Negative(a) | ExactExpression::Power(a, _) | ExactExpression::Apply(_, a) => has_motion(a),
    }
}
