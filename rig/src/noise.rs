//! Gaussian noise that is the same on every machine: integers and the pure-Rust `libm` only.

/// A stream of random numbers.
#[derive(Clone, Debug)]
pub struct GaussianNoise(u64);

impl GaussianNoise {
    /// The stream `channel` of a seed; channels of one seed are independent of each other.
    pub fn new(seed: u64, channel: u64) -> Self {
        let mut mixed = Self(seed ^ 0x6D6F_6465_6C6D_696C);
        let start = mixed.bits() ^ channel.wrapping_mul(0xD134_2543_DE82_EF95);
        let mut stream = Self(start);
        stream.0 = stream.bits();
        stream
    }

    /// 64 random bits: `SplitMix64` (G. Steele, D. Lea, C. Flood 2014).
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Uniform in `(0, 1]`.
    pub fn uniform(&mut self) -> f64 {
        ((self.bits() >> 11) as f64 + 1.0) / (1_u64 << 53) as f64
    }

    /// Normal distribution with mean zero and standard deviation one (G. Box, M. Muller 1958).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * libm::log(self.uniform())).sqrt();
        radius * libm::cos(2.0 * std::f64::consts::PI * self.uniform())
    }
}

#[cfg(test)]
mod tests {
    use super::GaussianNoise;

    /// These bits are part of the interface: a recording made with a seed can be made again.
    #[test]
    fn the_same_seed_gives_the_same_bits() {
        let mut noise = GaussianNoise::new(7, 2);
        let first: Vec<u64> = (0..3).map(|_| noise.bits()).collect();
        let mut again = GaussianNoise::new(7, 2);
        assert_eq!(first, (0..3).map(|_| again.bits()).collect::<Vec<_>>());
        assert_ne!(first[0], GaussianNoise::new(7, 3).bits());
        assert_ne!(first[0], GaussianNoise::new(8, 2).bits());
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
