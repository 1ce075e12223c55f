//! The quadratic extension of a prime field: pairs `re + im i` with `i^2 = -1`, which is no square in the fields that
//! are used.
//!
//! Every element of the prime field has a root here. A loop that takes its roots of a pose drawn in the prime field
//! therefore closes at every draw, however many roots there are: six legs with two each would otherwise need four
//! thousand draws for one pose.

use std::ops::{Add, Mul, Neg, Sub};

use super::{Element, MODULUS, Number, Stream};
use crate::Rational;

/// `re + im i`
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct Extended<const P: u64 = MODULUS> {
    /// The part in the prime field.
    pub re: Element<P>,
    /// The factor of `i`.
    pub im: Element<P>,
}

impl<const P: u64> From<Element<P>> for Extended<P> {
    fn from(re: Element<P>) -> Self {
        let im = Element::ZERO;
        Self { re, im }
    }
}

impl<const P: u64> Extended<P> {
    /// `re^2 + im^2`, which is zero for zero alone.
    fn norm(self) -> Element<P> {
        self.re * self.re + self.im * self.im
    }
}

impl<const P: u64> Add for Extended<P> {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self {
            re: self.re + other.re,
            im: self.im + other.im,
        }
    }
}

impl<const P: u64> Sub for Extended<P> {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl<const P: u64> Neg for Extended<P> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self {
            re: -self.re,
            im: -self.im,
        }
    }
}

impl<const P: u64> Mul for Extended<P> {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        Self {
            re: Element::sum_of_products([self.re, other.re], [-self.im, other.im]),
            im: Element::sum_of_products([self.re, other.im], [self.im, other.re]),
        }
    }
}

impl<const P: u64> Number for Extended<P> {
    const ZERO: Self = Self {
        re: Element::ZERO,
        im: Element::ZERO,
    };
    const ONE: Self = Self {
        re: Element::ONE,
        im: Element::ZERO,
    };

    fn from_rational(value: &Rational) -> Option<Self> {
        Element::from_rational(value).map(Self::from)
    }

    fn inverse(self) -> Option<Self> {
        let norm = self.norm().inverse()?;
        Some(Self {
            re: self.re * norm,
            im: -self.im * norm,
        })
    }

    fn square_root(self) -> Option<Self> {
        if self.im == Element::ZERO {
            let re = self.re;
            return re.square_root().map(Self::from).or_else(|| {
                let im = (-re).square_root()?;
                let re = Element::ZERO;
                Some(Self { re, im })
            });
        }
        // (u + v i)^2 = re + im i gives u^2 = (re + s)/2 with s^2 the norm; of the two signs of s one makes a square.
        let root = self.norm().square_root()?;
        let half = Element::from_i64(2).inverse()?;
        let u = ((self.re + root) * half)
            .square_root()
            .or_else(|| ((self.re - root) * half).square_root())?;
        let im = self.im * half * u.inverse()?;
        Some(Self { re: u, im })
    }

    fn hashed(self, seed: u64) -> Self {
        if self.im == Element::ZERO {
            return self.re.hashed(seed).into();
        }
        let part = self.im.hashed(seed).representative();
        Self {
            re: self.re.hashed(seed ^ part),
            im: self.re.hashed(!(seed ^ part)),
        }
    }

    fn bits(self, seed: u64) -> u64 {
        self.hashed(seed).re.representative()
    }

    fn draw(stream: &mut Stream) -> Self {
        stream.element().into()
    }

    fn draw_circle(stream: &mut Stream) -> (Self, Self) {
        let (c, s) = stream.circle();
        (c.into(), s.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn any(stream: &mut Stream) -> Extended {
        Extended {
            re: stream.element(),
            im: stream.element(),
        }
    }

    #[test]
    fn it_is_a_field() {
        let mut stream = Stream::new(11);
        for _ in 0..500 {
            let (a, b, c) = (any(&mut stream), any(&mut stream), any(&mut stream));
            assert_eq!(a * (b + c), a * b + a * c);
            assert_eq!((a * b) * c, a * (b * c));
            assert_eq!(a * a.inverse().unwrap(), Extended::ONE);
            assert_eq!((a - b) + b, a);
            assert_eq!(a.integer_power(-3).unwrap() * a * a * a, Extended::ONE);
        }
        assert_eq!(Extended::<MODULUS>::ZERO.inverse(), None);
    }

    #[test]
    fn half_of_its_numbers_are_squares_and_all_of_the_prime_field() {
        let mut stream = Stream::new(12);
        let mut squares = 0;
        for _ in 0..400 {
            let a = any(&mut stream);
            assert_eq!((a * a).square_root().map(|r| r * r), Some(a * a));
            if let Some(root) = a.square_root() {
                assert_eq!(root * root, a);
                squares += 1;
            }
            let inside = Extended::from(a.re);
            assert_eq!(inside.square_root().map(|r| r * r), Some(inside));
        }
        assert!((120..280).contains(&squares), "{squares}");
    }

    #[test]
    fn opaque_values_of_the_prime_field_are_those_that_the_prime_field_gives() {
        let mut stream = Stream::new(13);
        for seed in 0..50 {
            let a: Element = stream.element();
            assert_eq!(Extended::from(a).hashed(seed), a.hashed(seed).into());
            assert_eq!(Extended::from(a).bits(seed), Number::bits(a, seed));
            let b = Extended {
                re: a,
                im: stream.element(),
            };
            assert_eq!(b.hashed(seed), b.hashed(seed));
            assert_ne!(b.hashed(seed), (-b).hashed(seed));
        }
    }
}
