//! Medians of streams. Input: magnitudes one by one; output: their median to three digits, in constant memory.

/// Bits of a magnitude that select its bin: the exponent and six more bits, 64 bins per octave.
const BITS: u32 = 17;

/// Counts of magnitudes in bins with a constant ratio of width to value.
#[derive(Debug, Clone)]
pub(crate) struct MagnitudeHistogram {
    /// Count of each bin.
    counts: Vec<u64>,
    /// Count of all magnitudes.
    total: u64,
}

impl MagnitudeHistogram {
    pub(crate) fn new() -> Self {
        Self {
            counts: vec![0; 1 << BITS],
            total: 0,
        }
    }

    /// Adds a magnitude, which is finite and not negative.
    pub(crate) fn add(&mut self, magnitude: f64) {
        self.counts[bin_of_magnitude(magnitude)] += 1;
        self.total += 1;
    }

    /// The median, interpolated within its bin; 0 without magnitudes.
    pub(crate) fn median(&self) -> f64 {
        let half = self.total as f64 / 2.0;
        let mut before = 0.0;
        for (at, count) in self.counts.iter().enumerate().filter(|(_, count)| **count > 0) {
            let count = *count as f64;
            if before + count >= half {
                let (low, high) = (bin_edge(at), bin_edge(at + 1));
                return low + (high - low) * (half - before) / count;
            }
            before += count;
        }
        0.0
    }
}

/// Bin of a magnitude.
#[allow(clippy::cast_possible_truncation, reason = "18 bits at most")]
fn bin_of_magnitude(magnitude: f64) -> usize {
    // The sign bit of a magnitude is zero.
    ((magnitude.to_bits() & (u64::MAX >> 1)) >> (63 - BITS)) as usize
}

/// Lower edge of a bin.
fn bin_edge(bin: usize) -> f64 {
    f64::from_bits((bin as u64) << (63 - BITS))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::TestNoise;

    #[test]
    fn the_median_agrees_with_the_sorted_one() {
        let mut noise = TestNoise::new(2);
        for scale in [1e-9, 1.0, 3e7] {
            let mut magnitudes = MagnitudeHistogram::new();
            let mut all: Vec<f64> = (0..4001).map(|_| scale * noise.normal().abs()).collect();
            for x in &all {
                magnitudes.add(*x);
            }
            all.sort_by(f64::total_cmp);
            assert!((magnitudes.median() / all[2000] - 1.0).abs() < 5e-3);
        }
        assert!(MagnitudeHistogram::new().median().abs() < f64::MIN_POSITIVE);
    }
}
