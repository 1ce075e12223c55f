//! Floating-point numbers of some 130 digits. Values that double precision cannot distinguish from rounding errors
//! remain distinguishable here.

use std::ops::{Add, Div, Mul, Neg, Sub};
use std::sync::OnceLock;

use num_bigint::BigInt;
use num_traits::{Signed, ToPrimitive, Zero};

use crate::Rational;

/// Bits of a mantissa.
const BITS: u64 = 448;
/// Additional bits for intermediate results of functions.
const GUARD_BITS: u64 = 64;

/// `mantissa * 2^exponent`, with at most `BITS` bits in the mantissa; zero has the exponent zero.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BigFloat {
    /// Signed mantissa.
    mantissa: BigInt,
    /// Exponent of two.
    exponent: i64,
}

impl BigFloat {
    /// A relative error far above the rounding errors of long computations.
    pub const ROUNDING: f64 = 1e-120;

    /// 0
    pub fn zero() -> Self {
        Self {
            mantissa: BigInt::zero(),
            exponent: 0,
        }
    }

    /// An integer.
    pub fn integer(value: i64) -> Self {
        Self::new(BigInt::from(value), 0)
    }

    /// Rounded to `BITS` bits, towards zero.
    fn new(mantissa: BigInt, exponent: i64) -> Self {
        Self::round_to_bits(mantissa, exponent, BITS)
    }

    /// Rounds to a number of bits, towards zero.
    fn round_to_bits(mantissa: BigInt, exponent: i64, bits: u64) -> Self {
        if mantissa.is_zero() {
            return Self::zero();
        }
        let excess = mantissa.bits().saturating_sub(bits);
        let places = i64::try_from(excess).expect("a mantissa fits the memory");
        Self {
            // Shifted by its magnitude, since shifts of negative numbers round down.
            mantissa: if excess == 0 {
                mantissa
            } else {
                BigInt::from_biguint(mantissa.sign(), mantissa.magnitude() >> excess)
            },
            exponent: exponent + places,
        }
    }

    /// The exact value of a double; `None` if it is not finite.
    pub fn from_f64(value: f64) -> Option<Self> {
        if !value.is_finite() {
            return None;
        }
        let bits = value.to_bits();
        let biased = i64::try_from((bits >> 52) & 0x7ff).expect("eleven bits");
        // Bits of an IEEE double: sign, 11 bits of exponent, 52 bits of fraction. Subnormal numbers have no leading
        // one.
        let fraction = bits & ((1 << 52) - 1);
        let (magnitude, exponent) = if biased == 0 {
            (fraction, -1074)
        } else {
            (fraction | (1 << 52), biased - 1075)
        };
        let magnitude = BigInt::from(magnitude);
        let signed = if value < 0.0 { -magnitude } else { magnitude };
        Some(Self::new(signed, exponent))
    }

    /// The shortest decimal number that is read as `value`, which is what a person wrote; `None` if it is not finite.
    pub fn from_shortest_decimal(value: f64) -> Option<Self> {
        // The standard library prints the shortest decimal that is read as the same double.
        let text = value.is_finite().then(|| format!("{value:e}"))?;
        let (mantissa, exponent) = text.split_once('e')?;
        let n_places = mantissa.split_once('.').map_or(0, |(_, places)| places.len());
        let whole: BigInt = mantissa.replace('.', "").parse().ok()?;
        let exponent: i64 = exponent.parse::<i64>().ok()? - i64::try_from(n_places).ok()?;
        let power = BigInt::from(10).pow(u32::try_from(exponent.unsigned_abs()).ok()?);
        Some(if exponent < 0 {
            Self::new(whole, 0) / Self::new(power, 0)
        } else {
            Self::new(whole * power, 0)
        })
    }

    /// The quotient of numerator and denominator, rounded.
    pub fn from_rational(value: &Rational) -> Self {
        if let Some((n, d)) = value.as_small() {
            return if d == 1 {
                Self::integer(n)
            } else {
                Self::integer(n) / Self::integer(d)
            };
        }
        let big = value.to_big();
        Self::new(big.numer().clone(), 0) / Self::new(big.denom().clone(), 0)
    }

    /// The nearest double, up to its last bit.
    pub fn to_f64(&self) -> f64 {
        let short = Self::round_to_bits(self.mantissa.clone(), self.exponent, 60);
        let mantissa = short.mantissa.to_f64().unwrap_or(0.0);
        // Numbers outside of the range of doubles become zero or infinite.
        // In two steps, so that neither power leaves the range before the product does.
        let half = short.exponent.clamp(-2200, 2200) / 2;
        let rest = short.exponent.clamp(-2200, 2200) - half;
        let power = |n: i64| 2.0_f64.powi(i32::try_from(n).expect("clamped"));
        mantissa * power(half) * power(rest)
    }

    /// Whether it is 0.
    pub fn is_zero(&self) -> bool {
        self.mantissa.is_zero()
    }

    /// Whether it is below 0.
    pub fn is_negative(&self) -> bool {
        self.mantissa.is_negative()
    }

    /// Its magnitude.
    #[must_use]
    pub fn abs(&self) -> Self {
        if self.is_negative() { -self } else { self.clone() }
    }

    /// `self * 2^n`
    #[must_use]
    pub fn scale_by_power_of_two(&self, n: i64) -> Self {
        let mut scaled = self.clone();
        if !scaled.is_zero() {
            scaled.exponent += n;
        }
        scaled
    }

    /// `self^n`; `None` for a negative power of 0.
    #[must_use]
    pub fn power(&self, n: i32) -> Option<Self> {
        if n < 0 {
            let below = self.power(-n).filter(|x| !x.is_zero())?;
            return Some(Self::integer(1) / below);
        }
        // Repeated squaring over the binary digits of n.
        let (mut rest, mut square, mut product) = (n, self.clone(), Self::integer(1));
        while rest > 0 {
            if rest & 1 == 1 {
                product = &product * &square;
            }
            rest >>= 1;
            if rest > 0 {
                square = &square * &square;
            }
        }
        Some(product)
    }

    /// The square root; `None` for negative numbers.
    #[must_use]
    pub fn sqrt(&self) -> Option<Self> {
        if self.is_negative() {
            return None;
        }
        if self.is_zero() {
            return Some(Self::zero());
        }
        // The mantissa is extended so that its integer root has enough bits; the exponent must be even.
        let wanted = 2 * BITS;
        let mut shift = wanted.saturating_sub(self.mantissa.bits());
        if (self.exponent - i64::try_from(shift).expect("some bits")) % 2 != 0 {
            shift += 1;
        }
        let exponent = self.exponent - i64::try_from(shift).expect("some bits");
        Some(Self::new((&self.mantissa << shift).sqrt(), exponent / 2))
    }

    /// The exponent of the power of two directly above its magnitude.
    fn binary_magnitude(&self) -> i64 {
        i64::try_from(self.mantissa.bits()).expect("some bits") + self.exponent
    }

    /// As an integer in units of `2^-places`.
    fn to_fixed_point(&self, places: u64) -> BigInt {
        let shift = self.exponent + i64::try_from(places).expect("some bits");
        if shift >= 0 {
            &self.mantissa << shift.unsigned_abs()
        } else {
            let magnitude = self.mantissa.magnitude() >> shift.unsigned_abs();
            BigInt::from_biguint(self.mantissa.sign(), magnitude)
        }
    }

    /// How often an argument is halved before its series is used, and the number of binary places that the later
    /// doublings need. `None` for arguments that are too large.
    fn argument_halvings(&self) -> Option<(u64, u64)> {
        /// Larger arguments than 2^40 do not occur in mechanisms.
        const LARGEST: i64 = 40;
        /// Arguments are halved until they are below 2^-20.
        const SMALL: i64 = 20;
        let n = (self.binary_magnitude() + SMALL).max(0);
        let n = (self.binary_magnitude() <= LARGEST).then(|| n.unsigned_abs())?;
        Some((n, BITS + GUARD_BITS + 2 * n))
    }

    /// Cosine and sine of an angle in rad; `None` for angles above 2^40.
    pub fn cos_sin(&self) -> Option<(Self, Self)> {
        let (n, places) = self.argument_halvings()?;
        let one = BigInt::from(1) << places;
        let x = self
            .scale_by_power_of_two(-i64::try_from(n).ok()?)
            .to_fixed_point(places);
        let square: BigInt = (&x * &x) >> places;
        // 1 - cos by its series: doubling the angle loses no digits of it.
        let (mut term, mut versed) = (square.clone() >> 1_u32, BigInt::zero());
        let mut k = 2_u64;
        while !term.is_zero() {
            versed += &term;
            term = -((term * &square) >> places) / ((k + 1) * (k + 2));
            k += 2;
        }
        // The sine by its series.
        let (mut term, mut sine) = (x, BigInt::zero());
        let mut k = 1_u64;
        while !term.is_zero() {
            sine += &term;
            term = -((term * &square) >> places) / ((k + 1) * (k + 2));
            k += 2;
        }
        // Doubling: 1 - cos 2x = 2 sin^2 x, sin 2x = 2 sin x cos x.
        for _ in 0..n {
            let cosine = &one - &versed;
            versed = (&sine * &sine) >> (places - 1);
            sine = (sine * cosine) >> (places - 1);
        }
        let exponent = -i64::try_from(places).ok()?;
        Some((Self::new(one - versed, exponent), Self::new(sine, exponent)))
    }

    /// The exponential; `None` for arguments above 1e4 in magnitude.
    pub fn exp(&self) -> Option<Self> {
        /// Exponentials of larger arguments are of no use.
        const LARGEST: f64 = 1e4;
        if self.to_f64().abs() > LARGEST {
            return None;
        }
        let (n, places) = self.argument_halvings()?;
        let x = self
            .scale_by_power_of_two(-i64::try_from(n).ok()?)
            .to_fixed_point(places);
        // The series at the argument divided by a power of two.
        let mut total = BigInt::zero();
        let (mut term, mut k) = (BigInt::from(1) << places, 1_u64);
        while !term.is_zero() {
            total += &term;
            term = ((term * &x) >> places) / k;
            // Shifts of negative numbers round down, so the last term would never become zero.
            if term == BigInt::from(-1) {
                break;
            }
            k += 1;
        }
        // exp(2x) = exp(x)^2
        let mut value = Self::round_to_bits(total, -i64::try_from(places).ok()?, places);
        for _ in 0..n {
            let mantissa = &value.mantissa * &value.mantissa;
            value = Self::round_to_bits(mantissa, 2 * value.exponent, places);
        }
        Some(Self::new(value.mantissa, value.exponent))
    }

    /// The hyperbolic tangent; 1 or -1 for arguments above 400 in magnitude.
    pub fn tanh(&self) -> Option<Self> {
        // Above this argument the difference to 1 is below the last bit.
        const FLAT: f64 = 400.0;
        let size = self.to_f64();
        if size.abs() > FLAT {
            return Some(Self::integer(if size > 0.0 { 1 } else { -1 }));
        }
        let (above, below) = (self.exp()?, (-self).exp()?);
        Some((&above - &below) / (&above + &below))
    }

    /// pi, by Machin's formula (1706).
    pub fn pi() -> Self {
        // Computed once and shared by all threads.
        static PI: OnceLock<BigFloat> = OnceLock::new();
        PI.get_or_init(|| {
            let places = BITS + GUARD_BITS;
            // arctan(1/n) by its series, in fixed point.
            let arctangent = |inverse: u64| {
                let mut power = (BigInt::from(1) << places) / inverse;
                let (mut total, mut k) = (BigInt::zero(), 1_u64);
                while !power.is_zero() {
                    let term = &power / k;
                    total += if k % 4 == 1 { term } else { -term };
                    power /= inverse * inverse;
                    k += 2;
                }
                total
            };
            let total = arctangent(5) * 16 - arctangent(239) * 4;
            Self::new(total, -i64::try_from(places).expect("some bits"))
        })
        .clone()
    }
}

impl Add for &BigFloat {
    type Output = BigFloat;
    fn add(self, other: &BigFloat) -> BigFloat {
        if self.is_zero() {
            return other.clone();
        }
        if other.is_zero() {
            return self.clone();
        }
        let (high, low) = if self.exponent >= other.exponent {
            (self, other)
        } else {
            (other, self)
        };
        // Digits below the last bit of the larger number have no effect.
        if high.binary_magnitude() - low.binary_magnitude() > i64::try_from(BITS + GUARD_BITS).expect("some bits") {
            return high.clone();
        }
        // Both mantissas in units of the smaller exponent.
        let shift = (high.exponent - low.exponent).unsigned_abs();
        BigFloat::new((&high.mantissa << shift) + &low.mantissa, low.exponent)
    }
}

impl Neg for &BigFloat {
    type Output = BigFloat;
    fn neg(self) -> BigFloat {
        BigFloat {
            mantissa: -&self.mantissa,
            exponent: self.exponent,
        }
    }
}

impl Sub for &BigFloat {
    type Output = BigFloat;
    fn sub(self, other: &BigFloat) -> BigFloat {
        self + &-other
    }
}

impl Mul for &BigFloat {
    type Output = BigFloat;
    fn mul(self, other: &BigFloat) -> BigFloat {
        BigFloat::new(&self.mantissa * &other.mantissa, self.exponent + other.exponent)
    }
}

impl Div for BigFloat {
    type Output = BigFloat;
    /// The divisor must not be zero.
    fn div(self, other: BigFloat) -> BigFloat {
        assert!(!other.is_zero(), "a divisor is not zero");
        // The dividend is extended so that the quotient has enough bits.
        let shift = (BITS + other.mantissa.bits() + 1).saturating_sub(self.mantissa.bits());
        let exponent = self.exponent - other.exponent - i64::try_from(shift).expect("some bits");
        BigFloat::new((self.mantissa << shift) / other.mantissa, exponent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn same(a: &BigFloat, b: &BigFloat) {
        let off = (a - b).abs().to_f64();
        assert!(off <= BigFloat::ROUNDING * a.abs().to_f64(), "{off:.1e}");
    }

    #[test]
    fn decimals_are_what_was_written() {
        let tenth = BigFloat::from_shortest_decimal(0.1).unwrap();
        same(&(&tenth * &BigFloat::integer(10)), &BigFloat::integer(1));
        same(
            &BigFloat::from_shortest_decimal(-2.5e-7).unwrap(),
            &(BigFloat::integer(-25) / BigFloat::integer(100_000_000)),
        );
        // The machine's own tenth is another number.
        let rounded = BigFloat::from_f64(0.1).unwrap();
        assert!((&rounded - &tenth).abs().to_f64() > 1e-19);
        assert_eq!(rounded.to_f64().to_bits(), 0.1_f64.to_bits());
    }

    #[test]
    fn functions_keep_their_laws() {
        for x in [1e-9, 0.3, 1.7, -12.0, 150.0] {
            let x = BigFloat::from_shortest_decimal(x).unwrap();
            let (c, s) = x.cos_sin().unwrap();
            same(&(&(&c * &c) + &(&s * &s)), &BigFloat::integer(1));
            assert!((s.to_f64() - x.to_f64().sin()).abs() < 1e-14);
            assert!((c.to_f64() - x.to_f64().cos()).abs() < 1e-14);
            same(&(&x.exp().unwrap() * &(-&x).exp().unwrap()), &BigFloat::integer(1));
            assert!((x.tanh().unwrap().to_f64() - x.to_f64().tanh()).abs() < 1e-15);
            let root = x.abs().sqrt().unwrap();
            same(&(&root * &root), &x.abs());
        }
        let (c, s) = BigFloat::pi().cos_sin().unwrap();
        assert!(s.abs().to_f64() < BigFloat::ROUNDING);
        same(&c, &BigFloat::integer(-1));
        let e = BigFloat::integer(1).exp().unwrap();
        assert!((e.to_f64() - std::f64::consts::E).abs() < 1e-15);
        same(
            &BigFloat::integer(2).power(-3).unwrap(),
            &BigFloat::from_shortest_decimal(0.125).unwrap(),
        );
        assert!(BigFloat::zero().power(-1).is_none());
        assert!(BigFloat::integer(-1).sqrt().is_none());
    }
}
