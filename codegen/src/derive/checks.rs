//! Numbers that a derivation must not have: values of the model file that are none, factors beyond floating point, base
//! parameters that the file's own constants divide by zero.

use modelmill_spec::{Exact, Function, Mechanism, Symbol};

use crate::lower::{Op, Program};
use crate::programs::PassivePosition;
use crate::{Derivation, DeriveError};

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

/// That programs and nominal base parameters are made of finite numbers.
pub(crate) fn check_results(derivation: &Derivation) -> Result<(), DeriveError> {
    let programs = &derivation.programs;
    let mut all = vec![
        &programs.passive,
        &programs.full_regressor,
        &programs.regressor,
        &programs.inverse_dynamics,
        &programs.base_parameters,
        &programs.drives,
    ];
    if let PassivePosition::Newton(loops) = &programs.passive_position {
        all.extend([&loops.residual, &loops.scales]);
    }
    if let Some(number) = all.into_iter().find_map(too_large) {
        return Err(DeriveError::NotFinite {
            what: format!("the factor {number} of the equations"),
            todo: "write the mechanism with factors of reasonable size",
        });
    }
    let nominal = derivation.nominal_base_values();
    let Some(k) = nominal.iter().position(|value| !value.is_finite()) else {
        return Ok(());
    };
    let base = &derivation.base_parameters()[k];
    Err(DeriveError::NotFinite {
        what: format!(
            "with the model file's values, the base parameter {} = {}",
            base.name, base.expression
        ),
        todo: "see whether a constant in a denominator is zero (then retain other products) or values are too large",
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

/// A number of a program that no floating-point number comes near.
fn too_large(program: &Program) -> Option<String> {
    program.ops.iter().find_map(|op| match op {
        Op::Number(number) if !number.to_f64().is_finite() => Some(number.to_big().to_string()),
        _ => None,
    })
}
