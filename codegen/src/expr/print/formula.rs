//! The tree that is printed: sums of terms, fractions, powers and functions, as a person would write them.
//!
//! Expressions and exact numbers go in through the constructors. Renderings as text, LaTeX and MathML read the tree.

use num_bigint::BigInt;

use super::simplify;
use super::symbol::FormulaSymbol;

/// Largest number of terms of a sum in which like terms are collected. The search is quadratic, so longer sums are
/// printed without it.
const MOST_COMPARED: usize = 100;
use crate::expr::Rational;

/// A function by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum FormulaFunction {
    /// Sine.
    Sin,
    /// Cosine.
    Cos,
    /// Square root.
    Sqrt,
    /// Sign: -1, 0 or 1.
    Sign,
    /// Absolute value.
    Abs,
    /// Hyperbolic tangent.
    Tanh,
    /// Exponential.
    Exp,
    /// Angle of the point with the second operand as abscissa and the first as ordinate.
    Atan2,
    /// Cross product of two vectors.
    Cross,
}

impl FormulaFunction {
    /// Its name in text.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sin => "sin",
            Self::Cos => "cos",
            Self::Sqrt => "sqrt",
            Self::Sign => "sign",
            Self::Abs => "abs",
            Self::Tanh => "tanh",
            Self::Exp => "exp",
            Self::Atan2 => "atan2",
            Self::Cross => "cross",
        }
    }
}

impl From<crate::expr::Unary> for FormulaFunction {
    fn from(unary: crate::expr::Unary) -> Self {
        use crate::expr::Unary;
        match unary {
            Unary::Sqrt => Self::Sqrt,
            Unary::Sign => Self::Sign,
            Unary::Abs => Self::Abs,
            Unary::Tanh => Self::Tanh,
            Unary::Exp => Self::Exp,
            Unary::Sin => Self::Sin,
            Unary::Cos => Self::Cos,
        }
    }
}

/// A formula to be printed. The constructors keep it in normal form: no zero term, no factor 1, no sum in a sum.
#[derive(Clone, Debug, PartialEq)]
pub enum PrintedFormula {
    /// A rational number of any sign.
    Number(Rational),
    /// A name.
    Symbol(FormulaSymbol),
    /// A name with a formula as its index: `h` with `m1*dc1`.
    Indexed(FormulaSymbol, Box<PrintedFormula>),
    /// A sum of two or more terms.
    Sum(Vec<PrintedFormula>),
    /// A number times a product, divided by a product.
    Term {
        /// The number, not zero.
        factor: Rational,
        /// Factors above the line.
        above: Vec<PrintedFormula>,
        /// Factors below the line.
        below: Vec<PrintedFormula>,
    },
    /// A power with an exponent of at least two.
    Power(Box<PrintedFormula>, u32),
    /// A function of one or two operands.
    Apply(FormulaFunction, Vec<PrintedFormula>),
}

impl PrintedFormula {
    /// An integer.
    pub fn integer(value: i64) -> Self {
        Self::Number(Rational::integer(value))
    }

    /// A name.
    pub fn name(name: impl Into<String>) -> Self {
        Self::Symbol(FormulaSymbol::new(name))
    }

    /// Whether it is the number 0.
    pub fn is_zero(&self) -> bool {
        matches!(self, Self::Number(n) if n.is_zero())
    }

    /// Whether it is the number 1.
    pub fn is_one(&self) -> bool {
        matches!(self, Self::Number(n) if n.is_one())
    }

    /// Whether it starts with a minus sign.
    pub fn is_negative(&self) -> bool {
        match self {
            Self::Number(n) => n.is_negative(),
            Self::Term { factor, .. } => factor.is_negative(),
            _ => false,
        }
    }

    /// A sum; its first positive term comes first.
    pub fn sum(terms: impl IntoIterator<Item = Self>) -> Self {
        // Sums in sums are opened, and zero terms are dropped.
        let mut flat = Vec::new();
        for term in terms {
            match term {
                Self::Sum(inner) => flat.extend(inner),
                term if term.is_zero() => {}
                term => flat.push(term),
            }
        }
        if flat.len() <= MOST_COMPARED {
            flat = simplify::collect_like_terms(flat);
        }
        // A sum should not begin with a minus sign where a positive term exists.
        if let Some(first) = flat.iter().position(|term| !term.is_negative()) {
            flat[..=first].rotate_right(1);
        }
        // Sums of no term or one term are simpler formulas.
        match flat.len() {
            0 => Self::integer(0),
            1 => flat.remove(0),
            _ => Self::Sum(flat),
        }
    }

    /// A number times a product.
    pub fn product(factor: Rational, factors: impl IntoIterator<Item = Self>) -> Self {
        Self::term(factor, factors, [])
    }

    /// `above / below`
    pub fn quotient(above: Self, below: Self) -> Self {
        Self::term(Rational::ONE, [above], [below])
    }

    /// A number times a product, divided by a product; no factor below the line may be zero.
    pub fn term(
        factor: Rational,
        above: impl IntoIterator<Item = Self>,
        below: impl IntoIterator<Item = Self>,
    ) -> Self {
        let mut number = factor;
        // Factors that move to the numerator and to the denominator.
        let (mut up, mut down) = (Vec::new(), Vec::new());
        for one in above {
            Self::gather_factor(one, &mut number, &mut up, &mut down);
        }
        // Factors below the line invert: what a denominator divides by stands above.
        let mut inverse = Rational::ONE;
        for one in below {
            Self::gather_factor(one, &mut inverse, &mut down, &mut up);
        }
        number = &number * &inverse.recip();
        // Squares of roots of numbers become numbers.
        number = &number * &simplify::without_squared_roots(&mut up);
        number = &number * &simplify::without_squared_roots(&mut down).recip();
        for one in up.iter_mut().chain(&mut down) {
            // Signs that all terms of a sum share go outside.
            if let Self::Sum(terms) = one
                && terms.iter().all(Self::is_negative)
            {
                let turned = std::mem::take(terms).into_iter().map(Self::negate);
                *terms = turned.collect();
                number = -&number;
            }
        }
        // A product with a factor zero is zero, and one without factors is its number.
        if number.is_zero() {
            return Self::Number(number);
        }
        if up.is_empty() && down.is_empty() {
            return Self::Number(number);
        }
        // A product of one factor and no denominator needs no term of its own, or a simpler form.
        if down.is_empty() && up.len() == 1 {
            match (up.remove(0), number == Rational::MINUS_ONE) {
                (only, false) if number.is_one() => return only,
                // The sign of a sum goes to its terms: `b - a` rather than `-(a - b)`.
                (Self::Sum(terms), true) => {
                    return Self::sum(terms.into_iter().map(Self::negate));
                }
                (only, _) => up.push(only),
            }
        }
        Self::Term {
            factor: number,
            above: up,
            below: down,
        }
    }

    /// Distributes one factor: numbers go into `number`, and the parts of a term to the lists above and below the line.
    fn gather_factor(one: Self, number: &mut Rational, above: &mut Vec<Self>, below: &mut Vec<Self>) {
        match one {
            Self::Number(n) => *number = &*number * &n,
            Self::Term {
                factor,
                above: up,
                below: down,
            } => {
                *number = &*number * &factor;
                for one in up {
                    Self::multiply_factor(above, one);
                }
                for one in down {
                    Self::multiply_factor(below, one);
                }
            }
            other => Self::multiply_factor(above, other),
        }
    }

    /// Appends a factor, as a power where it is there already.
    fn multiply_factor(factors: &mut Vec<Self>, factor: Self) {
        let (base, n) = factor.into_power();
        // Whether a factor of the list has the same base.
        let same = |there: &&mut Self| match there {
            Self::Power(inner, _) => **inner == base,
            other => **other == base,
        };
        if let Some(there) = factors.iter_mut().find(same) {
            let (inner, m) = std::mem::replace(there, Self::integer(1)).into_power();
            *there = Self::Power(Box::new(inner), n + m);
            return;
        }
        factors.push(match n {
            1 => base,
            _ => Self::Power(Box::new(base), n),
        });
    }

    /// A formula as base and exponent; the exponent is 1 where there is no power.
    fn into_power(self) -> (Self, u32) {
        match self {
            Self::Power(base, n) => (*base, n),
            other => (other, 1),
        }
    }

    /// An integer power; a negative exponent goes below the line.
    #[must_use]
    pub fn power(self, n: i32) -> Self {
        let magnitude = match (self, n.unsigned_abs()) {
            // Powers of numbers are computed, and powers of powers and of products are merged.
            (_, 0) => return Self::integer(1),
            (base, 1) => base,
            (Self::Number(value), m) => Self::Number(value.pow(i32::try_from(m).unwrap_or(1))),
            (Self::Power(base, k), m) => Self::Power(base, k * m),
            (Self::Term { factor, above, below }, m) => {
                let exponent = i32::try_from(m).unwrap_or(1);
                let raise = |x: Vec<Self>| -> Vec<Self> { x.into_iter().map(|one| one.power(exponent)).collect() };
                Self::term(factor.pow(exponent), raise(above), raise(below))
            }
            (base, m) => Self::Power(Box::new(base), m),
        };
        // Negative exponents become denominators.
        if n < 0 {
            Self::quotient(Self::integer(1), magnitude)
        } else {
            magnitude
        }
    }

    /// The formula with its sign changed.
    #[must_use]
    pub fn negate(self) -> Self {
        Self::product(Rational::MINUS_ONE, [self])
    }

    /// The cross product of two vectors.
    pub fn cross(a: Self, b: Self) -> Self {
        Self::Apply(FormulaFunction::Cross, vec![a, b])
    }

    /// A function of one operand.
    pub fn apply(function: FormulaFunction, operand: Self) -> Self {
        Self::Apply(function, vec![operand])
    }
}

/// Numerator and denominator of the magnitude of a number, as decimal digits. Long finite decimals have no denominator.
pub(super) fn digits(value: &Rational) -> (String, Option<String>) {
    // Numbers with long denominators are printed as decimals where that is exact.
    if let Some(decimal) = decimal(&value.abs()) {
        return (decimal, None);
    }
    let text = value.abs().to_string();
    match text.split_once('/') {
        Some((n, d)) => (n.to_owned(), Some(d.to_owned())),
        None => (text, None),
    }
}

/// A positive number as a decimal, if it is finite and its denominator has three digits or more: such a number is
/// easier to read as a decimal than as a quotient.
fn decimal(value: &Rational) -> Option<String> {
    // Longer decimals are no easier to read than the quotient.
    const MOST_DIGITS: usize = 40;
    let big = value.to_big();
    if *big.denom() < BigInt::from(100) {
        return None;
    }
    let ten = BigInt::from(10);
    let (mut scaled, mut places) = (big.clone(), 0);
    // Powers of ten are multiplied in until the number is an integer.
    while !scaled.is_integer() {
        places += 1;
        if places > MOST_DIGITS {
            return None;
        }
        scaled *= &ten;
    }
    // Leading zeros fill up numbers below 1.
    let digits = format!("{:0>width$}", scaled.to_integer(), width = places + 1);
    let (whole, fraction) = digits.split_at(digits.len() - places);
    Some(format!("{whole}.{fraction}"))
}
