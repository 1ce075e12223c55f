//! Formulas of the exact expressions that a model file is written in.
//!
//! An exact expression of a mechanism goes in; a formula with the names of the file comes out.

use modelmill_spec::{
    ExactAngle, ExactExpression, ExactFunction as FileFunction, ExactLength, Mechanism, PlaceQuantity,
};

use super::formula::{FormulaFunction, PrintedFormula};
use super::symbol::FormulaSymbol;
use crate::expr::Rational;

/// The formula of an exact expression.
// Outside of effects the names of places do not occur.
pub fn exact_formula(mechanism: &Mechanism, expression: &ExactExpression) -> PrintedFormula {
    exact_formula_at(mechanism, expression, ["x", "other"])
}

/// The formula of an exact expression that acts at the first of two places: `x`, `x_d`, `x_dd` and `load` are the
/// quantities of a place `x`.
pub fn exact_formula_at(mechanism: &Mechanism, expression: &ExactExpression, places: [&str; 2]) -> PrintedFormula {
    // Formula of an operand.
    let of = |inner: &ExactExpression| exact_formula_at(mechanism, inner, places);
    match expression {
        ExactExpression::Rational(value) => PrintedFormula::Number(Rational::from(value.clone())),
        ExactExpression::Pi => PrintedFormula::name("pi"),
        ExactExpression::Symbol(symbol) => PrintedFormula::Symbol(symbol_name(mechanism, *symbol, places)),
        ExactExpression::Sum(terms) => PrintedFormula::sum(terms.iter().map(of)),
        ExactExpression::Product(factors) => PrintedFormula::product(Rational::ONE, factors.iter().map(of)),
        ExactExpression::Quotient(above, below) => PrintedFormula::quotient(of(above), of(below)),
        ExactExpression::Negative(inner) => of(inner).negate(),
        ExactExpression::Power(base, n) => of(base).power(*n),
        // Both crates have an enumeration of functions.
        ExactExpression::Apply(function, inner) => {
            let function = match function {
                FileFunction::Sin => FormulaFunction::Sin,
                FileFunction::Cos => FormulaFunction::Cos,
                FileFunction::Sqrt => FormulaFunction::Sqrt,
                FileFunction::Abs => FormulaFunction::Abs,
                FileFunction::Sign => FormulaFunction::Sign,
                FileFunction::Tanh => FormulaFunction::Tanh,
                FileFunction::Exp => FormulaFunction::Exp,
            };
            PrintedFormula::apply(function, of(inner))
        }
    }
}

/// The formula of an angle.
pub fn angle_formula(mechanism: &Mechanism, angle: &ExactAngle) -> PrintedFormula {
    // The constant part, as a multiple of pi.
    let turns = PrintedFormula::product(Rational::from(angle.pi.clone()), [PrintedFormula::name("pi")]);
    // Coordinates and constants with their integer factors.
    let terms = angle.terms.iter().map(|(symbol, n)| {
        let symbol = PrintedFormula::Symbol(symbol_name(mechanism, *symbol, ["x", "other"]));
        PrintedFormula::product(Rational::integer(i64::from(*n)), [symbol])
    });
    PrintedFormula::sum(terms.chain([turns]))
}

/// The formula of a length.
pub fn length_formula(mechanism: &Mechanism, length: &ExactLength) -> PrintedFormula {
    // Prismatic coordinates with their factors.
    let slides = length.coordinates.iter().map(|(i, k)| {
        let name = PrintedFormula::name(&*mechanism.coordinates[i.0].name);
        PrintedFormula::product(Rational::from(k.clone()), [name])
    });
    PrintedFormula::sum([exact_formula(mechanism, &length.offset)].into_iter().chain(slides))
}

/// The printed name of a symbol of the model file; `x` and `other` name the quantities of an effect's two places.
fn symbol_name(mechanism: &Mechanism, symbol: modelmill_spec::ModelSymbol, [x, other]: [&str; 2]) -> FormulaSymbol {
    use modelmill_spec::ModelSymbol as Named;
    // Rates and accelerations of places get the suffixes `_d` and `_dd`.
    match symbol {
        Named::Constant(i) => FormulaSymbol::new(&*mechanism.constants[i.0].name),
        Named::Parameter(i) => FormulaSymbol::new(&*mechanism.parameters[i.0].name),
        Named::Coordinate(i) => FormulaSymbol::new(&*mechanism.coordinates[i.0].name),
        Named::Place(PlaceQuantity::Coordinate) => FormulaSymbol::new(x),
        Named::Place(PlaceQuantity::Rate) => FormulaSymbol::time_derivative(x, 1),
        Named::Place(PlaceQuantity::Acceleration) => FormulaSymbol::time_derivative(x, 2),
        Named::Place(PlaceQuantity::Load) => FormulaSymbol::new("load"),
        Named::Place(PlaceQuantity::OtherCoordinate) => FormulaSymbol::new(other),
        Named::Place(PlaceQuantity::OtherRate) => FormulaSymbol::time_derivative(other, 1),
        Named::Place(PlaceQuantity::OtherAcceleration) => FormulaSymbol::time_derivative(other, 2),
    }
}
