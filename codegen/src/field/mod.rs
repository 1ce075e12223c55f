//! The prime field in which the mill decides what depends on what.
//!
//! The modulus is 2^61 - 465. It is 23 modulo 24, so that square roots are one power, and 2 and 3 have roots:
//! the sines and cosines of all multiples of pi/12 exist in the field.

use std::ops::{Add, Mul, Neg, Sub};

use num_bigint::BigInt;
use num_traits::{Signed, ToPrimitive};

use crate::expr::Rational;

/// The modulus.
pub const MODULUS: u64 = (1 << 61) - 465;

/// An element of the field, always below [`MODULUS`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Element(u64);

impl Element {
    /// 0
    pub const ZERO: Self = Self(0);
    /// 1
    pub const ONE: Self = Self(1);

    /// The element congruent to an integer.
    pub fn from_i64(value: i64) -> Self {
        let magnitude = Self(value.unsigned_abs() % MODULUS);
        if value < 0 { -magnitude } else { magnitude }
    }

    /// The smallest representative that is not negative.
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
            let magnitude = (n.abs() % BigInt::from(MODULUS))
                .to_u64()
                .expect("a remainder fits");
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
        // Extended Euclid: far fewer steps than a power of 61 bits.
        let (mut r0, mut r1) = (i128::from(MODULUS), i128::from(self.0));
        let (mut t0, mut t1) = (0i128, 1i128);
        while r1 != 0 {
            let q = r0 / r1;
            (r0, r1) = (r1, r0 - q * r1);
            (t0, t1) = (t1, t0 - q * t1);
        }
        u64::try_from(t0.rem_euclid(i128::from(MODULUS)))
            .ok()
            .map(Self)
    }

    /// Integer power; `None` for a negative power of 0.
    pub fn integer_power(self, exponent: i32) -> Option<Self> {
        let base = if exponent < 0 { self.inverse()? } else { self };
        Some(base.power(u64::from(exponent.unsigned_abs())))
    }

    /// A square root if there is one.
    pub fn square_root(self) -> Option<Self> {
        let root = self.power(MODULUS.div_ceil(4));
        (root * root == self).then_some(root)
    }

    /// The rational of smallest size that is congruent to it (Wang 1981), if there is one whose numerator and
    /// denominator are both below 2^29, so that it is unique.
    pub fn to_rational(self) -> Option<Rational> {
        const BOUND: i128 = 1 << 29;
        let (mut r0, mut r1) = (i128::from(MODULUS), i128::from(self.0));
        let (mut t0, mut t1) = (0i128, 1i128);
        while r1 >= BOUND {
            let q = r0 / r1;
            (r0, r1) = (r1, r0 - q * r1);
            (t0, t1) = (t1, t0 - q * t1);
        }
        if t1 == 0 || t1.abs() >= BOUND {
            return None;
        }
        let (n, d) = if t1 < 0 { (-r1, -t1) } else { (r1, t1) };
        Some(Rational::new(
            i64::try_from(n).ok()?,
            i64::try_from(d).ok()?,
        ))
    }
}

fn reduce(x: u128) -> Element {
    const MASK: u128 = (1 << 61) - 1;
    const EXCESS: u128 = (1 << 61) - MODULUS as u128;
    let x = (x & MASK) + (x >> 61) * EXCESS;
    let x = (x & MASK) + (x >> 61) * EXCESS;
    #[expect(
        clippy::cast_possible_truncation,
        reason = "below 2^62 after two folds"
    )]
    let x = x as u64;
    Element(if x >= MODULUS { x - MODULUS } else { x })
}

impl Add for Element {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let sum = self.0 + other.0;
        Self(if sum >= MODULUS { sum - MODULUS } else { sum })
    }
}

impl Sub for Element {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Neg for Element {
    type Output = Self;
    fn neg(self) -> Self {
        Self(if self.0 == 0 { 0 } else { MODULUS - self.0 })
    }
}

impl Mul for Element {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        reduce(u128::from(self.0) * u128::from(other.0))
    }
}

/// A reproducible stream of elements (SplitMix64, Steele 2014): the same seed gives the same model text on any machine.
#[derive(Clone, Debug)]
pub struct Stream(u64);

impl Stream {
    /// A stream that starts from a seed.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        mix(self.0)
    }

    /// The next element, uniformly distributed to within 2^-52.
    pub fn element(&mut self) -> Element {
        reduce((u128::from(self.bits()) << 50) ^ u128::from(self.bits()))
    }

    /// A point (cosine, sine) of the unit circle, from its rational parametrisation.
    pub fn circle(&mut self) -> (Element, Element) {
        let t = self.element();
        // -1 is not a square in the field, so 1 + t^2 has an inverse.
        let scale = (Element::ONE + t * t)
            .inverse()
            .expect("-1 is no square modulo a prime that is 3 modulo 4");
        ((Element::ONE - t * t) * scale, (t + t) * scale)
    }
}

/// A value that depends on `key` and `seed` alone and otherwise looks random.
pub fn hashed(seed: u64, key: Element) -> Element {
    let mut stream = Stream::new(mix(seed ^ mix(key.0)));
    stream.element()
}

fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn field_laws_hold_on_random_elements() {
        let mut stream = Stream::new(7);
        for _ in 0..2000 {
            let (a, b, c) = (stream.element(), stream.element(), stream.element());
            assert_eq!(a * (b + c), a * b + a * c);
            assert_eq!((a - b) + b, a);
            assert_eq!(a * a.inverse().unwrap(), Element::ONE);
            assert_eq!((a * a).square_root().map(|r| r * r), Some(a * a));
            let wide = u128::from(a.0) * u128::from(b.0) % u128::from(MODULUS);
            assert_eq!(u128::from((a * b).0), wide);
            let (cos, sin) = stream.circle();
            assert_eq!(cos * cos + sin * sin, Element::ONE);
        }
    }

    #[test]
    fn roots_of_two_and_three_exist_and_minus_one_has_none() {
        assert!(Element::from_i64(2).square_root().is_some());
        assert!(Element::from_i64(3).square_root().is_some());
        assert!(Element::from_i64(-1).square_root().is_none());
    }

    #[test]
    fn rationals_survive_the_field() {
        for (n, d) in [(0, 1), (1, 1), (-7, 3), (12345, 678), (-1, 536_870_911)] {
            let value = Rational::new(n, d);
            assert_eq!(
                Element::from_rational(&value).unwrap().to_rational(),
                Some(value)
            );
        }
    }
}
