//! Expressions of the statement tree: constructors that normalise signs and order, and the precedence of operators.

use modelmill_codegen::expr::print::{FormulaFunction, PrintedFormula};
use modelmill_codegen::expr::{Rational, Unary};

/// A formula of variables and numbers. Operands may be exchanged only where the result is the same floating-point
/// number.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum CodeExpression {
    /// A number.
    Number(f64),
    /// A variable.
    Name(String),
    /// A sum of two operands.
    Add(Box<CodeExpression>, Box<CodeExpression>),
    /// A difference.
    Sub(Box<CodeExpression>, Box<CodeExpression>),
    /// A product.
    Mul(Box<CodeExpression>, Box<CodeExpression>),
    /// A quotient.
    Div(Box<CodeExpression>, Box<CodeExpression>),
    /// A change of sign.
    Neg(Box<CodeExpression>),
    /// A function of one argument.
    Call(Unary, Box<CodeExpression>),
    /// Angle of the point (`x`, `y`) in rad, with the operands in the order y, x.
    Atan2(Box<CodeExpression>, Box<CodeExpression>),
}

/// How strongly an expression binds, in increasing order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum OperatorPrecedence {
    /// Sums and differences.
    Sum,
    /// Products and quotients.
    Product,
    /// Changes of sign and negative numbers.
    Negation,
    /// Names, positive numbers and calls.
    Whole,
}

impl CodeExpression {
    /// A variable.
    pub(crate) fn name(name: impl Into<String>) -> Self {
        Self::Name(name.into())
    }

    /// A number, rounded to floating point.
    pub(crate) fn number(value: &Rational) -> Self {
        Self::Number(value.to_f64())
    }

    /// `a + b`, as `b + a` where that needs no parentheses; the result is the same number.
    pub(crate) fn add(a: Self, b: Self) -> Self {
        match (a, b) {
            // Adding a negative is a subtraction.
            (a, Self::Neg(b)) => Self::sub(a, *b),
            (Self::Neg(a), b) => Self::sub(b, *a),
            (a, b) if b.precedence() == OperatorPrecedence::Sum && a.precedence() > OperatorPrecedence::Sum => {
                Self::Add(Box::new(b), Box::new(a))
            }
            (a, b) => Self::Add(Box::new(a), Box::new(b)),
        }
    }

    /// `a - b`; changes of sign are merged into the operator.
    pub(crate) fn sub(a: Self, b: Self) -> Self {
        match (a, b) {
            (a, Self::Neg(b)) => Self::add(a, *b),
            (Self::Neg(a), b) => Self::neg(Self::add(*a, b)),
            (a, b) => Self::Sub(Box::new(a), Box::new(b)),
        }
    }

    /// `a * b`, as `b * a` where that reads better; the result is the same number. Signs are moved outwards.
    pub(crate) fn mul(a: Self, b: Self) -> Self {
        match (a, b) {
            // Signs of both operands move outwards.
            (Self::Neg(a), b) => Self::neg(Self::mul(*a, b)),
            (a, Self::Neg(b)) => Self::neg(Self::mul(a, *b)),
            (a, b) => Self::product(a, b),
        }
    }

    /// A product without signs: numbers in front, nested products on the left.
    fn product(a: Self, b: Self) -> Self {
        // A product on the right would need parentheses.
        let nested = b.precedence() == OperatorPrecedence::Product && a.precedence() != OperatorPrecedence::Product;
        let number = matches!(b, Self::Number(_)) && a.precedence() != OperatorPrecedence::Product;
        let (a, b) = if nested || number { (b, a) } else { (a, b) };
        Self::Mul(Box::new(a), Box::new(b))
    }

    /// `a / b`; signs are moved outwards.
    pub(crate) fn div(a: Self, b: Self) -> Self {
        match (a, b) {
            (Self::Neg(a), b) => Self::neg(Self::div(*a, b)),
            (a, Self::Neg(b)) => Self::neg(Self::div(a, *b)),
            (a, b) => Self::Div(Box::new(a), Box::new(b)),
        }
    }

    /// `-a`; two signs cancel, and a number takes the sign.
    pub(crate) fn neg(a: Self) -> Self {
        match a {
            Self::Neg(a) => *a,
            Self::Number(a) => Self::Number(-a),
            a => Self::Neg(Box::new(a)),
        }
    }

    /// The negative, if it needs no additional operation; the result is the same number.
    fn negated_without_cost(&self) -> Option<Self> {
        match self {
            Self::Number(a) => Some(Self::Number(-a)),
            Self::Neg(a) => Some((**a).clone()),
            Self::Sub(a, b) => Some(Self::Sub(b.clone(), a.clone())),
            Self::Add(a, b) => {
                // One negated term is enough: the other one is subtracted.
                let (turned, rest) = match a.negated_without_cost() {
                    Some(turned) => (turned, b),
                    None => (b.negated_without_cost()?, a),
                };
                Some(Self::Sub(Box::new(turned), rest.clone()))
            }
            // A product is negated by one of its factors.
            Self::Mul(a, b) => match a.negated_without_cost() {
                Some(a) => Some(Self::mul(a, (**b).clone())),
                None => Some(Self::mul((**a).clone(), b.negated_without_cost()?)),
            },
            Self::Div(a, b) => match a.negated_without_cost() {
                Some(a) => Some(Self::div(a, (**b).clone())),
                None => Some(Self::div((**a).clone(), b.negated_without_cost()?)),
            },
            Self::Name(_) | Self::Call(..) | Self::Atan2(..) => None,
        }
    }

    /// The same number, with its leading sign absorbed where possible.
    pub(crate) fn normalize_sign(self) -> Self {
        match self {
            Self::Neg(a) => a.negated_without_cost().unwrap_or(Self::Neg(a)),
            other => other,
        }
    }

    /// A function of one argument.
    pub(crate) fn call(function: Unary, a: Self) -> Self {
        Self::Call(function, Box::new(a))
    }

    /// Angle of the point (`x`, `y`).
    pub(crate) fn atan2(y: Self, x: Self) -> Self {
        Self::Atan2(Box::new(y), Box::new(x))
    }

    /// Precedence of the outermost operator.
    pub(crate) fn precedence(&self) -> OperatorPrecedence {
        match self {
            Self::Add(..) | Self::Sub(..) => OperatorPrecedence::Sum,
            Self::Mul(..) | Self::Div(..) => OperatorPrecedence::Product,
            Self::Neg(_) => OperatorPrecedence::Negation,
            Self::Number(x) if x.is_sign_negative() => OperatorPrecedence::Negation,
            Self::Number(_) | Self::Name(_) | Self::Call(..) | Self::Atan2(..) => OperatorPrecedence::Whole,
        }
    }

    /// Calls `visit` for every name, from left to right.
    pub(crate) fn for_each_name(&self, visit: &mut dyn FnMut(&str)) {
        match self {
            Self::Number(_) => {}
            Self::Name(name) => visit(name),
            Self::Neg(a) | Self::Call(_, a) => a.for_each_name(visit),
            Self::Add(a, b) | Self::Sub(a, b) | Self::Mul(a, b) | Self::Div(a, b) | Self::Atan2(a, b) => {
                a.for_each_name(visit);
                b.for_each_name(visit);
            }
        }
    }

    /// Calls `change` for every name, from left to right.
    pub(crate) fn rename(&mut self, change: &dyn Fn(&mut String)) {
        match self {
            Self::Number(_) => {}
            Self::Name(name) => change(name),
            Self::Neg(a) | Self::Call(_, a) => a.rename(change),
            Self::Add(a, b) | Self::Sub(a, b) | Self::Mul(a, b) | Self::Div(a, b) | Self::Atan2(a, b) => {
                a.rename(change);
                b.rename(change);
            }
        }
    }

    /// A printed formula as an expression; `rename` maps its names to those of the scope.
    pub(crate) fn from_formula(formula: &PrintedFormula, rename: &dyn Fn(&str) -> String) -> Self {
        let of = |f: &PrintedFormula| Self::from_formula(f, rename);
        match formula {
            PrintedFormula::Number(value) => Self::number(value),
            PrintedFormula::Symbol(symbol) | PrintedFormula::Indexed(symbol, _) => Self::Name(rename(&symbol.text())),
            PrintedFormula::Sum(terms) => {
                // The terms of a sum are added in order, with their signs as operators.
                // The first term may be negative, all others are added or subtracted.
                let mut sum: Option<Self> = None;
                for term in terms {
                    let (negative, term) = if term.is_negative() {
                        (true, of(&term.clone().negate()))
                    } else {
                        (false, of(term))
                    };
                    sum = Some(match (sum, negative) {
                        (None, false) => term,
                        (None, true) => Self::neg(term),
                        (Some(sum), false) => Self::Add(Box::new(sum), Box::new(term)),
                        (Some(sum), true) => Self::Sub(Box::new(sum), Box::new(term)),
                    });
                }
                sum.unwrap_or(Self::Number(0.0))
            }
            PrintedFormula::Term { factor, above, below } => {
                // The sign is added at the end.
                let magnitude = factor.abs();
                // A term: factor times numerator over denominator.
                let number = (!magnitude.is_one()).then(|| Self::number(&magnitude));
                let product = |factors: Vec<Self>| {
                    let mut factors = factors.into_iter();
                    let first = factors.next();
                    first.map(|first| factors.fold(first, |a, b| Self::Mul(Box::new(a), Box::new(b))))
                };
                let above = product(number.into_iter().chain(above.iter().map(of)).collect());
                // Numerator and denominator as products.
                let below = product(below.iter().map(of).collect());
                let above = above.unwrap_or(Self::Number(1.0));
                let value = match below {
                    Some(below) => Self::div(above, below),
                    None => above,
                };
                if factor.is_negative() { Self::neg(value) } else { value }
            }
            PrintedFormula::Power(base, n) => {
                // A power becomes repeated multiplication.
                let base = of(base);
                (1..*n).fold(base.clone(), |power, _| {
                    Self::Mul(Box::new(power), Box::new(base.clone()))
                })
            }
            PrintedFormula::Apply(function, operands) => match (function, operands.as_slice()) {
                (FormulaFunction::Atan2, [y, x]) => Self::atan2(of(y), of(x)),
                (function, [a, ..]) => Self::call(unary(*function), of(a)),
                (_, []) => Self::Number(0.0),
            },
        }
    }
}

/// The operation of a function of one argument.
fn unary(function: FormulaFunction) -> Unary {
    match function {
        FormulaFunction::Sin => Unary::Sin,
        FormulaFunction::Cos => Unary::Cos,
        FormulaFunction::Sqrt => Unary::Sqrt,
        FormulaFunction::Sign => Unary::Sign,
        // The last two have two arguments: one is treated before, and the other has vectors, which no program has.
        FormulaFunction::Abs | FormulaFunction::Atan2 | FormulaFunction::Cross => Unary::Abs,
        FormulaFunction::Tanh => Unary::Tanh,
        FormulaFunction::Exp => Unary::Exp,
    }
}
