//! Polynomials in several unknowns with rational coefficients, and the order of their terms.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use num_rational::BigRational;
use num_traits::{One, ToPrimitive, Zero};

/// Exponents of a term, one per unknown, in graded reverse lexicographic order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TermExponents(pub Vec<u32>);

impl TermExponents {
    /// The term 1 in `n` unknowns.
    pub fn unit_term(n: usize) -> Self {
        Self(vec![0; n])
    }

    /// Unknown `i` of `n`, to the first power.
    pub fn unknown(n: usize, i: usize) -> Self {
        let mut powers = Self::unit_term(n);
        powers.0[i] = 1;
        powers
    }

    /// Sum of all exponents.
    pub fn degree(&self) -> u32 {
        self.0.iter().sum()
    }

    /// The product of two terms.
    #[must_use]
    pub fn times(&self, other: &Self) -> Self {
        Self(self.0.iter().zip(&other.0).map(|(a, b)| a + b).collect())
    }

    /// `self / divisor`, if it is a term.
    pub fn quotient(&self, divisor: &Self) -> Option<Self> {
        let pairs = self.0.iter().zip(&divisor.0);
        pairs.map(|(a, b)| a.checked_sub(*b)).collect::<Option<_>>().map(Self)
    }

    /// The least term that both divide.
    #[must_use]
    pub fn least_common_multiple(&self, other: &Self) -> Self {
        Self(self.0.iter().zip(&other.0).map(|(a, b)| *a.max(b)).collect())
    }
}

impl PartialOrd for TermExponents {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for TermExponents {
    // The degree decides first; among equal degrees the term with the smaller exponent of the last unknown is greater.
    fn cmp(&self, other: &Self) -> Ordering {
        let by_degree = self.degree().cmp(&other.degree());
        by_degree.then_with(|| {
            let pairs = self.0.iter().zip(&other.0).rev();
            pairs
                .map(|(a, b)| b.cmp(a))
                .find(|order| order.is_ne())
                .unwrap_or(Ordering::Equal)
        })
    }
}

/// A polynomial in `n` unknowns with exact coefficients, none of them zero: a sum of terms in their order.
///
/// ```
/// use modelmill_algebra::polynomial::{Polynomial, exact_decimal};
/// let mut p = Polynomial::new(2);
/// p.add_term(&[(0, 1), (1, 2)], &exact_decimal(0.5));
/// p.add_term(&[], &exact_decimal(3.0));
/// assert_eq!(p.value(&[4.0, 3.0]), 21.0);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Polynomial {
    /// Terms with their coefficients, in ascending order.
    pub terms: BTreeMap<TermExponents, BigRational>,
    /// Number of unknowns.
    pub n: usize,
}

impl Polynomial {
    /// Zero, in `n` unknowns.
    pub fn new(n: usize) -> Self {
        Self {
            terms: BTreeMap::new(),
            n,
        }
    }

    /// Adds `factor` times a product of powers of unknowns, `(unknown, exponent)`.
    pub fn add_term(&mut self, powers: &[(usize, u32)], factor: &BigRational) {
        let mut term = TermExponents::unit_term(self.n);
        for (i, exponent) in powers {
            term.0[*i] += exponent;
        }
        self.add(term, factor);
    }

    /// Adds `factor` times a term.
    pub fn add(&mut self, term: TermExponents, factor: &BigRational) {
        if factor.is_zero() {
            return;
        }
        let entry = self.terms.entry(term);
        let slot = entry.or_insert_with(BigRational::zero);
        *slot += factor;
        if slot.is_zero() {
            self.terms.retain(|_, factor| !factor.is_zero());
        }
    }

    /// Adds `factor * shift * other`.
    pub fn add_shifted(&mut self, other: &Self, shift: &TermExponents, factor: &BigRational) {
        for (term, k) in &other.terms {
            self.add(term.times(shift), &(k * factor));
        }
    }

    /// The greatest term with its coefficient; `None` for the polynomial zero.
    pub fn leading_term(&self) -> Option<(&TermExponents, &BigRational)> {
        self.terms.last_key_value()
    }

    /// Degree of its greatest term; 0 for zero.
    pub fn degree(&self) -> u32 {
        self.leading_term().map_or(0, |(term, _)| term.degree())
    }

    /// Divides by the leading coefficient; zero stays zero.
    pub fn make_monic(&mut self) {
        let Some((_, leading)) = self.leading_term() else {
            return;
        };
        let inverse = leading.recip();
        for factor in self.terms.values_mut() {
            *factor *= &inverse;
        }
    }

    /// Its derivative by an unknown.
    #[must_use]
    pub fn derivative(&self, i: usize) -> Self {
        let mut derivative = Self::new(self.n);
        for (term, factor) in &self.terms {
            if term.0[i] > 0 {
                let mut lower = term.clone();
                lower.0[i] -= 1;
                let exponent = BigRational::from_integer(term.0[i].into());
                derivative.add(lower, &(factor * exponent));
            }
        }
        derivative
    }

    /// Whether an unknown occurs in it.
    pub fn has_unknown(&self, i: usize) -> bool {
        self.terms.keys().any(|term| term.0[i] > 0)
    }

    /// Its value in double precision, for values of all unknowns.
    pub fn value(&self, at: &[f64]) -> f64 {
        let terms = self.terms.iter();
        terms
            .map(|(term, factor)| {
                let exponents = term.0.iter().zip(at);
                exponents.fold(nearest_f64(factor), |product, (n, x)| {
                    product * x.powi(i32::try_from(*n).unwrap_or(i32::MAX))
                })
            })
            .sum()
    }

    /// Its exact value, for exact values of all unknowns.
    pub fn exact_value(&self, at: &[BigRational]) -> BigRational {
        let mut sum = BigRational::zero();
        for (term, factor) in &self.terms {
            let mut product = factor.clone();
            for (n, x) in term.0.iter().zip(at) {
                for _ in 0..*n {
                    product *= x;
                }
            }
            sum += product;
        }
        sum
    }
}

/// The decimal number that a value is printed as: 1.13 means 113/100 and not the nearest binary fraction.
///
/// The value must be finite.
pub fn exact_decimal(value: f64) -> BigRational {
    assert!(value.is_finite(), "{value} is not finite");
    let text = format!("{value:e}");
    let (digits, exponent) = text.split_once('e').expect("an exponent is printed");
    let exponent: i32 = exponent.parse().expect("a small exponent");
    let decimals = digits.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    let digits: num_bigint::BigInt = digits.replace('.', "").parse().expect("digits");
    let power = exponent - i32::try_from(decimals).expect("at most 17 decimals");
    let ten = num_bigint::BigInt::from(10).pow(power.unsigned_abs());
    if power < 0 {
        BigRational::new(digits, ten)
    } else {
        BigRational::from_integer(digits * ten)
    }
}

/// The nearest double; NaN if it has none.
pub fn nearest_f64(value: &BigRational) -> f64 {
    value.to_f64().unwrap_or(f64::NAN)
}

/// Unknown `i` of `n` as a polynomial.
pub fn unknown_polynomial(n: usize, i: usize) -> Polynomial {
    let mut polynomial = Polynomial::new(n);
    polynomial.add(TermExponents::unknown(n, i), &BigRational::one());
    polynomial
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimals_are_taken_as_they_are_printed() {
        assert_eq!(exact_decimal(1.13), BigRational::new(113.into(), 100.into()));
        assert_eq!(exact_decimal(-2.5e-7), BigRational::new((-1).into(), 4_000_000.into()));
        assert_eq!(
            exact_decimal(3e20),
            BigRational::from_integer(300_000_000_000_000_000_000_i128.into())
        );
        assert_eq!(nearest_f64(&exact_decimal(0.1)).to_bits(), 0.1_f64.to_bits());
    }
}
