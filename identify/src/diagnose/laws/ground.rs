//! The ground on which products are scored: what the base parameters and the effects that were found take up is projected out of
//! every column and of what is left, each channel in units of its noise, by inner products over some samples.

use nalgebra::{DMatrix, DVector};

use super::features::{
    FactorCatalog, LawFactor, LawProduct, LawSite, factors_with_other, own_factors, range,
};
use super::shapes::LawVariable;
use crate::diagnose::bench::{EffectSelector, SelectedEffect};

/// A column of which others leave a smaller share of squares than this says nothing new.
const INDEPENDENCE_TOLERANCE: f64 = 1e-5;
/// Columns of products that are looked at at once.
const BATCH: usize = 64;

/// Samples of all recordings that are looked at, and what places do along them.
pub(crate) struct LawSamples<'a> {
    pub(crate) sites: &'a [LawSite],
    loads: &'a [Option<Vec<f64>>],
    /// Which samples.
    pub(crate) picked: Vec<usize>,
    /// Where stretches begin, among all samples.
    starts: Vec<usize>,
    /// Position, rate, acceleration and load of each place.
    tracks: Vec<[Vec<f64>; 4]>,
    /// What the drives must supply for one at each place, in units of the noise; `None` on channels that do not feel it.
    forces: Vec<Vec<Option<Vec<f64>>>>,
}

impl<'a> LawSamples<'a> {
    /// About `most` samples; `deviations` is the noise of each channel.
    pub(crate) fn new(
        bench: &EffectSelector<'_>,
        sites: &'a [LawSite],
        loads: &'a [Option<Vec<f64>>],
        deviations: &[f64],
        most: usize,
    ) -> Self {
        let layout = &bench.problem.layout;
        let n = layout.samples();
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
        let starts = layout.segments.iter().map(|stretch| {
            let this = start;
            start += stretch.samples;
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

    fn track(&self, site: usize, other: Option<usize>, variable: LawVariable) -> &[f64] {
        let (at, which) = variable_place(site, other, variable);
        &self.tracks[at][which]
    }

    /// Least and largest value of a factor's variable.
    pub(crate) fn range(&self, site: usize, product: &LawProduct, factor: usize) -> [f64; 2] {
        range(self.track(site, product.other, product.factors[factor].variable))
    }

    /// A factor along the samples.
    fn factor_columns(
        &self,
        site: usize,
        other: Option<usize>,
        factor: &LawFactor,
    ) -> Vec<Vec<f64>> {
        if !factor.shape.has_memory() {
            let track = self.track(site, other, factor.variable);
            return factor.shape.values(track, &[0]);
        }
        // What remembers must see all of the way.
        let (at, _) = variable_place(site, other, factor.variable);
        let whole = factor.shape.values(&self.sites[at].position, &self.starts);
        let some = |values: Vec<f64>| self.picked.iter().map(|i| values[*i]).collect();
        whole.into_iter().map(some).collect()
    }

    /// The columns of a product: channels on which the place is felt one after the other.
    pub(crate) fn columns(&self, site: usize, product: &LawProduct) -> Vec<Vec<f64>> {
        let mut columns = vec![vec![1.0; self.picked.len()]];
        for factor in &product.factors {
            let shapes = self.factor_columns(site, product.other, factor);
            columns = pairwise_products(&columns, &shapes);
        }
        columns
            .iter()
            .map(|one| self.drive_forces(site, one))
            .collect()
    }

    /// What the drives must supply for a force at a place, channel after channel, in units of the noise.
    fn drive_forces(&self, site: usize, values: &[f64]) -> Vec<f64> {
        let mut rows = Vec::with_capacity(values.len());
        for force in self.forces[site].iter().flatten() {
            rows.extend(force.iter().zip(values).map(|(f, x)| f * x));
        }
        rows
    }

    /// Channels on which a place is felt.
    pub(crate) fn channels(&self, site: usize) -> Vec<usize> {
        let of = self.forces[site].iter().enumerate();
        of.filter_map(|(d, force)| force.as_ref().map(|_| d))
            .collect()
    }

    /// What is tried at a place: by itself, and with each other place that `wanted` names.
    fn factor_catalogs(
        &self,
        site: usize,
        wanted: &dyn Fn(usize) -> bool,
    ) -> Vec<(Option<usize>, FactorCatalog)> {
        let [position, rate, _, _] = &self.tracks[site];
        let load = self.loads[site].as_ref().map(|_| &self.tracks[site][3][..]);
        let mut menus = vec![(None, own_factors(position, rate, load))];
        for (other, [position, other_rate, _, _]) in self.tracks.iter().enumerate() {
            if other != site && wanted(other) {
                let is_angle = self.sites[other].is_angle;
                menus.push((
                    Some(other),
                    factors_with_other(rate, position, other_rate, is_angle),
                ));
            }
        }
        menus
    }
}

/// The place whose variable it is, and which of its tracks.
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

/// Every product of two lists of columns.
fn pairwise_products(some: &[Vec<f64>], others: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).collect();
    some.iter()
        .flat_map(|a| others.iter().map(move |b| product(a, b)))
        .collect()
}

/// A product with what it explains.
#[derive(Clone, Debug)]
pub(crate) struct ScoredProduct {
    pub(crate) site: usize,
    pub(crate) product: LawProduct,
    /// Squares that it takes off, in units of the noise.
    pub(crate) score: f64,
}

/// What is projected out, and what is left.
#[derive(Clone)]
pub(crate) struct LawProjection {
    samples: usize,
    /// Orthonormal columns, channels one after the other.
    basis: DMatrix<f64>,
    residual: DVector<f64>,
}

impl LawProjection {
    /// Beside a set of effects.
    pub(crate) fn new(
        bench: &EffectSelector<'_>,
        picks: &[SelectedEffect],
        samples: &LawSamples<'_>,
        deviations: &[f64],
    ) -> Self {
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
        let columns = bench.columns(picks);
        ground.project_out(columns.into_iter().map(stacked));
        ground
    }

    /// Takes further columns up.
    fn project_out(&mut self, columns: impl Iterator<Item = DVector<f64>>) {
        let mut basis: Vec<DVector<f64>> = self
            .basis
            .column_iter()
            .map(nalgebra::Matrix::into_owned)
            .collect();
        for column in columns {
            let mut left = column.clone();
            for _ in 0..2 {
                for direction in &basis {
                    let share = direction.dot(&left);
                    left.axpy(-share, direction, 1.0);
                }
            }
            let size = left.norm();
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

    /// The same beside a product at a place.
    pub(crate) fn conditional_on_product(
        &self,
        samples: &LawSamples<'_>,
        site: usize,
        product: &LawProduct,
    ) -> Self {
        let mut more = self.clone();
        let n = self.samples;
        let channels = samples.channels(site);
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

    /// The part that feels a place.
    pub(crate) fn project_at_site(&self, samples: &LawSamples<'_>, site: usize) -> SiteProjection {
        let n = self.samples;
        let channels = samples.channels(site);
        let rows: Vec<usize> = channels.iter().flat_map(|d| d * n..(d + 1) * n).collect();
        let k = self.basis.ncols();
        SiteProjection {
            site,
            basis: DMatrix::from_fn(k, rows.len(), |i, j| self.basis[(rows[j], i)]),
            residual: DVector::from_iterator(rows.len(), rows.iter().map(|i| self.residual[*i])),
        }
    }
}

/// Rows of the ground on the channels that feel a place.
pub(crate) struct SiteProjection {
    site: usize,
    /// Transposed, as products with many columns need it.
    basis: DMatrix<f64>,
    residual: DVector<f64>,
}

impl SiteProjection {
    /// What one product takes off.
    pub(crate) fn score(&self, samples: &LawSamples<'_>, product: &LawProduct) -> f64 {
        let columns = samples.columns(self.site, product);
        self.scores(&columns, &[columns.len()])[0]
    }

    /// What every product of the grammar takes off, beside others that `wanted` names; those that take nothing off are left out.
    pub(crate) fn screen_products(
        &self,
        samples: &LawSamples<'_>,
        wanted: &dyn Fn(usize) -> bool,
    ) -> Vec<ScoredProduct> {
        let site = self.site;
        let mut batch = ProductBatch::default();
        let mut scored = Vec::new();
        for (other, menu) in samples.factor_catalogs(site, wanted) {
            let list = |factors: &[LawFactor]| -> Vec<Vec<Vec<f64>>> {
                let of = |factor| samples.factor_columns(site, other, factor);
                factors.iter().map(of).collect()
            };
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
        batch.score_batch(self, 1, &mut scored);
        scored
    }

    /// Squares that groups of columns take off; each group has one or two.
    fn scores(&self, columns: &[Vec<f64>], counts: &[usize]) -> Vec<f64> {
        let rows = self.residual.len();
        let matrix = DMatrix::from_iterator(rows, columns.len(), columns.iter().flatten().copied());
        let taken = &self.basis * &matrix;
        let with_rest = matrix.tr_mul(&self.residual);
        let product = |i: usize, j: usize| {
            matrix.column(i).dot(&matrix.column(j)) - taken.column(i).dot(&taken.column(j))
        };
        let mut at = 0;
        let of_group = |count: &usize| {
            let (i, j) = (at, at + 1);
            at += count;
            let own = product(i, i);
            let is_said = |own: f64, k: usize| {
                !own.is_finite() || own <= INDEPENDENCE_TOLERANCE * matrix.column(k).norm_squared()
            };
            if is_said(own, i) {
                return 0.0;
            }
            let first = with_rest[i] * with_rest[i] / own;
            if *count == 1 {
                return first;
            }
            let across = product(i, j);
            let beside = product(j, j) - across * across / own;
            if is_said(beside, j) {
                return first;
            }
            let left = with_rest[j] - across / own * with_rest[i];
            first + left * left / beside
        };
        counts.iter().map(of_group).collect()
    }
}

/// Products whose columns wait for their inner products.
#[derive(Default)]
struct ProductBatch {
    products: Vec<LawProduct>,
    /// Columns of each.
    counts: Vec<usize>,
    columns: Vec<Vec<f64>>,
}

impl ProductBatch {
    fn add(&mut self, product: LawProduct, columns: Vec<Vec<f64>>) {
        self.products.push(product);
        self.counts.push(columns.len());
        self.columns.extend(columns);
    }

    /// Scores those that wait if there are so many.
    fn score_batch(
        &mut self,
        part: &SiteProjection,
        least: usize,
        scored: &mut Vec<ScoredProduct>,
    ) {
        if self.columns.len() < least {
            return;
        }
        let scores = part.scores(&self.columns, &self.counts);
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
