//! Factors of polynomials in the constants that trial division finds: a number, a monomial, and linear factors with
//! small coefficients. The rest stays a sum, so that the product always equals the polynomial.

use std::collections::{BTreeMap, BTreeSet};

use super::super::rational_function::{FactorVariable, PowerProduct, TrigonometricPolynomial};
use super::{content, ordered_terms};
use crate::expr::Rational;

/// A product that equals a polynomial.
pub(super) struct FactoredPolynomial {
    /// Rational factor with the sign of the leading term.
    pub(super) number: Rational,
    /// Common powers of all terms.
    pub(super) monomial: PowerProduct,
    /// Polynomials of several terms with their exponents.
    pub(super) factors: Vec<(TrigonometricPolynomial, u32)>,
}

/// Most terms of a polynomial whose factors are searched; beyond this the search is slow and the result is not
/// readable.
const MOST_TERMS: usize = 60;
/// Most variables of such a polynomial.
const MOST_VARIABLES: usize = 7;

/// Factors a polynomial. The zero polynomial has the number 0 and no factors.
pub(super) fn factor_polynomial(p: &TrigonometricPolynomial) -> FactoredPolynomial {
    let mut number = content(p);
    let Some((_, leading)) = ordered_terms(p).into_iter().next() else {
        return FactoredPolynomial {
            number: Rational::ZERO,
            monomial: PowerProduct::new(),
            factors: Vec::new(),
        };
    };
    // The leading term of the remaining polynomial is positive.
    if leading.is_negative() {
        number = -&number;
    }
    // Number and common powers are divided out first.
    let monomial = common_powers(p);
    let inverse = number.recip();
    let mut rest: TrigonometricPolynomial = p
        .iter()
        .map(|(powers, k)| {
            let left = divide_powers(powers, &monomial).expect("a common power divides");
            (left, k * &inverse)
        })
        .collect();
    // Each candidate is divided out as often as possible.
    let mut factors: Vec<(TrigonometricPolynomial, u32)> = Vec::new();
    // Variables that the remaining polynomial contains.
    let names: BTreeSet<FactorVariable> = rest.keys().flatten().map(|(v, _)| *v).collect();
    if rest.len() <= MOST_TERMS && names.len() <= MOST_VARIABLES {
        for divisor in linear_form_candidates(&names.into_iter().collect::<Vec<_>>()) {
            let mut n = 0;
            while rest.len() > 1 {
                let Some(quotient) = exact_quotient(&rest, &divisor) else {
                    break;
                };
                rest = quotient;
                n += 1;
            }
            if n > 0 {
                factors.push((divisor, n));
            }
        }
    }
    // Division by primitive factors leaves a primitive rest: 1, -1 or a sum.
    match (rest.len(), rest.get(&PowerProduct::new())) {
        (1, Some(unit)) => number = &number * unit,
        _ => factors.push((rest, 1)),
    }
    FactoredPolynomial {
        number,
        monomial,
        factors,
    }
}

/// The powers that all terms have in common.
fn common_powers(p: &TrigonometricPolynomial) -> PowerProduct {
    p.keys()
        .map(|powers| powers.iter().copied().collect::<BTreeMap<_, _>>())
        .reduce(|a, b| {
            a.into_iter()
                .filter_map(|(v, n)| b.get(&v).map(|m| (v, n.min(*m))))
                .collect()
        })
        .unwrap_or_default()
        .into_iter()
        .collect()
}

/// The quotient of two monomials, if it is a monomial.
fn divide_powers(powers: &PowerProduct, by: &PowerProduct) -> Option<PowerProduct> {
    // Exponents that remain.
    let mut left: BTreeMap<FactorVariable, u32> = powers.iter().copied().collect();
    for (v, n) in by {
        let there = left.get_mut(v)?;
        *there = there.checked_sub(*n)?;
    }
    Some(left.into_iter().filter(|(_, n)| *n > 0).collect())
}

/// The product of two monomials.
fn multiply_powers(a: &PowerProduct, b: &PowerProduct) -> PowerProduct {
    let mut total: BTreeMap<FactorVariable, u32> = a.iter().copied().collect();
    for (v, n) in b {
        *total.entry(*v).or_insert(0) += n;
    }
    total.into_iter().collect()
}

/// Candidates for linear factors: `a u + b v` with coefficients up to 2, and `u + v + w` with all signs.
fn linear_form_candidates(variables: &[FactorVariable]) -> Vec<TrigonometricPolynomial> {
    // A linear form from variables and coefficients.
    let linear = |terms: &[(FactorVariable, i64)]| -> TrigonometricPolynomial {
        terms
            .iter()
            .map(|(v, k)| (vec![(*v, 1)], Rational::integer(*k)))
            .collect()
    };
    let mut found = Vec::new();
    for (i, u) in variables.iter().enumerate() {
        for (j, v) in variables.iter().enumerate().skip(i + 1) {
            for (a, b) in [(1, 1), (1, -1), (2, 1), (2, -1), (1, 2), (1, -2)] {
                found.push(linear(&[(*u, a), (*v, b)]));
            }
            for w in &variables[j + 1..] {
                for (b, c) in [(1, 1), (1, -1), (-1, 1), (-1, -1)] {
                    found.push(linear(&[(*u, 1), (*v, b), (*w, c)]));
                }
            }
        }
    }
    found
}

/// The leading term in the lexicographic order of variables, which is compatible with products.
fn leading_term(p: &TrigonometricPolynomial) -> Option<(&PowerProduct, &Rational)> {
    p.iter().max_by(|(a, _), (b, _)| super::compare_powers(b, a))
}

/// The quotient of two polynomials, if the division has no remainder.
fn exact_quotient(p: &TrigonometricPolynomial, by: &TrigonometricPolynomial) -> Option<TrigonometricPolynomial> {
    // Polynomial long division by leading terms.
    let (lead, k) = leading_term(by)?;
    let inverse = k.recip();
    let mut rest = p.clone();
    let mut quotient = TrigonometricPolynomial::new();
    // The leading term of the rest must be divisible by that of the divisor.
    while let Some((powers, value)) = leading_term(&rest) {
        let step = divide_powers(powers, lead)?;
        let value = value * &inverse;
        for (other, k) in by {
            // The divisor times the step is subtracted from the rest.
            let at = multiply_powers(&step, other);
            let there = rest.remove(&at).unwrap_or(Rational::ZERO);
            let left = &there - &(&value * k);
            if !left.is_zero() {
                rest.insert(at, left);
            }
        }
        quotient.insert(step, value);
    }
    Some(quotient)
}

/// `number * (sum of linear)^2`, and the terms of a polynomial that it consists of.
pub(super) struct SumSquare {
    /// Rational factor.
    pub(super) number: Rational,
    /// Variables with their coefficients; the first one is 1.
    pub(super) linear: Vec<(FactorVariable, Rational)>,
    /// Terms of the polynomial that the square stands for.
    pub(super) terms: Vec<PowerProduct>,
}

/// Squares of sums of several variables that a polynomial contains with all their terms.
pub(super) fn find_squares(p: &TrigonometricPolynomial) -> Vec<SumSquare> {
    let coefficient = |powers: &PowerProduct| p.get(powers).cloned().unwrap_or(Rational::ZERO);
    // Coefficient of a mixed term.
    let cross = |u: FactorVariable, v: FactorVariable| coefficient(&vec![(u.min(v), 1), (u.max(v), 1)]);
    // Variables with a pure square are candidates.
    let mut variables: Vec<FactorVariable> = p
        .keys()
        .filter_map(|powers| match powers.as_slice() {
            [(v, 2)] => Some(*v),
            _ => None,
        })
        .collect();
    variables.sort();
    let mut found = Vec::new();
    while !variables.is_empty() {
        // The first variable fixes the coefficients of all others by its mixed terms.
        let first = variables.remove(0);
        // The number in front of the square.
        let number = coefficient(&vec![(first, 2)]);
        // A mixed term has twice the product of the coefficients.
        let half = (&number * &Rational::integer(2)).recip();
        let mut linear = vec![(first, Rational::ONE)];
        for v in &variables {
            let k = &cross(first, *v) * &half;
            if !k.is_zero() {
                linear.push((*v, k));
            }
        }
        // All squares and mixed terms must match.
        let whole = linear.iter().enumerate().all(|(i, (u, k))| {
            coefficient(&vec![(*u, 2)]) == &number * &(k * k)
                && linear[i + 1..]
                    .iter()
                    .all(|(v, l)| cross(*u, *v) == &(&number * &Rational::integer(2)) * &(k * l))
        });
        if linear.len() < 2 || !whole {
            continue;
        }
        // A variable belongs to one square only.
        variables.retain(|v| linear.iter().all(|(u, _)| u != v));
        // Terms that the square replaces.
        let mut terms = Vec::new();
        for (i, (u, _)) in linear.iter().enumerate() {
            terms.push(vec![(*u, 2)]);
            for (v, _) in &linear[i + 1..] {
                terms.push(vec![(*u.min(v), 1), (*u.max(v), 1)]);
            }
        }
        found.push(SumSquare { number, linear, terms });
    }
    found
}
