//! Prints exact expressions so that the parser reads the same expression again, and evaluates them.

use num_rational::BigRational;
use num_traits::{One, Signed, ToPrimitive, Zero};

use crate::exact::{ExactAngle, ExactExpression, ExactFunction, ExactLength, ModelSymbol};
use crate::mechanism::Mechanism;

impl ExactExpression {
    /// The number zero.
    pub fn zero() -> Self {
        Self::Rational(BigRational::zero())
    }

    /// The number one.
    pub fn unity() -> Self {
        Self::Rational(BigRational::one())
    }

    /// True for the number zero as written; a formula that happens to vanish is not recognised.
    pub fn is_zero(&self) -> bool {
        matches!(self, Self::Rational(value) if value.is_zero())
    }

    /// The expression as the model file would write it, symbols named by `name`.
    pub fn to_text(&self, name: &dyn Fn(ModelSymbol) -> String) -> String {
        let mut text = String::new();
        print_expression(self, OperandPrecedence::Sum, name, &mut text);
        text
    }

    /// The value in double precision, symbols valued by `value`; not finite where the expression has no value.
    pub fn evaluate(&self, value: &dyn Fn(ModelSymbol) -> f64) -> f64 {
        match self {
            Self::Rational(number) => to_f64(number),
            Self::Pi => std::f64::consts::PI,
            Self::Symbol(symbol) => value(*symbol),
            Self::Sum(terms) => terms.iter().map(|term| term.evaluate(value)).sum(),
            Self::Product(factors) => factors
                .iter()
                .map(|factor| factor.evaluate(value))
                .product(),
            Self::Quotient(above, below) => above.evaluate(value) / below.evaluate(value),
            Self::Negative(inner) => -inner.evaluate(value),
            Self::Power(base, exponent) => base.evaluate(value).powi(*exponent),
            Self::Apply(function, inner) => {
                let x = inner.evaluate(value);
                match function {
                    ExactFunction::Sin => x.sin(),
                    ExactFunction::Cos => x.cos(),
                    ExactFunction::Sqrt => x.sqrt(),
                    ExactFunction::Abs => x.abs(),
                    ExactFunction::Sign if x > 0.0 => 1.0,
                    ExactFunction::Sign if x < 0.0 => -1.0,
                    ExactFunction::Sign => 0.0,
                    ExactFunction::Tanh => x.tanh(),
                    ExactFunction::Exp => x.exp(),
                }
            }
        }
    }

    /// Calls `visit` with every symbol of the expression.
    pub fn for_each_symbol(&self, visit: &mut dyn FnMut(ModelSymbol)) {
        match self {
            Self::Rational(_) | Self::Pi => {}
            Self::Symbol(symbol) => visit(*symbol),
            Self::Sum(inner) | Self::Product(inner) => {
                for one in inner {
                    one.for_each_symbol(visit);
                }
            }
            Self::Quotient(above, below) => {
                above.for_each_symbol(visit);
                below.for_each_symbol(visit);
            }
            Self::Negative(inner) | Self::Power(inner, _) | Self::Apply(_, inner) => {
                inner.for_each_symbol(visit);
            }
        }
    }

    /// True if any symbol of the expression satisfies the condition.
    pub fn mentions(&self, condition: &dyn Fn(ModelSymbol) -> bool) -> bool {
        let mut found = false;
        self.for_each_symbol(&mut |symbol| found |= condition(symbol));
        found
    }
}

impl ExactAngle {
    /// The angle zero.
    pub fn zero() -> Self {
        Self {
            pi: BigRational::zero(),
            terms: Vec::new(),
        }
    }

    /// True for the angle zero.
    pub fn is_zero(&self) -> bool {
        self.pi.is_zero() && self.terms.is_empty()
    }

    /// The value in rad, symbols valued by `value`.
    pub fn evaluate(&self, value: &dyn Fn(ModelSymbol) -> f64) -> f64 {
        to_f64(&self.pi) * std::f64::consts::PI
            + self
                .terms
                .iter()
                .map(|&(symbol, factor)| f64::from(factor) * value(symbol))
                .sum::<f64>()
    }
}

impl ExactLength {
    /// The value in m, symbols valued by `value`.
    pub fn evaluate(&self, value: &dyn Fn(ModelSymbol) -> f64) -> f64 {
        self.offset.evaluate(value)
            + self
                .coordinates
                .iter()
                .map(|(coordinate, factor)| {
                    to_f64(factor) * value(ModelSymbol::Coordinate(*coordinate))
                })
                .sum::<f64>()
    }

    /// True for the length zero as written.
    pub fn is_zero(&self) -> bool {
        self.offset.is_zero() && self.coordinates.is_empty()
    }
}

impl Mechanism {
    /// The name of a symbol in the model file.
    pub fn symbol_name(&self, symbol: ModelSymbol) -> &str {
        match symbol {
            ModelSymbol::Constant(idx) => &self.constants[idx.0].name,
            ModelSymbol::Parameter(idx) => &self.parameters[idx.0].name,
            ModelSymbol::Coordinate(idx) => &self.coordinates[idx.0].name,
            ModelSymbol::Place(quantity) => quantity.name(),
        }
    }

    /// The nominal value of a symbol; zero for the quantities of a place, which have none.
    pub fn symbol_nominal(&self, symbol: ModelSymbol) -> f64 {
        match symbol {
            ModelSymbol::Constant(idx) => self.constants[idx.0].value,
            ModelSymbol::Parameter(idx) => self.parameters[idx.0].nominal,
            ModelSymbol::Coordinate(idx) => self.coordinates[idx.0].nominal,
            ModelSymbol::Place(_) => 0.0,
        }
    }

    /// An expression as the model file would write it.
    pub fn text_of(&self, exact: &ExactExpression) -> String {
        exact.to_text(&|symbol| self.symbol_name(symbol).to_owned())
    }
}

/// The nearest double; infinite beyond its range.
pub(crate) fn to_f64(number: &BigRational) -> f64 {
    number.to_f64().unwrap_or(f64::NAN)
}

/// How tightly the surroundings of an operand bind.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum OperandPrecedence {
    Sum,
    Product,
    /// A later factor or a divisor, where a fraction would be read otherwise.
    Factor,
    Power,
}

fn print_expression(
    exact: &ExactExpression,
    level: OperandPrecedence,
    name: &dyn Fn(ModelSymbol) -> String,
    text: &mut String,
) {
    let own = match exact {
        ExactExpression::Rational(value) if value.is_negative() => OperandPrecedence::Sum,
        ExactExpression::Rational(value) if !value.is_integer() => OperandPrecedence::Product,
        ExactExpression::Sum(_) | ExactExpression::Negative(_) => OperandPrecedence::Sum,
        ExactExpression::Product(_) | ExactExpression::Quotient(..) => OperandPrecedence::Product,
        ExactExpression::Power(..) => OperandPrecedence::Factor,
        ExactExpression::Rational(_)
        | ExactExpression::Pi
        | ExactExpression::Symbol(_)
        | ExactExpression::Apply(..) => OperandPrecedence::Power,
    };
    let bracket = own < level;
    if bracket {
        text.push('(');
    }
    match exact {
        ExactExpression::Rational(value) => text.push_str(&value.to_string()),
        ExactExpression::Pi => text.push_str("pi"),
        ExactExpression::Symbol(symbol) => text.push_str(&name(*symbol)),
        ExactExpression::Sum(terms) => print_sum(terms, name, text),
        ExactExpression::Product(factors) => {
            for (i, factor) in factors.iter().enumerate() {
                if i > 0 {
                    text.push('*');
                }
                let number = i == 0 && matches!(factor, ExactExpression::Rational(_));
                let inner = if number {
                    OperandPrecedence::Product
                } else {
                    OperandPrecedence::Factor
                };
                print_expression(factor, inner, name, text);
            }
        }
        ExactExpression::Quotient(above, below) => {
            let inner = match **above {
                ExactExpression::Quotient(..) => OperandPrecedence::Factor,
                _ => OperandPrecedence::Product,
            };
            print_expression(above, inner, name, text);
            text.push('/');
            print_expression(below, OperandPrecedence::Factor, name, text);
        }
        ExactExpression::Negative(inner) => {
            text.push('-');
            print_expression(inner, OperandPrecedence::Product, name, text);
        }
        ExactExpression::Power(base, exponent) => {
            print_expression(base, OperandPrecedence::Power, name, text);
            text.push('^');
            text.push_str(&exponent.to_string());
        }
        ExactExpression::Apply(function, inner) => {
            text.push_str(function_name(*function));
            text.push('(');
            print_expression(inner, OperandPrecedence::Sum, name, text);
            text.push(')');
        }
    }
    if bracket {
        text.push(')');
    }
}

fn print_sum(terms: &[ExactExpression], name: &dyn Fn(ModelSymbol) -> String, text: &mut String) {
    for (i, term) in terms.iter().enumerate() {
        match term {
            ExactExpression::Negative(inner) if i > 0 => {
                text.push_str(" - ");
                print_expression(inner, OperandPrecedence::Product, name, text);
            }
            ExactExpression::Rational(value) if i > 0 && value.is_negative() => {
                text.push_str(" - ");
                text.push_str(&(-value).to_string());
            }
            _ => {
                if i > 0 {
                    text.push_str(" + ");
                }
                let inner = match term {
                    ExactExpression::Negative(_) | ExactExpression::Rational(_) if i == 0 => {
                        OperandPrecedence::Sum
                    }
                    _ => OperandPrecedence::Product,
                };
                print_expression(term, inner, name, text);
            }
        }
    }
}

/// The word for a function.
pub(crate) fn function_name(function: ExactFunction) -> &'static str {
    match function {
        ExactFunction::Sin => "sin",
        ExactFunction::Cos => "cos",
        ExactFunction::Sqrt => "sqrt",
        ExactFunction::Abs => "abs",
        ExactFunction::Sign => "sign",
        ExactFunction::Tanh => "tanh",
        ExactFunction::Exp => "exp",
    }
}
