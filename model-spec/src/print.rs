//! Prints exact expressions so that the parser reads the same expression again, and evaluates them.

use num_rational::BigRational;
use num_traits::{One, Signed, ToPrimitive, Zero};

use crate::exact::{Angle, Exact, Function, Length, Symbol};
use crate::mechanism::Mechanism;

impl Exact {
    /// The number zero.
    pub fn zero() -> Self {
        Self::Rational(BigRational::zero())
    }

    /// The number one.
    pub fn one() -> Self {
        Self::Rational(BigRational::one())
    }

    /// True for the number zero as written; a formula that happens to vanish is not recognised.
    pub fn is_zero(&self) -> bool {
        matches!(self, Self::Rational(value) if value.is_zero())
    }

    /// The expression as the model file would write it, symbols named by `name`.
    pub fn to_text(&self, name: &dyn Fn(Symbol) -> String) -> String {
        let mut text = String::new();
        print(self, Level::Sum, name, &mut text);
        text
    }

    /// The value in double precision, symbols valued by `value`; not finite where the expression has no value.
    pub fn evaluate(&self, value: &dyn Fn(Symbol) -> f64) -> f64 {
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
                    Function::Sin => x.sin(),
                    Function::Cos => x.cos(),
                    Function::Sqrt => x.sqrt(),
                    Function::Abs => x.abs(),
                    Function::Sign if x > 0.0 => 1.0,
                    Function::Sign if x < 0.0 => -1.0,
                    Function::Sign => 0.0,
                    Function::Tanh => x.tanh(),
                    Function::Exp => x.exp(),
                }
            }
        }
    }

    /// Calls `visit` with every symbol of the expression.
    pub fn for_each_symbol(&self, visit: &mut dyn FnMut(Symbol)) {
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
    pub fn mentions(&self, condition: &dyn Fn(Symbol) -> bool) -> bool {
        let mut found = false;
        self.for_each_symbol(&mut |symbol| found |= condition(symbol));
        found
    }
}

impl Angle {
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
    pub fn evaluate(&self, value: &dyn Fn(Symbol) -> f64) -> f64 {
        to_f64(&self.pi) * std::f64::consts::PI
            + self
                .terms
                .iter()
                .map(|&(symbol, factor)| f64::from(factor) * value(symbol))
                .sum::<f64>()
    }
}

impl Length {
    /// The value in m, symbols valued by `value`.
    pub fn evaluate(&self, value: &dyn Fn(Symbol) -> f64) -> f64 {
        self.offset.evaluate(value)
            + self
                .coordinates
                .iter()
                .map(|(coordinate, factor)| to_f64(factor) * value(Symbol::Coordinate(*coordinate)))
                .sum::<f64>()
    }

    /// True for the length zero as written.
    pub fn is_zero(&self) -> bool {
        self.offset.is_zero() && self.coordinates.is_empty()
    }
}

impl Mechanism {
    /// The name of a symbol in the model file.
    pub fn symbol_name(&self, symbol: Symbol) -> &str {
        match symbol {
            Symbol::Constant(idx) => &self.constants[idx.0].name,
            Symbol::Parameter(idx) => &self.parameters[idx.0].name,
            Symbol::Coordinate(idx) => &self.coordinates[idx.0].name,
            Symbol::Place(quantity) => quantity.name(),
        }
    }

    /// The nominal value of a symbol; zero for the quantities of a place, which have none.
    pub fn symbol_nominal(&self, symbol: Symbol) -> f64 {
        match symbol {
            Symbol::Constant(idx) => self.constants[idx.0].value,
            Symbol::Parameter(idx) => self.parameters[idx.0].nominal,
            Symbol::Coordinate(idx) => self.coordinates[idx.0].nominal,
            Symbol::Place(_) => 0.0,
        }
    }

    /// An expression as the model file would write it.
    pub fn text_of(&self, exact: &Exact) -> String {
        exact.to_text(&|symbol| self.symbol_name(symbol).to_owned())
    }
}

/// The nearest double; infinite beyond its range.
pub(crate) fn to_f64(number: &BigRational) -> f64 {
    number.to_f64().unwrap_or(f64::NAN)
}

/// How tightly the surroundings of an operand bind.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Level {
    Sum,
    Product,
    /// A later factor or a divisor, where a fraction would be read otherwise.
    Factor,
    Power,
}

fn print(exact: &Exact, level: Level, name: &dyn Fn(Symbol) -> String, text: &mut String) {
    let own = match exact {
        Exact::Rational(value) if value.is_negative() => Level::Sum,
        Exact::Rational(value) if !value.is_integer() => Level::Product,
        Exact::Sum(_) | Exact::Negative(_) => Level::Sum,
        Exact::Product(_) | Exact::Quotient(..) => Level::Product,
        Exact::Power(..) => Level::Factor,
        Exact::Rational(_) | Exact::Pi | Exact::Symbol(_) | Exact::Apply(..) => Level::Power,
    };
    let bracket = own < level;
    if bracket {
        text.push('(');
    }
    match exact {
        Exact::Rational(value) => text.push_str(&value.to_string()),
        Exact::Pi => text.push_str("pi"),
        Exact::Symbol(symbol) => text.push_str(&name(*symbol)),
        Exact::Sum(terms) => print_sum(terms, name, text),
        Exact::Product(factors) => {
            for (i, factor) in factors.iter().enumerate() {
                if i > 0 {
                    text.push('*');
                }
                let number = i == 0 && matches!(factor, Exact::Rational(_));
                let inner = if number {
                    Level::Product
                } else {
                    Level::Factor
                };
                print(factor, inner, name, text);
            }
        }
        Exact::Quotient(above, below) => {
            let inner = match **above {
                Exact::Quotient(..) => Level::Factor,
                _ => Level::Product,
            };
            print(above, inner, name, text);
            text.push('/');
            print(below, Level::Factor, name, text);
        }
        Exact::Negative(inner) => {
            text.push('-');
            print(inner, Level::Product, name, text);
        }
        Exact::Power(base, exponent) => {
            print(base, Level::Power, name, text);
            text.push('^');
            text.push_str(&exponent.to_string());
        }
        Exact::Apply(function, inner) => {
            text.push_str(function_name(*function));
            text.push('(');
            print(inner, Level::Sum, name, text);
            text.push(')');
        }
    }
    if bracket {
        text.push(')');
    }
}

fn print_sum(terms: &[Exact], name: &dyn Fn(Symbol) -> String, text: &mut String) {
    for (i, term) in terms.iter().enumerate() {
        match term {
            Exact::Negative(inner) if i > 0 => {
                text.push_str(" - ");
                print(inner, Level::Product, name, text);
            }
            Exact::Rational(value) if i > 0 && value.is_negative() => {
                text.push_str(" - ");
                text.push_str(&(-value).to_string());
            }
            _ => {
                if i > 0 {
                    text.push_str(" + ");
                }
                let inner = match term {
                    Exact::Negative(_) | Exact::Rational(_) if i == 0 => Level::Sum,
                    _ => Level::Product,
                };
                print(term, inner, name, text);
            }
        }
    }
}

/// The word for a function.
pub(crate) fn function_name(function: Function) -> &'static str {
    match function {
        Function::Sin => "sin",
        Function::Cos => "cos",
        Function::Sqrt => "sqrt",
        Function::Abs => "abs",
        Function::Sign => "sign",
        Function::Tanh => "tanh",
        Function::Exp => "exp",
    }
}
