//! Formulas of the exact expressions that a model file is written in.

use modelmill_spec::{Angle, Exact, Function as FileFunction, Length, Mechanism, PlaceQuantity};

use super::formula::{Formula, Function};
use super::symbol::Symbol;
use crate::expr::Rational;

/// The formula of an exact expression.
pub fn exact(mechanism: &Mechanism, expression: &Exact) -> Formula {
    exact_at(mechanism, expression, ["x", "other"])
}

/// The formula of an exact expression that acts at the first of two places: `x`, `x_d`, `x_dd` and `load` are the
/// quantities of a place `x`.
pub fn exact_at(mechanism: &Mechanism, expression: &Exact, places: [&str; 2]) -> Formula {
    let of = |inner: &Exact| exact_at(mechanism, inner, places);
    match expression {
        Exact::Rational(value) => Formula::Number(Rational::from(value.clone())),
        Exact::Pi => Formula::name("pi"),
        Exact::Symbol(symbol) => Formula::Symbol(name(mechanism, *symbol, places)),
        Exact::Sum(terms) => Formula::sum(terms.iter().map(of)),
        Exact::Product(factors) => Formula::product(Rational::ONE, factors.iter().map(of)),
        Exact::Quotient(above, below) => Formula::quotient(of(above), of(below)),
        Exact::Negative(inner) => of(inner).negated(),
        Exact::Power(base, n) => of(base).power(*n),
        Exact::Apply(function, inner) => {
            let function = match function {
                FileFunction::Sin => Function::Sin,
                FileFunction::Cos => Function::Cos,
                FileFunction::Sqrt => Function::Sqrt,
                FileFunction::Abs => Function::Abs,
                FileFunction::Sign => Function::Sign,
                FileFunction::Tanh => Function::Tanh,
                FileFunction::Exp => Function::Exp,
            };
            Formula::apply(function, of(inner))
        }
    }
}

/// The formula of an angle.
pub fn angle(mechanism: &Mechanism, angle: &Angle) -> Formula {
    let turns = Formula::product(Rational::from(angle.pi.clone()), [Formula::name("pi")]);
    let terms = angle.terms.iter().map(|(symbol, n)| {
        let symbol = Formula::Symbol(name(mechanism, *symbol, ["x", "other"]));
        Formula::product(Rational::integer(i64::from(*n)), [symbol])
    });
    Formula::sum(terms.chain([turns]))
}

/// The formula of a length.
pub fn length(mechanism: &Mechanism, length: &Length) -> Formula {
    let slides = length.coordinates.iter().map(|(i, k)| {
        let name = Formula::name(&*mechanism.coordinates[i.0].name);
        Formula::product(Rational::from(k.clone()), [name])
    });
    Formula::sum([exact(mechanism, &length.offset)].into_iter().chain(slides))
}

fn name(mechanism: &Mechanism, symbol: modelmill_spec::Symbol, [x, other]: [&str; 2]) -> Symbol {
    use modelmill_spec::Symbol as Named;
    match symbol {
        Named::Constant(i) => Symbol::new(&*mechanism.constants[i.0].name),
        Named::Parameter(i) => Symbol::new(&*mechanism.parameters[i.0].name),
        Named::Coordinate(i) => Symbol::new(&*mechanism.coordinates[i.0].name),
        Named::Place(PlaceQuantity::Coordinate) => Symbol::new(x),
        Named::Place(PlaceQuantity::Rate) => Symbol::derived(x, 1),
        Named::Place(PlaceQuantity::Acceleration) => Symbol::derived(x, 2),
        Named::Place(PlaceQuantity::Load) => Symbol::new("load"),
        Named::Place(PlaceQuantity::OtherCoordinate) => Symbol::new(other),
        Named::Place(PlaceQuantity::OtherRate) => Symbol::derived(other, 1),
        Named::Place(PlaceQuantity::OtherAcceleration) => Symbol::derived(other, 2),
    }
}
