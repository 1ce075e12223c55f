//! The prime fields in which linear dependence is decided: integers modulo a prime, with random elements.
//!
//! The moduli are just below 2^61 and are 23 modulo 24, so a square root is a single power. The primes up to 13 have
//! roots in all of them. So the sines and cosines of all multiples of pi/12 exist there, and most square roots in model
//! files. One field is sufficient for everything except long coefficients, for which the other fields give additional
//! digits.

mod extension;
mod number;

use std::ops::{Add, Mul, Neg, Sub};

use modelmill_runtime::{RandomBits, scramble_bits};

use num_bigint::BigInt;
use num_traits::{Signed, ToPrimitive};

pub use extension::ExtensionElement;
pub use number::FieldNumber;

use crate::Rational;

/// The moduli, in the order in which they are used.
pub const PRIMES: [u64; 8] = [
    (1 << 61) - 11_913,
    (1 << 61) - 14_241,
    (1 << 61) - 20_961,
    (1 << 61) - 21_633,
    (1 << 61) - 23_481,
    (1 << 61) - 26_961,
    (1 << 61) - 27_033,
    (1 << 61) - 30_873,
];

/// The modulus that is used by default.
pub const MODULUS: u64 = PRIMES[0];

/// An element of the field with `P` elements, stored as a number below `P`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct FieldElement<const P: u64 = MODULUS>(u64);

impl<const P: u64> FieldElement<P> {
    /// 0
    pub const ZERO: Self = Self(0);
    /// 1
    pub const ONE: Self = Self(1);

    /// The element congruent to an integer.
    pub fn from_i64(value: i64) -> Self {
        let magnitude = Self(value.unsigned_abs() % P);
        if value < 0 { -magnitude } else { magnitude }
    }

    /// The smallest non-negative representative.
    pub fn representative(self) -> u64 {
        self.0
    }

    /// The element congruent to a rational; `None` if the modulus divides its denominator.
    pub fn from_rational(value: &Rational) -> Option<Self> {
        if let Some((n, d)) = value.as_small() {
            let n = Self::from_i64(n);
            return if d == 1 {
                Some(n)
            } else {
                Some(n * Self::from_i64(d).inverse()?)
            };
        }
        let big = value.to_big();
        let reduce = |n: &BigInt| {
            let magnitude = (n.abs() % BigInt::from(P)).to_u64().expect("a remainder fits");
            if n.is_negative() {
                -Self(magnitude)
            } else {
                Self(magnitude)
            }
        };
        Some(reduce(big.numer()) * reduce(big.denom()).inverse()?)
    }

    /// Power with a non-negative exponent.
    #[must_use]
    pub fn power(self, mut exponent: u64) -> Self {
        let (mut base, mut result) = (self, Self::ONE);
        // Repeated squaring.
        while exponent > 0 {
            if exponent & 1 == 1 {
                result = result * base;
            }
            base = base * base;
            exponent >>= 1;
        }
        result
    }

    /// Multiplicative inverse; `None` for 0.
    pub fn inverse(self) -> Option<Self> {
        if self.0 == 0 {
            return None;
        }
        // Extended Euclid: far fewer steps than a power with 61 bits. The cofactors stay below the modulus.
        let (mut r0, mut r1) = (P, self.0);
        let (mut t0, mut t1) = (0_i64, 1_i64);
        while r1 != 0 {
            let q = r0 / r1;
            (r0, r1) = (r1, r0 - q * r1);
            let q = i64::try_from(q).expect("a quotient below 2^61");
            (t0, t1) = (t1, t0 - q * t1);
        }
        // The cofactor lies between -P and P.
        let inverse = Self(t0.unsigned_abs() % P);
        Some(if t0 < 0 { -inverse } else { inverse })
    }

    /// A square root, if there is one; one of two for all elements but zero.
    pub fn square_root(self) -> Option<Self> {
        // For P = 3 modulo 4 this power is a root of every square.
        let root = self.power(P.div_ceil(4));
        (root * root == self).then_some(root)
    }
}

/// The element congruent to a number below 2^124. As `P` is just below 2^61, the upper bits are folded onto the lower
/// ones.
#[inline]
fn reduce<const P: u64>(x: u128) -> FieldElement<P> {
    // The lower 61 bits.
    const MASK: u64 = (1 << 61) - 1;
    let excess = (1 << 61) - P;
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the low bits are meant, and the high ones are below 2^63"
    )]
    let halves = |x: u128| (x as u64 & MASK, (x >> 61) as u64);
    let (low, high) = halves(x);
    // Below 2^78, so that the second fold takes words alone.
    let (low, high) = halves(u128::from(low) + u128::from(high) * u128::from(excess));
    let x = low + high * excess;
    FieldElement(if x >= P { x - P } else { x })
}

impl<const P: u64> FieldElement<P> {
    /// `self + a * b`, with one reduction.
    #[inline]
    #[must_use]
    pub fn plus_product(self, a: Self, b: Self) -> Self {
        reduce(u128::from(self.0) + u128::from(a.0) * u128::from(b.0))
    }

    /// Adds multiples `factor * row` to a row of numbers.
    pub(crate) fn add_multiples(to: &mut [Self], multiples: &[(Self, &[Self])]) {
        /// So many products and one number fit into 128 bits.
        const MOST: usize = 60;
        for group in multiples.chunks(MOST) {
            let mut sums: Vec<u128> = to.iter().map(|x| u128::from(x.0)).collect();
            for (factor, row) in group {
                for (sum, x) in sums.iter_mut().zip(*row) {
                    *sum += u128::from(factor.0) * u128::from(x.0);
                }
            }
            let excess = u128::from((1 << 61) - P);
            for (x, sum) in to.iter_mut().zip(sums) {
                *x = reduce((sum & ((1 << 61) - 1)) + (sum >> 61) * excess);
            }
        }
    }

    /// `a * b + c * d`, with one reduction.
    #[inline]
    fn sum_of_products([a, b]: [Self; 2], [c, d]: [Self; 2]) -> Self {
        reduce(u128::from(a.0) * u128::from(b.0) + u128::from(c.0) * u128::from(d.0))
    }
}

impl<const P: u64> Add for FieldElement<P> {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        let sum = self.0 + other.0;
        Self(if sum >= P { sum - P } else { sum })
    }
}

impl<const P: u64> Sub for FieldElement<P> {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl<const P: u64> Neg for FieldElement<P> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self(if self.0 == 0 { 0 } else { P - self.0 })
    }
}

impl<const P: u64> Mul for FieldElement<P> {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        reduce(u128::from(self.0) * u128::from(other.0))
    }
}

/// A reproducible stream of random elements (SplitMix64, Steele 2014): the same seed gives the same model text on every
/// machine.
#[derive(Clone, Debug)]
pub struct RandomStream(RandomBits);

impl RandomStream {
    /// A stream that starts from a seed.
    pub fn new(seed: u64) -> Self {
        Self(RandomBits::new(seed))
    }

    /// The next 64 bits.
    pub fn next_bits(&mut self) -> u64 {
        self.0.bits()
    }

    /// The next element, uniformly distributed to within 2^-52.
    pub fn next_element<const P: u64>(&mut self) -> FieldElement<P> {
        reduce((u128::from(self.next_bits()) << 50) ^ u128::from(self.next_bits()))
    }

    /// A point (cosine, sine) of the unit circle, from its rational parametrisation.
    pub fn next_circle_point<const P: u64>(&mut self) -> (FieldElement<P>, FieldElement<P>) {
        let t: FieldElement<P> = self.next_element();
        // -1 is not a square in the field, so 1 + t^2 has an inverse.
        let scale = (FieldElement::ONE + t * t)
            .inverse()
            .expect("-1 is no square modulo a prime that is 3 modulo 4");
        ((FieldElement::ONE - t * t) * scale, (t + t) * scale)
    }
}

/// A pseudorandom element that depends on `key` and `seed` alone.
pub fn hash_element<const P: u64>(seed: u64, key: FieldElement<P>) -> FieldElement<P> {
    let mut stream = RandomStream::new(scramble_bits(seed ^ scramble_bits(key.0)));
    stream.next_element()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn laws<const P: u64>() {
        let mut stream = RandomStream::new(7);
        for _ in 0..500 {
            let (a, b, c): (FieldElement<P>, FieldElement<P>, FieldElement<P>) =
                (stream.next_element(), stream.next_element(), stream.next_element());
            assert_eq!(a * (b + c), a * b + a * c);
            assert_eq!((a - b) + b, a);
            assert_eq!(a * a.inverse().unwrap(), FieldElement::ONE);
            assert_eq!((a * a).square_root().map(|r| r * r), Some(a * a));
            let wide = u128::from(a.0) * u128::from(b.0) % u128::from(P);
            assert_eq!(u128::from((a * b).0), wide);
            assert_eq!(c.plus_product(a, b), c + a * b);
            let (cos, sin) = stream.next_circle_point::<P>();
            assert_eq!(cos * cos + sin * sin, FieldElement::ONE);
        }
        for n in [2, 3, 5, 7, 11, 13] {
            assert!(FieldElement::<P>::from_i64(n).square_root().is_some());
        }
        assert!(FieldElement::<P>::from_i64(-1).square_root().is_none());
        let largest = FieldElement::<P>(P - 1);
        assert_eq!(largest * largest, FieldElement::ONE);
        let mut row = [largest; 3];
        let largest_row = [largest; 3];
        let others = [(largest, largest_row.as_slice()); 150];
        FieldElement::add_multiples(&mut row, &others);
        assert_eq!(row, [FieldElement::from_i64(149); 3]);
        let two = FieldElement::sum_of_products([largest, largest], [largest, largest]);
        assert_eq!(two, FieldElement::from_i64(2));
    }

    #[test]
    fn every_modulus_makes_a_field_with_the_roots_that_are_promised() {
        laws::<{ PRIMES[0] }>();
        laws::<{ PRIMES[1] }>();
        laws::<{ PRIMES[2] }>();
        laws::<{ PRIMES[3] }>();
        laws::<{ PRIMES[4] }>();
        laws::<{ PRIMES[5] }>();
        laws::<{ PRIMES[6] }>();
        laws::<{ PRIMES[7] }>();
    }
}
