//! Validation of laws on data to which they were not fitted. Each block of the fit is predicted from all other blocks,
//! and blocks of validation runs are predicted from the recordings of the fit alone.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::LawTrial;
use super::features::LawProduct;
use super::projection::LawSamples;
use crate::diagnose::bench::{EffectSelector, SelectedEffect};
use crate::diagnose::noise::effective_samples;
use crate::diagnose::pool::solve_gram;
use crate::signal::dot;

/// Largest number of blocks of each segment.
const BLOCKS: usize = 12;

/// Inner products by block of the columns of base and effects and of the residual.
pub(crate) struct BlockValidation {
    /// Ranges of the selected samples.
    blocks: Vec<Range<usize>>,
    /// Whether each block belongs to a validation run.
    is_check: Vec<bool>,
    /// Columns of base and effects, then the residual, `[channel][column][sample]`, relative to the noise. Empty where
    /// a column is zero.
    columns: Vec<Vec<Vec<f64>>>,
    /// Inner products of the columns on each block, summed over all channels.
    grams: Vec<DMatrix<f64>>,
}

/// A law with its error on data to which it was not fitted.
#[derive(Clone, Debug)]
pub(crate) struct ValidatedLaw {
    /// Squared residual of each block, relative to the noise.
    pub(crate) block_squares: Vec<f64>,
    /// Estimates of its parameters from all blocks.
    pub(crate) values: Vec<f64>,
    /// Their standard deviations, from the estimates with single blocks left out (jackknife).
    pub(crate) standard_deviations: Vec<f64>,
    /// Factors of all columns from all blocks, then -1 for the residual.
    factors: DVector<f64>,
}

impl ValidatedLaw {
    /// Squared residual of all blocks, relative to the noise.
    pub(crate) fn total(&self) -> f64 {
        self.block_squares.iter().sum()
    }

    /// Difference of the squared residual to that of another law, and the standard deviation of this difference over
    /// the blocks.
    pub(crate) fn excess_over(&self, other: &Self) -> (f64, f64) {
        // Differences block by block, since both laws have the same noise there.
        let differences: Vec<f64> = self
            .block_squares
            .iter()
            .zip(&other.block_squares)
            .map(|(a, b)| a - b)
            .collect();
        let n = differences.len() as f64;
        let mean = differences.iter().sum::<f64>() / n;
        let squares: f64 = differences.iter().map(|d| (d - mean).powi(2)).sum();
        (n * mean, (n * squares / (n - 1.0).max(1.0)).sqrt())
    }
}

impl BlockValidation {
    /// Prepares the columns of a set of effects with the residual `rest`; `deviations` are the standard deviations by
    /// which channels are divided.
    pub(crate) fn new(
        bench: &EffectSelector<'_>,
        picks: &[SelectedEffect],
        rest: &[Vec<f64>],
        samples: &LawSamples<'_>,
        deviations: &[f64],
    ) -> Self {
        let layout = &bench.problem.layout;
        let fit = layout.fit_samples();
        // Blocks of samples become ranges among the selected samples.
        let at = |sample: usize| samples.picked.partition_point(|i| *i < sample);
        // Blocks of all recordings; those behind the fit are validation blocks.
        let all = layout.blocks(BLOCKS);
        let is_check = all.iter().map(|block| block.start >= fit).collect();
        let blocks: Vec<Range<usize>> = all.iter().map(|b| at(b.start)..at(b.end)).collect();
        // Selected samples of a channel, relative to its noise.
        let some = |d: usize, values: &[f64]| -> Vec<f64> {
            let scaled = samples.picked.iter().map(|i| values[*i] / deviations[d]);
            scaled.collect()
        };
        // Columns of base and effects on each channel, then the residual as the last one.
        let columns: Vec<Vec<Vec<f64>>> = (0..deviations.len())
            .map(|d| {
                // Excluded samples are zero, so that they do not count.
                let mut all: Vec<Vec<f64>> = (bench.columns(picks).iter())
                    .map(|k| match bench.pool.column(*k).0[d].clone() {
                        Some(mut values) => {
                            bench.pool.zero_excluded(d, 0, &mut values);
                            some(d, &values)
                        }
                        None => Vec::new(),
                    })
                    .collect();
                all.push(some(d, &rest[d]));
                all
            })
            .collect();
        Self {
            grams: block_grams(&blocks, &columns),
            blocks,
            is_check,
            columns,
        }
    }

    /// Adds the columns of a law, before the residual.
    pub(crate) fn add_law(&mut self, samples: &LawSamples<'_>, site: usize, terms: &[LawProduct]) {
        let channels = samples.channels(site);
        for column in terms.iter().flat_map(|term| samples.columns(site, term)) {
            for (d, columns) in self.columns.iter_mut().enumerate() {
                // On channels without effect of the law the new column is empty.
                let part = channels.iter().position(|channel| *channel == d);
                let k = samples.picked.len();
                let own = part.map_or_else(Vec::new, |p| column[p * k..(p + 1) * k].to_vec());
                columns.insert(columns.len() - 1, own);
            }
        }
        self.grams = block_grams(&self.blocks, &self.columns);
    }

    /// Fits a law of some products at a place and validates it.
    pub(crate) fn validate_law(&self, samples: &LawSamples<'_>, site: usize, terms: &[LawProduct]) -> ValidatedLaw {
        let channels = samples.channels(site);
        // Columns of the law on the channels on which it has an effect.
        let own: Vec<Vec<f64>> = (terms.iter()).flat_map(|term| samples.columns(site, term)).collect();
        let k = samples.picked.len();
        // Number of known columns, without the residual.
        let n = self.grams.first().map_or(0, DMatrix::nrows) - 1;
        let m = own.len();
        // Inner products of one block in the order: base and effects, law, residual.
        let of_block = |(block, gram): (&Range<usize>, &DMatrix<f64>)| {
            let mut whole = DMatrix::zeros(n + m + 1, n + m + 1);
            // Known columns keep their index; the residual moves behind the law.
            let place = |i: usize| if i < n { i } else { n + m };
            for i in 0..=n {
                for j in 0..=n {
                    whole[(place(i), place(j))] = gram[(i, j)];
                }
            }
            // Add the products of the law's columns.
            for (a, column) in own.iter().enumerate() {
                for (part, d) in channels.iter().enumerate() {
                    let values = &column[part * k..(part + 1) * k];
                    // Products of the law with the known columns and the residual.
                    for (i, other) in self.columns[*d].iter().enumerate() {
                        let product = product_on_block(block, values, other);
                        whole[(n + a, place(i))] += product;
                        whole[(place(i), n + a)] += product;
                    }
                    // Products of the law's columns with each other.
                    for (b, other) in own.iter().enumerate().take(a + 1) {
                        let product = product_on_block(block, values, &other[part * k..(part + 1) * k]);
                        whole[(n + a, n + b)] += product;
                        if a != b {
                            whole[(n + b, n + a)] += product;
                        }
                    }
                }
            }
            whole
        };
        // Sums over blocks replace further passes over the samples.
        let grams: Vec<DMatrix<f64>> = self.blocks.iter().zip(&self.grams).map(of_block).collect();
        let zero = || DMatrix::zeros(n + m + 1, n + m + 1);
        // Sums over all blocks, and over those of the fit.
        let whole = grams.iter().fold(zero(), |sum, gram| sum + gram);
        let of_fit = grams.iter().zip(&self.is_check).filter(|(_, check)| !**check);
        let of_fit = of_fit.fold(zero(), |sum, (gram, _)| sum + gram);
        // Factors with -1 appended, so that the squared residual is f' G f.
        let fitted = |gram: &DMatrix<f64>| -> DVector<f64> {
            let (factors, _) = solve_gram(gram);
            factors.push(-1.0)
        };
        // Factors from the fit alone predict the validation runs.
        let by_fit = fitted(&of_fit);
        let mut left = Vec::new();
        let mut others: Vec<Vec<f64>> = Vec::new();
        for (gram, is_check) in grams.iter().zip(&self.is_check) {
            // Validation blocks are predicted from the fit; a block of the fit from all other blocks.
            let factors = if *is_check {
                by_fit.clone()
            } else {
                let factors = fitted(&(&whole - gram));
                others.push(factors.as_slice()[n..n + m].to_vec());
                factors
            };
            // Squared residual of the block with these factors.
            left.push(factors.dot(&(gram * &factors)).max(0.0));
        }
        let factors = fitted(&whole);
        let values = factors.as_slice()[n..n + m].to_vec();
        // Jackknife standard deviation from the estimates without single blocks.
        let count = others.len() as f64;
        let deviation = |a: usize| {
            let mean = others.iter().map(|one| one[a]).sum::<f64>() / count;
            let squares: f64 = others.iter().map(|one| (one[a] - mean).powi(2)).sum();
            ((count - 1.0) / count * squares).sqrt()
        };
        ValidatedLaw {
            block_squares: left,
            standard_deviations: (0..m).map(deviation).collect(),
            values,
            factors,
        }
    }

    /// Squared residual of a law that is fitted to all blocks, on the channels on which it has an effect, relative to
    /// the noise; and its effective number of samples.
    pub(super) fn residual_at_site(&self, samples: &LawSamples<'_>, one: &LawTrial) -> (f64, f64) {
        let site = one.site;
        let own: Vec<Vec<f64>> = (one.terms.iter())
            .flat_map(|term| samples.columns(site, term))
            .collect();
        let k = samples.picked.len();
        let (mut squares, mut worth) = (0.0, 0.0);
        for (part, d) in samples.channels(site).iter().enumerate() {
            // Base, effects and residual on this channel.
            let known = &self.columns[*d];
            let n = known.len() - 1;
            // Subtract the known columns and the law from the residual, with the factors from all blocks.
            let mut left = known[n].clone();
            let of_law = own.iter().map(|column| &column[part * k..(part + 1) * k]);
            let all = known[..n].iter().map(Vec::as_slice).chain(of_law);
            for (column, factor) in all.zip(one.validation.factors.iter()) {
                for (left, x) in left.iter_mut().zip(column) {
                    *left -= factor * x;
                }
            }
            squares += dot(&left, &left);
            worth += effective_samples(&left);
        }
        (squares, worth)
    }
}

/// Inner products of columns on each block, summed over all channels.
fn block_grams(blocks: &[Range<usize>], columns: &[Vec<Vec<f64>>]) -> Vec<DMatrix<f64>> {
    let n = columns.first().map_or(0, Vec::len);
    let gram = |block: &Range<usize>| {
        let mut gram = DMatrix::zeros(n, n);
        for of_channel in columns {
            for i in 0..n {
                for j in 0..=i {
                    let product = product_on_block(block, &of_channel[i], &of_channel[j]);
                    gram[(i, j)] += product;
                    if i != j {
                        gram[(j, i)] += product;
                    }
                }
            }
        }
        gram
    };
    blocks.iter().map(gram).collect()
}

/// Inner product of two columns on a block; an empty column is zero.
fn product_on_block(block: &Range<usize>, a: &[f64], b: &[f64]) -> f64 {
    if a.is_empty() || b.is_empty() {
        return 0.0;
    }
    dot(&a[block.clone()], &b[block.clone()])
}
