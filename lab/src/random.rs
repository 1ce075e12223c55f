//! Random numbers of cases: seed, number and purpose go in; a stream that is the same on every machine comes out.

use modelmill_runtime::RandomBits;

/// A stream of random numbers.
pub struct CaseRandom(RandomBits);

impl CaseRandom {
    /// The stream for a seed, the number of a case and a purpose; different streams are independent.
    pub fn new(seed: u64, case: u64, purpose: u64) -> Self {
        // Each word is mixed into the state, so that similar words give different streams.
        let mut state = 0x6869_6464_656E_u64;
        for word in [seed, case, purpose] {
            let mut mixer = RandomBits::new(state ^ word.wrapping_mul(0xD134_2543_DE82_EF95));
            state = mixer.bits() ^ word;
        }
        Self(RandomBits::new(state))
    }

    /// Uniform in `(0, 1]`.
    fn uniform(&mut self) -> f64 {
        self.0.above_zero()
    }

    /// Uniform between two numbers.
    pub fn uniform_between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Uniform on a logarithmic scale between two positive numbers.
    pub fn log_between(&mut self, low: f64, high: f64) -> f64 {
        libm::exp(self.uniform_between(libm::log(low), libm::log(high)))
    }

    /// Normal with mean zero and standard deviation one (G. Box, M. Muller 1958).
    pub fn normal(&mut self) -> f64 {
        self.0.normal()
    }

    /// True with the given probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.uniform() <= probability
    }

    /// 1 or -1 with equal probability.
    pub fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }

    /// An index below `n`, which must be positive.
    pub fn below(&mut self, n: usize) -> usize {
        usize::try_from(self.0.bits() % n as u64).unwrap_or(0)
    }

    /// The numbers below `n` in random order (R. Fisher, F. Yates 1938).
    pub fn order(&mut self, n: usize) -> Vec<usize> {
        let mut order: Vec<usize> = (0..n).collect();
        for i in (1..n).rev() {
            order.swap(i, self.below(i + 1));
        }
        order
    }
}

/// A number rounded to three significant digits.
pub fn three_digits(x: f64) -> f64 {
    format!("{x:.2e}").parse().unwrap_or(x)
}
