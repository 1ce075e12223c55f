//! Factored text, parsed again, equals the function, and expected factors are found.

use std::collections::BTreeMap;

use modelmill_algebra::field::{FieldElement, RandomStream};

use proptest::prelude::*;

use super::super::rational_function::{FactorVariable, PowerProduct, RationalFunction, TrigonometricPolynomial};
use crate::expr::print::parse::parse;
use crate::expr::{Atom, FieldPoint, Rational};
use crate::review::tests::model;

fn multiply(a: &TrigonometricPolynomial, b: &TrigonometricPolynomial) -> TrigonometricPolynomial {
    let mut product: BTreeMap<PowerProduct, Rational> = BTreeMap::new();
    for (p, k) in a {
        for (q, l) in b {
            let mut powers: BTreeMap<FactorVariable, u32> = p.iter().copied().collect();
            for (v, n) in q {
                *powers.entry(*v).or_insert(0) += n;
            }
            let slot = product.entry(powers.into_iter().collect()).or_insert(Rational::ZERO);
            *slot = &*slot + &(k * l);
        }
    }
    product.retain(|_, k| !k.is_zero());
    product
}

/// `sum of k * product of constants`, the constants by position in the model file.
fn polynomial(terms: &[(i64, &[usize])]) -> TrigonometricPolynomial {
    let mut sum = TrigonometricPolynomial::new();
    for (k, factors) in terms {
        let mut powers: BTreeMap<FactorVariable, u32> = BTreeMap::new();
        for i in *factors {
            *powers.entry(FactorVariable::Constant(*i)).or_insert(0) += 1;
        }
        sum.insert(powers.into_iter().collect(), Rational::integer(*k));
    }
    sum
}

fn linear() -> impl Strategy<Value = TrigonometricPolynomial> {
    prop::collection::vec((0..5usize, -3..4i64), 1..4).prop_map(|terms| {
        let mut sum = TrigonometricPolynomial::new();
        for (i, k) in terms {
            if k != 0 {
                sum.insert(vec![(FactorVariable::Constant(i), 1)], Rational::integer(k));
            }
        }
        sum
    })
}

fn product() -> impl Strategy<Value = TrigonometricPolynomial> {
    prop::collection::vec(linear(), 1..4)
        .prop_map(|factors| factors.iter().fold(polynomial(&[(1, &[])]), |p, f| multiply(&p, f)))
}

fn sum_of_products() -> impl Strategy<Value = TrigonometricPolynomial> {
    (product(), product(), any::<bool>()).prop_map(|(a, b, both)| {
        let mut sum = a;
        if both {
            for (powers, k) in b {
                let there = sum.remove(&powers).unwrap_or(Rational::ZERO);
                let total = &there + &k;
                if !total.is_zero() {
                    sum.insert(powers, total);
                }
            }
        }
        sum
    })
}

proptest! {
    #[test]
    fn printed_factors_read_again_are_the_function(
        numerator in sum_of_products(),
        denominator in sum_of_products(),
    ) {
        prop_assume!(!denominator.is_empty());
        let mechanism = model("spidermill-paper");
        let function = RationalFunction::new(numerator, denominator);
        let mut stream = RandomStream::new(3);
        let mut at = FieldPoint::<FieldElement>::default();
        let mut names = BTreeMap::new();
        for (i, c) in mechanism.constants.iter().enumerate() {
            at.values.insert(Atom::Constant(i), stream.next_element());
            names.insert(c.name.clone(), Atom::Constant(i));
        }
        let expected = function.value(&at);
        for printed in [function.formula(&mechanism), function.expanded_formula(&mechanism)] {
            let text = printed.text();
            prop_assert_eq!(parse(&text).value(&at, &names), expected, "{}", text);
        }
        if !function.is_zero() {
            let (number, rest) = function.split_number();
            let number = FieldElement::from_rational(&number).expect("a small number");
            prop_assert_eq!(rest.value(&at).map(|v| v * number), expected);
        }
    }
}

/// Constants of the model are d1, d3, b, dA, Bx, ... in this order.
fn check(numerator: &TrigonometricPolynomial, denominator: &TrigonometricPolynomial, expected: &str) {
    let mechanism = model("spidermill-paper");
    let function = RationalFunction::new(numerator.clone(), denominator.clone());
    assert_eq!(function.formula(&mechanism).text(), expected);
}

#[test]
fn numbers_and_powers_stand_outside() {
    check(
        &polynomial(&[(2, &[0, 0, 1]), (4, &[0, 1, 1])]),
        &polynomial(&[(6, &[2])]),
        "1/3*d1*d3*(d1 + 2*d3)/b",
    );
    check(&polynomial(&[(-1, &[0])]), &polynomial(&[(2, &[1])]), "-1/2*d1/d3");
}

#[test]
fn squares_and_their_differences_are_seen() {
    let one = polynomial(&[(1, &[])]);
    check(&polynomial(&[(1, &[0, 0]), (-1, &[1, 1])]), &one, "(d1 + d3)*(d1 - d3)");
    check(
        &polynomial(&[(1, &[0, 0]), (2, &[0, 1]), (1, &[1, 1])]),
        &one,
        "(d1 + d3)^2",
    );
    // The puma's (d2 + d3)^2 + a2^2.
    check(
        &polynomial(&[(1, &[0, 0]), (2, &[0, 1]), (1, &[1, 1]), (1, &[2, 2])]),
        &one,
        "(d1 + d3)^2 + b^2",
    );
    check(&polynomial(&[(1, &[0, 0]), (1, &[1, 1])]), &one, "d1^2 + d3^2");
}

/// The same at random points, with fewer terms where even powers of a cosine make up one of the sine.
#[test]
fn even_powers_of_cosines_become_sines_where_that_is_shorter() {
    let (length, cosine, sine) = (
        FactorVariable::Constant(0),
        FactorVariable::Cos(1),
        FactorVariable::Sin(1),
    );
    let one = Rational::ONE;
    let numerator = TrigonometricPolynomial::from([
        (vec![(length, 2)], one.clone()),
        (vec![(length, 2), (cosine, 2)], -&one),
    ]);
    let quartic = TrigonometricPolynomial::from([
        (vec![], one.clone()),
        (vec![(cosine, 2)], Rational::integer(-2)),
        (vec![(cosine, 4)], one.clone()),
    ]);
    let kept = TrigonometricPolynomial::from([(vec![(cosine, 2)], one.clone()), (vec![(sine, 1)], one)]);
    for (p, n_terms, power_of_sine) in [(numerator, 1, 2), (quartic, 1, 4), (kept, 2, 1)] {
        let written = RationalFunction {
            numerator: p.clone(),
            denominator: polynomial(&[(1, &[])]),
        };
        let found = RationalFunction::new(p, polynomial(&[(1, &[])]));
        assert_eq!(found.numerator.len(), n_terms);
        let sines = found.numerator.keys().flatten().filter(|(v, _)| *v == sine);
        assert_eq!(sines.map(|(_, n)| *n).max(), Some(power_of_sine));
        let mut stream = RandomStream::new(7);
        for _ in 0..4 {
            let mut point = FieldPoint::<FieldElement>::default();
            for i in 0..2 {
                point.values.insert(Atom::Constant(i), stream.next_element());
                point.angles.insert(Atom::Constant(i), stream.next_circle_point());
            }
            assert_eq!(found.value(&point), written.value(&point));
        }
    }
}
