//! A reproducible stream of random numbers: the same seed makes the same mechanism on any machine.

use modelmill_runtime::RandomBits;

/// What random mechanisms are made of.
#[derive(Clone, Debug)]
pub struct Stream(RandomBits);

impl Stream {
    /// A stream that starts from a seed.
    pub fn new(seed: u64) -> Self {
        Self(RandomBits::new(seed.wrapping_mul(0xD134_2543_DE82_EF95)))
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0.bits()
    }

    /// Uniform between `low` and `high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + self.0.below_one() * (high - low)
    }

    /// Uniform in magnitude between `low` and `high`, with a random sign.
    pub fn either_side(&mut self, low: f64, high: f64) -> f64 {
        let magnitude = self.between(low, high);
        if self.chance(0.5) { -magnitude } else { magnitude }
    }

    /// A number below `n`.
    pub fn below(&mut self, n: usize) -> usize {
        usize::try_from(self.bits() % n as u64).expect("a remainder fits")
    }

    /// True with the given probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.between(0.0, 1.0) < probability
    }

    /// One of the choices.
    pub fn pick<'a, T>(&mut self, choices: &'a [T]) -> &'a T {
        &choices[self.below(choices.len())]
    }
}
