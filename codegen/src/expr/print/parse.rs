//! Reads printed text again, for tests: the text of a formula has the formula's value.

use std::collections::BTreeMap;

use crate::expr::{Atom, AtomAngleSum, EvaluationDomain, Rational, Unary};

/// The tree of a text that was read.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum ParsedFormula {
    /// A decimal or an integer, exact.
    Number(Rational),
    /// A symbol.
    Name(String),
    /// `a + b`
    Add(Box<ParsedFormula>, Box<ParsedFormula>),
    /// `a - b`
    Sub(Box<ParsedFormula>, Box<ParsedFormula>),
    /// `a * b`
    Mul(Box<ParsedFormula>, Box<ParsedFormula>),
    /// `a / b`
    Div(Box<ParsedFormula>, Box<ParsedFormula>),
    /// `-a`
    Negative(Box<ParsedFormula>),
    /// An integer power.
    Power(Box<ParsedFormula>, i32),
    /// A function by name, with its operands.
    Apply(String, Vec<ParsedFormula>),
}

/// Reads a complete text; panics with the text where it cannot be read.
pub(crate) fn parse(text: &str) -> ParsedFormula {
    let mut reader = FormulaReader {
        text,
        rest: text.trim(),
    };
    let read = reader.sum();
    assert!(reader.rest.is_empty(), "left over in {text}: {}", reader.rest);
    read
}

/// A text and the part of it that is not read yet.
struct FormulaReader<'a> {
    /// The complete text, for messages.
    text: &'a str,
    /// The part that is not read yet, without leading spaces.
    rest: &'a str,
}

impl FormulaReader<'_> {
    /// Reads one character if it comes next, and returns whether it did.
    fn take(&mut self, wanted: char) -> bool {
        let found = self.rest.starts_with(wanted);
        if found {
            self.rest = self.rest[wanted.len_utf8()..].trim_start();
        }
        found
    }

    /// Reads one character, which must come next.
    fn expect(&mut self, wanted: char) {
        assert!(self.take(wanted), "no {wanted} in {} at {}", self.text, self.rest);
    }

    /// Reads the longest word of characters that belong to it.
    fn word(&mut self, belongs: fn(char) -> bool) -> String {
        let end = self.rest.find(|c| !belongs(c)).unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        let word = word.to_owned();
        self.rest = rest.trim_start();
        word
    }

    /// Reads terms with `+` and `-`.
    fn sum(&mut self) -> ParsedFormula {
        let mut total = if self.take('-') {
            ParsedFormula::Negative(Box::new(self.product()))
        } else {
            self.product()
        };
        loop {
            if self.take('+') {
                total = ParsedFormula::Add(Box::new(total), Box::new(self.product()));
            } else if self.take('-') {
                total = ParsedFormula::Sub(Box::new(total), Box::new(self.product()));
            } else {
                return total;
            }
        }
    }

    /// Reads factors with `*` and `/`, from left to right.
    fn product(&mut self) -> ParsedFormula {
        let mut total = self.power();
        loop {
            if self.take('*') {
                total = ParsedFormula::Mul(Box::new(total), Box::new(self.power()));
            } else if self.take('/') {
                total = ParsedFormula::Div(Box::new(total), Box::new(self.power()));
            } else {
                return total;
            }
        }
    }

    /// Reads an operand with an optional exponent.
    fn power(&mut self) -> ParsedFormula {
        let base = self.operand();
        if self.take('^') {
            let n = self.word(|c| c.is_ascii_digit());
            return ParsedFormula::Power(Box::new(base), n.parse().expect("an exponent"));
        }
        base
    }

    /// Reads a sum in parentheses, a number, a name or a function.
    fn operand(&mut self) -> ParsedFormula {
        if self.take('(') {
            let inner = self.sum();
            self.expect(')');
            return inner;
        }
        if self.rest.starts_with(|c: char| c.is_ascii_digit()) {
            let digits = self.word(|c| c.is_ascii_digit() || c == '.');
            // A decimal is read exactly, as an integer over a power of ten.
            let (whole, fraction) = digits.split_once('.').unwrap_or((&digits, ""));
            let places = u32::try_from(fraction.len()).expect("few places");
            let all: num_bigint::BigInt = format!("{whole}{fraction}").parse().expect("digits");
            let scale = num_bigint::BigInt::from(10).pow(places);
            let value = num_rational::BigRational::new(all, scale);
            return ParsedFormula::Number(Rational::from(value));
        }
        let name = self.word(|c| c.is_alphanumeric() || c == '_');
        assert!(!name.is_empty(), "no operand in {} at {}", self.text, self.rest);
        // A name with a parenthesis is a function.
        if !self.take('(') {
            return ParsedFormula::Name(name);
        }
        let mut operands = vec![self.sum()];
        while self.take(',') {
            operands.push(self.sum());
        }
        self.expect(')');
        ParsedFormula::Apply(name, operands)
    }
}

impl ParsedFormula {
    /// Its value in double precision; panics at unknown names.
    pub(crate) fn value_f64(&self, names: &BTreeMap<String, f64>) -> f64 {
        let of = |r: &Self| r.value_f64(names);
        match self {
            Self::Number(n) => n.to_f64(),
            Self::Name(name) if name == "pi" => std::f64::consts::PI,
            Self::Name(name) => *names.get(name).unwrap_or_else(|| panic!("{name} has no value yet")),
            Self::Add(a, b) => of(a) + of(b),
            Self::Sub(a, b) => of(a) - of(b),
            Self::Mul(a, b) => of(a) * of(b),
            Self::Div(a, b) => of(a) / of(b),
            Self::Negative(a) => -of(a),
            Self::Power(a, n) => of(a).powi(*n),
            Self::Apply(function, operands) => {
                let x = of(&operands[0]);
                match function.as_str() {
                    "sin" => x.sin(),
                    "cos" => x.cos(),
                    "sqrt" => x.sqrt(),
                    "abs" => x.abs(),
                    "sign" => f64::from(u8::from(x > 0.0)) - f64::from(u8::from(x < 0.0)),
                    "tanh" => x.tanh(),
                    "exp" => x.exp(),
                    "atan2" => x.atan2(of(&operands[1])),
                    other => panic!("unknown function {other}"),
                }
            }
        }
    }

    /// Its value in any domain; `None` where it does not exist. Names must be in `names`.
    pub(crate) fn value<D: EvaluationDomain>(&self, domain: &D, names: &BTreeMap<String, Atom>) -> Option<D::Value> {
        let of = |r: &Self| r.value(domain, names);
        // k times a value of the domain.
        let scaled = |a: D::Value, k: i64| Some(domain.mul(&domain.rational(&Rational::integer(k))?, &a));
        match self {
            Self::Number(n) => domain.rational(n),
            Self::Name(name) => domain.atom(names[name]),
            Self::Add(a, b) => Some(domain.add(&of(a)?, &of(b)?)),
            Self::Sub(a, b) => Some(domain.add(&of(a)?, &scaled(of(b)?, -1)?)),
            Self::Mul(a, b) => Some(domain.mul(&of(a)?, &of(b)?)),
            Self::Div(a, b) => Some(domain.mul(&of(a)?, &domain.power(&of(b)?, -1)?)),
            Self::Negative(a) => scaled(of(a)?, -1),
            Self::Power(a, n) => domain.power(&of(a)?, *n),
            Self::Apply(function, operands) => {
                let unary = match function.as_str() {
                    // Arguments of sine and cosine are sums of angles, which domains treat as such.
                    "sin" | "cos" => {
                        let mut terms = Vec::new();
                        operands[0].angle(1, names, &mut terms);
                        let (c, s) = domain.cos_sin(&AtomAngleSum::new(terms))?;
                        return Some(if function == "sin" { s } else { c });
                    }
                    "sqrt" => Unary::Sqrt,
                    "abs" => Unary::Abs,
                    "sign" => Unary::Sign,
                    "tanh" => Unary::Tanh,
                    "exp" => Unary::Exp,
                    other => panic!("unknown function {other}"),
                };
                domain.unary(unary, &of(&operands[0])?)
            }
        }
    }

    /// Collects an integer combination of angles, multiplied by `factor`, into `terms`.
    fn angle(&self, factor: i32, names: &BTreeMap<String, Atom>, terms: &mut Vec<(Atom, i32)>) {
        match self {
            Self::Name(name) => terms.push((names[name], factor)),
            Self::Add(a, b) => {
                a.angle(factor, names, terms);
                b.angle(factor, names, terms);
            }
            Self::Sub(a, b) => {
                a.angle(factor, names, terms);
                b.angle(-factor, names, terms);
            }
            Self::Negative(a) => a.angle(-factor, names, terms),
            Self::Mul(a, b) => match a.as_ref() {
                Self::Number(n) => {
                    let (n, _) = n.as_small().expect("a small factor");
                    b.angle(factor * i32::try_from(n).expect("a small factor"), names, terms);
                }
                other => panic!("no integer factor of an angle: {other:?}"),
            },
            other => panic!("no sum of angles: {other:?}"),
        }
    }
}
