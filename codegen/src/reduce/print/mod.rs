//! Printing of the factors of eq. (6): expanded for scripts, factored for readers.

mod factor;

use std::cmp::{Ordering, Reverse};
use std::collections::BTreeMap;

use modelmill_spec::Mechanism;

use super::rational_function::{FactorVariable, PowerProduct, RationalFunction, TrigonometricPolynomial};
use crate::expr::Rational;
use crate::expr::print::{FormulaFunction, PrintedFormula};

impl FactorVariable {
    /// The variable as it is printed: the name of a constant, its sine or cosine, or a root.
    pub fn formula(self, mechanism: &Mechanism) -> PrintedFormula {
        let name = |i: usize| PrintedFormula::name(&*mechanism.constants[i].name);
        match self {
            Self::Constant(i) => name(i),
            Self::Cos(i) => PrintedFormula::apply(FormulaFunction::Cos, name(i)),
            Self::Sin(i) => PrintedFormula::apply(FormulaFunction::Sin, name(i)),
            Self::Root(n) => PrintedFormula::apply(FormulaFunction::Sqrt, PrintedFormula::integer(n)),
        }
    }
}

impl RationalFunction {
    /// The terms of the expanded numerator, each divided by the denominator and multiplied by `factors`: the form that
    /// a script reads.
    pub fn expanded_terms(&self, mechanism: &Mechanism, factors: &[PrintedFormula]) -> Vec<PrintedFormula> {
        // A denominator of one term is divided factor by factor, any other one as a whole.
        let below = match self.denominator.first_key_value() {
            Some((powers, k)) if self.denominator.len() == 1 => {
                let mut below = power_factors(powers, mechanism);
                below.push(PrintedFormula::Number(k.clone()));
                below
            }
            _ => vec![expand_polynomial(&self.denominator, mechanism)],
        };
        ordered_terms(&self.numerator)
            .into_iter()
            .map(|(powers, k)| {
                // Each term keeps the whole denominator, so that terms can be read alone.
                let above = power_factors(powers, mechanism)
                    .into_iter()
                    .chain(factors.iter().cloned());
                PrintedFormula::term(k.clone(), above, below.clone())
            })
            .collect()
    }

    /// The function as a sum of expanded terms.
    pub fn expanded_formula(&self, mechanism: &Mechanism) -> PrintedFormula {
        PrintedFormula::sum(self.expanded_terms(mechanism, &[]))
    }

    /// The function factored as far as is cheap: numbers and powers in front, linear factors, sums of squares.
    pub fn formula(&self, mechanism: &Mechanism) -> PrintedFormula {
        // Numerator and denominator are factored separately.
        let (number, above) = polynomial_factors(&self.numerator, mechanism);
        let (divisor, below) = polynomial_factors(&self.denominator, mechanism);
        if number.is_zero() {
            return PrintedFormula::Number(number);
        }
        PrintedFormula::term(&number * &divisor.recip(), above, below)
    }

    /// The rational factor and the function without it, so that functions that differ by a number only are equal.
    #[cfg(any(test, feature = "review"))]
    pub(crate) fn split_number(&self) -> (Rational, Self) {
        let Some((_, leading)) = ordered_terms(&self.numerator).into_iter().next() else {
            return (Rational::ZERO, Self::constant(Rational::ONE));
        };
        // The number has the sign of the leading term.
        let mut content = content(&self.numerator);
        if leading.is_negative() {
            content = -&content;
        }
        // The number of the denominator belongs to the factor as well.
        let below = self.denominator.values().fold(Rational::ZERO, |c, k| c.content_with(k));
        // A polynomial divided by a number.
        let scaled = |p: &TrigonometricPolynomial, by: &Rational| -> TrigonometricPolynomial {
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

/// The greatest common divisor of all coefficients.
fn content(p: &TrigonometricPolynomial) -> Rational {
    p.values().fold(Rational::ZERO, |c, k| c.content_with(k))
}

/// A monomial as a list of powers.
fn power_factors(powers: &PowerProduct, mechanism: &Mechanism) -> Vec<PrintedFormula> {
    powers
        .iter()
        .map(|(v, n)| {
            let n = i32::try_from(*n).unwrap_or(i32::MAX);
            v.formula(mechanism).power(n)
        })
        .collect()
}

/// Terms in the usual order: higher degrees first, then higher powers of the constants that are declared first.
fn ordered_terms(p: &TrigonometricPolynomial) -> Vec<(&PowerProduct, &Rational)> {
    // Sum of the exponents.
    let degree = |powers: &PowerProduct| powers.iter().map(|(_, n)| *n).sum::<u32>();
    let mut terms: Vec<_> = p.iter().collect();
    terms.sort_by(|(a, _), (b, _)| degree(b).cmp(&degree(a)).then_with(|| compare_powers(a, b)));
    terms
}

/// Order of two monomials by their variables and powers; a monomial that continues comes before one that ends.
fn compare_powers(a: &PowerProduct, b: &PowerProduct) -> Ordering {
    let (mut a, mut b) = (a.iter().peekable(), b.iter().peekable());
    loop {
        match (a.peek(), b.peek()) {
            (None, None) => return Ordering::Equal,
            (None, Some(_)) => return Ordering::Greater,
            (Some(_), None) => return Ordering::Less,
            (Some(&&(v, n)), Some(&&(w, m))) => {
                // Variables in the order of declaration, then higher powers first.
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

/// A polynomial as a sum of terms in the usual order.
fn expand_polynomial(p: &TrigonometricPolynomial, mechanism: &Mechanism) -> PrintedFormula {
    PrintedFormula::sum(
        ordered_terms(p)
            .into_iter()
            .map(|(powers, k)| PrintedFormula::product(k.clone(), power_factors(powers, mechanism))),
    )
}

/// The rational factor of a polynomial and its other factors.
fn polynomial_factors(p: &TrigonometricPolynomial, mechanism: &Mechanism) -> (Rational, Vec<PrintedFormula>) {
    let factor::FactoredPolynomial {
        number,
        monomial,
        factors,
    } = factor::factor_polynomial(p);
    // Monomial first, then the polynomials.
    let mut formulas = power_factors(&monomial, mechanism);
    for (base, n) in factors {
        let n = i32::try_from(n).unwrap_or(i32::MAX);
        formulas.push(gather_squares(&base, mechanism).power(n));
    }
    (number, formulas)
}

/// A sum whose quadratic terms are written as squares where they form some: `(r2 + r3)^2 + d3^2`.
fn gather_squares(p: &TrigonometricPolynomial, mechanism: &Mechanism) -> PrintedFormula {
    // Terms that belong to no square.
    let mut rest = p.clone();
    let mut squares: BTreeMap<FactorVariable, PrintedFormula> = BTreeMap::new();
    // Each square takes its terms out of the sum.
    for square in factor::find_squares(p) {
        // Squares are ordered by their first variable.
        let first = square.linear[0].0;
        let sum = PrintedFormula::sum(
            square
                .linear
                .iter()
                .map(|(v, k)| PrintedFormula::product(k.clone(), [v.formula(mechanism)])),
        );
        squares.insert(first, PrintedFormula::product(square.number, [sum.power(2)]));
        for used in &square.terms {
            rest.remove(used);
        }
    }
    // Squares first, then all other terms.
    let terms = ordered_terms(&rest)
        .into_iter()
        .map(|(powers, k)| PrintedFormula::product(k.clone(), power_factors(powers, mechanism)));
    PrintedFormula::sum(squares.into_values().chain(terms))
}

#[cfg(test)]
mod tests;
