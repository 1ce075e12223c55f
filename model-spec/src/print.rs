//! Prints exact expressions in the syntax of the parser, and evaluates them in double precision.

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

    /// True for the number zero as written; an expression that simplifies to zero is not recognised.
    pub fn is_zero(&self) -> bool {
        matches!(self, Self::Rational(value) if value.is_zero())
    }

    /// The expression in the syntax of a model file; `name` gives the names of symbols.
    /// The text starts in the context of a sum, where no parentheses are needed.
    pub fn to_text(&self, name: &dyn Fn(ModelSymbol) -> String) -> String {
        let mut text = String::new();
        print_expression(self, OperandPrecedence::Sum, name, &mut text);
        text
    }

    /// The value in double precision; `value` gives the values of symbols. It is not finite where the expression is
    /// undefined.
    /// Exact numbers are rounded only here.
    pub fn evaluate(&self, value: &dyn Fn(ModelSymbol) -> f64) -> f64 {
        match self {
            Self::Rational(number) => to_f64(number),
            Self::Pi => std::f64::consts::PI,
            Self::Symbol(symbol) => value(*symbol),
            Self::Sum(terms) => terms.iter().map(|term| term.evaluate(value)).sum(),
            Self::Product(factors) => factors.iter().map(|factor| factor.evaluate(value)).product(),
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
                    // Unlike `signum`, the sign of zero is zero.
                    ExactFunction::Sign if x > 0.0 => 1.0,
                    ExactFunction::Sign if x < 0.0 => -1.0,
                    ExactFunction::Sign => 0.0,
                    ExactFunction::Tanh => x.tanh(),
                    ExactFunction::Exp => x.exp(),
                }
            }
        }
    }

    /// Calls `visit` for every occurrence of a symbol in the expression.
    /// Symbols are visited in the order in which they are printed, also repeatedly.
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

    /// True if any symbol in the expression satisfies the condition.
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

    /// The value in rad; `value` gives the values of symbols.
    /// The fixed part, then the multiples of symbols.
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
    /// The value in m; `value` gives the values of symbols.
    /// The fixed part, then the multiples of coordinates.
    pub fn evaluate(&self, value: &dyn Fn(ModelSymbol) -> f64) -> f64 {
        self.offset.evaluate(value)
            + self
                .coordinates
                .iter()
                .map(|(coordinate, factor)| to_f64(factor) * value(ModelSymbol::Coordinate(*coordinate)))
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

    /// The nominal value of a symbol; zero for the quantities of a place, which have no nominal value.
    pub fn symbol_nominal(&self, symbol: ModelSymbol) -> f64 {
        // Each symbol has one value in the mechanism.
        match symbol {
            ModelSymbol::Constant(idx) => self.constants[idx.0].value,
            ModelSymbol::Parameter(idx) => self.parameters[idx.0].nominal,
            ModelSymbol::Coordinate(idx) => self.coordinates[idx.0].nominal,
            ModelSymbol::Place(_) => 0.0,
        }
    }

    /// An expression in the syntax of the model file, with its names.
    pub fn text_of(&self, exact: &ExactExpression) -> String {
        exact.to_text(&|symbol| self.symbol_name(symbol).to_owned())
    }
}

/// The nearest double; infinite beyond its range.
pub(crate) fn to_f64(number: &BigRational) -> f64 {
    number.to_f64().unwrap_or(f64::NAN)
}

/// Precedence of the context of an operand, from weak to strong.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum OperandPrecedence {
    /// In a sum: nothing needs parentheses.
    Sum,
    /// In a product as its first factor: sums need parentheses.
    Product,
    /// As a later factor or a divisor: fractions need parentheses, too.
    Factor,
    /// As the base of a power: only numbers, names and calls need none.
    Power,
}

/// Appends an expression; parentheses are added if its own precedence is below that of its context.
/// The parser reads the same tree again.
fn print_expression(
    exact: &ExactExpression,
    level: OperandPrecedence,
    name: &dyn Fn(ModelSymbol) -> String,
    text: &mut String,
) {
    // A negative number prints a sign and a fraction prints a slash, so both bind less than an integer.
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
        // Terms of a sum are printed with their signs.
        ExactExpression::Sum(terms) => print_sum(terms, name, text),
        ExactExpression::Product(factors) => {
            for (i, factor) in factors.iter().enumerate() {
                if i > 0 {
                    text.push('*');
                }
                // A leading number may be a fraction, because products are read from left to right.
                let number = i == 0 && matches!(factor, ExactExpression::Rational(_));
                let inner = if number {
                    OperandPrecedence::Product
                } else {
                    OperandPrecedence::Factor
                };
                print_expression(factor, inner, name, text);
            }
        }
        // A divisor always needs parentheses around products and fractions.
        ExactExpression::Quotient(above, below) => {
            // `(a/b)/c` needs parentheses, because chains of fractions are parsed into one.
            let inner = match **above {
                ExactExpression::Quotient(..) => OperandPrecedence::Factor,
                _ => OperandPrecedence::Product,
            };
            print_expression(above, inner, name, text);
            text.push('/');
            print_expression(below, OperandPrecedence::Factor, name, text);
        }
        // A sign is printed before a product, but before a sum only with parentheses.
        ExactExpression::Negative(inner) => {
            text.push('-');
            print_expression(inner, OperandPrecedence::Product, name, text);
        }
        // The base of a power is printed as an atom.
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

/// Appends a sum, in which negative terms become differences.
fn print_sum(terms: &[ExactExpression], name: &dyn Fn(ModelSymbol) -> String, text: &mut String) {
    for (i, term) in terms.iter().enumerate() {
        // A negative term after the first one is subtracted.
        match term {
            ExactExpression::Negative(inner) if i > 0 => {
                text.push_str(" - ");
                print_expression(inner, OperandPrecedence::Product, name, text);
            }
            // A negative number after the first term is subtracted, too.
            ExactExpression::Rational(value) if i > 0 && value.is_negative() => {
                text.push_str(" - ");
                text.push_str(&(-value).to_string());
            }
            _ => {
                if i > 0 {
                    text.push_str(" + ");
                }
                // A sign is allowed without parentheses only at the start of the sum.
                let inner = match term {
                    ExactExpression::Negative(_) | ExactExpression::Rational(_) if i == 0 => OperandPrecedence::Sum,
                    _ => OperandPrecedence::Product,
                };
                print_expression(term, inner, name, text);
            }
        }
    }
}

/// The name of a function in expressions.
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
