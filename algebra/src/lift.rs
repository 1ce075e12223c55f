//! Rational numbers from their residues modulo several primes (Chinese remainders, then Monagan 2004).

use num_bigint::{BigInt, Sign};
use num_rational::BigRational;
use num_traits::{One, Signed, Zero};

use crate::Rational;

/// Number of bits by which the residues must exceed the rational: a random residue passes with a probability of 2^-30.
const MARGIN: u64 = 30;

/// The rational of smallest size with the given residues `(prime, residue)`; `None` if it is not so much smaller than
/// the product of the primes that this cannot be chance.
pub fn reconstruct_rational(residues: &[(u64, u64)]) -> Option<Rational> {
    let (modulus, residue) = combine_residues(residues);
    let bits = modulus.bits();
    // Every step of Euclid's algorithm gives a quotient r1/t1 with this residue. The smallest one is clearly smaller
    // than the others (Monagan 2004).
    let (mut r0, mut r1) = (modulus, residue);
    let (mut t0, mut t1) = (BigInt::zero(), BigInt::one());
    let mut best: Option<(u64, BigInt, BigInt)> = None;
    loop {
        let size = r1.bits() + t1.bits();
        if best.as_ref().is_none_or(|(least, ..)| size < *least) {
            best = Some((size, r1.clone(), t1.clone()));
        }
        if r1.is_zero() {
            break;
        }
        let quotient = &r0 / &r1;
        (r0, r1) = {
            let rest = r0 - &quotient * &r1;
            (r1, rest)
        };
        (t0, t1) = {
            let rest = t0 - &quotient * &t1;
            (t1, rest)
        };
    }
    // The sign belongs to the numerator.
    let (_, numerator, denominator) = best.filter(|(size, ..)| size + MARGIN <= bits)?;
    let sign = if denominator.sign() == Sign::Minus {
        -BigInt::one()
    } else {
        BigInt::one()
    };
    Some(Rational::from(BigRational::new(sign * numerator, denominator.abs())))
}

/// Product of the primes, and the number below it that has all the residues (Chinese remainder theorem).
fn combine_residues(residues: &[(u64, u64)]) -> (BigInt, BigInt) {
    let (mut modulus, mut value) = (BigInt::one(), BigInt::zero());
    for &(prime, residue) in residues {
        let prime = BigInt::from(prime);
        // value + modulus * k = residue (mod prime), k by Fermat's inverse
        let inverse = modulus.modpow(&(&prime - 2), &prime);
        let gap = ((BigInt::from(residue) - &value) * inverse) % &prime;
        let gap = if gap.is_negative() { gap + &prime } else { gap };
        value += &modulus * gap;
        modulus *= prime;
    }
    (modulus, value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::{FieldElement, PRIMES};

    fn residues(value: &Rational, n: usize) -> Vec<(u64, u64)> {
        fn residue<const P: u64>(value: &Rational) -> (u64, u64) {
            let element = FieldElement::<P>::from_rational(value).unwrap();
            (P, element.representative())
        }
        [
            residue::<{ PRIMES[0] }>(value),
            residue::<{ PRIMES[1] }>(value),
            residue::<{ PRIMES[2] }>(value),
        ][..n]
            .to_vec()
    }

    #[test]
    fn rationals_come_back_as_soon_as_there_are_digits_enough() {
        for (n, d, primes) in [
            (0, 1, 1),
            (1, 1, 1),
            (-7, 3, 1),
            (12_345, 678, 1),
            (-4318 * 4318, 100_000_000, 2),
            (432_182_371, 10_000_000_000_001, 2),
            (7_654_321_987_654_321_987, 3, 2),
            (7_654_321_987_654_321_987, 7_123_456_789_123_456_789, 3),
        ] {
            let value = Rational::new(n, d);
            for k in 1..=3 {
                let found = reconstruct_rational(&residues(&value, k));
                assert_eq!(found, (k >= primes).then(|| value.clone()), "{n}/{d}, {k}");
            }
        }
    }
}
