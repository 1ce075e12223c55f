//! Polynomials in constants, and in sines and cosines of constant angles: their normal form, sums, products, and their
//! conversion from expressions.
//!
//! No square of a sine or root occurs (`sin^2 = 1 - cos^2`), so that equal polynomials have equal terms.

use super::rational_function::{FactorVariable, PowerProduct, TrigonometricPolynomial};
use crate::expr::{Atom, AtomAngleSum, ExprId, Graph, Node, Rational, Unary};

/// Adds another polynomial.
pub(super) fn sum_into(to: &mut TrigonometricPolynomial, other: &TrigonometricPolynomial) {
    for (powers, k) in other {
        add_term(to, powers.clone(), k);
    }
}

/// The product of two polynomials.
pub(super) fn product_of(a: &TrigonometricPolynomial, b: &TrigonometricPolynomial) -> TrigonometricPolynomial {
    let mut found = TrigonometricPolynomial::new();
    for (p, x) in a {
        for (q, y) in b {
            add_term(&mut found, power_product(p, q), &(x * y));
        }
    }
    found
}

/// An expression of constants as a polynomial; `None` if it is none. Lengths that are coordinates count as zero.
pub(super) fn polynomial_of(graph: &Graph, id: ExprId) -> Option<TrigonometricPolynomial> {
    let variable = |v: FactorVariable| TrigonometricPolynomial::from([(vec![(v, 1)], Rational::ONE)]);
    match graph.node(id) {
        Node::Rational(value) => Some(number(value)),
        Node::Atom(Atom::Constant(i)) => Some(variable(FactorVariable::Constant(*i))),
        Node::Atom(Atom::Coordinate(_)) => Some(TrigonometricPolynomial::new()),
        Node::Sin(sum) => Some(cos_sin_polynomials(sum)?.1),
        Node::Cos(sum) => Some(cos_sin_polynomials(sum)?.0),
        Node::Sum(terms) => {
            let mut found = TrigonometricPolynomial::new();
            for (term, factor) in terms {
                sum_into(&mut found, &product_of(&number(factor), &polynomial_of(graph, *term)?));
            }
            Some(found)
        }
        Node::Product(factors) => {
            let mut found = number(&Rational::ONE);
            for (factor, power) in factors {
                let factor = polynomial_of(graph, *factor)?;
                for _ in 0..u32::try_from(*power).ok()? {
                    found = product_of(&found, &factor);
                }
            }
            Some(found)
        }
        Node::Unary(Unary::Sqrt, inner) => match graph.node(*inner) {
            Node::Rational(value) => match value.as_small() {
                Some((n, 1)) => Some(variable(FactorVariable::Root(n))),
                _ => None,
            },
            _ => None,
        },
        Node::Atom(_) | Node::Unary(..) => None,
    }
}

/// Cosine and sine of a sum of constant angles, by the addition theorem.
fn cos_sin_polynomials(sum: &AtomAngleSum) -> Option<(TrigonometricPolynomial, TrigonometricPolynomial)> {
    let variable = |v: FactorVariable| TrigonometricPolynomial::from([(vec![(v, 1)], Rational::ONE)]);
    let minus = |p: &TrigonometricPolynomial| product_of(&number(&Rational::MINUS_ONE), p);
    let (mut cosine, mut sine) = (number(&Rational::ONE), TrigonometricPolynomial::new());
    for (atom, n) in sum.terms() {
        let Atom::Constant(i) = atom else { return None };
        let c = variable(FactorVariable::Cos(*i));
        let s = variable(FactorVariable::Sin(*i));
        let s = if *n < 0 { minus(&s) } else { s };
        for _ in 0..n.unsigned_abs() {
            let (cc, ss) = (product_of(&cosine, &c), product_of(&sine, &s));
            let (sc, cs) = (product_of(&sine, &c), product_of(&cosine, &s));
            (cosine, sine) = (cc, sc);
            sum_into(&mut cosine, &minus(&ss));
            sum_into(&mut sine, &cs);
        }
    }
    Some((cosine, sine))
}

/// A number as a polynomial.
fn number(value: &Rational) -> TrigonometricPolynomial {
    let mut found = TrigonometricPolynomial::new();
    add_term(&mut found, PowerProduct::new(), value);
    found
}

/// The product of two products of powers, both sorted.
pub(super) fn power_product(a: &PowerProduct, b: &PowerProduct) -> PowerProduct {
    merge_powers(a, b, |n, m| n + m)
}

/// The product with the larger exponent of every variable.
pub(super) fn least_common_multiple(a: &PowerProduct, b: &PowerProduct) -> PowerProduct {
    merge_powers(a, b, u32::max)
}

/// `a / b`, which must be a product of powers.
pub(super) fn power_quotient(a: &PowerProduct, b: &PowerProduct) -> PowerProduct {
    merge_powers(a, b, |n, m| n - m)
}

/// Combines the exponents of two sorted products of powers, variable by variable; zero exponents are dropped.
fn merge_powers(a: &PowerProduct, b: &PowerProduct, exponent: impl Fn(u32, u32) -> u32) -> PowerProduct {
    let mut found = PowerProduct::with_capacity(a.len() + b.len());
    let (mut a, mut b) = (a.iter().peekable(), b.iter().peekable());
    loop {
        let next = match (a.peek(), b.peek()) {
            (None, None) => return found,
            (Some((v, _)), None) => *v,
            (None, Some((w, _))) => *w,
            (Some((v, _)), Some((w, _))) => *v.min(w),
        };
        let n = a.next_if(|(v, _)| *v == next).map_or(0, |(_, n)| *n);
        let m = b.next_if(|(w, _)| *w == next).map_or(0, |(_, m)| *m);
        let n = exponent(n, m);
        if n > 0 {
            found.push((next, n));
        }
    }
}

/// Adds a term, after squares of sines and roots have been replaced: `sin^2 = 1 - cos^2`, and `root^2` is a number.
pub(super) fn add_term(to: &mut TrigonometricPolynomial, powers: PowerProduct, k: &Rational) {
    if k.is_zero() {
        return;
    }
    // The first variable whose square must be replaced.
    let squared = powers
        .iter()
        .position(|(v, n)| *n > 1 && matches!(v, FactorVariable::Sin(_) | FactorVariable::Root(_)));
    let Some(at) = squared else {
        let sum = to.entry(powers);
        match sum {
            std::collections::btree_map::Entry::Vacant(place) => _ = place.insert(k.clone()),
            std::collections::btree_map::Entry::Occupied(mut place) => {
                let total = place.get() + k;
                if total.is_zero() {
                    place.remove();
                } else {
                    place.insert(total);
                }
            }
        }
        return;
    };
    // One square is taken out; the remaining term is added recursively.
    let (variable, n) = powers[at];
    let mut rest = powers;
    if n == 2 {
        rest.remove(at);
    } else {
        rest[at].1 = n - 2;
    }
    match variable {
        FactorVariable::Root(root) => add_term(to, rest, &(k * &Rational::integer(root))),
        FactorVariable::Sin(i) => {
            let with = power_product(&rest, &vec![(FactorVariable::Cos(i), 2)]);
            add_term(to, rest, k);
            add_term(to, with, &-k);
        }
        FactorVariable::Constant(_) | FactorVariable::Cos(_) => add_term(to, rest, k),
    }
}
