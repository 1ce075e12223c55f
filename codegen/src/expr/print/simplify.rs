//! What a person sees at once in a sum or product that is printed: like terms, squares of a sine and a cosine that make one,
//! squares of roots.

use super::{Formula, Function};
use crate::expr::Rational;

/// A term as a number times factors over factors.
struct Split {
    factor: Rational,
    above: Vec<Formula>,
    below: Vec<Formula>,
}

impl Split {
    fn new(formula: Formula) -> Self {
        let (factor, above, below) = match formula {
            Formula::Number(n) => (n, Vec::new(), Vec::new()),
            Formula::Term {
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
    fn without_squares(&self) -> impl Iterator<Item = (Function, &Formula, Vec<Formula>)> {
        self.above.iter().enumerate().filter_map(|(i, factor)| {
            let Formula::Power(base, 2) = factor else {
                return None;
            };
            let Formula::Apply(function @ (Function::Sin | Function::Cos), operands) = &**base
            else {
                return None;
            };
            let mut rest = self.above.clone();
            rest.remove(i);
            Some((*function, operands.first()?, rest))
        })
    }

    /// What a sine's and a cosine's square leave together, if all else is equal.
    fn joined(&self, other: &Self) -> Option<Vec<Formula>> {
        if self.factor != other.factor || self.below != other.below {
            return None;
        }
        let joins = |(f, angle, rest): (Function, &Formula, Vec<Formula>)| {
            let is_met = other
                .without_squares()
                .any(|(g, with, left)| g != f && with == angle && is_same(&left, &rest));
            is_met.then_some(rest)
        };
        self.without_squares().find_map(joins)
    }
}

/// Whether two products are the same in any order.
fn is_same(a: &[Formula], b: &[Formula]) -> bool {
    a.len() == b.len() && a.iter().all(|x| b.contains(x))
}

/// The terms of a sum with like ones added up, in the order in which they first stand.
pub(super) fn gathered(terms: Vec<Formula>) -> Vec<Formula> {
    let mut found: Vec<Split> = Vec::with_capacity(terms.len());
    for term in terms.into_iter().map(Split::new) {
        insert(&mut found, term);
    }
    let terms = found.into_iter().filter(|term| !term.factor.is_zero());
    terms
        .map(|term| Formula::term(term.factor, term.above, term.below))
        .collect()
}

/// Adds a term to those that are there.
fn insert(found: &mut Vec<Split>, term: Split) {
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
        .find_map(|(i, other)| Some((i, other.joined(&term)?)));
    match joined {
        Some((i, above)) => {
            let Split { factor, below, .. } = found.remove(i);
            insert(
                found,
                Split {
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
pub(super) fn without_squared_roots(factors: &mut Vec<Formula>) -> Rational {
    let mut number = Rational::ONE;
    for factor in factors.iter_mut() {
        let Formula::Power(base, n) = factor else {
            continue;
        };
        let Formula::Apply(Function::Sqrt, operands) = &**base else {
            continue;
        };
        let [Formula::Number(inner)] = operands.as_slice() else {
            continue;
        };
        let halves = i32::try_from(*n / 2).unwrap_or(0);
        number = &number * &inner.pow(halves);
        *factor = if *n % 2 == 0 {
            Formula::integer(1)
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

    fn name(text: &str) -> Formula {
        Formula::name(text)
    }

    #[test]
    fn what_a_person_sees_is_done() {
        let root = || Formula::apply(Function::Sqrt, Formula::integer(3));
        let product = |factors: Vec<Formula>| Formula::product(Rational::ONE, factors);
        let sum = Formula::sum([name("R"), product(vec![name("R"), root(), root()])]);
        let quarter = Formula::product(Rational::new(1, 4), [sum]);
        assert_eq!(quarter, name("R"));

        let square = |f| Formula::apply(f, name("x")).power(2);
        let stroke = |f| Formula::product(Rational::MINUS_ONE, [name("stroke"), square(f)]);
        let sum = Formula::sum([stroke(Function::Sin), name("a"), stroke(Function::Cos)]);
        assert_eq!(sum, Formula::sum([name("a"), name("stroke").negated()]));

        let difference = Formula::sum([square(Function::Cos), square(Function::Sin).negated()]);
        assert!(matches!(difference, Formula::Sum(terms) if terms.len() == 2));
        assert!(Formula::sum([name("a"), name("a").negated()]).is_zero());
    }
}
