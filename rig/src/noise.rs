//! Gaussian noise that is the same on every machine.

use modelmill_runtime::RandomBits;

/// A stream of random numbers.
#[derive(Clone, Debug)]
pub struct GaussianNoise(RandomBits);

impl GaussianNoise {
    /// The stream `channel` of a seed; channels of one seed are independent of each other.
    pub fn new(seed: u64, channel: u64) -> Self {
        let mut mixed = RandomBits::new(seed ^ 0x6D6F_6465_6C6D_696C);
        let start = mixed.bits() ^ channel.wrapping_mul(0xD134_2543_DE82_EF95);
        Self(RandomBits::new(RandomBits::new(start).bits()))
    }

    /// Uniform in `(0, 1]`.
    pub fn uniform(&mut self) -> f64 {
        self.0.above_zero()
    }

    /// Normal distribution with mean zero and standard deviation one (G. Box, M. Muller 1958).
    pub fn normal(&mut self) -> f64 {
        self.0.normal()
    }
}

#[cfg(test)]
mod tests {
    use super::GaussianNoise;

    /// These bits are part of the interface: a recording made with a seed can be made again.
    #[test]
    fn the_same_seed_gives_the_same_bits() {
        let mut noise = GaussianNoise::new(7, 2);
        let first: Vec<u64> = (0..3).map(|_| noise.0.bits()).collect();
        let mut again = GaussianNoise::new(7, 2);
        assert_eq!(first, (0..3).map(|_| again.0.bits()).collect::<Vec<_>>());
        assert_ne!(first[0], GaussianNoise::new(7, 3).0.bits());
        assert_ne!(first[0], GaussianNoise::new(8, 2).0.bits());
    }

    #[test]
    fn mean_and_deviation_are_zero_and_one() {
        let mut noise = GaussianNoise::new(1, 0);
        let n = 40_000;
        let draws: Vec<f64> = (0..n).map(|_| noise.normal()).collect();
        let mean = draws.iter().sum::<f64>() / f64::from(n);
        let variance = draws.iter().map(|x| x * x).sum::<f64>() / f64::from(n);
        assert!(mean.abs() < 0.015, "{mean}");
        assert!((variance - 1.0).abs() < 0.03, "{variance}");
    }
}
