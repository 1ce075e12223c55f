//! What a person sees at once in a sum or product that is printed: like terms, squares of a sine and a cosine that make one,
//! squares of roots.

use super::{FormulaFunction, PrintedFormula};
use crate::expr::Rational;

/// A term as a number times factors over factors.
struct SplitTerm {
    factor: Rational,
    above: Vec<PrintedFormula>,
    below: Vec<PrintedFormula>,
}

impl SplitTerm {
    fn new(formula: PrintedFormula) -> Self {
        let (factor, above, below) = match formula {
            PrintedFormula::Number(n) => (n, Vec::new(), Vec::new()),
            PrintedFormula::Term {
                factor,
                above,
                below,
            } => (factor, above, below),
            other => (Rational::ONE, vec![other], Vec::new()),
        };
        Self {
            factor,
            above,
            below,
        }
    }

    /// The same without the square of a sine or cosine, with whose it is.
    fn without_squares(
        &self,
    ) -> impl Iterator<Item = (FormulaFunction, &PrintedFormula, Vec<PrintedFormula>)> {
        self.above.iter().enumerate().filter_map(|(i, factor)| {
            let PrintedFormula::Power(base, 2) = factor else {
                return None;
            };
            let PrintedFormula::Apply(
                function @ (FormulaFunction::Sin | FormulaFunction::Cos),
                operands,
            ) = &**base
            else {
                return None;
            };
            let mut rest = self.above.clone();
            rest.remove(i);
            Some((*function, operands.first()?, rest))
        })
    }

    /// What a sine's and a cosine's square leave together, if all else is equal.
    fn pythagorean_sum(&self, other: &Self) -> Option<Vec<PrintedFormula>> {
        if self.factor != other.factor || self.below != other.below {
            return None;
        }
        let joins = |(f, angle, rest): (FormulaFunction, &PrintedFormula, Vec<PrintedFormula>)| {
            let is_met = other
                .without_squares()
                .any(|(g, with, left)| g != f && with == angle && is_same(&left, &rest));
            is_met.then_some(rest)
        };
        self.without_squares().find_map(joins)
    }
}

/// Whether two products are the same in any order.
fn is_same(a: &[PrintedFormula], b: &[PrintedFormula]) -> bool {
    a.len() == b.len() && a.iter().all(|x| b.contains(x))
}

/// The terms of a sum with like ones added up, in the order in which they first stand.
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

/// Adds a term to those that are there.
fn insert_term(found: &mut Vec<SplitTerm>, term: SplitTerm) {
    let like = found
        .iter_mut()
        .find(|other| is_same(&other.above, &term.above) && is_same(&other.below, &term.below));
    if let Some(other) = like {
        other.factor = &other.factor + &term.factor;
        return;
    }
    let joined = found
        .iter()
        .enumerate()
        .find_map(|(i, other)| Some((i, other.pythagorean_sum(&term)?)));
    match joined {
        Some((i, above)) => {
            let SplitTerm { factor, below, .. } = found.remove(i);
            insert_term(
                found,
                SplitTerm {
                    factor,
                    above,
                    below,
                },
            );
        }
        None => found.push(term),
    }
}

/// Takes even powers of roots of numbers out of a product, and returns what they are.
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
        let product =
            |factors: Vec<PrintedFormula>| PrintedFormula::product(Rational::ONE, factors);
        let sum = PrintedFormula::sum([name("R"), product(vec![name("R"), root(), root()])]);
        let quarter = PrintedFormula::product(Rational::new(1, 4), [sum]);
        assert_eq!(quarter, name("R"));

        let square = |f| PrintedFormula::apply(f, name("x")).power(2);
        let stroke = |f| PrintedFormula::product(Rational::MINUS_ONE, [name("stroke"), square(f)]);
        let sum = PrintedFormula::sum([
            stroke(FormulaFunction::Sin),
            name("a"),
            stroke(FormulaFunction::Cos),
        ]);
        assert_eq!(
            sum,
            PrintedFormula::sum([name("a"), name("stroke").negate()])
        );

        let difference = PrintedFormula::sum([
            square(FormulaFunction::Cos),
            square(FormulaFunction::Sin).negate(),
        ]);
        assert!(matches!(difference, PrintedFormula::Sum(terms) if terms.len() == 2));
        assert!(PrintedFormula::sum([name("a"), name("a").negate()]).is_zero());
    }
}
