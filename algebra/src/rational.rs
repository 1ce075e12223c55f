//! Exact rationals that use machine words as long as these are sufficient.

use std::fmt;
use std::ops::{Add, Mul, Neg, Sub};

use num_bigint::BigInt;
use num_rational::BigRational;
use num_traits::{One, Signed, ToPrimitive, Zero};

/// An exact rational number: a fraction of machine words, or of big integers where those overflow.
#[derive(Clone, PartialEq, Eq, Hash)]
pub struct Rational(RationalRepr);

/// The two representations. Every number that fits into words is `Small`, so that equal numbers are equal as values.
#[derive(Clone, PartialEq, Eq, Hash)]
enum RationalRepr {
    /// Numerator and positive denominator, coprime.
    Small(i64, i64),
    /// Numbers that do not fit into `Small`.
    Big(Box<BigRational>),
}

/// Greatest common divisor; `a` for `b = 0`.
fn gcd(a: u128, b: u128) -> u128 {
    if b == 0 { a } else { gcd(b, a % b) }
}

impl Rational {
    /// 0
    pub const ZERO: Self = Self(RationalRepr::Small(0, 1));
    /// 1
    pub const ONE: Self = Self(RationalRepr::Small(1, 1));
    /// -1
    pub const MINUS_ONE: Self = Self(RationalRepr::Small(-1, 1));

    /// `numerator / denominator`; the denominator must not be zero.
    pub fn new(numerator: i64, denominator: i64) -> Self {
        assert!(denominator != 0, "a rational's denominator is not zero");
        Self::from_wide(i128::from(numerator), i128::from(denominator))
    }

    /// An integer.
    pub fn integer(value: i64) -> Self {
        Self(RationalRepr::Small(value, 1))
    }

    /// A fraction of double words in lowest terms; the denominator must not be zero.
    fn from_wide(numerator: i128, denominator: i128) -> Self {
        // Nearly all numbers are words and most are integers, and long division is slow.
        // The least word has no negative, so it is left to the general case.
        if let (Ok(n), Ok(d)) = (i64::try_from(numerator), i64::try_from(denominator))
            && n != i64::MIN
            && d != i64::MIN
        {
            return Self::from_words(n, d);
        }
        let common = gcd(numerator.unsigned_abs(), denominator.unsigned_abs());
        let divide = |x: i128| {
            let magnitude = x.unsigned_abs() / common;
            let sign = if (x < 0) ^ (denominator < 0) { -1 } else { 1 };
            (magnitude, sign)
        };
        // The sign goes to the numerator.
        let (n, sign) = divide(numerator);
        let d = denominator.unsigned_abs() / common;
        // Numbers that do not fit into words become big integers.
        match (i64::try_from(n), i64::try_from(d)) {
            (Ok(n), Ok(d)) => Self(RationalRepr::Small(sign * n, d)),
            _ => Self::from(BigRational::new(BigInt::from(numerator), BigInt::from(denominator))),
        }
    }

    /// A fraction of words, neither of which is the least one, in lowest terms.
    fn from_words(numerator: i64, denominator: i64) -> Self {
        if denominator == 1 {
            return Self(RationalRepr::Small(numerator, 1));
        }
        // Euclid's algorithm in words.
        let (mut common, mut rest) = (numerator.abs(), denominator.abs());
        while rest != 0 {
            (common, rest) = (rest, common % rest);
        }
        let common = if denominator < 0 { -common } else { common };
        Self(RationalRepr::Small(numerator / common, denominator / common))
    }

    /// The same number as a fraction of big integers, in lowest terms.
    pub fn to_big(&self) -> BigRational {
        match &self.0 {
            RationalRepr::Small(n, d) => BigRational::new_raw(BigInt::from(*n), BigInt::from(*d)),
            RationalRepr::Big(big) => (**big).clone(),
        }
    }

    /// Numerator and positive denominator, if both are machine words.
    pub fn as_small(&self) -> Option<(i64, i64)> {
        match &self.0 {
            RationalRepr::Small(n, d) => Some((*n, *d)),
            RationalRepr::Big(_) => None,
        }
    }

    /// Whether it is 0.
    pub fn is_zero(&self) -> bool {
        matches!(self.0, RationalRepr::Small(0, _))
    }

    /// Whether it is 1.
    pub fn is_one(&self) -> bool {
        matches!(self.0, RationalRepr::Small(1, 1))
    }

    /// Whether it is below 0.
    pub fn is_negative(&self) -> bool {
        match &self.0 {
            RationalRepr::Small(n, _) => *n < 0,
            RationalRepr::Big(big) => big.is_negative(),
        }
    }

    /// Whether its denominator is 1.
    pub fn is_integer(&self) -> bool {
        match &self.0 {
            RationalRepr::Small(_, d) => *d == 1,
            RationalRepr::Big(big) => big.is_integer(),
        }
    }

    /// Absolute value.
    #[must_use]
    pub fn abs(&self) -> Self {
        if self.is_negative() { -self } else { self.clone() }
    }

    /// One over it; it must not be zero.
    #[must_use]
    pub fn recip(&self) -> Self {
        match &self.0 {
            RationalRepr::Small(n, d) => Self::from_wide(i128::from(*d), i128::from(*n)),
            RationalRepr::Big(big) => Self::from(big.recip()),
        }
    }

    /// Integer power; zero must not be raised to a negative one.
    #[must_use]
    pub fn pow(&self, exponent: i32) -> Self {
        if self.is_one() || exponent == 1 {
            return self.clone();
        }
        // A negative exponent inverts the number first.
        let base = if exponent < 0 { self.recip() } else { self.clone() };
        (0..exponent.unsigned_abs()).fold(Self::ONE, |product, _| &product * &base)
    }

    /// The largest rational that divides both with integer quotients; 0 only for two zeros.
    #[must_use]
    pub fn content_with(&self, other: &Self) -> Self {
        if let (RationalRepr::Small(a, b), RationalRepr::Small(c, d)) = (&self.0, &other.0) {
            // gcd(a/b, c/d) = gcd(a d, c b) / (b d)
            let (b, d) = (u128::from(b.unsigned_abs()), u128::from(d.unsigned_abs()));
            let n = gcd(u128::from(a.unsigned_abs()) * d, u128::from(c.unsigned_abs()) * b);
            let m = b * d;
            let common = gcd(n, m).max(1);
            if let (Ok(n), Ok(m)) = (i64::try_from(n / common), i64::try_from(m / common)) {
                return Self(RationalRepr::Small(n, m));
            }
        }
        // The same with big integers, if words overflow.
        let (x, y) = (self.to_big(), other.to_big());
        let n = num_gcd(&(x.numer() * y.denom()), &(y.numer() * x.denom()));
        Self::from(BigRational::new(n, x.denom() * y.denom()))
    }

    /// Nearest floating-point number.
    pub fn to_f64(&self) -> f64 {
        match &self.0 {
            RationalRepr::Small(n, d) => *n as f64 / *d as f64,
            RationalRepr::Big(big) => big.to_f64().unwrap_or(f64::NAN),
        }
    }
}

/// Greatest common divisor of big integers; 1 for two zeros.
fn num_gcd(a: &BigInt, b: &BigInt) -> BigInt {
    let (mut a, mut b) = (a.abs(), b.abs());
    while !b.is_zero() {
        let r = &a % &b;
        a = b;
        b = r;
    }
    if a.is_zero() { BigInt::one() } else { a }
}

impl From<BigRational> for Rational {
    fn from(big: BigRational) -> Self {
        // The numerator must have a negative that fits as well.
        match (big.numer().to_i64(), big.denom().to_i64()) {
            (Some(n), Some(d)) if n != i64::MIN => Self(RationalRepr::Small(n, d)),
            _ => Self(RationalRepr::Big(Box::new(big))),
        }
    }
}

impl Default for Rational {
    fn default() -> Self {
        Self::ZERO
    }
}

impl From<i64> for Rational {
    fn from(value: i64) -> Self {
        Self::integer(value)
    }
}

impl Add for &Rational {
    type Output = Rational;
    fn add(self, other: Self) -> Rational {
        // Sums of integers need no common denominator.
        match (&self.0, &other.0) {
            (RationalRepr::Small(a, 1), RationalRepr::Small(c, 1)) => {
                Rational::from_wide(i128::from(*a) + i128::from(*c), 1)
            }
            (RationalRepr::Small(a, b), RationalRepr::Small(c, d)) => {
                let (a, b, c, d) = (i128::from(*a), i128::from(*b), i128::from(*c), i128::from(*d));
                Rational::from_wide(a * d + c * b, b * d)
            }
            _ => Rational::from(self.to_big() + other.to_big()),
        }
    }
}

impl Sub for &Rational {
    type Output = Rational;
    fn sub(self, other: Self) -> Rational {
        self + &-other
    }
}

impl Mul for &Rational {
    type Output = Rational;
    fn mul(self, other: Self) -> Rational {
        match (&self.0, &other.0) {
            (RationalRepr::Small(a, b), RationalRepr::Small(c, d)) => {
                Rational::from_wide(i128::from(*a) * i128::from(*c), i128::from(*b) * i128::from(*d))
            }
            _ => Rational::from(self.to_big() * other.to_big()),
        }
    }
}

impl Neg for &Rational {
    type Output = Rational;
    fn neg(self) -> Rational {
        match &self.0 {
            RationalRepr::Small(n, d) if *n != i64::MIN => Rational(RationalRepr::Small(-n, *d)),
            _ => Rational::from(-self.to_big()),
        }
    }
}

impl PartialOrd for Rational {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Rational {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        match (&self.0, &other.0) {
            (RationalRepr::Small(a, b), RationalRepr::Small(c, d)) => {
                // Denominators are positive, so cross products compare the fractions.
                let [a, b, c, d] = [*a, *b, *c, *d].map(i128::from);
                (a * d).cmp(&(c * b))
            }
            _ => self.to_big().cmp(&other.to_big()),
        }
    }
}

impl fmt::Display for Rational {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            RationalRepr::Small(n, 1) => write!(f, "{n}"),
            RationalRepr::Small(n, d) => write!(f, "{n}/{d}"),
            RationalRepr::Big(big) => write!(f, "{big}"),
        }
    }
}

impl fmt::Debug for Rational {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}
