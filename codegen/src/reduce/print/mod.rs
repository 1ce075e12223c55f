//! Printing of the factors of eq. (6): expanded for scripts, factored for people.

mod factor;

use std::cmp::{Ordering, Reverse};
use std::collections::BTreeMap;

use modelmill_spec::Mechanism;

use super::rational_function::{Polynomial, Powers, RationalFunction, Variable};
use crate::expr::Rational;
use crate::expr::print::{Formula, Function};

impl Variable {
    /// As it is printed: the constant's name, or its sine or cosine.
    pub fn formula(self, mechanism: &Mechanism) -> Formula {
        let name = |i: usize| Formula::name(&*mechanism.constants[i].name);
        match self {
            Self::Constant(i) => name(i),
            Self::Cos(i) => Formula::apply(Function::Cos, name(i)),
            Self::Sin(i) => Formula::apply(Function::Sin, name(i)),
            Self::Root(n) => Formula::apply(Function::Sqrt, Formula::integer(n)),
        }
    }
}

impl RationalFunction {
    /// As a sum of plain terms, each times `factors`: what a script reads.
    pub fn expanded_times(&self, mechanism: &Mechanism, factors: &[Formula]) -> Vec<Formula> {
        let below = match self.denominator.first_key_value() {
            Some((powers, k)) if self.denominator.len() == 1 => {
                let mut below = variables(powers, mechanism);
                below.push(Formula::Number(k.clone()));
                below
            }
            _ => vec![expanded(&self.denominator, mechanism)],
        };
        ordered(&self.numerator)
            .into_iter()
            .map(|(powers, k)| {
                let above = variables(powers, mechanism)
                    .into_iter()
                    .chain(factors.iter().cloned());
                Formula::term(k.clone(), above, below.clone())
            })
            .collect()
    }

    /// As a sum of plain terms.
    pub fn expanded(&self, mechanism: &Mechanism) -> Formula {
        Formula::sum(self.expanded_times(mechanism, &[]))
    }

    /// Factored as far as is cheap: numbers and powers outside, linear factors, sums of squares.
    pub fn formula(&self, mechanism: &Mechanism) -> Formula {
        let (number, above) = factored(&self.numerator, mechanism);
        let (divisor, below) = factored(&self.denominator, mechanism);
        if number.is_zero() {
            return Formula::Number(number);
        }
        Formula::term(&number * &divisor.recip(), above, below)
    }

    /// The number in front and the function without it, so that equal functions up to a number can be recognised.
    #[cfg(any(test, feature = "review"))]
    pub(crate) fn split_number(&self) -> (Rational, Self) {
        let Some((_, leading)) = ordered(&self.numerator).into_iter().next() else {
            return (Rational::ZERO, Self::constant(Rational::ONE));
        };
        let mut content = content(&self.numerator);
        if leading.is_negative() {
            content = -&content;
        }
        // The denominator's number goes along.
        let below = self
            .denominator
            .values()
            .fold(Rational::ZERO, |c, k| c.content_with(k));
        let scaled = |p: &Polynomial, by: &Rational| -> Polynomial {
            let inverse = by.recip();
            p.iter().map(|(v, k)| (v.clone(), k * &inverse)).collect()
        };
        let rest = Self {
            numerator: scaled(&self.numerator, &content),
            denominator: scaled(&self.denominator, &below),
        };
        (&content * &below.recip(), rest)
    }
}

/// The largest number that divides all coefficients.
fn content(p: &Polynomial) -> Rational {
    p.values().fold(Rational::ZERO, |c, k| c.content_with(k))
}

/// Powers as factors.
fn variables(powers: &Powers, mechanism: &Mechanism) -> Vec<Formula> {
    powers
        .iter()
        .map(|(v, n)| {
            let n = i32::try_from(*n).unwrap_or(i32::MAX);
            v.formula(mechanism).power(n)
        })
        .collect()
}

/// Terms as people order them: higher degrees first, then higher powers of the constants that are declared first.
fn ordered(p: &Polynomial) -> Vec<(&Powers, &Rational)> {
    let degree = |powers: &Powers| powers.iter().map(|(_, n)| *n).sum::<u32>();
    let mut terms: Vec<_> = p.iter().collect();
    terms.sort_by(|(a, _), (b, _)| degree(b).cmp(&degree(a)).then_with(|| compare_powers(a, b)));
    terms
}

fn compare_powers(a: &Powers, b: &Powers) -> Ordering {
    let (mut a, mut b) = (a.iter().peekable(), b.iter().peekable());
    loop {
        match (a.peek(), b.peek()) {
            (None, None) => return Ordering::Equal,
            (None, Some(_)) => return Ordering::Greater,
            (Some(_), None) => return Ordering::Less,
            (Some(&&(v, n)), Some(&&(w, m))) => {
                let order = v.cmp(&w).then(Reverse(n).cmp(&Reverse(m)));
                if order != Ordering::Equal {
                    return order;
                }
                a.next();
                b.next();
            }
        }
    }
}

fn expanded(p: &Polynomial, mechanism: &Mechanism) -> Formula {
    Formula::sum(
        ordered(p)
            .into_iter()
            .map(|(powers, k)| Formula::product(k.clone(), variables(powers, mechanism))),
    )
}

/// A number and the factors of a polynomial.
fn factored(p: &Polynomial, mechanism: &Mechanism) -> (Rational, Vec<Formula>) {
    let factor::Factored {
        number,
        monomial,
        factors,
    } = factor::factor(p);
    let mut formulas = variables(&monomial, mechanism);
    for (base, n) in factors {
        let n = i32::try_from(n).unwrap_or(i32::MAX);
        formulas.push(with_squares(&base, mechanism).power(n));
    }
    (number, formulas)
}

/// A sum whose quadratic terms are gathered to squares where they are some: `(r2 + r3)^2 + d3^2`.
fn with_squares(p: &Polynomial, mechanism: &Mechanism) -> Formula {
    let mut rest = p.clone();
    let mut squares: BTreeMap<Variable, Formula> = BTreeMap::new();
    for square in factor::squares(p) {
        let first = square.linear[0].0;
        let sum = Formula::sum(
            square
                .linear
                .iter()
                .map(|(v, k)| Formula::product(k.clone(), [v.formula(mechanism)])),
        );
        squares.insert(first, Formula::product(square.number, [sum.power(2)]));
        for used in &square.terms {
            rest.remove(used);
        }
    }
    let terms = ordered(&rest)
        .into_iter()
        .map(|(powers, k)| Formula::product(k.clone(), variables(powers, mechanism)));
    Formula::sum(squares.into_values().chain(terms))
}

#[cfg(test)]
mod tests;
