//! All real roots of a polynomial in one unknown: exact coefficients go in, and intervals with one root each come out,
//! as narrow as requested.
//!
//! Sturm's theorem (D. E. Knuth, "The Art of Computer Programming", 4.6.1 and exercise 22 of 4.6.2).

use num_rational::BigRational;
use num_traits::{One, Signed, Zero};

/// Coefficients, the constant first, the last of them not zero; empty for the polynomial zero.
pub type UnivariatePolynomial = Vec<BigRational>;

/// A closed interval with exact ends.
#[derive(Clone, Debug, PartialEq)]
pub struct RationalInterval {
    /// Lower end, part of the interval.
    pub low: BigRational,
    /// Upper end, part of the interval.
    pub high: BigRational,
}

impl RationalInterval {
    /// `high - low`
    pub fn width(&self) -> BigRational {
        &self.high - &self.low
    }

    /// The centre of the interval.
    pub fn middle(&self) -> BigRational {
        (&self.low + &self.high) / BigRational::from_integer(2.into())
    }

    /// An interval that contains all values of a polynomial on this one, by Horner's rule. It may be too wide, but
    /// never too narrow.
    #[must_use]
    pub fn image(&self, polynomial: &[BigRational]) -> Self {
        let zero = BigRational::zero();
        let mut image = Self {
            low: zero.clone(),
            high: zero,
        };
        // Interval arithmetic: the product of two intervals lies between its extreme corner products.
        for coefficient in polynomial.iter().rev() {
            let products = [
                &image.low * &self.low,
                &image.low * &self.high,
                &image.high * &self.low,
                &image.high * &self.high,
            ];
            let least = products.iter().min().expect("four products").clone();
            let greatest = products.iter().max().expect("four products").clone();
            image = Self {
                low: least + coefficient,
                high: greatest + coefficient,
            };
        }
        image
    }
}

/// The real roots of a polynomial without multiple roots, each in a separate interval.
pub fn isolate_roots(polynomial: &[BigRational]) -> Vec<RationalInterval> {
    let chain = sturm_chain(polynomial);
    if polynomial.len() < 2 {
        return Vec::new();
    }
    // Cauchy's bound of the magnitudes of all roots.
    let leading = polynomial.last().expect("not empty").abs();
    let largest = polynomial.iter().map(Signed::abs).max().expect("not empty");
    let bound = BigRational::one() + (largest / leading).ceil();
    let mut roots = Vec::new();
    let whole = RationalInterval {
        low: -bound.clone(),
        high: bound,
    };
    let mut open = vec![whole];
    while let Some(interval) = open.pop() {
        // Sturm's theorem: the number of roots in (low, high].
        let count = sign_variations(&chain, &interval.low) - sign_variations(&chain, &interval.high);
        match count {
            // Intervals with several roots are halved until each has one.
            0 => {}
            1 => roots.push(interval),
            _ => {
                let middle = interval.middle();
                open.push(RationalInterval {
                    low: middle.clone(),
                    high: interval.high,
                });
                open.push(RationalInterval {
                    low: interval.low,
                    high: middle,
                });
            }
        }
    }
    roots
}

/// Halves an interval `(low, high]` that contains one simple root.
pub fn halve_interval(polynomial: &[BigRational], interval: &mut RationalInterval) {
    // A root at the upper end is exact.
    let at_high = value(polynomial, &interval.high);
    if at_high.is_zero() {
        interval.low = interval.high.clone();
        return;
    }
    let middle = interval.middle();
    let at_middle = value(polynomial, &middle);
    if at_middle.is_zero() {
        interval.low = middle.clone();
        interval.high = middle;
    // The half whose ends have different signs contains the root.
    } else if at_middle.is_positive() == at_high.is_positive() {
        interval.high = middle;
    } else {
        interval.low = middle;
    }
}

/// The polynomial with the same roots, each of them simple.
pub fn squarefree_part(polynomial: &[BigRational]) -> UnivariatePolynomial {
    let common = gcd(polynomial.to_vec(), derivative(polynomial));
    divide(polynomial, &common).0
}

/// Whether all roots are simple.
pub fn is_squarefree(polynomial: &[BigRational]) -> bool {
    gcd(polynomial.to_vec(), derivative(polynomial)).len() <= 1
}

/// Value by Horner's rule.
fn value(polynomial: &[BigRational], x: &BigRational) -> BigRational {
    let coefficients = polynomial.iter().rev();
    coefficients.fold(BigRational::zero(), |value, k| value * x + k)
}

/// Coefficients of the derivative.
fn derivative(polynomial: &[BigRational]) -> UnivariatePolynomial {
    let terms = polynomial.iter().enumerate().skip(1);
    terms.map(|(n, k)| k * BigRational::from_integer(n.into())).collect()
}

/// The polynomial divided by the magnitude of its leading coefficient, so that remainders stay short; signs are kept.
fn primitive_part(mut polynomial: UnivariatePolynomial) -> UnivariatePolynomial {
    if let Some(leading) = polynomial.last().map(Signed::abs) {
        for k in &mut polynomial {
            *k /= &leading;
        }
    }
    polynomial
}

/// Quotient and remainder of a division; the divisor must not be zero.
fn divide(polynomial: &[BigRational], by: &[BigRational]) -> (UnivariatePolynomial, UnivariatePolynomial) {
    let mut rest = polynomial.to_vec();
    let leading = by.last().expect("no division by zero");
    let steps = (rest.len() + 1).saturating_sub(by.len());
    let mut quotient = vec![BigRational::zero(); steps];
    // From the highest power down, one coefficient of the quotient at a time.
    for shift in (0..steps).rev() {
        let factor = &rest[shift + by.len() - 1] / leading;
        for (k, coefficient) in by.iter().enumerate() {
            let change = &factor * coefficient;
            rest[shift + k] -= change;
        }
        quotient[shift] = factor;
    }
    while rest.last().is_some_and(Zero::is_zero) {
        rest.pop();
    }
    (quotient, rest)
}

/// A greatest common divisor, by Euclid's algorithm.
fn gcd(mut a: UnivariatePolynomial, mut b: UnivariatePolynomial) -> UnivariatePolynomial {
    while !b.is_empty() {
        let (_, rest) = divide(&a, &b);
        a = b;
        b = primitive_part(rest);
    }
    a
}

/// Sturm's chain: the polynomial, its derivative, and the negative remainders of each pair.
fn sturm_chain(polynomial: &[BigRational]) -> Vec<UnivariatePolynomial> {
    let mut chain = vec![
        primitive_part(polynomial.to_vec()),
        primitive_part(derivative(polynomial)),
    ];
    while let [.., a, b] = chain.as_slice()
        && !b.is_empty()
    {
        let (_, rest) = divide(a, b);
        chain.push(primitive_part(rest.into_iter().map(|k| -k).collect()));
    }
    chain
}

/// Number of changes of sign along the chain at `x`, without zeros.
fn sign_variations(chain: &[UnivariatePolynomial], x: &BigRational) -> usize {
    let signs: Vec<bool> = chain
        .iter()
        .map(|p| value(p, x))
        .filter(|v| !v.is_zero())
        .map(|v| v.is_positive())
        .collect();
    signs.windows(2).filter(|pair| pair[0] != pair[1]).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn from_roots(roots: &[(i64, i64)]) -> UnivariatePolynomial {
        let mut product = vec![BigRational::one()];
        for (n, d) in roots {
            let root = BigRational::new((*n).into(), (*d).into());
            let mut next = vec![BigRational::zero(); product.len() + 1];
            for (k, coefficient) in product.iter().enumerate() {
                next[k + 1] += coefficient;
                next[k] -= coefficient * &root;
            }
            product = next;
        }
        product
    }

    #[test]
    fn every_real_root_has_an_interval_of_its_own() {
        let roots = [(-7, 2), (0, 1), (1, 3), (333_334, 1_000_000), (12, 1)];
        // (x^2 + 1) has no real roots.
        let plain = from_roots(&roots);
        let mut polynomial = vec![BigRational::zero(); plain.len() + 2];
        for (k, coefficient) in plain.iter().enumerate() {
            polynomial[k] += coefficient;
            polynomial[k + 2] += coefficient;
        }
        let found = isolate_roots(&polynomial);
        assert_eq!(found.len(), roots.len());
        for (mut interval, (n, d)) in found.into_iter().zip(roots) {
            let root = BigRational::new(n.into(), d.into());
            for _ in 0..60 {
                halve_interval(&polynomial, &mut interval);
                assert!(interval.low <= root && root <= interval.high);
            }
            assert!(interval.width() < BigRational::new(1.into(), (1_u64 << 50).into()));
        }
    }

    #[test]
    fn multiple_roots_become_simple() {
        let polynomial = from_roots(&[(1, 2), (1, 2), (1, 2), (-3, 1)]);
        assert!(!is_squarefree(&polynomial));
        let simple = squarefree_part(&polynomial);
        assert!(is_squarefree(&simple));
        assert_eq!(isolate_roots(&simple).len(), 2);
    }
}
