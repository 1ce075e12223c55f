//! Seeded random numbers for tests.

use modelmill_runtime::RandomBits;

/// Random numbers with Box and Muller's transform on top.
pub(crate) struct TestNoise(RandomBits);

impl TestNoise {
    pub(crate) fn new(seed: u64) -> Self {
        Self(RandomBits::new(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15)))
    }

    /// Uniform in `(0, 1]`.
    pub(crate) fn uniform(&mut self) -> f64 {
        self.0.above_zero()
    }

    /// Standard normal.
    pub(crate) fn normal(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (2.0 * std::f64::consts::PI * self.uniform()).cos()
    }
}
