//! Simplifications of printed sums and products: like terms are added, `sin^2 + cos^2` becomes 1, and squares of roots
//! of numbers become numbers.

use super::{FormulaFunction, PrintedFormula};
use crate::expr::Rational;

/// A term of a sum: a number times factors, divided by factors.
struct SplitTerm {
    /// The rational factor.
    factor: Rational,
    /// Factors above the line.
    above: Vec<PrintedFormula>,
    /// Factors below the line.
    below: Vec<PrintedFormula>,
}

impl SplitTerm {
    /// Splits a formula; a formula that is neither a number nor a term is its own only factor.
    fn new(formula: PrintedFormula) -> Self {
        let (factor, above, below) = match formula {
            PrintedFormula::Number(n) => (n, Vec::new(), Vec::new()),
            PrintedFormula::Term { factor, above, below } => (factor, above, below),
            other => (Rational::ONE, vec![other], Vec::new()),
        };
        Self { factor, above, below }
    }

    /// For every factor that is the square of a sine or cosine: the function, its angle, and the other factors above
    /// the line.
    fn without_squares(&self) -> impl Iterator<Item = (FormulaFunction, &PrintedFormula, Vec<PrintedFormula>)> {
        self.above.iter().enumerate().filter_map(|(i, factor)| {
            // Only squares of one function of one angle count.
            let PrintedFormula::Power(base, 2) = factor else {
                return None;
            };
            let PrintedFormula::Apply(function @ (FormulaFunction::Sin | FormulaFunction::Cos), operands) = &**base
            else {
                return None;
            };
            // The term without this factor.
            let mut rest = self.above.clone();
            rest.remove(i);
            Some((*function, operands.first()?, rest))
        })
    }

    /// The factors above the line of the sum of two terms that differ only in `sin^2` and `cos^2` of one angle; `None`
    /// for other terms.
    fn pythagorean_sum(&self, other: &Self) -> Option<Vec<PrintedFormula>> {
        // Both terms must have the same number and the same denominator.
        if self.factor != other.factor || self.below != other.below {
            return None;
        }
        // The other term must have the other function of the same angle, and the same remaining factors.
        let joins = |(f, angle, rest): (FormulaFunction, &PrintedFormula, Vec<PrintedFormula>)| {
            let is_met = other
                .without_squares()
                .any(|(g, with, left)| g != f && with == angle && is_same(&left, &rest));
            is_met.then_some(rest)
        };
        self.without_squares().find_map(joins)
    }
}

/// Whether two products have the same factors in any order. Factors of a product are distinct.
fn is_same(a: &[PrintedFormula], b: &[PrintedFormula]) -> bool {
    a.len() == b.len() && a.iter().all(|x| b.contains(x))
}

/// The terms of a sum with like terms added, in the order of their first occurrence.
pub(super) fn collect_like_terms(terms: Vec<PrintedFormula>) -> Vec<PrintedFormula> {
    let mut found: Vec<SplitTerm> = Vec::with_capacity(terms.len());
    for term in terms.into_iter().map(SplitTerm::new) {
        insert_term(&mut found, term);
    }
    let terms = found.into_iter().filter(|term| !term.factor.is_zero());
    terms
        .map(|term| PrintedFormula::term(term.factor, term.above, term.below))
        .collect()
}

/// Adds a term to a list: to a like term, by `sin^2 + cos^2 = 1` to another term, or as a new one.
fn insert_term(found: &mut Vec<SplitTerm>, term: SplitTerm) {
    // A like term has the same factors.
    let like = found
        .iter_mut()
        .find(|other| is_same(&other.above, &term.above) && is_same(&other.below, &term.below));
    if let Some(other) = like {
        other.factor = &other.factor + &term.factor;
        return;
    }
    // A joined term may itself have a like term, so it is inserted again.
    let joined = found
        .iter()
        .enumerate()
        .find_map(|(i, other)| Some((i, other.pythagorean_sum(&term)?)));
    match joined {
        Some((i, above)) => {
            let SplitTerm { factor, below, .. } = found.remove(i);
            insert_term(found, SplitTerm { factor, above, below });
        }
        None => found.push(term),
    }
}

/// Removes even powers of roots of numbers from a product and returns the product of their values.
pub(super) fn without_squared_roots(factors: &mut Vec<PrintedFormula>) -> Rational {
    let mut number = Rational::ONE;
    for factor in factors.iter_mut() {
        let PrintedFormula::Power(base, n) = factor else {
            continue;
        };
        let PrintedFormula::Apply(FormulaFunction::Sqrt, operands) = &**base else {
            continue;
        };
        let [PrintedFormula::Number(inner)] = operands.as_slice() else {
            continue;
        };
        // sqrt(x)^n = x^(n/2), with one root remaining for odd n.
        let halves = i32::try_from(*n / 2).unwrap_or(0);
        number = &number * &inner.pow(halves);
        *factor = if *n % 2 == 0 {
            PrintedFormula::integer(1)
        } else {
            (**base).clone()
        };
    }
    factors.retain(|factor| !factor.is_one());
    number
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(text: &str) -> PrintedFormula {
        PrintedFormula::name(text)
    }

    #[test]
    fn what_a_person_sees_is_done() {
        let root = || PrintedFormula::apply(FormulaFunction::Sqrt, PrintedFormula::integer(3));
        let product = |factors: Vec<PrintedFormula>| PrintedFormula::product(Rational::ONE, factors);
        let sum = PrintedFormula::sum([name("R"), product(vec![name("R"), root(), root()])]);
        let quarter = PrintedFormula::product(Rational::new(1, 4), [sum]);
        assert_eq!(quarter, name("R"));

        let square = |f| PrintedFormula::apply(f, name("x")).power(2);
        let stroke = |f| PrintedFormula::product(Rational::MINUS_ONE, [name("stroke"), square(f)]);
        let sum = PrintedFormula::sum([stroke(FormulaFunction::Sin), name("a"), stroke(FormulaFunction::Cos)]);
        assert_eq!(sum, PrintedFormula::sum([name("a"), name("stroke").negate()]));

        let difference = PrintedFormula::sum([square(FormulaFunction::Cos), square(FormulaFunction::Sin).negate()]);
        assert!(matches!(difference, PrintedFormula::Sum(terms) if terms.len() == 2));
        assert!(PrintedFormula::sum([name("a"), name("a").negate()]).is_zero());
    }
}
