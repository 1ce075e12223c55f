//! Scores of products. The base parameters and the effects found are projected out of every column and of the residual,
//! each channel relative to its noise, by inner products over selected samples. Input: products of the grammar; output:
//! what each explains.

use nalgebra::{DMatrix, DVector};

use super::features::{FactorCatalog, LawFactor, LawProduct, LawSite, factors_with_other, own_factors, range};
use super::shapes::LawVariable;
use crate::diagnose::bench::{EffectSelector, SelectedEffect};
use crate::diagnose::thresholds::LAW_INDEPENDENCE_TOLERANCE;

/// Number of columns that are scored at the same time.
const BATCH: usize = 64;

/// Selected samples of all recordings, with the motion of the places.
pub(crate) struct LawSamples<'a> {
    /// All places, with complete series.
    pub(crate) sites: &'a [LawSite],
    /// Load of each place at every sample, N or N m; `None` where it is unknown.
    loads: &'a [Option<Vec<f64>>],
    /// Indices of the selected samples, ascending.
    pub(crate) picked: Vec<usize>,
    /// First sample of each segment.
    starts: Vec<usize>,
    /// Position, rate, acceleration and load of each place at the selected samples; the load is empty where it is
    /// unknown.
    tracks: Vec<[Vec<f64>; 4]>,
    /// Forces of the drives per unit force at each place, `[place][channel][sample]`, relative to the noise; `None` on
    /// channels without effect.
    forces: Vec<Vec<Option<Vec<f64>>>>,
}

impl<'a> LawSamples<'a> {
    /// Selects at most `most` samples at equal distances; `deviations` are the standard deviations of the channels.
    pub(crate) fn new(
        bench: &EffectSelector<'_>,
        sites: &'a [LawSite],
        loads: &'a [Option<Vec<f64>>],
        deviations: &[f64],
        most: usize,
    ) -> Self {
        let layout = &bench.problem.layout;
        let n = layout.samples();
        // Equally spaced samples over all recordings.
        let picked: Vec<usize> = (0..n).step_by(n.div_ceil(most).max(1)).collect();
        let some = |values: &[f64]| -> Vec<f64> { picked.iter().map(|i| values[*i]).collect() };
        let track = |(site, load): (&LawSite, &Option<Vec<f64>>)| {
            [
                some(&site.position),
                some(&site.rate),
                some(&site.acceleration),
                load.as_deref().map_or_else(Vec::new, &some),
            ]
        };
        let tracks = sites.iter().zip(loads).map(track).collect();
        // Excluded samples have no force, so that they do not count in any product.
        let forces = sites.iter().map(|site| {
            let channels = site.drive_forces.0.iter().enumerate().map(|(d, values)| {
                let mut values = values.clone()?;
                bench.pool.zero_excluded(d, 0, &mut values);
                let scaled = picked.iter().map(|i| values[*i] / deviations[d]);
                Some(scaled.collect())
            });
            channels.collect()
        });
        let mut start = 0;
        // First sample of each segment, counted over all segments.
        let starts = layout.segments.iter().map(|segment| {
            let this = start;
            start += segment.samples;
            this
        });
        Self {
            starts: starts.collect(),
            forces: forces.collect(),
            tracks,
            sites,
            loads,
            picked,
        }
    }

    /// A variable at the selected samples.
    fn track(&self, site: usize, other: Option<usize>, variable: LawVariable) -> &[f64] {
        let (at, which) = variable_place(site, other, variable);
        &self.tracks[at][which]
    }

    /// Least and largest value of a factor's variable.
    pub(crate) fn range(&self, site: usize, product: &LawProduct, factor: usize) -> [f64; 2] {
        range(self.track(site, product.other, product.factors[factor].variable))
    }

    /// Columns of a factor at the selected samples: one, or two for sine and cosine.
    fn factor_columns(&self, site: usize, other: Option<usize>, factor: &LawFactor) -> Vec<Vec<f64>> {
        if !factor.shape.has_memory() {
            let track = self.track(site, other, factor.variable);
            return factor.shape.values(track, &[0]);
        }
        // A state with memory is integrated over all samples.
        // The state is evaluated along the complete series and then reduced to the selected samples.
        let (at, _) = variable_place(site, other, factor.variable);
        let whole = factor.shape.values(&self.sites[at].position, &self.starts);
        let some = |values: Vec<f64>| self.picked.iter().map(|i| values[*i]).collect();
        whole.into_iter().map(some).collect()
    }

    /// Columns of a product: forces on the channels on which the place has an effect, one channel after the other.
    pub(crate) fn columns(&self, site: usize, product: &LawProduct) -> Vec<Vec<f64>> {
        // A product of two waves has all combinations of sines and cosines.
        let mut columns = vec![vec![1.0; self.picked.len()]];
        for factor in &product.factors {
            let shapes = self.factor_columns(site, product.other, factor);
            columns = pairwise_products(&columns, &shapes);
        }
        columns.iter().map(|one| self.drive_forces(site, one)).collect()
    }

    /// Forces of the drives for a force at a place, one channel after the other, relative to the noise.
    fn drive_forces(&self, site: usize, values: &[f64]) -> Vec<f64> {
        let mut rows = Vec::with_capacity(values.len());
        for force in self.forces[site].iter().flatten() {
            rows.extend(force.iter().zip(values).map(|(f, x)| f * x));
        }
        rows
    }

    /// Indices of the channels on which a force at a place has an effect.
    pub(crate) fn channels(&self, site: usize) -> Vec<usize> {
        let of = self.forces[site].iter().enumerate();
        of.filter_map(|(d, force)| force.as_ref().map(|_| d)).collect()
    }

    /// Factors that are tried at a place, alone and with each other place for which `wanted` is true.
    fn factor_catalogs(&self, site: usize, wanted: &dyn Fn(usize) -> bool) -> Vec<(Option<usize>, FactorCatalog)> {
        // The motion at the place itself comes first.
        let [position, rate, _, _] = &self.tracks[site];
        let load = self.loads[site].as_ref().map(|_| &self.tracks[site][3][..]);
        let mut menus = vec![(None, own_factors(position, rate, load))];
        for (other, [position, other_rate, _, _]) in self.tracks.iter().enumerate() {
            if other != site && wanted(other) {
                let is_angle = self.sites[other].is_angle;
                menus.push((Some(other), factors_with_other(rate, position, other_rate, is_angle)));
            }
        }
        menus
    }
}

/// Index of the place that a variable belongs to, and of its series among the four of that place.
fn variable_place(site: usize, other: Option<usize>, variable: LawVariable) -> (usize, usize) {
    let away = other.unwrap_or(site);
    match variable {
        LawVariable::Position => (site, 0),
        LawVariable::Rate => (site, 1),
        LawVariable::Acceleration => (site, 2),
        LawVariable::Load => (site, 3),
        LawVariable::OtherPosition => (away, 0),
        LawVariable::OtherRate => (away, 1),
    }
}

/// All products of two lists of columns.
fn pairwise_products(some: &[Vec<f64>], others: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).collect();
    some.iter()
        .flat_map(|a| others.iter().map(move |b| product(a, b)))
        .collect()
}

/// A product with its score.
#[derive(Clone, Debug)]
pub(crate) struct ScoredProduct {
    /// Index of its place.
    pub(crate) site: usize,
    /// The product.
    pub(crate) product: LawProduct,
    /// Decrease of the squared residual, relative to the noise.
    pub(crate) score: f64,
}

/// Orthonormal basis of what is projected out, and the residual.
#[derive(Clone)]
pub(crate) struct LawProjection {
    /// Number of samples of each channel.
    samples: usize,
    /// Orthonormal columns; rows are the channels one after the other.
    basis: DMatrix<f64>,
    /// Measured forces with the basis projected out, relative to the noise.
    residual: DVector<f64>,
}

impl LawProjection {
    /// Projects out the base parameters and a set of effects.
    pub(crate) fn new(
        bench: &EffectSelector<'_>,
        picks: &[SelectedEffect],
        samples: &LawSamples<'_>,
        deviations: &[f64],
    ) -> Self {
        // A column of the pool as one vector: channels one after the other, each relative to its noise.
        let stacked = |column: usize| {
            let channels = bench.pool.column(column).0.iter().enumerate();
            let values = channels.flat_map(|(d, values)| {
                let mut values = values
                    .clone()
                    .unwrap_or_else(|| vec![0.0; bench.pool.all_samples().len()]);
                bench.pool.zero_excluded(d, 0, &mut values);
                let scaled = samples.picked.iter().map(|i| values[*i] / deviations[d]);
                scaled.collect::<Vec<f64>>()
            });
            DVector::from_vec(values.collect())
        };
        let mut ground = Self {
            samples: samples.picked.len(),
            basis: DMatrix::zeros(deviations.len() * samples.picked.len(), 0),
            residual: stacked(bench.measured),
        };
        // Project the base and the set out of the measured forces; the rest is the residual.
        let columns = bench.columns(picks);
        ground.project_out(columns.into_iter().map(stacked));
        ground
    }

    /// Projects out further columns (Gram-Schmidt, each column twice against rounding).
    fn project_out(&mut self, columns: impl Iterator<Item = DVector<f64>>) {
        let mut basis: Vec<DVector<f64>> = self.basis.column_iter().map(nalgebra::Matrix::into_owned).collect();
        for column in columns {
            let mut left = column.clone();
            // Twice, since the first pass has rounding errors.
            for _ in 0..2 {
                for direction in &basis {
                    let share = direction.dot(&left);
                    left.axpy(-share, direction, 1.0);
                }
            }
            let size = left.norm();
            // Dependent columns add no direction.
            if size * size > 1e-12 * column.norm_squared() {
                basis.push(left / size);
            }
        }
        if basis.is_empty() {
            return;
        }
        for direction in &basis {
            let share = direction.dot(&self.residual);
            self.residual.axpy(-share, direction, 1.0);
        }
        self.basis = DMatrix::from_columns(&basis);
    }

    /// A copy with a product at a place projected out as well.
    pub(crate) fn conditional_on_product(&self, samples: &LawSamples<'_>, site: usize, product: &LawProduct) -> Self {
        // The residual is projected again together with the basis.
        let mut more = self.clone();
        let n = self.samples;
        let channels = samples.channels(site);
        // Extend the columns by zeros on the channels without effect.
        let whole = samples.columns(site, product).into_iter().map(|rows| {
            let mut whole = DVector::zeros(self.residual.len());
            for (part, d) in rows.chunks(n).zip(&channels) {
                whole.rows_mut(d * n, n).copy_from_slice(part);
            }
            whole
        });
        more.project_out(whole.collect::<Vec<_>>().into_iter());
        more
    }

    /// The rows of the channels on which a place has an effect.
    pub(crate) fn project_at_site(&self, samples: &LawSamples<'_>, site: usize) -> SiteProjection {
        let n = self.samples;
        let channels = samples.channels(site);
        // Rows of the stacked vectors that belong to these channels.
        let rows: Vec<usize> = channels.iter().flat_map(|d| d * n..(d + 1) * n).collect();
        // The basis is transposed, so that it multiplies columns from the left.
        let k = self.basis.ncols();
        SiteProjection {
            site,
            basis: DMatrix::from_fn(k, rows.len(), |i, j| self.basis[(rows[j], i)]),
            residual: DVector::from_iterator(rows.len(), rows.iter().map(|i| self.residual[*i])),
        }
    }
}

/// Rows of a projection for the channels on which a place has an effect.
pub(crate) struct SiteProjection {
    site: usize,
    /// Transposed basis, as products with many columns need it.
    basis: DMatrix<f64>,
    residual: DVector<f64>,
}

impl SiteProjection {
    /// Score of one product.
    pub(crate) fn score(&self, samples: &LawSamples<'_>, product: &LawProduct) -> f64 {
        let columns = samples.columns(self.site, product);
        self.scores(&columns, &[columns.len()])[0]
    }

    /// Scores every product of the grammar at the place, with other places for which `wanted` is true. Products that
    /// explain nothing are omitted.
    pub(crate) fn screen_products(
        &self,
        samples: &LawSamples<'_>,
        wanted: &dyn Fn(usize) -> bool,
    ) -> Vec<ScoredProduct> {
        let site = self.site;
        let mut batch = ProductBatch::default();
        let mut scored = Vec::new();
        for (other, menu) in samples.factor_catalogs(site, wanted) {
            // Columns of a list of factors, evaluated once for all pairs.
            let list = |factors: &[LawFactor]| -> Vec<Vec<Vec<f64>>> {
                let of = |factor| samples.factor_columns(site, other, factor);
                factors.iter().map(of).collect()
            };
            // Products of one factor.
            for factor in &menu.single_factors {
                let product = LawProduct {
                    other,
                    factors: vec![*factor],
                };
                let columns = samples.factor_columns(site, other, factor);
                let felt = columns.iter().map(|one| samples.drive_forces(site, one));
                batch.add(product, felt.collect());
                batch.score_batch(self, BATCH, &mut scored);
            }
            // Products of two factors.
            for [some, others] in &menu.pairs {
                let (a, b) = (list(some), list(others));
                for (first, a) in some.iter().zip(&a) {
                    for (second, b) in others.iter().zip(&b) {
                        let product = LawProduct {
                            other,
                            factors: vec![*first, *second],
                        };
                        let columns = pairwise_products(a, b);
                        let felt = columns.iter().map(|one| samples.drive_forces(site, one));
                        batch.add(product, felt.collect());
                        batch.score_batch(self, BATCH, &mut scored);
                    }
                }
            }
        }
        // Score the last batch.
        batch.score_batch(self, 1, &mut scored);
        scored
    }

    /// Decrease of the squared residual for groups of columns; `counts` gives the number of columns of each group, one
    /// or two.
    fn scores(&self, columns: &[Vec<f64>], counts: &[usize]) -> Vec<f64> {
        let rows = self.residual.len();
        let matrix = DMatrix::from_iterator(rows, columns.len(), columns.iter().flatten().copied());
        // Products of all columns with the basis and with the residual, in two matrix products.
        let taken = &self.basis * &matrix;
        let with_rest = matrix.tr_mul(&self.residual);
        let product =
            |i: usize, j: usize| matrix.column(i).dot(&matrix.column(j)) - taken.column(i).dot(&taken.column(j));
        let mut at = 0;
        let of_group = |count: &usize| {
            // Indices of the one or two columns of the group.
            let (i, j) = (at, at + 1);
            at += count;
            let own = product(i, i);
            // Whether a column depends on what is projected out.
            let is_said = |own: f64, k: usize| {
                !own.is_finite() || own <= LAW_INDEPENDENCE_TOLERANCE * matrix.column(k).norm_squared()
            };
            if is_said(own, i) {
                return 0.0;
            }
            // Decrease of the squares by one column: the squared product with the residual over its own square.
            let first = with_rest[i] * with_rest[i] / own;
            if *count == 1 {
                return first;
            }
            // Second column of the group: the part that is orthogonal to the first.
            let across = product(i, j);
            let beside = product(j, j) - across * across / own;
            if is_said(beside, j) {
                return first;
            }
            // Product of the second column's orthogonal part with the residual.
            let left = with_rest[j] - across / own * with_rest[i];
            first + left * left / beside
        };
        counts.iter().map(of_group).collect()
    }
}

/// Products whose columns are collected for one matrix product.
#[derive(Default)]
struct ProductBatch {
    products: Vec<LawProduct>,
    /// Number of columns of each product.
    counts: Vec<usize>,
    /// Their columns, one product after the other.
    columns: Vec<Vec<f64>>,
}

impl ProductBatch {
    /// Adds a product with its columns.
    fn add(&mut self, product: LawProduct, columns: Vec<Vec<f64>>) {
        self.products.push(product);
        self.counts.push(columns.len());
        self.columns.extend(columns);
    }

    /// Scores the collected products and empties the batch, if it has at least `least` columns.
    fn score_batch(&mut self, part: &SiteProjection, least: usize, scored: &mut Vec<ScoredProduct>) {
        if self.columns.len() < least {
            return;
        }
        let scores = part.scores(&self.columns, &self.counts);
        // Products that explain nothing are dropped here, so that lists stay short.
        let all = std::mem::take(&mut self.products).into_iter().zip(scores);
        scored.extend(
            all.filter(|(_, score)| *score > 0.0)
                .map(|(product, score)| ScoredProduct {
                    site: part.site,
                    product,
                    score,
                }),
        );
        self.counts.clear();
        self.columns.clear();
    }
}
