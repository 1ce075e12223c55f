//! The quadratic extension of a prime field: pairs `re + im i` with `i^2 = -1`, where -1 is no square in the prime
//! fields used here.
//!
//! Every element of the prime field has a square root here. So the loops of a pose that is drawn in the prime field
//! close at every draw, however many roots there are. Six legs with two roots each would otherwise need four
//! thousand draws for one pose.
//!
//! Decision: each equation counts twice here. The factors lie in the prime field, so real and imaginary parts satisfy
//! the same relations.

use std::ops::{Add, Mul, Neg, Sub};

use super::{FieldElement, FieldNumber, MODULUS, RandomStream};
use crate::Rational;

/// The number `re + im i`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct ExtensionElement<const P: u64 = MODULUS> {
    /// The part in the prime field.
    pub re: FieldElement<P>,
    /// The factor of `i`.
    pub im: FieldElement<P>,
}

impl<const P: u64> From<FieldElement<P>> for ExtensionElement<P> {
    fn from(re: FieldElement<P>) -> Self {
        let im = FieldElement::ZERO;
        Self { re, im }
    }
}

impl<const P: u64> ExtensionElement<P> {
    /// `re^2 + im^2`, which is zero only for zero.
    fn norm(self) -> FieldElement<P> {
        self.re * self.re + self.im * self.im
    }
}

impl<const P: u64> Add for ExtensionElement<P> {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self {
            re: self.re + other.re,
            im: self.im + other.im,
        }
    }
}

impl<const P: u64> Sub for ExtensionElement<P> {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl<const P: u64> Neg for ExtensionElement<P> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self {
            re: -self.re,
            im: -self.im,
        }
    }
}

impl<const P: u64> Mul for ExtensionElement<P> {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        Self {
            re: FieldElement::sum_of_products([self.re, other.re], [-self.im, other.im]),
            im: FieldElement::sum_of_products([self.re, other.im], [self.im, other.re]),
        }
    }
}

impl<const P: u64> FieldNumber for ExtensionElement<P> {
    const ZERO: Self = Self {
        re: FieldElement::ZERO,
        im: FieldElement::ZERO,
    };
    const ONE: Self = Self {
        re: FieldElement::ONE,
        im: FieldElement::ZERO,
    };

    fn from_rational(value: &Rational) -> Option<Self> {
        FieldElement::from_rational(value).map(Self::from)
    }

    fn inverse(self) -> Option<Self> {
        // 1/(re + im i) = (re - im i)/norm
        let norm = self.norm().inverse()?;
        Some(Self {
            re: self.re * norm,
            im: -self.im * norm,
        })
    }

    fn square_root(self) -> Option<Self> {
        // An element of the prime field, or its negative, is a square there.
        if self.im == FieldElement::ZERO {
            let re = self.re;
            return re.square_root().map(Self::from).or_else(|| {
                let im = (-re).square_root()?;
                let re = FieldElement::ZERO;
                Some(Self { re, im })
            });
        }
        // (u + v i)^2 = re + im i gives u^2 = (re + s)/2, where s^2 is the norm. For one of the two signs of s this is
        // a square. The norm must have a root in the prime field.
        let root = self.norm().square_root()?;
        let half = FieldElement::from_i64(2).inverse()?;
        let u = ((self.re + root) * half)
            .square_root()
            .or_else(|| ((self.re - root) * half).square_root())?;
        let im = self.im * half * u.inverse()?;
        Some(Self { re: u, im })
    }

    fn hash_with_seed(self, seed: u64) -> Self {
        // Elements of the prime field must have the same value as there.
        if self.im == FieldElement::ZERO {
            return self.re.hash_with_seed(seed).into();
        }
        // Both parts depend on both parts of the number.
        let part = self.im.hash_with_seed(seed).representative();
        Self {
            re: self.re.hash_with_seed(seed ^ part),
            im: self.re.hash_with_seed(!(seed ^ part)),
        }
    }

    fn hash_bits(self, seed: u64) -> u64 {
        self.hash_with_seed(seed).re.representative()
    }

    fn draw(stream: &mut RandomStream) -> Self {
        stream.next_element().into()
    }

    fn draw_circle(stream: &mut RandomStream) -> (Self, Self) {
        let (c, s) = stream.next_circle_point();
        (c.into(), s.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn any(stream: &mut RandomStream) -> ExtensionElement {
        ExtensionElement {
            re: stream.next_element(),
            im: stream.next_element(),
        }
    }

    #[test]
    fn it_is_a_field() {
        let mut stream = RandomStream::new(11);
        for _ in 0..500 {
            let (a, b, c) = (any(&mut stream), any(&mut stream), any(&mut stream));
            assert_eq!(a * (b + c), a * b + a * c);
            assert_eq!((a * b) * c, a * (b * c));
            assert_eq!(a * a.inverse().unwrap(), ExtensionElement::ONE);
            assert_eq!((a - b) + b, a);
            assert_eq!(a.integer_power(-3).unwrap() * a * a * a, ExtensionElement::ONE);
        }
        assert_eq!(ExtensionElement::<MODULUS>::ZERO.inverse(), None);
    }

    #[test]
    fn half_of_its_numbers_are_squares_and_all_of_the_prime_field() {
        let mut stream = RandomStream::new(12);
        let mut squares = 0;
        for _ in 0..400 {
            let a = any(&mut stream);
            assert_eq!((a * a).square_root().map(|r| r * r), Some(a * a));
            if let Some(root) = a.square_root() {
                assert_eq!(root * root, a);
                squares += 1;
            }
            let inside = ExtensionElement::from(a.re);
            assert_eq!(inside.square_root().map(|r| r * r), Some(inside));
        }
        assert!((120..280).contains(&squares), "{squares}");
    }

    #[test]
    fn opaque_values_of_the_prime_field_are_those_that_the_prime_field_gives() {
        let mut stream = RandomStream::new(13);
        for seed in 0..50 {
            let a: FieldElement = stream.next_element();
            assert_eq!(
                ExtensionElement::from(a).hash_with_seed(seed),
                a.hash_with_seed(seed).into()
            );
            assert_eq!(
                ExtensionElement::from(a).hash_bits(seed),
                FieldNumber::hash_bits(a, seed)
            );
            let b = ExtensionElement {
                re: a,
                im: stream.next_element(),
            };
            assert_eq!(b.hash_with_seed(seed), b.hash_with_seed(seed));
            assert_ne!(b.hash_with_seed(seed), (-b).hash_with_seed(seed));
        }
    }
}
