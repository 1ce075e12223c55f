//! The fewest changes that explain what a later run does not share with the one before.
//!
//! Decision: nothing changed within a run. Standard deviations count noise, and not what a model lacks along one
//! motion and not along another. So parts of one run are compared like runs; between runs a change must explain
//! twice what it explains there. On four real arms this removes every false change, at the price of small true ones
//! where the model is poor.

use nalgebra::{DMatrix, DVector};

use crate::changes::moments::{Beside, Moments, Solved};

/// How many times the logarithm of the number of rows a value must gain: 1 is Schwarz' criterion, which holds for white noise;
/// what is left of real runs is never quite white.
const STRICTER: f64 = 3.0;
/// The part of a change's gain that must be there on blocks that had no part in its fit.
const HELD_OUT: f64 = 0.3;
/// A change must explain so many times what parts of one run differ by among themselves: motions of two runs have less in
/// common than parts of one.
const BEYOND: f64 = 2.0;
/// A change must stand so many deviations clear of none. Deviations count the noise alone: parts of one run show much of what a
/// model lacks, but not what it lacks along the other motion.
const CLEAR: f64 = 12.0;
/// Changes that differ by less than this part of the gain cannot be told apart.
const NEAR: f64 = 0.02;

/// Two runs as sums over rows of variance 1, block by block and over the same columns.
#[derive(Clone, Debug)]
pub struct Runs {
    /// The run before.
    pub reference: Vec<Moments>,
    /// The later run.
    pub later: Vec<Moments>,
    /// By what parts of one run differ among themselves: the larger of what [`within`] says of the two.
    pub within: f64,
}

/// What is asked of two runs.
#[derive(Clone, Debug)]
pub struct Search {
    /// Columns whose coefficients both runs share: those of the model, and those of what it may lack in both.
    pub shared: Vec<usize>,
    /// The changes that are possible.
    pub changes: Vec<Candidate>,
}

/// A change that is possible.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Its columns, which have coefficients of their own in the later run.
    pub columns: Vec<usize>,
    /// The most values that it is charged for; fewer than it has where they move together as a rule.
    pub most: usize,
    /// What it is charged besides, in values, for being rarer than others.
    pub rarity: f64,
}

/// A change that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// Which of the possible ones.
    pub which: usize,
    /// The values of its columns.
    pub values: DVector<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
    /// Which values are known by themselves.
    pub determined: Vec<bool>,
    /// By how much the sum of squares would rise without it, over the variance of what is left.
    pub gain: f64,
    /// The same on blocks that had no part in the fit.
    pub held_out: f64,
    /// Changes that explain nearly as much in its place.
    pub rivals: Vec<usize>,
}

/// The fewest changes that explain the later run, the largest first; none where the runs differ by chance alone, or by no more
/// than parts of one run do.
pub fn search(runs: &Runs, search: &Search) -> Vec<Change> {
    let bench = Bench::new(runs, search);
    let mut chosen: Vec<usize> = Vec::new();
    loop {
        let candidates = (0..search.changes.len()).filter(|g| !chosen.contains(g));
        let tried = candidates.map(|g| (g, bench.cost(&with(&chosen, g))));
        let Some((best, cost)) = tried.min_by(|a, b| a.1.total_cmp(&b.1)) else {
            break;
        };
        if cost >= bench.cost(&chosen) || !bench.holds(&chosen, best) {
            break;
        }
        chosen.push(best);
        bench.settle(&mut chosen);
    }
    // What the exchanges have made small goes again.
    while let Some(at) = (0..chosen.len()).find(|at| {
        let rest = without(&chosen, chosen[*at]);
        bench.gain(&rest, chosen[*at]) < bench.least
    }) {
        chosen.remove(at);
    }
    let mut found: Vec<Change> = chosen.iter().map(|g| bench.change(&chosen, *g)).collect();
    found.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    found
}

/// By how much each change, with no other beside it, lowers the sum of squares, over the variance of what all of them leave; of
/// many machines this says what is usual among them.
pub fn gains(runs: &Runs, search: &Search) -> Vec<f64> {
    let bench = Bench::new(runs, search);
    (0..search.changes.len())
        .map(|which| bench.gain(&[], which))
        .collect()
}

/// One change with no other beside it, whatever it explains.
pub fn alone(runs: &Runs, search: &Search, which: usize) -> Change {
    Bench::new(runs, search).change(&[which], which)
}

/// By what parts of one run differ among themselves: the largest sum of squares that a single change between parts of it explains,
/// over the rows that a difference of its parts is worth. Noise makes it small; what a model lacks, and friction that drifts, make
/// it large, and then the same must be expected between two runs.
pub fn within(blocks: &[Moments], search: &Search) -> f64 {
    let n = blocks.len();
    let halves = [(0, n / 2)];
    let quarters = (0..4).map(|k| (k * n / 4, (k + 1) * n / 4));
    let mut most = 0.0_f64;
    for (start, end) in halves.into_iter().chain(quarters) {
        let is_later = |k: &usize| (start..end).contains(k);
        let part = |later: bool| {
            let some = (0..n).filter(|k| is_later(k) == later);
            some.map(|k| blocks[k].clone()).collect::<Vec<_>>()
        };
        let runs = Runs {
            reference: part(false),
            later: part(true),
            within: 0.0,
        };
        let worth = worth([rows(&runs.reference), rows(&runs.later)]);
        if worth == 0.0 {
            continue;
        }
        let bench = Bench::new(&runs, search);
        for (g, candidate) in search.changes.iter().enumerate() {
            let beyond =
                bench.gain(&[], g) - by_chance(candidate.columns.len(), search.changes.len());
            most = most.max(beyond * bench.noise / worth);
        }
    }
    most
}

/// What the best of some changes with so many values gains by chance, which it seldom exceeds (Laurent and Massart, Annals of
/// Statistics 28, 2000).
fn by_chance(values: usize, changes: usize) -> f64 {
    let (k, tail) = (values as f64, (10.0 * changes as f64).ln());
    k + 2.0 * (k * tail).sqrt() + 2.0 * tail
}

fn rows(blocks: &[Moments]) -> f64 {
    blocks.iter().map(|block| block.rows).sum::<usize>() as f64
}

/// How many rows a difference between two runs is worth.
fn worth([a, b]: [f64; 2]) -> f64 {
    if a > 0.0 && b > 0.0 {
        a * b / (a + b)
    } else {
        0.0
    }
}

/// All blocks but one.
fn sum(blocks: &[Moments], but: Option<usize>) -> Moments {
    let mut sum = Moments::new(blocks.first().map_or(0, |block| block.rhs.len()));
    for (_, block) in blocks.iter().enumerate().filter(|(k, _)| Some(*k) != but) {
        sum.merge(block);
    }
    sum
}

fn with(chosen: &[usize], further: usize) -> Vec<usize> {
    chosen.iter().copied().chain([further]).collect()
}

fn without(chosen: &[usize], one: usize) -> Vec<usize> {
    chosen.iter().copied().filter(|g| *g != one).collect()
}

/// Rows of both runs together: the shared columns, and behind them those of changes, which are the later run's alone.
fn together([reference, later]: [&Moments; 2], shared: &[usize], columns: &[usize]) -> Moments {
    let mut all = later.of(columns);
    let reference = reference.of(shared);
    let n = shared.len();
    let mut gram = all.gram.view_mut((0, 0), (n, n));
    gram += &reference.gram;
    let mut rhs = all.rhs.rows_mut(0, n);
    rhs += &reference.rhs;
    all.total += reference.total;
    all.rows += reference.rows;
    all
}

struct Bench<'a> {
    runs: &'a Runs,
    search: &'a Search,
    /// Columns that both runs share and that say something of their own.
    shared: Vec<usize>,
    /// All blocks of both runs.
    sums: [Moments; 2],
    /// What the columns of all changes, one after the other, say beside the shared ones, and where each change begins.
    beside: Beside,
    starts: Vec<usize>,
    /// Variance of what no change explains.
    noise: f64,
    /// What a value must gain.
    price: f64,
    /// What a change must gain, whatever it is.
    least: f64,
}

impl<'a> Bench<'a> {
    fn new(runs: &'a Runs, search: &'a Search) -> Self {
        let sums = [sum(&runs.reference, None), sum(&runs.later, None)];
        let mut all = sums[0].of(&search.shared);
        all.merge(&sums[1].of(&search.shared));
        let telling = all.solve().kept;
        let shared = search.shared.iter().zip(telling);
        let rows = (sums[0].rows + sums[1].rows) as f64;
        let shared: Vec<usize> = shared
            .filter(|(_, telling)| *telling)
            .map(|(k, _)| *k)
            .collect();
        let everything = shared
            .iter()
            .chain(search.changes.iter().flat_map(|one| &one.columns));
        let everything: Vec<usize> = everything.copied().collect();
        let beside = together(sums.each_ref(), &shared, &everything).beside(shared.len());
        let mut starts = vec![0];
        for candidate in &search.changes {
            starts.push(starts[starts.len() - 1] + candidate.columns.len());
        }
        let changes: Vec<usize> = (0..starts[search.changes.len()]).collect();
        let (rest, kept) = beside.rest(&changes);
        let rank = shared.len() + kept.iter().filter(|kept| **kept).count();
        let noise = (rest / (rows - rank as f64).max(1.0)).max(1.0);
        let worth = worth(sums.each_ref().map(|one| one.rows as f64));
        Self {
            runs,
            search,
            shared,
            beside,
            starts,
            noise,
            price: STRICTER * rows.max(2.0).ln(),
            least: (BEYOND * runs.within * worth / noise).max(CLEAR * CLEAR),
            sums,
        }
    }

    /// The shared columns, and once more those of some changes.
    fn columns(&self, chosen: &[usize]) -> Vec<usize> {
        let of = |g: &usize| self.search.changes[*g].columns.iter().copied();
        let shared = self.shared.iter().copied();
        shared.chain(chosen.iter().flat_map(of)).collect()
    }

    fn solved(&self, chosen: &[usize]) -> Solved {
        together(self.sums.each_ref(), &self.shared, &self.columns(chosen)).solve()
    }

    /// What some changes leave, over the variance of the noise, and how many values they are charged for.
    fn left(&self, chosen: &[usize]) -> (f64, f64) {
        let columns = chosen
            .iter()
            .flat_map(|g| self.starts[*g]..self.starts[*g + 1]);
        let (rest, kept) = self.beside.rest(&columns.collect::<Vec<usize>>());
        let mut kept = kept.into_iter();
        let charged = chosen.iter().map(|g| {
            let candidate = &self.search.changes[*g];
            let own = kept.by_ref().take(candidate.columns.len());
            own.filter(|kept| *kept).count().min(candidate.most) as f64 + candidate.rarity
        });
        let charged = charged.sum();
        (rest / self.noise, charged)
    }

    /// By how much a further change lowers the sum of squares, over the variance of the noise.
    fn gain(&self, chosen: &[usize], further: usize) -> f64 {
        self.left(chosen).0 - self.left(&with(chosen, further)).0
    }

    /// What some changes leave, with a price on each value.
    fn cost(&self, chosen: &[usize]) -> f64 {
        let (rest, charged) = self.left(chosen);
        rest + self.price * charged
    }

    /// Takes out and exchanges for as long as that costs less.
    fn settle(&self, chosen: &mut Vec<usize>) {
        loop {
            let now = self.cost(chosen);
            let mut better: Option<(f64, Vec<usize>)> = None;
            for one in chosen.clone() {
                let rest = without(chosen, one);
                let others = (0..self.search.changes.len()).filter(|g| !chosen.contains(g));
                let exchanged = others.map(|g| with(&rest, g));
                for tried in exchanged.chain([rest.clone()]) {
                    let cost = self.cost(&tried);
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

    /// By how much a further change lowers the sum of squares, and by how much on blocks that had no part in the fit.
    fn gains(&self, chosen: &[usize], further: usize) -> (f64, f64) {
        let both = with(chosen, further);
        let gain = self.gain(chosen, further);
        let mut held_out = 0.0;
        for (run, blocks) in [&self.runs.reference, &self.runs.later]
            .into_iter()
            .enumerate()
        {
            for k in 0..blocks.len() {
                let others = sum(blocks, Some(k));
                let mut sums = self.sums.each_ref();
                sums[run] = &others;
                let rest = |set: &[usize]| {
                    let both = together(sums, &self.shared, &self.columns(set));
                    let values = both.solve().values;
                    let columns = self.columns(if run == 0 { &[] } else { set });
                    let own = values.rows(0, columns.len()).into_owned();
                    blocks[k].of(&columns).rest(&own)
                };
                held_out += (rest(chosen) - rest(&both)) / self.noise;
            }
        }
        (gain, held_out)
    }

    fn holds(&self, chosen: &[usize], further: usize) -> bool {
        // Held-out blocks take the most time, and most candidates fail before.
        if self.gain(chosen, further) <= self.least {
            return false;
        }
        let (gain, held_out) = self.gains(chosen, further);
        gain > self.least && held_out > HELD_OUT * gain
    }

    fn change(&self, chosen: &[usize], which: usize) -> Change {
        let rest = without(chosen, which);
        let order = with(&rest, which);
        let solved = self.solved(&order);
        let n = self.search.changes[which].columns.len();
        let at = solved.values.len() - n;
        let (gain, held_out) = self.gains(&rest, which);
        let cost = self.cost(&order);
        let near = (NEAR * gain).max(self.price);
        let others = (0..self.search.changes.len()).filter(|g| !chosen.contains(g));
        Change {
            which,
            values: solved.values.rows(at, n).into_owned(),
            covariance: self.noise * solved.covariance.view((at, at), (n, n)),
            determined: solved.determined[at..].to_vec(),
            gain,
            held_out,
            rivals: others
                .filter(|g| self.cost(&with(&rest, *g)) < cost + near)
                .collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::Noise;

    const ROWS: usize = 400;

    /// Runs with three base columns; the later one has changes of one, two and one columns, of which the second column of
    /// the second is a twin of the first base column.
    fn runs(seed: u64, changed: &[(usize, f64)]) -> Runs {
        let mut noise = Noise::new(seed);
        let mut moments = |extra: bool| {
            let mut z: Vec<Vec<f64>> = (0..7)
                .map(|_| (0..ROWS).map(|_| noise.normal()).collect())
                .collect();
            z[5] = z[0].clone();
            let y: Vec<f64> = (0..ROWS)
                .map(|i| {
                    let base = 2.0 * z[0][i] - z[1][i] + 0.5 * z[2][i];
                    let more: f64 = changed.iter().map(|(k, c)| c * z[*k][i]).sum();
                    base + if extra { more } else { 0.0 } + noise.normal()
                })
                .collect();
            let mut one = Moments::new(7);
            let columns: Vec<Option<&[f64]>> = z.iter().map(|c| Some(&c[..])).collect();
            one.add_rows(&columns, &y);
            one
        };
        Runs {
            reference: (0..5).map(|_| moments(false)).collect(),
            later: (0..5).map(|_| moments(true)).collect(),
            within: 0.0,
        }
    }

    fn possible() -> Search {
        Search {
            shared: (0..7).collect(),
            changes: vec![vec![3], vec![4, 5], vec![6]]
                .into_iter()
                .map(|columns| Candidate {
                    columns,
                    most: 2,
                    rarity: 0.0,
                })
                .collect(),
        }
    }

    #[test]
    fn what_changed_is_found_and_nothing_else() {
        for seed in 0..30 {
            assert_eq!(search(&runs(seed, &[]), &possible()), []);
            let found = search(&runs(seed, &[(5, 1.0), (6, 0.6)]), &possible());
            let which: Vec<usize> = found.iter().map(|c| c.which).collect();
            assert_eq!(which, [1, 2], "seed {seed}");
            let [pair, single] = &found[..] else {
                unreachable!()
            };
            assert!((pair.values[1] - 1.0).abs() < 5.0 * pair.covariance[(1, 1)].sqrt());
            assert!((single.values[0] - 0.6).abs() < 5.0 * single.covariance[(0, 0)].sqrt());
            assert!(pair.determined[1] && single.determined[0]);
            assert!(single.held_out > 0.5 * single.gain && single.rivals.is_empty());
            // Each by itself gains as much as it does beside the other: their columns have little in common.
            let alone_gain = gains(&runs(seed, &[(5, 1.0), (6, 0.6)]), &possible());
            assert!(alone_gain[0] < 0.1 * alone_gain[2] && alone_gain[2] < 1.5 * single.gain);
            let one = alone(&runs(seed, &[(6, 0.6)]), &possible(), 2);
            assert!((one.values[0] - 0.6).abs() < 5.0 * one.covariance[(0, 0)].sqrt());
        }
    }

    /// What the model lacks in both runs is no change.
    #[test]
    fn what_both_runs_have_is_no_change() {
        for seed in 0..10 {
            let mut both = runs(seed, &[(3, 1.0)]);
            both.reference = runs(seed + 100, &[(3, 1.0)]).later;
            assert_eq!(search(&both, &possible()), []);
        }
    }

    /// What parts of one run differ by is no change between runs, and what is larger is one.
    #[test]
    fn what_parts_of_one_run_differ_by_is_no_change() {
        let mut drifting = runs(3, &[]);
        drifting.reference[4] = runs(7, &[(3, 0.8)]).later[4].clone();
        drifting.later = runs(9, &[(3, 0.6)]).later;
        assert_eq!(search(&drifting, &possible()).len(), 1);
        drifting.within = within(&drifting.reference, &possible());
        assert_eq!(search(&drifting, &possible()), []);
        drifting.later = runs(9, &[(3, 1.0)]).later;
        assert_eq!(search(&drifting, &possible()).len(), 1);
        // Noise alone hides little.
        let alone = runs(11, &[]);
        for blocks in [&alone.reference, &alone.later] {
            assert!(within(blocks, &possible()).abs() < f64::EPSILON);
        }
    }

    /// A change that one block alone has is no change of the run.
    #[test]
    fn a_single_block_decides_nothing() {
        let mut runs = runs(1, &[]);
        runs.later[2] = self::runs(2, &[(3, 1.0)]).later[0].clone();
        assert_eq!(search(&runs, &possible()), []);
    }
}
