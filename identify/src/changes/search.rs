//! Search for the fewest changes that explain the difference between two runs. Input: normal equations of both runs and
//! possible changes; output: selected changes with values.
//!
//! Decision: nothing changed within a run. Standard deviations count noise only, and not model errors that appear along
//! one motion and not along another. So parts of one run are compared like two runs; between runs a change must explain
//! twice what it explains there. On four real arms this removes every false change, at the price of small true ones
//! where the model is poor.

use nalgebra::{DMatrix, DVector};

use crate::changes::jackknife::{occupied, sum_except, variance_factors};
use crate::changes::moments::{NormalEquations, NormalSolution, SchurComplement};
use crate::changes::thresholds::{
    CHANCE_GAIN_RARITY, CHANGE_VALUE_PRICE, JACKKNIFE_FEWEST_BLOCKS, MIN_SIGNIFICANCE, MIN_SPREAD_RATIO,
    MIN_VALIDATION_SHARE, RIVAL_TOLERANCE,
};

/// Two runs as normal equations of rows with variance 1, block by block and with the same columns.
#[derive(Clone, Debug)]
pub struct RunPair {
    /// Blocks of the earlier run.
    pub reference: Vec<NormalEquations>,
    /// Blocks of the later run.
    pub later: Vec<NormalEquations>,
    /// Differences within one run: the larger result of [`within_run_spread`] for the two runs.
    pub within_run_spread: f64,
}

/// Possible explanations of the difference of two runs.
#[derive(Clone, Debug)]
pub struct ChangeHypotheses {
    /// Columns whose coefficients both runs share: those of the model, and those of effects that it may lack in both.
    pub shared: Vec<usize>,
    /// The changes that are possible.
    pub changes: Vec<PossibleChange>,
}

/// A change that is possible.
#[derive(Clone, Debug)]
pub struct PossibleChange {
    /// Its columns, which have own coefficients in the later run.
    pub columns: Vec<usize>,
    /// Largest number of values in its price; lower than the number of columns if they usually change together.
    pub max_charged_values: usize,
    /// Additional price for a rare change, in values.
    pub rarity: f64,
}

/// A change that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct SelectedChange {
    /// Index among the possible changes.
    pub candidate: usize,
    /// Changes of the coefficients of its columns.
    pub values: DVector<f64>,
    /// Their covariance, from the noise and from the scatter between blocks of the runs.
    pub covariance: DMatrix<f64>,
    /// Which of the values are determined individually.
    pub determined: Vec<bool>,
    /// Increase of the sum of squares without it, relative to the variance of the residual.
    pub gain: f64,
    /// The same on blocks that were not fitted.
    pub validation_gain: f64,
    /// Indices of changes that explain nearly as much in its place.
    pub rivals: Vec<usize>,
}

/// Finds the fewest changes that explain the later run, sorted by gain. Empty if the runs differ by chance only, or by
/// no more than parts of one run do.
pub fn search_changes(runs: &RunPair, search: &ChangeHypotheses) -> Vec<SelectedChange> {
    let bench = ChangeSelector::new(runs, search);
    let mut chosen: Vec<usize> = Vec::new();
    loop {
        // Forward: add the change with the lowest cost, then exchange members.
        let candidates = (0..search.changes.len()).filter(|g| !chosen.contains(g));
        let tried = candidates.map(|g| (g, bench.penalised_residual(&add_index(&chosen, g))));
        let Some((best, cost)) = tried.min_by(|a, b| a.1.total_cmp(&b.1)) else {
            break;
        };
        if cost >= bench.penalised_residual(&chosen) || !bench.is_supported(&chosen, best) {
            break;
        }
        chosen.push(best);
        bench.improve_selection(&mut chosen);
    }
    // Remove changes whose gain has become too small by the exchanges.
    while let Some(at) = (0..chosen.len()).find(|at| {
        let rest = remove_index(&chosen, chosen[*at]);
        bench.squares_gain(&rest, chosen[*at]) < bench.min_gain
    }) {
        chosen.remove(at);
    }
    let mut found: Vec<SelectedChange> = chosen.iter().map(|g| bench.build_change(&chosen, *g)).collect();
    found.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    found
}

/// Decrease of the sum of squares by each change alone, relative to the variance of the residual of all changes. Over
/// many machines this shows what is usual.
pub fn single_change_gains(runs: &RunPair, search: &ChangeHypotheses) -> Vec<f64> {
    let bench = ChangeSelector::new(runs, search);
    (0..search.changes.len())
        .map(|which| bench.squares_gain(&[], which))
        .collect()
}

/// Fits a single change, however little it explains.
pub fn fit_single_change(runs: &RunPair, search: &ChangeHypotheses, which: usize) -> SelectedChange {
    ChangeSelector::new(runs, search).build_change(&[which], which)
}

/// What a search could find at all.
#[derive(Clone, Debug, PartialEq)]
pub struct SearchSensitivity {
    /// Least gain with which a change is reported, relative to the variance of the residual.
    pub min_gain: f64,
    /// The least gain that noise alone requires; [`Self::min_gain`] exceeds it where parts of one run differ.
    pub min_gain_of_noise: f64,
    /// For each requested change of one value, the smallest value that would be reported; infinite if none would.
    pub smallest_values: Vec<f64>,
}

/// The smallest values of some changes of one value that a search would report. Without it, "nothing was found" could
/// not be distinguished from "nothing could be found".
pub fn search_sensitivity(runs: &RunPair, search: &ChangeHypotheses, which: &[usize]) -> SearchSensitivity {
    let bench = ChangeSelector::new(runs, search);
    let smallest = |which: &usize| {
        let column = bench.starts[*which];
        let price = bench.value_price * (1.0 + search.changes[*which].rarity);
        let squares = bench.complement.squares(column) / bench.noise;
        (bench.min_gain.max(price) / squares).sqrt()
    };
    SearchSensitivity {
        min_gain: bench.min_gain,
        min_gain_of_noise: MIN_SIGNIFICANCE * MIN_SIGNIFICANCE,
        smallest_values: which.iter().map(smallest).collect(),
    }
}

/// Differences within one run: the largest sum of squares that a single change between parts of it explains, relative
/// to the effective number of rows of the difference. Noise alone makes it small. Model errors and drifting friction
/// make it large, and then the same must be expected between two runs.
pub fn within_run_spread(blocks: &[NormalEquations], search: &ChangeHypotheses) -> f64 {
    let n = blocks.len();
    // Compare the first half with the second, and each quarter with the rest.
    let halves = [(0, n / 2)];
    let quarters = (0..4).map(|k| (k * n / 4, (k + 1) * n / 4));
    let mut most = 0.0_f64;
    for (start, end) in halves.into_iter().chain(quarters) {
        let is_later = |k: &usize| (start..end).contains(k);
        let part = |later: bool| {
            let some = (0..n).filter(|k| is_later(k) == later);
            some.map(|k| blocks[k].clone()).collect::<Vec<_>>()
        };
        let runs = RunPair {
            reference: part(false),
            later: part(true),
            within_run_spread: 0.0,
        };
        let worth = effective_rows([count_rows(&runs.reference), count_rows(&runs.later)]);
        if worth == 0.0 {
            continue;
        }
        let bench = ChangeSelector::new(&runs, search);
        for (g, candidate) in search.changes.iter().enumerate() {
            // Only the part above what the best of all changes gains by chance.
            let beyond = bench.squares_gain(&[], g) - chance_gain(candidate.columns.len(), search.changes.len());
            most = most.max(beyond * bench.noise / worth);
        }
    }
    most
}

/// Gain of the best of some changes by chance, which is rarely exceeded; `values` is the number of its values (Laurent
/// and Massart, Annals of Statistics 28, 2000).
fn chance_gain(values: usize, changes: usize) -> f64 {
    let (k, tail) = (values as f64, (CHANCE_GAIN_RARITY * changes as f64).ln());
    k + 2.0 * (k * tail).sqrt() + 2.0 * tail
}

/// Number of rows of all blocks.
fn count_rows(blocks: &[NormalEquations]) -> f64 {
    blocks.iter().map(|block| block.rows).sum::<usize>() as f64
}

/// Effective number of rows of a difference between two runs: half the harmonic mean of both.
fn effective_rows([a, b]: [f64; 2]) -> f64 {
    if a > 0.0 && b > 0.0 { a * b / (a + b) } else { 0.0 }
}

/// A set with one more index.
fn add_index(chosen: &[usize], further: usize) -> Vec<usize> {
    chosen.iter().copied().chain([further]).collect()
}

/// A set without one index.
fn remove_index(chosen: &[usize], one: usize) -> Vec<usize> {
    chosen.iter().copied().filter(|g| *g != one).collect()
}

/// Normal equations of both runs together: the shared columns, then those of changes, which only the later run has.
fn stack_runs([reference, later]: [&NormalEquations; 2], shared: &[usize], columns: &[usize]) -> NormalEquations {
    let mut all = later.select_columns(columns);
    let reference = reference.select_columns(shared);
    let n = shared.len();
    let mut gram = all.gram.view_mut((0, 0), (n, n));
    gram += &reference.gram;
    let mut rhs = all.rhs.rows_mut(0, n);
    rhs += &reference.rhs;
    all.total += reference.total;
    all.rows += reference.rows;
    all
}

/// Evaluates sets of changes between two runs.
struct ChangeSelector<'a> {
    /// Blocks of both runs.
    runs: &'a RunPair,
    /// Shared columns and possible changes.
    search: &'a ChangeHypotheses,
    /// Shared columns that are independent.
    shared: Vec<usize>,
    /// Sums over all blocks of each run.
    sums: [NormalEquations; 2],
    /// Columns of all changes, one after the other, with the shared ones eliminated; and the first column of each
    /// change.
    complement: SchurComplement,
    starts: Vec<usize>,
    /// Variance of the residual with all changes fitted, at least 1.
    noise: f64,
    /// Price of a value.
    value_price: f64,
    /// Least gain of a change.
    min_gain: f64,
}

impl<'a> ChangeSelector<'a> {
    /// Eliminates the shared columns and determines noise and prices.
    fn new(runs: &'a RunPair, search: &'a ChangeHypotheses) -> Self {
        let sums = [sum_except(&runs.reference, None), sum_except(&runs.later, None)];
        let mut all = sums[0].select_columns(&search.shared);
        all.merge(&sums[1].select_columns(&search.shared));
        // Shared columns that are combinations of others are dropped.
        let telling = all.solve().independent;
        let shared = search.shared.iter().zip(telling);
        let rows = (sums[0].rows + sums[1].rows) as f64;
        let shared: Vec<usize> = shared.filter(|(_, telling)| *telling).map(|(k, _)| *k).collect();
        let everything = shared.iter().chain(search.changes.iter().flat_map(|one| &one.columns));
        let everything: Vec<usize> = everything.copied().collect();
        let beside = stack_runs(sums.each_ref(), &shared, &everything).schur_complement(shared.len());
        let mut starts = vec![0];
        for candidate in &search.changes {
            starts.push(starts[starts.len() - 1] + candidate.columns.len());
        }
        let changes: Vec<usize> = (0..starts[search.changes.len()]).collect();
        // The noise is what remains when all changes are fitted at once.
        let (rest, kept) = beside.residual_squares(&changes);
        let rank = shared.len() + kept.iter().filter(|kept| **kept).count();
        let noise = (rest / (rows - rank as f64).max(1.0)).max(1.0);
        let worth = effective_rows(sums.each_ref().map(|one| one.rows as f64));
        Self {
            runs,
            search,
            shared,
            complement: beside,
            starts,
            noise,
            value_price: CHANGE_VALUE_PRICE * rows.max(2.0).ln(),
            min_gain: (MIN_SPREAD_RATIO * runs.within_run_spread * worth / noise)
                .max(MIN_SIGNIFICANCE * MIN_SIGNIFICANCE),
            sums,
        }
    }

    /// The shared columns, followed by those of some changes.
    fn columns(&self, chosen: &[usize]) -> Vec<usize> {
        let of = |g: &usize| self.search.changes[*g].columns.iter().copied();
        let shared = self.shared.iter().copied();
        shared.chain(chosen.iter().flat_map(of)).collect()
    }

    /// Least squares solution with some changes.
    fn solve_changes(&self, chosen: &[usize]) -> NormalSolution {
        stack_runs(self.sums.each_ref(), &self.shared, &self.columns(chosen)).solve()
    }

    /// Squared residual with some changes, relative to the variance of the noise, and the number of values in their
    /// price.
    fn residual_and_charges(&self, chosen: &[usize]) -> (f64, f64) {
        let columns = chosen.iter().flat_map(|g| self.starts[*g]..self.starts[*g + 1]);
        let (rest, kept) = self.complement.residual_squares(&columns.collect::<Vec<usize>>());
        let mut kept = kept.into_iter();
        let charged = chosen.iter().map(|g| {
            let candidate = &self.search.changes[*g];
            let own = kept.by_ref().take(candidate.columns.len());
            own.filter(|kept| *kept).count().min(candidate.max_charged_values) as f64 + candidate.rarity
        });
        let charged = charged.sum();
        (rest / self.noise, charged)
    }

    /// Decrease of the sum of squares by a further change, relative to the variance of the noise.
    fn squares_gain(&self, chosen: &[usize], further: usize) -> f64 {
        self.residual_and_charges(chosen).0 - self.residual_and_charges(&add_index(chosen, further)).0
    }

    /// Squared residual with some changes plus the price of their values.
    fn penalised_residual(&self, chosen: &[usize]) -> f64 {
        let (rest, charged) = self.residual_and_charges(chosen);
        rest + self.value_price * charged
    }

    /// Removes or exchanges changes as long as that lowers the cost.
    fn improve_selection(&self, chosen: &mut Vec<usize>) {
        loop {
            let now = self.penalised_residual(chosen);
            let mut better: Option<(f64, Vec<usize>)> = None;
            for one in chosen.clone() {
                let rest = remove_index(chosen, one);
                let others = (0..self.search.changes.len()).filter(|g| !chosen.contains(g));
                let exchanged = others.map(|g| add_index(&rest, g));
                for tried in exchanged.chain([rest.clone()]) {
                    let cost = self.penalised_residual(&tried);
                    if cost < better.as_ref().map_or(now - 1e-6 * now.abs(), |b| b.0) {
                        better = Some((cost, tried));
                    }
                }
            }
            match better {
                Some((_, set)) => *chosen = set,
                None => return,
            }
        }
    }

    /// Decrease of the sum of squares by a further change, in the fit and on blocks that were not fitted.
    fn fit_and_validation_gain(&self, chosen: &[usize], further: usize) -> (f64, f64) {
        let both = add_index(chosen, further);
        let gain = self.squares_gain(chosen, further);
        let mut held_out = 0.0;
        for (run, blocks) in [&self.runs.reference, &self.runs.later].into_iter().enumerate() {
            for k in 0..blocks.len() {
                let others = sum_except(blocks, Some(k));
                let mut sums = self.sums.each_ref();
                sums[run] = &others;
                // Squared residual of the omitted block; the earlier run has no changes.
                let rest = |set: &[usize]| {
                    let both = stack_runs(sums, &self.shared, &self.columns(set));
                    let values = both.solve().values;
                    let columns = self.columns(if run == 0 { &[] } else { set });
                    let own = values.rows(0, columns.len()).into_owned();
                    blocks[k].select_columns(&columns).residual_squares(&own)
                };
                held_out += (rest(chosen) - rest(&both)) / self.noise;
            }
        }
        (gain, held_out)
    }

    /// Whether a further change gains enough, in the fit and on blocks that were not fitted.
    fn is_supported(&self, chosen: &[usize], further: usize) -> bool {
        // Validation needs the most time, and most candidates fail before.
        if self.squares_gain(chosen, further) <= self.min_gain {
            return false;
        }
        let (gain, held_out) = self.fit_and_validation_gain(chosen, further);
        gain > self.min_gain && held_out > MIN_VALIDATION_SHARE * gain
    }

    /// Values of the last change of a set without one block each, for both runs.
    fn values_without_blocks(&self, order: &[usize], values: usize) -> Vec<Vec<DVector<f64>>> {
        let runs = [&self.runs.reference, &self.runs.later];
        let of_run = |run: usize| {
            let without = |k: usize| {
                let others = sum_except(runs[run], Some(k));
                let mut sums = self.sums.each_ref();
                sums[run] = &others;
                let solved = stack_runs(sums, &self.shared, &self.columns(order)).solve();
                let at = solved.values.len() - values;
                solved.values.rows(at, values).into_owned()
            };
            // Runs that are one block have no scatter, so their fits are not needed.
            let some = occupied(runs[run]).filter(|_| runs[run].len() >= JACKKNIFE_FEWEST_BLOCKS);
            some.map(without).collect()
        };
        (0..runs.len()).map(of_run).collect()
    }

    /// The covariance of the last change of a set: that of white noise, enlarged where blocks scatter more.
    fn change_covariance(&self, order: &[usize], solved: &NormalSolution, values: usize) -> DMatrix<f64> {
        let at = solved.values.len() - values;
        let covariance: DMatrix<f64> = self.noise * solved.covariance.view((at, at), (values, values));
        let variances: Vec<f64> = covariance.diagonal().iter().copied().collect();
        let estimates = self.values_without_blocks(order, values);
        let factors = variance_factors(&estimates, &variances, &solved.determined[at..]);
        DMatrix::from_fn(values, values, |i, j| {
            covariance[(i, j)] * (factors[i] * factors[j]).sqrt()
        })
    }

    /// The result for one of the chosen changes: values, gains and rivals.
    fn build_change(&self, chosen: &[usize], which: usize) -> SelectedChange {
        let rest = remove_index(chosen, which);
        let order = add_index(&rest, which);
        let solved = self.solve_changes(&order);
        let n = self.search.changes[which].columns.len();
        let at = solved.values.len() - n;
        let (gain, held_out) = self.fit_and_validation_gain(&rest, which);
        let cost = self.penalised_residual(&order);
        let near = (RIVAL_TOLERANCE * gain).max(self.value_price);
        let others = (0..self.search.changes.len()).filter(|g| !chosen.contains(g));
        SelectedChange {
            candidate: which,
            values: solved.values.rows(at, n).into_owned(),
            covariance: self.change_covariance(&order, &solved, n),
            determined: solved.determined[at..].to_vec(),
            gain,
            validation_gain: held_out,
            rivals: others
                .filter(|g| self.penalised_residual(&add_index(&rest, *g)) < cost + near)
                .collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::TestNoise;

    const ROWS: usize = 400;

    /// Runs with three base columns; the later one has changes of one, two and one columns, of which the second column
    /// of the second is a twin of the first base column.
    fn runs(seed: u64, changed: &[(usize, f64)]) -> RunPair {
        let mut noise = TestNoise::new(seed);
        let mut moments = |extra: bool| {
            let mut z: Vec<Vec<f64>> = (0..7).map(|_| (0..ROWS).map(|_| noise.normal()).collect()).collect();
            z[5] = z[0].clone();
            let y: Vec<f64> = (0..ROWS)
                .map(|i| {
                    let base = 2.0 * z[0][i] - z[1][i] + 0.5 * z[2][i];
                    let more: f64 = changed.iter().map(|(k, c)| c * z[*k][i]).sum();
                    base + if extra { more } else { 0.0 } + noise.normal()
                })
                .collect();
            let mut one = NormalEquations::new(7);
            let columns: Vec<Option<&[f64]>> = z.iter().map(|c| Some(&c[..])).collect();
            one.add_rows(&columns, &y);
            one
        };
        RunPair {
            reference: (0..5).map(|_| moments(false)).collect(),
            later: (0..5).map(|_| moments(true)).collect(),
            within_run_spread: 0.0,
        }
    }

    fn possible() -> ChangeHypotheses {
        ChangeHypotheses {
            shared: (0..7).collect(),
            changes: vec![vec![3], vec![4, 5], vec![6]]
                .into_iter()
                .map(|columns| PossibleChange {
                    columns,
                    max_charged_values: 2,
                    rarity: 0.0,
                })
                .collect(),
        }
    }

    #[test]
    fn what_changed_is_found_and_nothing_else() {
        for seed in 0..30 {
            assert_eq!(search_changes(&runs(seed, &[]), &possible()), []);
            let found = search_changes(&runs(seed, &[(5, 1.0), (6, 0.6)]), &possible());
            let which: Vec<usize> = found.iter().map(|c| c.candidate).collect();
            assert_eq!(which, [1, 2], "seed {seed}");
            let [pair, single] = &found[..] else { unreachable!() };
            assert!((pair.values[1] - 1.0).abs() < 5.0 * pair.covariance[(1, 1)].sqrt());
            assert!((single.values[0] - 0.6).abs() < 5.0 * single.covariance[(0, 0)].sqrt());
            assert!(pair.determined[1] && single.determined[0]);
            assert!(single.validation_gain > 0.5 * single.gain && single.rivals.is_empty());
            // Each alone gains as much as in addition to the other: their columns have little in common.
            let alone_gain = single_change_gains(&runs(seed, &[(5, 1.0), (6, 0.6)]), &possible());
            assert!(alone_gain[0] < 0.1 * alone_gain[2] && alone_gain[2] < 1.5 * single.gain);
            let one = fit_single_change(&runs(seed, &[(6, 0.6)]), &possible(), 2);
            assert!((one.values[0] - 0.6).abs() < 5.0 * one.covariance[(0, 0)].sqrt());
        }
    }

    /// What the model lacks in both runs is no change.
    #[test]
    fn what_both_runs_have_is_no_change() {
        for seed in 0..10 {
            let mut both = runs(seed, &[(3, 1.0)]);
            both.reference = runs(seed + 100, &[(3, 1.0)]).later;
            assert_eq!(search_changes(&both, &possible()), []);
        }
    }

    /// What parts of one run differ by is no change between runs, and what is larger is one.
    #[test]
    fn what_parts_of_one_run_differ_by_is_no_change() {
        let mut drifting = runs(3, &[]);
        drifting.reference[4] = runs(7, &[(3, 0.8)]).later[4].clone();
        drifting.later = runs(9, &[(3, 0.6)]).later;
        assert_eq!(search_changes(&drifting, &possible()).len(), 1);
        drifting.within_run_spread = within_run_spread(&drifting.reference, &possible());
        assert_eq!(search_changes(&drifting, &possible()), []);
        drifting.later = runs(9, &[(3, 1.0)]).later;
        assert_eq!(search_changes(&drifting, &possible()).len(), 1);
        // Noise alone hides little.
        let alone = runs(11, &[]);
        for blocks in [&alone.reference, &alone.later] {
            assert!(within_run_spread(blocks, &possible()).abs() < f64::EPSILON);
        }
    }

    /// A change that one block alone has is no change of the run.
    #[test]
    fn a_single_block_decides_nothing() {
        let mut runs = runs(1, &[]);
        runs.later[2] = self::runs(2, &[(3, 1.0)]).later[0].clone();
        assert_eq!(search_changes(&runs, &possible()), []);
    }
}
