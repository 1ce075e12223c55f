//! The ground on which products are scored: what the base parameters and the effects that were found take up is projected out of
//! every column and of what is left, each channel in units of its noise, by inner products over some samples.

use nalgebra::{DMatrix, DVector};

use super::features::{Factor, Menu, Product, Site, own, range, with_other};
use super::shapes::Variable;
use crate::diagnose::bench::{Bench, Pick};

/// A column of which others leave a smaller share of squares than this says nothing new.
const SAID: f64 = 1e-5;
/// Columns of products that are looked at at once.
const BATCH: usize = 64;

/// Samples of all recordings that are looked at, and what places do along them.
pub(crate) struct Samples<'a> {
    pub(crate) sites: &'a [Site],
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

impl<'a> Samples<'a> {
    /// About `most` samples; `deviations` is the noise of each channel.
    pub(crate) fn new(
        bench: &Bench<'_>,
        sites: &'a [Site],
        loads: &'a [Option<Vec<f64>>],
        deviations: &[f64],
        most: usize,
    ) -> Self {
        let layout = &bench.problem.layout;
        let n = layout.samples();
        let picked: Vec<usize> = (0..n).step_by(n.div_ceil(most).max(1)).collect();
        let some = |values: &[f64]| -> Vec<f64> { picked.iter().map(|i| values[*i]).collect() };
        let track = |(site, load): (&Site, &Option<Vec<f64>>)| {
            [
                some(&site.position),
                some(&site.rate),
                some(&site.acceleration),
                load.as_deref().map_or_else(Vec::new, &some),
            ]
        };
        let tracks = sites.iter().zip(loads).map(track).collect();
        let forces = sites.iter().map(|site| {
            let channels = site.force.0.iter().enumerate().map(|(d, values)| {
                let mut values = values.clone()?;
                bench.pool.silence(d, 0, &mut values);
                let scaled = picked.iter().map(|i| values[*i] / deviations[d]);
                Some(scaled.collect())
            });
            channels.collect()
        });
        let mut start = 0;
        let starts = layout.stretches.iter().map(|stretch| {
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

    fn track(&self, site: usize, other: Option<usize>, variable: Variable) -> &[f64] {
        let (at, which) = place_of(site, other, variable);
        &self.tracks[at][which]
    }

    /// Least and largest value of a factor's variable.
    pub(crate) fn range(&self, site: usize, product: &Product, factor: usize) -> [f64; 2] {
        range(self.track(site, product.other, product.factors[factor].variable))
    }

    /// A factor along the samples.
    fn factor(&self, site: usize, other: Option<usize>, factor: &Factor) -> Vec<Vec<f64>> {
        if !factor.shape.remembers() {
            let track = self.track(site, other, factor.variable);
            return factor.shape.values(track, &[0]);
        }
        // What remembers must see all of the way.
        let (at, _) = place_of(site, other, factor.variable);
        let whole = factor.shape.values(&self.sites[at].position, &self.starts);
        let some = |values: Vec<f64>| self.picked.iter().map(|i| values[*i]).collect();
        whole.into_iter().map(some).collect()
    }

    /// The columns of a product: channels on which the place is felt one after the other.
    pub(crate) fn columns(&self, site: usize, product: &Product) -> Vec<Vec<f64>> {
        let mut columns = vec![vec![1.0; self.picked.len()]];
        for factor in &product.factors {
            let shapes = self.factor(site, product.other, factor);
            columns = pairs(&columns, &shapes);
        }
        columns.iter().map(|one| self.felt(site, one)).collect()
    }

    /// What the drives must supply for a force at a place, channel after channel, in units of the noise.
    fn felt(&self, site: usize, values: &[f64]) -> Vec<f64> {
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
    fn menus(&self, site: usize, wanted: &dyn Fn(usize) -> bool) -> Vec<(Option<usize>, Menu)> {
        let [position, rate, _, _] = &self.tracks[site];
        let load = self.loads[site].as_ref().map(|_| &self.tracks[site][3][..]);
        let mut menus = vec![(None, own(position, rate, load))];
        for (other, [position, other_rate, _, _]) in self.tracks.iter().enumerate() {
            if other != site && wanted(other) {
                let is_angle = self.sites[other].is_angle;
                menus.push((
                    Some(other),
                    with_other(rate, position, other_rate, is_angle),
                ));
            }
        }
        menus
    }
}

/// The place whose variable it is, and which of its tracks.
fn place_of(site: usize, other: Option<usize>, variable: Variable) -> (usize, usize) {
    let away = other.unwrap_or(site);
    match variable {
        Variable::Position => (site, 0),
        Variable::Rate => (site, 1),
        Variable::Acceleration => (site, 2),
        Variable::Load => (site, 3),
        Variable::OtherPosition => (away, 0),
        Variable::OtherRate => (away, 1),
    }
}

/// Every product of two lists of columns.
fn pairs(some: &[Vec<f64>], others: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).collect();
    some.iter()
        .flat_map(|a| others.iter().map(move |b| product(a, b)))
        .collect()
}

/// A product with what it explains.
#[derive(Clone, Debug)]
pub(crate) struct Scored {
    pub(crate) site: usize,
    pub(crate) product: Product,
    /// Squares that it takes off, in units of the noise.
    pub(crate) score: f64,
}

/// What is projected out, and what is left.
#[derive(Clone)]
pub(crate) struct Ground {
    samples: usize,
    /// Orthonormal columns, channels one after the other.
    basis: DMatrix<f64>,
    rest: DVector<f64>,
}

impl Ground {
    /// Beside a set of effects.
    pub(crate) fn new(
        bench: &Bench<'_>,
        picks: &[Pick],
        samples: &Samples<'_>,
        deviations: &[f64],
    ) -> Self {
        let stacked = |column: usize| {
            let channels = bench.pool.column(column).0.iter().enumerate();
            let values = channels.flat_map(|(d, values)| {
                let mut values = values
                    .clone()
                    .unwrap_or_else(|| vec![0.0; bench.pool.all().len()]);
                bench.pool.silence(d, 0, &mut values);
                let scaled = samples.picked.iter().map(|i| values[*i] / deviations[d]);
                scaled.collect::<Vec<f64>>()
            });
            DVector::from_vec(values.collect())
        };
        let mut ground = Self {
            samples: samples.picked.len(),
            basis: DMatrix::zeros(deviations.len() * samples.picked.len(), 0),
            rest: stacked(bench.measured),
        };
        let columns = bench.columns(picks);
        ground.take_up(columns.into_iter().map(stacked));
        ground
    }

    /// Takes further columns up.
    fn take_up(&mut self, columns: impl Iterator<Item = DVector<f64>>) {
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
            let share = direction.dot(&self.rest);
            self.rest.axpy(-share, direction, 1.0);
        }
        self.basis = DMatrix::from_columns(&basis);
    }

    /// The same beside a product at a place.
    pub(crate) fn beside(&self, samples: &Samples<'_>, site: usize, product: &Product) -> Self {
        let mut more = self.clone();
        let n = self.samples;
        let channels = samples.channels(site);
        let whole = samples.columns(site, product).into_iter().map(|rows| {
            let mut whole = DVector::zeros(self.rest.len());
            for (part, d) in rows.chunks(n).zip(&channels) {
                whole.rows_mut(d * n, n).copy_from_slice(part);
            }
            whole
        });
        more.take_up(whole.collect::<Vec<_>>().into_iter());
        more
    }

    /// The part that feels a place.
    pub(crate) fn at(&self, samples: &Samples<'_>, site: usize) -> Part {
        let n = self.samples;
        let channels = samples.channels(site);
        let rows: Vec<usize> = channels.iter().flat_map(|d| d * n..(d + 1) * n).collect();
        let k = self.basis.ncols();
        Part {
            site,
            basis: DMatrix::from_fn(k, rows.len(), |i, j| self.basis[(rows[j], i)]),
            rest: DVector::from_iterator(rows.len(), rows.iter().map(|i| self.rest[*i])),
        }
    }
}

/// Rows of the ground on the channels that feel a place.
pub(crate) struct Part {
    site: usize,
    /// Transposed, as products with many columns need it.
    basis: DMatrix<f64>,
    rest: DVector<f64>,
}

impl Part {
    /// What one product takes off.
    pub(crate) fn score(&self, samples: &Samples<'_>, product: &Product) -> f64 {
        let columns = samples.columns(self.site, product);
        self.scores(&columns, &[columns.len()])[0]
    }

    /// What every product of the grammar takes off, beside others that `wanted` names; those that take nothing off are left out.
    pub(crate) fn screen(
        &self,
        samples: &Samples<'_>,
        wanted: &dyn Fn(usize) -> bool,
    ) -> Vec<Scored> {
        let site = self.site;
        let mut batch = Batch::default();
        let mut scored = Vec::new();
        for (other, menu) in samples.menus(site, wanted) {
            let list = |factors: &[Factor]| -> Vec<Vec<Vec<f64>>> {
                let of = |factor| samples.factor(site, other, factor);
                factors.iter().map(of).collect()
            };
            for factor in &menu.alone {
                let product = Product {
                    other,
                    factors: vec![*factor],
                };
                let columns = samples.factor(site, other, factor);
                let felt = columns.iter().map(|one| samples.felt(site, one));
                batch.add(product, felt.collect());
                batch.work_off(self, BATCH, &mut scored);
            }
            for [some, others] in &menu.pairs {
                let (a, b) = (list(some), list(others));
                for (first, a) in some.iter().zip(&a) {
                    for (second, b) in others.iter().zip(&b) {
                        let product = Product {
                            other,
                            factors: vec![*first, *second],
                        };
                        let columns = pairs(a, b);
                        let felt = columns.iter().map(|one| samples.felt(site, one));
                        batch.add(product, felt.collect());
                        batch.work_off(self, BATCH, &mut scored);
                    }
                }
            }
        }
        batch.work_off(self, 1, &mut scored);
        scored
    }

    /// Squares that groups of columns take off; each group has one or two.
    fn scores(&self, columns: &[Vec<f64>], counts: &[usize]) -> Vec<f64> {
        let rows = self.rest.len();
        let matrix = DMatrix::from_iterator(rows, columns.len(), columns.iter().flatten().copied());
        let taken = &self.basis * &matrix;
        let with_rest = matrix.tr_mul(&self.rest);
        let product = |i: usize, j: usize| {
            matrix.column(i).dot(&matrix.column(j)) - taken.column(i).dot(&taken.column(j))
        };
        let mut at = 0;
        let of_group = |count: &usize| {
            let (i, j) = (at, at + 1);
            at += count;
            let own = product(i, i);
            let is_said = |own: f64, k: usize| {
                !own.is_finite() || own <= SAID * matrix.column(k).norm_squared()
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
struct Batch {
    products: Vec<Product>,
    /// Columns of each.
    counts: Vec<usize>,
    columns: Vec<Vec<f64>>,
}

impl Batch {
    fn add(&mut self, product: Product, columns: Vec<Vec<f64>>) {
        self.products.push(product);
        self.counts.push(columns.len());
        self.columns.extend(columns);
    }

    /// Scores those that wait if there are so many.
    fn work_off(&mut self, part: &Part, least: usize, scored: &mut Vec<Scored>) {
        if self.columns.len() < least {
            return;
        }
        let scores = part.scores(&self.columns, &self.counts);
        let all = std::mem::take(&mut self.products).into_iter().zip(scores);
        scored.extend(
            all.filter(|(_, score)| *score > 0.0)
                .map(|(product, score)| Scored {
                    site: part.site,
                    product,
                    score,
                }),
        );
        self.counts.clear();
        self.columns.clear();
    }
}
