//! The bench on which sets of effects are tried: which columns they have, and what each set leaves.

use std::cell::RefCell;
use std::collections::HashMap;

use nalgebra::{DMatrix, DVector};

use super::noise::effective_samples;
use super::pool::{DEPENDENT, On, Pool, dot, solve};
use super::problem::{Candidate, Choice, Column, Problem, Sign, Source, Supply};

/// A column of which the others leave a smaller share of squares than this says nothing new.
const SAID: f64 = 1e-6;

/// An effect that was picked, with the columns that it has for its choice of constants.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Pick {
    /// Which candidate.
    pub(crate) candidate: usize,
    /// Its searched constants.
    pub(crate) constants: Vec<(String, f64)>,
    /// Its columns in the pool.
    pub(crate) columns: Vec<usize>,
    /// How many of them say something that others do not say already.
    pub(crate) rank: usize,
}

/// A column of a choice: candidate, choice, column.
type ChoiceColumn = (usize, usize, usize);

/// A set of effects, fitted to all samples with the base parameters.
#[derive(Clone, Debug)]
pub(crate) struct Trial {
    pub(crate) picks: Vec<Pick>,
    /// Weighted sum of squares that is left.
    pub(crate) squares: f64,
    /// Numbers that are free in the effects.
    pub(crate) freedoms: usize,
    /// Effects whose estimates have the wrong sign, by position.
    pub(crate) wrong_sign: Vec<usize>,
    /// The information criterion by which sets are compared; less is better.
    pub(crate) score: f64,
}

/// Columns, weights, and what every candidate looks like at present.
pub(crate) struct Bench<'a> {
    pub(crate) problem: &'a Problem,
    pub(crate) pool: Pool,
    pub(crate) base: Vec<usize>,
    pub(crate) measured: usize,
    /// One over the variance of each channel.
    pub(crate) weights: Vec<f64>,
    /// The best choice of each candidate for the present residual; `None` if the model says it all already.
    pub(crate) present: Vec<Option<Pick>>,
    supply: &'a dyn Supply,
    friction: Vec<usize>,
    /// Pool columns by candidate and choice.
    known: HashMap<(usize, usize), Vec<usize>>,
    /// Inner products of the columns of choices with those of the pool, channel by channel of the choice's column.
    seen: RefCell<HashMap<ChoiceColumn, Vec<Option<Box<[f64]>>>>>,
    /// Which columns lie in the span of others and the base.
    pub(crate) within: RefCell<HashMap<(Vec<usize>, Vec<usize>), bool>>,
}

impl<'a> Bench<'a> {
    pub(crate) fn new(problem: &'a Problem, supply: &'a dyn Supply) -> Self {
        let mut pool = Pool::new(&problem.layout);
        let base = problem.base.iter().map(|c| pool.add(c.clone())).collect();
        let measured = pool.add(problem.measured.clone());
        let friction = problem
            .friction
            .iter()
            .map(|c| pool.add(c.clone()))
            .collect();
        let mut bench = Self {
            problem,
            supply,
            friction,
            pool,
            base,
            measured,
            weights: vec![1.0; problem.layout.channels.len()],
            present: vec![None; problem.candidates.len()],
            known: HashMap::new(),
            seen: RefCell::default(),
            within: RefCell::default(),
        };
        // Channels of very different forces count alike from the start.
        bench.weigh(&[]);
        bench.weigh(&[]);
        bench
    }

    pub(crate) fn candidate(&self, pick: &Pick) -> &'a Candidate {
        &self.problem.candidates[pick.candidate]
    }

    /// Columns of the base and of some effects.
    pub(crate) fn columns(&self, picks: &[Pick]) -> Vec<usize> {
        let of_picks = picks.iter().flat_map(|pick| &pick.columns);
        self.base.iter().chain(of_picks).copied().collect()
    }

    /// Factors of the base and of some effects, and the weighted sum of squares they leave.
    pub(crate) fn fit(&self, picks: &[Pick], on: On) -> (DVector<f64>, f64) {
        let mut which = self.columns(picks);
        which.push(self.measured);
        solve(&self.pool.gram(&which, &self.weights, on))
    }

    /// What some effects with given factors leave, `[channel][sample]`.
    pub(crate) fn rest(&self, picks: &[Pick], factors: &DVector<f64>) -> Vec<Vec<f64>> {
        self.pool
            .rest(self.measured, &self.columns(picks), factors.as_slice())
    }

    /// Weighs each channel by the variance of what a set leaves, but not below its noise.
    pub(crate) fn weigh(&mut self, picks: &[Pick]) {
        let (factors, _) = self.fit(picks, On::All);
        let rest = self.rest(picks, &factors);
        let size = |values: &[f64]| dot(values, values) / values.len().max(1) as f64;
        let measured = self.pool.column(self.measured);
        for (d, values) in rest.iter().enumerate() {
            let noise = self.problem.noise[d].powi(2);
            let rounding = measured.0[d].as_deref().map_or(0.0, size) * 1e-14;
            let variance = size(values).max(noise).max(rounding);
            self.weights[d] = if variance > 0.0 { 1.0 / variance } else { 1.0 };
        }
    }

    /// How many independent equations the residual of a set is worth, on some channels.
    pub(crate) fn worth(&self, rest: &[Vec<f64>], channels: &[usize]) -> f64 {
        let mut worth = 0.0;
        for d in channels {
            let mut start = 0;
            for stretch in &self.problem.layout.stretches {
                worth += effective_samples(&rest[*d][start..start + stretch.samples]);
                start += stretch.samples;
            }
        }
        worth.max(2.0)
    }

    /// Chooses the constants of every candidate that suit what a set leaves best, and makes the columns of those that
    /// depend on the fit.
    pub(crate) fn look(&mut self, picks: &[Pick]) {
        let (factors, _) = self.fit(picks, On::All);
        let rest = self.rest(picks, &factors);
        let which = self.columns(picks);
        let weights = self.weights.clone();
        let factor = Factored::new(self.pool.gram(&which, &weights, On::All));
        let problem = self.problem;
        let carried = self.carried(picks);
        let mut present = Vec::with_capacity(problem.candidates.len());
        for (k, candidate) in problem.candidates.iter().enumerate() {
            let pick = match &candidate.source {
                Source::Columns(choices) => {
                    let best = if choices.len() == 1 {
                        Some(0)
                    } else {
                        let score = |(at, choice): (usize, &Choice)| {
                            let products = self.products_of_choice((k, at), choice, &which);
                            self.explained(&choice.columns, &products, &factor, &rest)
                        };
                        let scored = choices.iter().enumerate().map(score).enumerate();
                        scored
                            .max_by(|a, b| a.1.total_cmp(&b.1))
                            .map(|(best, _)| best)
                    };
                    best.map(|best| self.pick(k, best))
                }
                Source::Tangent(_) | Source::Delay => Some(self.tangent(k, picks, &factors)),
                Source::Carried => carried.get(&k).cloned(),
            };
            present.push(pick.and_then(|mut pick| {
                pick.rank = self.rank(&pick, &which, &factor);
                (pick.rank > 0).then_some(pick)
            }));
        }
        self.present = present;
    }

    /// A candidate with one of its choices.
    pub(crate) fn pick(&mut self, candidate: usize, choice: usize) -> Pick {
        let Source::Columns(choices) = &self.problem.candidates[candidate].source else {
            unreachable!("only known columns have choices")
        };
        let chosen = &choices[choice];
        let columns = match self.known.get(&(candidate, choice)) {
            Some(columns) => columns.clone(),
            None => {
                let add = |column: &Column| self.pool.add(column.clone());
                let columns: Vec<usize> = chosen.columns.iter().map(add).collect();
                self.known.insert((candidate, choice), columns.clone());
                columns
            }
        };
        Pick {
            candidate,
            constants: chosen.constants.clone(),
            rank: columns.len(),
            columns,
        }
    }

    /// Chooses the constants of each effect of a set anew, beside those of the others.
    pub(crate) fn retune(&mut self, mut picks: Vec<Pick>) -> Vec<Pick> {
        let problem = self.problem;
        for _ in 0..2 {
            let before = picks.clone();
            for i in 0..picks.len() {
                let Source::Columns(choices) = &problem.candidates[picks[i].candidate].source
                else {
                    continue;
                };
                if choices.len() < 2 {
                    continue;
                }
                let mut others = picks.clone();
                let old = others.remove(i);
                let (factors, _) = self.fit(&others, On::All);
                let rest = self.rest(&others, &factors);
                let which = self.columns(&others);
                let factor = Factored::new(self.pool.gram(&which, &self.weights, On::All));
                let candidate = old.candidate;
                let score = |(at, choice): (usize, &Choice)| {
                    let products = self.products_of_choice((candidate, at), choice, &which);
                    self.explained(&choice.columns, &products, &factor, &rest)
                };
                let scored = choices.iter().enumerate().map(score).enumerate();
                let Some((best, explained)) = scored.max_by(|a, b| a.1.total_cmp(&b.1)) else {
                    continue;
                };
                let own: Vec<Column> = old
                    .columns
                    .iter()
                    .map(|k| self.pool.column(*k).clone())
                    .collect();
                if explained
                    > self.explained(&own, &self.all_products(&own, &which), &factor, &rest)
                {
                    picks[i] = self.pick(old.candidate, best);
                }
            }
            if picks == before {
                break;
            }
        }
        picks
    }

    /// Searches for the constants of a set's effects between the values of their grids, by golden sections.
    pub(crate) fn refine(&mut self, mut picks: Vec<Pick>) -> Vec<Pick> {
        let problem = self.problem;
        let supply = self.supply;
        for i in 0..picks.len() {
            let candidate = picks[i].candidate;
            let Source::Columns(choices) = &problem.candidates[candidate].source else {
                continue;
            };
            let [(name, value)] = picks[i].constants.as_slice() else {
                continue;
            };
            let (name, value) = (name.clone(), *value);
            let mut grid: Vec<f64> = choices.iter().map(|c| c.constants[0].1).collect();
            grid.sort_by(f64::total_cmp);
            let low = grid
                .iter()
                .copied()
                .filter(|x| *x < value)
                .fold(0.7 * value, f64::max);
            let high = grid
                .iter()
                .copied()
                .filter(|x| *x > value)
                .fold(1.4 * value, f64::min);
            let mut others = picks.clone();
            others.remove(i);
            let (factors, _) = self.fit(&others, On::All);
            let rest = self.rest(&others, &factors);
            let which = self.columns(&others);
            let factor = Factored::new(self.pool.gram(&which, &self.weights, On::All));
            let at = |log: f64| -> Option<(f64, Vec<Column>)> {
                let columns = supply.finer(candidate, log.exp())?;
                let products = self.all_products(&columns, &which);
                Some((self.explained(&columns, &products, &factor, &rest), columns))
            };
            let Some(best) = golden(low.ln(), high.ln(), &at) else {
                continue;
            };
            let own: Vec<Column> = picks[i]
                .columns
                .iter()
                .map(|k| self.pool.column(*k).clone())
                .collect();
            let products = self.all_products(&own, &which);
            let now = self.explained(&own, &products, &factor, &rest);
            let (log, (explained, columns)) = best;
            if explained > now {
                picks[i] = Pick {
                    candidate,
                    constants: vec![(name, log.exp())],
                    rank: picks[i].rank,
                    columns: columns.into_iter().map(|c| self.pool.add(c)).collect(),
                };
            }
        }
        picks
    }

    /// Candidates that depend on what the drives carry, with the columns that a fit gives them.
    fn carried(&mut self, picks: &[Pick]) -> HashMap<usize, Pick> {
        let is_carried = |c: &Candidate| matches!(c.source, Source::Carried);
        if !self.problem.candidates.iter().any(is_carried) {
            return HashMap::new();
        }
        let mut which = self.columns(picks);
        let n = which.len();
        which.extend(&self.friction);
        which.push(self.measured);
        let (factors, _) = solve(&self.pool.gram(&which, &self.weights, On::All));
        let of_picks = picks.iter().flat_map(|pick| {
            let candidate = self.candidate(pick);
            pick.columns.iter().map(|_| candidate.bears)
        });
        let bears: Vec<bool> = (self.problem.base_bears.iter().copied())
            .chain(of_picks)
            .collect();
        let mut load = self.problem.held.clone().unwrap_or_default();
        load.0.resize(self.weights.len(), None);
        for ((k, factor), bears) in which[..n].iter().zip(factors.iter()).zip(bears) {
            if bears {
                load.add(*factor, self.pool.column(*k));
            }
        }
        let made = self.supply.carried(&load);
        let picks = made.into_iter().map(|(candidate, columns)| {
            let pick = Pick {
                candidate,
                constants: Vec::new(),
                rank: columns.len(),
                columns: columns.into_iter().map(|c| self.pool.add(c)).collect(),
            };
            (candidate, pick)
        });
        picks.collect()
    }

    /// Columns of a candidate that is a small change of the model as fitted.
    fn tangent(&mut self, candidate: usize, picks: &[Pick], factors: &DVector<f64>) -> Pick {
        let columns: Vec<Column> = match &self.problem.candidates[candidate].source {
            Source::Tangent(parameters) => parameters
                .iter()
                .map(|changes| {
                    let mut sum = Column(vec![None; self.weights.len()]);
                    for (change, factor) in changes.iter().zip(factors.iter()) {
                        sum.add(*factor, change);
                    }
                    sum
                })
                .collect(),
            Source::Delay => {
                let mut force = self.problem.held.clone().unwrap_or_default();
                force.0.resize(self.weights.len(), None);
                let is_delay = |pick: &Pick| {
                    matches!(
                        self.problem.candidates[pick.candidate].source,
                        Source::Delay
                    )
                };
                let delays: Vec<usize> = picks
                    .iter()
                    .filter(|pick| is_delay(pick))
                    .flat_map(|pick| pick.columns.clone())
                    .collect();
                for (k, factor) in self.columns(picks).iter().zip(factors.iter()) {
                    if !delays.contains(k) {
                        force.add(*factor, self.pool.column(*k));
                    }
                }
                // The delay that was found so far, where it is not new.
                let found = picks.iter().position(|pick| is_delay(pick)).map(|i| {
                    let before: usize = picks[..i].iter().map(|p| p.columns.len()).sum();
                    factors[self.base.len() + before]
                });
                vec![self.late(&force, found.unwrap_or(0.0))]
            }
            Source::Columns(_) | Source::Carried => unreachable!("they are no tangents"),
        };
        Pick {
            candidate,
            constants: Vec::new(),
            rank: columns.len(),
            columns: columns.into_iter().map(|c| self.pool.add(c)).collect(),
        }
    }

    /// What a force changes by when it is read later by `delay`, for each second of it; for delays below a tenth of a
    /// sample minus its rate of change.
    fn late(&self, force: &Column, delay: f64) -> Column {
        let stretches = &self.problem.layout.stretches;
        let changes = |values: &Vec<f64>| {
            let mut changes = Vec::with_capacity(values.len());
            let mut start = 0;
            for stretch in stretches {
                let part = &values[start..start + stretch.samples];
                let last = part.len() - 1;
                let samples = delay / stretch.step;
                for i in 0..part.len() {
                    if samples.abs() < 0.1 {
                        let (before, after) = (i.saturating_sub(1), (i + 1).min(last));
                        let time = stretch.step * (after - before).max(1) as f64;
                        changes.push((part[before] - part[after]) / time);
                        continue;
                    }
                    let at = (i as f64 - samples).clamp(0.0, last as f64);
                    let low = at.floor();
                    let (k, share) = (low as usize, at - low);
                    let then = part[k] + share * (part[(k + 1).min(last)] - part[k]);
                    changes.push((then - part[i]) / delay);
                }
                start += stretch.samples;
            }
            changes
        };
        Column(force.0.iter().map(|v| v.as_ref().map(changes)).collect())
    }

    /// Makes the columns of effects that depend on the fit anew.
    pub(crate) fn refresh(&mut self, mut picks: Vec<Pick>) -> Vec<Pick> {
        for _ in 0..3 {
            for i in 0..picks.len() {
                let candidate = picks[i].candidate;
                if matches!(
                    self.problem.candidates[candidate].source,
                    Source::Columns(_)
                ) {
                    continue;
                }
                let (factors, _) = self.fit(&picks, On::All);
                let rank = picks[i].rank;
                let anew = match self.problem.candidates[candidate].source {
                    Source::Carried => self.carried(&picks).remove(&candidate),
                    _ => Some(self.tangent(candidate, &picks.clone(), &factors)),
                };
                if let Some(anew) = anew {
                    picks[i] = Pick { rank, ..anew };
                }
            }
        }
        picks
    }

    /// How many columns of a candidate say something that others do not say already.
    fn rank(&self, pick: &Pick, which: &[usize], factor: &Factored) -> usize {
        let columns: Vec<&Column> = pick.columns.iter().map(|k| self.pool.column(*k)).collect();
        let halves: Vec<DVector<f64>> = columns
            .iter()
            .map(|c| factor.half(&self.products(c, which)))
            .collect();
        let n = columns.len();
        let own = |i: usize, j: usize| self.product(columns[i], columns[j]);
        let left = DMatrix::from_fn(n, n, |i, j| {
            let scale = (own(i, i) * own(j, j)).sqrt();
            if scale > 0.0 {
                (own(i, j) - halves[i].dot(&halves[j])) / scale
            } else {
                0.0
            }
        });
        let values = left.symmetric_eigenvalues();
        values.iter().filter(|value| **value > SAID).count()
    }

    /// Weighted inner products of a column that need not be in the pool with some that are.
    fn products(&self, column: &Column, which: &[usize]) -> DVector<f64> {
        let product = |k: &usize| self.product(column, self.pool.column(*k));
        DVector::from_iterator(which.len(), which.iter().map(product))
    }

    fn all_products(&self, columns: &[Column], which: &[usize]) -> Vec<DVector<f64>> {
        columns.iter().map(|c| self.products(c, which)).collect()
    }

    /// Weighted inner products of a choice's columns with some of the pool; each is computed once.
    fn products_of_choice(
        &self,
        (candidate, choice): (usize, usize),
        columns: &Choice,
        which: &[usize],
    ) -> Vec<DVector<f64>> {
        let mut seen = self.seen.borrow_mut();
        let mut all = Vec::with_capacity(columns.columns.len());
        for (i, column) in columns.columns.iter().enumerate() {
            let known = seen.entry((candidate, choice, i)).or_default();
            let mut products = DVector::zeros(which.len());
            for (product, k) in products.iter_mut().zip(which) {
                if known.len() <= *k {
                    known.resize(*k + 1, None);
                }
                let by_channel = known[*k].get_or_insert_with(|| {
                    let pairs = column.0.iter().zip(&self.pool.column(*k).0);
                    pairs
                        .filter_map(|(a, b)| {
                            let a = a.as_ref()?;
                            Some(b.as_ref().map_or(0.0, |b| dot(a, b)))
                        })
                        .collect()
                });
                let weights = column.channels().map(|d| self.weights[d]);
                *product = by_channel.iter().zip(weights).map(|(x, w)| x * w).sum();
            }
            all.push(products);
        }
        all
    }

    fn product(&self, a: &Column, b: &Column) -> f64 {
        let pairs = a.0.iter().zip(&b.0).zip(&self.weights);
        pairs
            .map(|((a, b), weight)| match (a, b) {
                (Some(a), Some(b)) => weight * dot(a, b),
                _ => 0.0,
            })
            .sum()
    }

    /// By how much some columns would lower the weighted sum of squares of a residual beside those that made it.
    fn explained(
        &self,
        columns: &[Column],
        products: &[DVector<f64>],
        factor: &Factored,
        rest: &[Vec<f64>],
    ) -> f64 {
        let n = columns.len();
        let halves: Vec<DVector<f64>> = products.iter().map(|p| factor.half(p)).collect();
        let mut gram = DMatrix::zeros(n + 1, n + 1);
        for i in 0..n {
            for j in 0..=i {
                let own = self.product(&columns[i], &columns[j]);
                let left = own - halves[i].dot(&halves[j]);
                // Rounding is nothing to explain by.
                let left = if i == j && left < 1e-7 * own {
                    0.0
                } else {
                    left
                };
                gram[(i, j)] = left;
                gram[(j, i)] = left;
            }
            let mut right = 0.0;
            for ((values, rest), weight) in columns[i].0.iter().zip(rest).zip(&self.weights) {
                if let Some(values) = values {
                    right += weight * dot(values, rest);
                }
            }
            gram[(i, n)] = right;
            gram[(n, i)] = right;
        }
        let total: f64 = rest
            .iter()
            .zip(&self.weights)
            .map(|(rest, weight)| weight * dot(rest, rest))
            .sum();
        gram[(n, n)] = total;
        total - solve(&gram).1
    }

    /// A set of effects, fitted to all samples.
    pub(crate) fn trial(&self, picks: Vec<Pick>) -> Trial {
        let (factors, squares) = self.fit(&picks, On::All);
        self.judged(picks, factors.as_slice(), squares)
    }

    /// Numbers that are free in an effect.
    pub(crate) fn freedoms(&self, pick: &Pick) -> usize {
        pick.rank + self.candidate(pick).searched
    }

    /// A trial from factors of base and effects.
    fn judged(&self, picks: Vec<Pick>, factors: &[f64], squares: f64) -> Trial {
        let wrong_sign = self.wrong_signs(&picks, &factors[factors.len() - n_columns(&picks)..]);
        let freedoms = picks.iter().map(|p| self.freedoms(p)).sum();
        Trial {
            picks,
            squares,
            freedoms,
            wrong_sign,
            score: f64::INFINITY,
        }
    }

    /// Effects with an estimate whose sign makes no physical sense, by position.
    fn wrong_signs(&self, picks: &[Pick], factors: &[f64]) -> Vec<usize> {
        let mut at = 0;
        let mut wrong = Vec::new();
        for (i, pick) in picks.iter().enumerate() {
            let parameters = &self.candidate(pick).parameters;
            let own = &factors[at..at + parameters.len()];
            at += parameters.len();
            let largest = own.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            let is_wrong = parameters.iter().zip(own).any(|(p, x)| match p.sign {
                Sign::Positive => *x < -1e-9 * largest,
                Sign::Negative => *x > 1e-9 * largest,
                Sign::Any => false,
            });
            if is_wrong {
                wrong.push(i);
            }
        }
        wrong
    }

    /// All present candidates and some picks at once: what the base leaves of their inner products, so that sets are
    /// tried without it.
    pub(crate) fn table(&self, also: &[Pick]) -> Table {
        let mut columns: Vec<usize> = Vec::new();
        for pick in self.present.iter().flatten().chain(also) {
            for k in &pick.columns {
                if !columns.contains(k) {
                    columns.push(*k);
                }
            }
        }
        columns.push(self.measured);
        let mut which = self.base.clone();
        which.extend(&columns);
        let gram = self.pool.gram(&which, &self.weights, On::All);
        let n = self.base.len();
        let m = columns.len();
        let factor = Factored::new(gram.view((0, 0), (n, n)).into_owned());
        let mut left = gram.view((n, n), (m, m)).into_owned();
        if n > 0 {
            let halves = factor.halves(&gram.view((0, n), (n, m)).into_owned());
            left -= halves.transpose() * halves;
        }
        for i in 0..m {
            // What is rounding beside the column itself is no information.
            if left[(i, i)] < 1e-10 * gram[(n + i, n + i)] {
                left.row_mut(i).fill(0.0);
                left.column_mut(i).fill(0.0);
            }
        }
        let place = columns.iter().enumerate().map(|(i, k)| (*k, i)).collect();
        Table { left, place }
    }

    /// A set of effects, fitted by a table that holds its columns.
    pub(crate) fn try_in(&self, table: &Table, picks: Vec<Pick>) -> Trial {
        let mut which: Vec<usize> = picks
            .iter()
            .flat_map(|p| &p.columns)
            .map(|k| table.place[k])
            .collect();
        which.push(table.left.nrows() - 1);
        let gram = table.left.select_rows(&which).select_columns(&which);
        let (factors, squares) = solve(&gram);
        self.judged(picks, factors.as_slice(), squares)
    }
}

/// The largest value of a function between two bounds, by golden sections (J. Kiefer 1953).
fn golden<T>(
    mut low: f64,
    mut high: f64,
    at: &dyn Fn(f64) -> Option<(f64, T)>,
) -> Option<(f64, (f64, T))> {
    let ratio = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut a, mut b) = (high - ratio * (high - low), low + ratio * (high - low));
    let (mut of_a, mut of_b) = (at(a)?, at(b)?);
    for _ in 0..12 {
        if of_a.0 > of_b.0 {
            high = b;
            (b, of_b) = (a, of_a);
            a = high - ratio * (high - low);
            of_a = at(a)?;
        } else {
            low = a;
            (a, of_a) = (b, of_b);
            b = low + ratio * (high - low);
            of_b = at(b)?;
        }
    }
    Some(if of_a.0 > of_b.0 {
        (a, of_a)
    } else {
        (b, of_b)
    })
}

/// Inner products of the effects' columns and the measured forces once the base is taken off.
pub(crate) struct Table {
    left: DMatrix<f64>,
    place: HashMap<usize, usize>,
}

pub(crate) fn n_columns(picks: &[Pick]) -> usize {
    picks.iter().map(|p| p.columns.len()).sum()
}

/// A decomposed matrix of inner products; columns that depend on earlier ones are passed over.
struct Factored {
    lower: DMatrix<f64>,
    scale: Vec<f64>,
    kept: Vec<bool>,
}

impl Factored {
    fn new(gram: DMatrix<f64>) -> Self {
        let n = gram.nrows();
        let scale: Vec<f64> = (0..n)
            .map(|i| {
                let root = gram[(i, i)].sqrt();
                if root > 0.0 { root } else { 1.0 }
            })
            .collect();
        let mut lower = DMatrix::zeros(n, n);
        let mut kept = vec![false; n];
        for i in 0..n {
            for j in 0..=i {
                if j < i && !kept[j] {
                    continue;
                }
                let mut sum = gram[(i, j)] / (scale[i] * scale[j]);
                for k in 0..j {
                    sum -= lower[(i, k)] * lower[(j, k)];
                }
                if j < i {
                    lower[(i, j)] = sum / lower[(j, j)];
                } else if sum > DEPENDENT {
                    kept[i] = true;
                    lower[(i, i)] = sum.sqrt();
                }
            }
        }
        Self { lower, scale, kept }
    }

    /// `L^-1 x`: its square is what the columns explain.
    fn half(&self, products: &DVector<f64>) -> DVector<f64> {
        let n = products.len();
        let mut half = DVector::zeros(n);
        for i in 0..n {
            if !self.kept[i] {
                continue;
            }
            let mut sum = products[i] / self.scale[i];
            for k in 0..i {
                sum -= self.lower[(i, k)] * half[k];
            }
            half[i] = sum / self.lower[(i, i)];
        }
        half
    }

    fn halves(&self, products: &DMatrix<f64>) -> DMatrix<f64> {
        let columns: Vec<DVector<f64>> = products
            .column_iter()
            .map(|column| self.half(&column.into_owned()))
            .collect();
        DMatrix::from_columns(&columns)
    }
}
