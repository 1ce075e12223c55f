//! Random numbers that are the same on every machine: integers, roots and the pure-Rust `libm` only.

use core::f64::consts::PI;

/// The step of a stream: 2^64 over the golden ratio, odd.
const STEP: u64 = 0x9E37_79B9_7F4A_7C15;

/// A stream of random bits, `SplitMix64` (G. Steele, D. Lea, C. Flood 2014). All that is drawn in this project is drawn from
/// such streams, so that the same seed gives the same numbers wherever and whenever it is used.
#[derive(Clone, Copy, Debug)]
pub struct RandomBits(u64);

impl RandomBits {
    /// The stream of a seed.
    pub const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next 64 bits.
    #[inline]
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(STEP);
        scramble_bits(self.0)
    }

    /// Uniform in `[0, 1)`.
    #[inline]
    pub fn below_one(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform in `(0, 1]`: it has a logarithm.
    #[inline]
    pub fn above_zero(&mut self) -> f64 {
        ((self.bits() >> 11) as f64 + 1.0) / (1_u64 << 53) as f64
    }

    /// Normal with mean zero and deviation one (G. Box, M. Muller 1958).
    pub fn normal(&mut self) -> f64 {
        let radius = libm::sqrt(-2.0 * libm::log(self.above_zero()));
        radius * libm::cos(2.0 * PI * self.above_zero())
    }

    /// Nearly normal, within six deviations: the sum of twelve uniform numbers, in which no function of a mathematical library
    /// has a part.
    pub fn nearly_normal(&mut self) -> f64 {
        (0..12).map(|_| self.below_one()).sum::<f64>() - 6.0
    }
}

/// Bits that depend on all of the given ones and otherwise look random; different ones give different ones.
#[inline]
pub const fn scramble_bits(mut bits: u64) -> u64 {
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    bits ^ (bits >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Models, recordings and whatever else is made with a seed can be made again: these are the numbers that other programs give too.
    #[test]
    fn a_seed_gives_the_bits_that_it_always_gave() {
        let mut random = RandomBits::new(1_234_567);
        let first = [(); 3].map(|()| random.bits());
        assert_eq!(
            first,
            [
                6_457_827_717_110_365_317,
                3_203_168_211_198_807_973,
                9_817_491_932_198_370_423
            ]
        );
    }

    #[test]
    fn numbers_keep_to_their_ranges() {
        let mut random = RandomBits::new(7);
        let (mut sum, mut squares) = (0.0, 0.0);
        for _ in 0..20_000 {
            assert!((0.0..1.0).contains(&random.below_one()));
            let above = random.above_zero();
            assert!(above > 0.0 && above <= 1.0);
            let normal = random.normal();
            sum += normal;
            squares += normal * normal;
            assert!(random.nearly_normal().abs() <= 6.0);
        }
        assert!((sum / 20_000.0).abs() < 0.02 && (squares / 20_000.0 - 1.0).abs() < 0.03);
    }
}
