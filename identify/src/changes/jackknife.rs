//! Standard deviations that do not trust the residual to be white: parts of a run are left out one at a time, and the
//! scatter of the estimates shows how much they depend on the part. Input: normal equations block by block, or
//! estimates without each block; output: factors of variances, or values with standard deviations.
//!
//! Decision: a factor is the mean of the parameter's own ratio and of that of all parameters. Eight blocks give a
//! ratio with seven degrees of freedom, by which alone one parameter in a hundred would look certain by chance.

use nalgebra::DVector;

use crate::changes::moments::NormalEquations;
use crate::changes::thresholds::JACKKNIFE_FEWEST_BLOCKS;

/// Estimated values of one run with standard deviations.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockFit {
    /// One value per column; 0 for a column that is a combination of those before it.
    pub values: DVector<f64>,
    /// Standard deviations; `None` where the run does not determine a value individually.
    pub std: Vec<Option<f64>>,
}

/// Fits all columns to the blocks of a run.
pub fn fit_blocks(blocks: &[NormalEquations]) -> BlockFit {
    let total = sum_except(blocks, None);
    let solved = total.solve();
    // If the rows scatter more than assumed, the standard deviations grow accordingly.
    let noise = (solved.residual_squares / (total.rows as f64 - solved.rank as f64).max(1.0)).max(1.0);
    let variances: Vec<f64> = (0..solved.values.len())
        .map(|i| noise * solved.covariance[(i, i)])
        .collect();
    let estimates = occupied(blocks).map(|k| {
        let part = sum_except(blocks, Some(k)).solve();
        // What the other blocks do not determine shows nothing about its scatter.
        let value = |i: usize| {
            if part.determined[i] {
                part.values[i]
            } else {
                solved.values[i]
            }
        };
        DVector::from_fn(solved.values.len(), |i, _| value(i))
    });
    let factors = variance_factors(&[estimates.collect()], &variances, &solved.determined);
    let deviation = |i: usize| {
        let variance: f64 = factors[i] * variances[i];
        solved.determined[i].then(|| variance.max(0.0).sqrt())
    };
    BlockFit {
        std: (0..variances.len()).map(deviation).collect(),
        values: solved.values,
    }
}

/// Factors, at least 1, by which the variances of estimates must grow to agree with the scatter of the estimates without
/// one block each, `estimates[run][block]`. Runs of too few blocks show no scatter.
pub(crate) fn variance_factors(estimates: &[Vec<DVector<f64>>], variances: &[f64], determined: &[bool]) -> Vec<f64> {
    let runs = || estimates.iter().filter(|run| run.len() >= JACKKNIFE_FEWEST_BLOCKS);
    let scatter = |i: usize, run: &[DVector<f64>]| -> f64 {
        let n = run.len() as f64;
        let mean = run.iter().map(|one| one[i]).sum::<f64>() / n;
        (n - 1.0) / n * run.iter().map(|one| (one[i] - mean).powi(2)).sum::<f64>()
    };
    let ratio = |i: usize| {
        let is_known = determined[i] && variances[i] > 0.0;
        is_known.then(|| runs().map(|run| scatter(i, run)).sum::<f64>() / variances[i])
    };
    let ratios: Vec<Option<f64>> = (0..variances.len()).map(ratio).collect();
    let known: Vec<f64> = ratios.iter().flatten().copied().collect();
    let common = known.iter().sum::<f64>() / known.len().max(1) as f64;
    let factor = |own: Option<f64>| own.map_or(1.0, |own| f64::midpoint(own, common).max(1.0));
    ratios.into_iter().map(factor).collect()
}

/// Indices of blocks that have rows.
pub(crate) fn occupied(blocks: &[NormalEquations]) -> impl Iterator<Item = usize> {
    (0..blocks.len()).filter(|k| blocks[*k].rows > 0)
}

/// Sum of all blocks except one.
pub(crate) fn sum_except(blocks: &[NormalEquations], but: Option<usize>) -> NormalEquations {
    let mut sum = NormalEquations::new(blocks.first().map_or(0, |block| block.rhs.len()));
    for (_, block) in blocks.iter().enumerate().filter(|(k, _)| Some(*k) != but) {
        sum.merge(block);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::TestNoise;

    /// Eight blocks of one column with the value 2, which drifts by `drift` from block to block.
    fn blocks(seed: u64, drift: f64) -> Vec<NormalEquations> {
        let mut noise = TestNoise::new(seed);
        let block = |_| {
            let level = 2.0 + drift * noise.normal();
            let z: Vec<f64> = (0..50).map(|_| noise.normal()).collect();
            let y: Vec<f64> = z.iter().map(|z| level * z + noise.normal()).collect();
            let mut one = NormalEquations::new(1);
            one.add_rows(&[Some(&z)], &y);
            one
        };
        (0..8).map(block).collect()
    }

    /// The rms value of error over standard deviation is hardly above 1, whether or not the value drifts within the run.
    #[test]
    fn standard_deviations_are_not_too_small() {
        for drift in [0.0, 0.3] {
            let squares = (0..400).map(|seed| {
                let fit = fit_blocks(&blocks(seed, drift));
                ((fit.values[0] - 2.0) / fit.std[0].expect("a deviation")).powi(2)
            });
            let ratio = (squares.sum::<f64>() / 400.0).sqrt();
            assert!((0.5..1.4).contains(&ratio), "{drift}: {ratio}");
        }
    }

    /// Runs of one block each keep their standard deviations.
    #[test]
    fn few_blocks_show_no_scatter() {
        let total = sum_except(&blocks(3, 0.5), None);
        let fit = fit_blocks(std::slice::from_ref(&total));
        let solved = total.solve();
        let noise = (solved.residual_squares / 399.0).max(1.0);
        let expected = (noise * solved.covariance[(0, 0)]).sqrt();
        assert!((fit.std[0].expect("a deviation") - expected).abs() < 1e-12);
    }
}
