//! Inner products of the columns of a set, of the shapes of changes and of the measured forces, block by block. Any
//! time profile of a change follows from sums over the blocks.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::super::column::ForceColumn;
use super::super::factored::GramFactor;
use super::super::noise::effective_samples as independent_samples;
use super::super::pool::solve_gram;
use super::super::problem::DiagnosisProblem;
use super::profile::TimeProfile;
use super::residual::standstill_samples;
use super::{ChangeForce, ChangeShape};
use crate::signal::dot;

/// Number of blocks of a recording.
const BLOCKS: usize = 40;
/// Largest number of columns: the effort grows with its square. Larger models are not searched for changes.
const MOST_COLUMNS: usize = 400;
/// Fewest samples of a block.
const FEWEST_IN_BLOCK: usize = 5;

impl DiagnosisProblem {
    /// Whether changes within recordings are searched: not for models with very many columns.
    pub fn searches_changes(&self) -> bool {
        self.columns_of_changes(self.base.len()) <= MOST_COLUMNS
    }

    /// Number of columns of a search of changes beside a set of `set` columns.
    fn columns_of_changes(&self, set: usize) -> usize {
        let of_shapes = self.change_shapes.iter().map(|shape| shape.parameters.len());
        set + self.friction.len() + of_shapes.sum::<usize>()
    }
}

/// A recording, cut into blocks.
pub(super) struct CutRecording {
    /// Its name.
    pub(super) name: String,
    /// Its samples.
    pub(super) samples: Range<usize>,
    /// Its blocks as ranges of samples.
    pub(super) blocks: Vec<Range<usize>>,
    /// Inner products of each block: columns of the set, then those of all shapes, then the measured forces.
    products: Vec<DMatrix<f64>>,
    /// Weighted squares of the residual of the set by channel.
    squares: Vec<f64>,
}

/// The products of a shape in one block, with the set projected out.
struct ReducedBlock {
    /// Columns of the shape with each other.
    own: DMatrix<f64>,
    /// Columns of the shape with the residual of the set.
    right: DVector<f64>,
    /// `L^-1 C` for the products `C` of the set with the columns of the shape, `L` the factor of the set.
    halves: DMatrix<f64>,
}

/// The same for all blocks of one or more recordings.
pub(super) struct ReducedBlocks {
    /// The blocks.
    blocks: Vec<ReducedBlock>,
    /// Number of columns of the shape.
    columns: usize,
    /// Weighted squares of the residual of the set.
    squares: f64,
}

impl ReducedBlocks {
    /// Decrease of the weighted squares if the shape acts with some time profiles, one value per block. Each profile has
    /// its own parameters.
    pub(super) fn explained_squares(&self, profiles: &[&[f64]]) -> f64 {
        self.squares - solve_gram(&self.gram(profiles)).1
    }

    /// Products of the shape with some profiles and of the residual.
    fn gram(&self, profiles: &[&[f64]]) -> DMatrix<f64> {
        let p = self.columns;
        let m = p * profiles.len();
        let n = self.blocks.first().map_or(0, |block| block.halves.nrows());
        let mut own = DMatrix::zeros(m, m);
        let mut halves = DMatrix::zeros(n, m);
        let mut right = DVector::zeros(m);
        for (b, block) in self.blocks.iter().enumerate() {
            for (k, profile) in profiles.iter().enumerate().filter(|(_, profile)| profile[b] != 0.0) {
                for (l, other) in profiles.iter().enumerate().filter(|(_, other)| other[b] != 0.0) {
                    let mut part = own.view_mut((p * k, p * l), (p, p));
                    part += profile[b] * other[b] * &block.own;
                }
                let mut part = halves.view_mut((0, p * k), (n, p));
                part += profile[b] * &block.halves;
                let mut part = right.rows_mut(p * k, p);
                part += profile[b] * &block.right;
            }
        }
        let left = &own - halves.transpose() * &halves;
        let mut gram = left.resize(m + 1, m + 1, 0.0);
        for i in 0..m {
            // What remains at the level of rounding belongs to the set.
            if gram[(i, i)] <= DEPENDENT_SHARE * own[(i, i)] {
                gram.row_mut(i).fill(0.0);
                gram.column_mut(i).fill(0.0);
                continue;
            }
            gram[(i, m)] = right[i];
            gram[(m, i)] = right[i];
        }
        gram[(m, m)] = self.squares;
        gram
    }
}

/// All products that a search of changes needs.
pub(super) struct BlockProducts<'a> {
    /// The problem.
    problem: &'a DiagnosisProblem,
    /// Columns of the set and of the friction of every drive.
    set: Vec<&'a ForceColumn>,
    /// Columns of each shape.
    shapes: Vec<Vec<ForceColumn>>,
    /// Index of the first column of each shape among all columns.
    starts: Vec<usize>,
    /// All recordings.
    pub(super) recordings: Vec<CutRecording>,
    /// Weight of each channel, one over the variance of its residual.
    weights: Vec<f64>,
    /// Samples that do not count, `[channel][sample]`.
    excluded: Vec<Vec<bool>>,
    /// Factor of the products of the set.
    factor: GramFactor,
    /// Fitted factors of the set.
    factors: DVector<f64>,
    /// Weighted squares of the residual of the set.
    squares: f64,
}

impl<'a> BlockProducts<'a> {
    /// Fits the set and computes the products of all blocks; `None` if all recordings are too short,
    /// or if there are too many columns.
    pub(super) fn new(problem: &'a DiagnosisProblem, set: &[&'a ForceColumn]) -> Option<Self> {
        let cut = cut_recordings(problem);
        if cut.is_empty() {
            return None;
        }
        if problem.columns_of_changes(set.len()) > MOST_COLUMNS {
            return None;
        }
        // Friction that the model lacks would look like a change where the motion changes.
        let set: Vec<&ForceColumn> = set.iter().copied().chain(&problem.friction).collect();
        let excluded = excluded_samples(problem);
        let channels = problem.layout.channels.len();
        let mut one = Self {
            problem,
            set,
            shapes: Vec::new(),
            starts: Vec::new(),
            recordings: Vec::new(),
            weights: vec![1.0; channels],
            excluded,
            factor: GramFactor::default(),
            factors: DVector::zeros(0),
            squares: 0.0,
        };
        // The weights come from the residual of a first fit.
        let all = 0..problem.layout.samples();
        let mut rest = Vec::new();
        for _ in 0..2 {
            let gram = one.products(&all);
            let (factors, squares) = solve_gram(&gram);
            let n = gram.nrows() - 1;
            one.factor = GramFactor::new(&gram.view((0, 0), (n, n)).into_owned());
            (one.factors, one.squares) = (factors, squares);
            rest = (0..channels).map(|d| one.residual(d)).collect();
            one.set_weights(&rest);
        }
        let gram = one.products(&all);
        let n = gram.nrows() - 1;
        one.factor = GramFactor::new(&gram.view((0, 0), (n, n)).into_owned());
        (one.factors, one.squares) = solve_gram(&gram);
        // Columns of the shapes; those of a scale come from the fit.
        one.shapes = problem
            .change_shapes
            .iter()
            .map(|shape| one.columns_of_shape(shape))
            .collect();
        let mut next = n;
        for columns in &one.shapes {
            one.starts.push(next);
            next += columns.len();
        }
        one.recordings = cut;
        for r in 0..one.recordings.len() {
            let blocks = one.recordings[r].blocks.clone();
            let products = blocks.iter().map(|block| one.products(block)).collect();
            let samples = one.recordings[r].samples.clone();
            let squares = (0..channels).map(|d| {
                let part = &rest[d][samples.clone()];
                one.weights[d] * dot(part, part)
            });
            let squares = squares.collect();
            let recording = &mut one.recordings[r];
            (recording.products, recording.squares) = (products, squares);
        }
        Some(one)
    }

    /// Columns of a shape.
    pub(super) fn shape_columns(&self, shape: usize) -> &[ForceColumn] {
        &self.shapes[shape]
    }

    /// Weighted squares of the residual of a recording on the channels on which a shape acts.
    pub(super) fn residual_squares(&self, shape: usize, recording: usize) -> f64 {
        let squares = self.recordings[recording].squares.iter().enumerate();
        let acting = squares.filter(|(d, _)| self.acts_on(shape, *d));
        acting.map(|(_, squares)| squares).sum()
    }

    /// Whether a shape acts on a channel.
    fn acts_on(&self, shape: usize, channel: usize) -> bool {
        self.shapes[shape].iter().any(|column| column.0[channel].is_some())
    }

    /// Effective number of samples of the residual of all recordings, on the channels on which a shape acts, if it acts with
    /// some time profiles. `reduced` are the blocks of all recordings, and each profile has a value for each of them.
    pub(super) fn effective_samples(&self, shape: usize, reduced: &ReducedBlocks, profiles: &[Vec<f64>]) -> f64 {
        let slices: Vec<&[f64]> = profiles.iter().map(Vec::as_slice).collect();
        let (own, _) = solve_gram(&reduced.gram(&slices));
        let p = self.shapes[shape].len();
        let blocks = || {
            self.recordings
                .iter()
                .flat_map(|cut| cut.blocks.iter().zip(&cut.products))
        };
        // Factors of the shape in each block.
        let by_block = |b: usize| {
            let terms = profiles.iter().enumerate();
            terms.fold(DVector::zeros(p), |sum, (k, profile)| {
                sum + profile[b] * own.rows(p * k, p)
            })
        };
        let factors = self.refit_set(
            shape,
            blocks().enumerate().map(|(b, (_, products))| (products, by_block(b))),
        );
        let channels = (0..self.weights.len()).filter(|d| self.acts_on(shape, *d));
        let of_channel = |d: usize| -> f64 {
            let mut rest = self.residual_with(d, &factors);
            for (b, (range, _)) in blocks().enumerate() {
                for (column, factor) in self.shapes[shape].iter().zip(by_block(b).iter()) {
                    let Some(values) = &column.0[d] else { continue };
                    for i in range.clone().filter(|i| !self.excluded[d][*i]) {
                        rest[i] -= factor * values[i];
                    }
                }
            }
            let recordings = self.recordings.iter().map(|cut| &rest[cut.samples.clone()]);
            recordings.map(independent_samples).sum()
        };
        channels.map(of_channel).sum::<f64>().max(2.0)
    }

    /// The blocks of some recordings for one shape, with the set projected out.
    pub(super) fn reduce_blocks(&self, shape: usize, recordings: Range<usize>) -> ReducedBlocks {
        let n = self.set.len();
        let (start, p) = (self.starts[shape], self.shapes[shape].len());
        let blocks = self.recordings[recordings].iter().flat_map(|cut| &cut.products);
        let blocks = blocks.map(|block| {
            let last = block.ncols() - 1;
            let with_set = block.view((0, start), (n, p)).into_owned();
            ReducedBlock {
                own: block.view((start, start), (p, p)).into_owned(),
                right: block.view((start, last), (p, 1)).column(0) - with_set.transpose() * &self.factors,
                halves: self.factor.forward_substitute(&with_set),
            }
        });
        ReducedBlocks {
            blocks: blocks.collect(),
            columns: p,
            squares: self.squares,
        }
    }

    /// Samples in which a change acts: the times of a profile, refined to samples.
    pub(super) fn refine_times(&self, shape: usize, recording: usize, profile: &TimeProfile) -> Range<usize> {
        let cut = &self.recordings[recording];
        let blocks = &cut.blocks;
        // The change and the level of the recording, with one factor for each column.
        let values = profile.values(blocks.len());
        let level = vec![1.0; blocks.len()];
        let profiles: [&[f64]; 2] = [&values, &level];
        let (own, _) = solve_gram(&self.reduce_blocks(shape, recording..recording + 1).gram(&profiles));
        let p = self.shapes[shape].len();
        let by_block = values.iter().zip(&level).zip(&cut.products);
        let by_block = by_block.map(|((change, level), products)| {
            let sum = *change * own.rows(0, p) + *level * own.rows(p, p);
            (products, sum)
        });
        let factors = self.refit_set(shape, by_block);
        let own = [own.rows(0, p), own.rows(p, p)].map(|part| part.iter().copied().collect::<Vec<f64>>());
        let decrease = self.decrease_by_sample(shape, &own, &factors, &cut.samples);
        let first = cut.samples.start;
        // Sums from each sample on, within one block of the coarse time.
        let about = |block: usize| {
            let from = blocks[block.saturating_sub(1)].start;
            let to = blocks.get(block).map_or(cut.samples.end, |b| b.end);
            from..to
        };
        let best = |near: Range<usize>, sign: f64| {
            let mut sum = 0.0;
            let mut best = (0.0, near.start);
            for i in near {
                // The change acts from the next sample on, so that this one does not count.
                sum -= sign * decrease[i - first];
                if sum > best.0 {
                    best = (sum, i + 1);
                }
            }
            best.1
        };
        let begin = best(about(profile.begin), 1.0);
        let end = profile.end.map_or(cut.samples.end, |end| best(about(end), -1.0));
        begin..end.max(begin + 1)
    }

    /// Factors of the set that is fitted again beside a shape, which acts in some blocks: the products of each block with the
    /// factors of the shape there.
    fn refit_set<'b>(
        &self,
        shape: usize,
        blocks: impl Iterator<Item = (&'b DMatrix<f64>, DVector<f64>)>,
    ) -> DVector<f64> {
        let (n, start) = (self.set.len(), self.starts[shape]);
        let mut gram = self.set_products(&(0..self.problem.layout.samples()));
        for (products, factors) in blocks {
            let less = products.view((0, start), (n, factors.len())) * factors;
            for i in 0..n {
                gram[(i, n)] -= less[i];
                gram[(n, i)] -= less[i];
            }
        }
        solve_gram(&gram).0
    }

    /// Decrease of the weighted squared residual at the samples of a recording if a change acts. `own` are the factors of
    /// the change and of the level of the recording.
    fn decrease_by_sample(
        &self,
        shape: usize,
        own: &[Vec<f64>; 2],
        factors: &DVector<f64>,
        samples: &Range<usize>,
    ) -> Vec<f64> {
        let mut decrease = vec![0.0; samples.len()];
        for d in 0..self.weights.len() {
            let acts = self.shapes[shape].iter().any(|column| column.0[d].is_some());
            if !acts {
                continue;
            }
            let [change, level] = own.each_ref().map(|own| {
                let mut force = vec![0.0; samples.len()];
                for (column, factor) in self.shapes[shape].iter().zip(own) {
                    for (sum, x) in force
                        .iter_mut()
                        .zip(column.0[d].iter().flat_map(|values| &values[samples.clone()]))
                    {
                        *sum += factor * x;
                    }
                }
                force
            });
            let rest = self.residual_with(d, factors);
            for (k, i) in samples.clone().enumerate() {
                if !self.excluded[d][i] {
                    let before = rest[i] - level[k];
                    let after = before - change[k];
                    decrease[k] += self.weights[d] * (before * before - after * after);
                }
            }
        }
        decrease
    }

    /// Columns of a shape: those that are given, or the fitted force of a channel.
    fn columns_of_shape(&self, shape: &ChangeShape) -> Vec<ForceColumn> {
        match &shape.force {
            ChangeForce::Columns(columns) => columns.clone(),
            ChangeForce::FittedForce(channel) => {
                let rest = self.unmasked_residual(*channel, &self.factors);
                let force = self.problem.measured_force(*channel);
                let fitted = force.iter().zip(&rest).map(|(y, r)| y - r).collect();
                let mut column = ForceColumn(vec![None; self.weights.len()]);
                column.0[*channel] = Some(fitted);
                vec![column]
            }
        }
    }

    /// Residual of the set on a channel; 0 for samples that do not count.
    fn residual(&self, channel: usize) -> Vec<f64> {
        self.residual_with(channel, &self.factors)
    }

    /// The same with other factors of the set.
    fn residual_with(&self, channel: usize, factors: &DVector<f64>) -> Vec<f64> {
        let mut rest = self.unmasked_residual(channel, factors);
        for (r, out) in rest.iter_mut().zip(&self.excluded[channel]) {
            if *out {
                *r = 0.0;
            }
        }
        rest
    }

    /// The same for all samples.
    fn unmasked_residual(&self, channel: usize, factors: &DVector<f64>) -> Vec<f64> {
        let samples = self.problem.layout.samples();
        let measured = self.problem.measured.0[channel].clone();
        let mut rest = measured.unwrap_or_else(|| vec![0.0; samples]);
        for (column, factor) in self.set.iter().zip(factors.iter()) {
            if let Some(values) = &column.0[channel] {
                for (r, x) in rest.iter_mut().zip(values) {
                    *r -= factor * x;
                }
            }
        }
        rest
    }

    /// Weighs channels by the variance of their residual, but not below that of their noise.
    fn set_weights(&mut self, rest: &[Vec<f64>]) {
        for (d, rest) in rest.iter().enumerate() {
            let counted = self.excluded[d].iter().filter(|out| !**out).count();
            let variance = dot(rest, rest) / counted.max(1) as f64;
            let variance = variance.max(self.problem.noise[d].powi(2));
            self.weights[d] = if variance > 0.0 { variance.recip() } else { 1.0 };
        }
    }

    /// Products of set and measured forces over some samples.
    fn set_products(&self, samples: &Range<usize>) -> DMatrix<f64> {
        self.products_of(samples, &[])
    }

    /// Products of set, shapes and measured forces over some samples.
    fn products(&self, samples: &Range<usize>) -> DMatrix<f64> {
        let shapes: Vec<&ForceColumn> = self.shapes.iter().flatten().collect();
        self.products_of(samples, &shapes)
    }

    /// Weighted inner products over some samples: set, further columns, measured forces.
    fn products_of(&self, samples: &Range<usize>, further: &[&ForceColumn]) -> DMatrix<f64> {
        let mut columns: Vec<&ForceColumn> = self.set.clone();
        columns.extend(further);
        columns.push(&self.problem.measured);
        let n = columns.len();
        let mut sum = DMatrix::zeros(n, n);
        for d in 0..self.weights.len() {
            // Only the columns that act on this channel are multiplied.
            let acting: Vec<usize> = (0..n).filter(|k| columns[*k].0[d].is_some()).collect();
            let root = self.weights[d].sqrt();
            let mut rows = DMatrix::zeros(samples.len(), acting.len());
            for (j, k) in acting.iter().enumerate() {
                let values = columns[*k].0[d].as_deref().unwrap_or_default();
                for (i, sample) in samples.clone().enumerate() {
                    if !self.excluded[d][sample] {
                        rows[(i, j)] = root * values[sample];
                    }
                }
            }
            let part = rows.transpose() * &rows;
            for (a, i) in acting.iter().enumerate() {
                for (b, j) in acting.iter().enumerate() {
                    sum[(*i, *j)] += part[(a, b)];
                }
            }
        }
        sum
    }
}

/// Squares of a column that remain beside the set, below which it belongs to the set (share of its squares).
const DEPENDENT_SHARE: f64 = 1e-9;

/// The recordings of a problem that are long enough, without products.
fn cut_recordings(problem: &DiagnosisProblem) -> Vec<CutRecording> {
    let mut recordings: Vec<(String, Range<usize>)> = Vec::new();
    let mut at = 0;
    for segment in &problem.layout.segments {
        let samples = at..at + segment.samples;
        match recordings.last_mut().filter(|(name, _)| *name == segment.name) {
            // Segments of one recording follow each other.
            Some((_, range)) => range.end = samples.end,
            None => recordings.push((segment.name.clone(), samples)),
        }
        at += segment.samples;
    }
    recordings.retain(|(_, samples)| samples.len() >= BLOCKS * FEWEST_IN_BLOCK);
    let cut = |(name, samples): (String, Range<usize>)| {
        let place = |k: usize| samples.start + k * samples.len() / BLOCKS;
        CutRecording {
            blocks: (0..BLOCKS).map(|k| place(k)..place(k + 1)).collect(),
            name,
            samples,
            products: Vec::new(),
            squares: Vec::new(),
        }
    };
    recordings.into_iter().map(cut).collect()
}

/// Samples that do not count, `[channel][sample]`: those that decide nothing, those that were not measured, and those at
/// which the drive of the channel stands still or nearly so, since dry friction takes any value there.
fn excluded_samples(problem: &DiagnosisProblem) -> Vec<Vec<bool>> {
    let mut excluded = problem.undecided_samples();
    for (d, out) in excluded.iter_mut().enumerate() {
        for (out, stands) in out.iter_mut().zip(standstill_samples(problem, d)) {
            *out |= stands;
        }
    }
    for (out, lost) in excluded.iter_mut().zip(&problem.layout.left_out) {
        for (out, lost) in out.iter_mut().zip(lost) {
            *out |= *lost;
        }
    }
    excluded
}
