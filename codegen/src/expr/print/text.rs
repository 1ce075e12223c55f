//! Formulas as plain infix text, in a form that can be parsed again.
//!
//! The inverse is `parse`, with which tests check that a text has the value of its formula.

use std::fmt::{self, Write};

use super::formula::{PrintedFormula, digits};
use crate::expr::Rational;

/// How strongly the surroundings bind, which decides whether parentheses are needed.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum TextPrecedence {
    /// A sum, or no surroundings.
    Sum,
    /// A factor of a product.
    Factor,
    /// The base of a power.
    Power,
}

impl PrintedFormula {
    /// As infix text: `m1*dc1 + d1*m2 + 1/2*d1*m4*dc3/d3`.
    pub fn text(&self) -> String {
        self.to_string()
    }
}

impl fmt::Display for PrintedFormula {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write_at(f, self, TextPrecedence::Sum)
    }
}

/// Writes a formula where the surroundings have some precedence, in parentheses if it binds less.
fn write_at(f: &mut dyn Write, formula: &PrintedFormula, level: TextPrecedence) -> fmt::Result {
    // Negative numbers and fractions need parentheses in products.
    let enclosed = match formula {
        PrintedFormula::Sum(_) => level > TextPrecedence::Sum,
        PrintedFormula::Number(n) => level > TextPrecedence::Sum && (n.is_negative() || !n.is_integer()),
        PrintedFormula::Term { factor, .. } => {
            level > TextPrecedence::Factor || (level > TextPrecedence::Sum && factor.is_negative())
        }
        PrintedFormula::Power(..) => level > TextPrecedence::Factor,
        PrintedFormula::Symbol(_) | PrintedFormula::Indexed(..) | PrintedFormula::Apply(..) => false,
    };
    // Parentheses around everything that follows.
    if enclosed {
        f.write_char('(')?;
    }
    match formula {
        PrintedFormula::Number(n) => {
            if n.is_negative() {
                f.write_char('-')?;
            }
            number(f, n)?;
        }
        PrintedFormula::Symbol(symbol) => f.write_str(&symbol.text())?,
        // An index that is a single name is joined to it by an underscore.
        PrintedFormula::Indexed(symbol, index) => match index.as_ref() {
            PrintedFormula::Symbol(inner) => write!(f, "{}_{}", symbol.text(), inner.text())?,
            index => write!(f, "{}[{index}]", symbol.text())?,
        },
        PrintedFormula::Sum(terms) => {
            // Each term's sign is written here, so only its magnitude follows.
            for (i, term) in terms.iter().enumerate() {
                match (i, term.is_negative()) {
                    (0, true) => f.write_str("-")?,
                    (0, false) => {}
                    (_, true) => f.write_str(" - ")?,
                    (_, false) => f.write_str(" + ")?,
                }
                magnitude(f, term)?;
            }
        }
        PrintedFormula::Term { .. } => {
            if formula.is_negative() {
                f.write_char('-')?;
            }
            magnitude(f, formula)?;
        }
        // The base is enclosed unless it is a name or a function.
        PrintedFormula::Power(base, n) => {
            write_at(f, base, TextPrecedence::Power)?;
            write!(f, "^{n}")?;
        }
        PrintedFormula::Apply(function, operands) => {
            write!(f, "{}(", function.name())?;
            for (i, operand) in operands.iter().enumerate() {
                if i > 0 {
                    f.write_str(", ")?;
                }
                write_at(f, operand, TextPrecedence::Sum)?;
            }
            f.write_char(')')?;
        }
    }
    if enclosed {
        f.write_char(')')?;
    }
    Ok(())
}

/// Writes the magnitude of a number.
fn number(f: &mut dyn Write, value: &Rational) -> fmt::Result {
    // A fraction of integers, or a decimal.
    match digits(value) {
        (n, Some(d)) => write!(f, "{n}/{d}"),
        (n, None) => f.write_str(&n),
    }
}

/// Writes a term of a sum without its sign.
fn magnitude(f: &mut dyn Write, formula: &PrintedFormula) -> fmt::Result {
    match formula {
        PrintedFormula::Number(n) => number(f, n),
        PrintedFormula::Term { factor, above, below } => term(f, factor, above, below),
        other => write_at(f, other, TextPrecedence::Sum),
    }
}

/// Writes a number times factors, divided by factors, without the sign of the number.
fn term(f: &mut dyn Write, factor: &Rational, above: &[PrintedFormula], below: &[PrintedFormula]) -> fmt::Result {
    let (n, d) = digits(factor);
    // Factors below the line, with the denominator of the number if nothing stands above.
    let mut divisors = Vec::new();
    if above.is_empty() {
        // 1/2/x is written 1/(2*x).
        f.write_str(&n)?;
        divisors.extend(d);
    } else {
        // The number comes first, except for the factor 1.
        match d {
            Some(d) => write!(f, "{n}/{d}*")?,
            None if n != "1" => write!(f, "{n}*")?,
            None => {}
        }
        for (i, one) in above.iter().enumerate() {
            if i > 0 {
                f.write_char('*')?;
            }
            write_at(f, one, TextPrecedence::Factor)?;
        }
    }
    // Several divisors are enclosed: a/(b*c).
    let several = divisors.len() + below.len() > 1;
    for one in below {
        let mut text = String::new();
        write_at(&mut text, one, TextPrecedence::Factor)?;
        divisors.push(text);
    }
    // No divisor, one divisor, or several in parentheses.
    match (divisors.is_empty(), several) {
        (true, _) => Ok(()),
        (false, false) => write!(f, "/{}", divisors[0]),
        (false, true) => write!(f, "/({})", divisors.join("*")),
    }
}
