//! Random numbers of tests.

use modelmill_runtime::RandomBits;

/// Uniform and normal numbers, the same on every machine.
pub(crate) struct Draws(RandomBits);

impl Draws {
    pub(crate) fn new(seed: u64) -> Self {
        Self(RandomBits::new(seed))
    }

    pub(crate) fn uniform(&mut self) -> f64 {
        self.0.below_one()
    }

    pub(crate) fn normal(&mut self) -> f64 {
        self.0.nearly_normal()
    }
}
