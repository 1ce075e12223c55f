//! Fits sets of effects. Input: a diagnosis problem and a provider of columns. Output: for each set its factors,
//! weighted squared residual, and whether its estimates are physically possible.

use std::cell::RefCell;
use std::collections::{HashMap, HashSet};

use nalgebra::{DMatrix, DVector};

use super::column::ForceColumn;
use super::conditional::ConditioningSet;
use super::factored::GramFactor;
use super::noise::effective_samples;
use super::plausible::largest_forces;
use super::pool::{ColumnPool, FitScope, solve_gram};
use super::problem::{
    CandidateEffect, ColumnChoice, ColumnProvider, ColumnSource, DiagnosisProblem, EffectParameter, SignConstraint,
};
use super::thresholds::{CANCELLATION_SHARE, FULL_CANCELLATION_SHARE, RANDOM_SIGN_SHARE};
use crate::signal::dot;

/// A candidate with the columns for one choice of its constants.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SelectedEffect {
    /// Index of the candidate.
    pub(crate) candidate: usize,
    /// Its searched constants, as (symbol, value).
    pub(crate) constants: Vec<(String, f64)>,
    /// Indices of its columns in the pool, one per parameter.
    pub(crate) columns: Vec<usize>,
    /// Number of its columns that are independent of the other columns of the set.
    pub(crate) rank: usize,
}

/// Results of span tests, by the tested columns and the columns of the other effect: whether the first lie in the span
/// of the second and the base.
type SpanCache = HashMap<(Vec<usize>, Vec<usize>), bool>;

/// A set of effects, fitted to all samples with the base parameters.
#[derive(Clone, Debug)]
pub(crate) struct ScoredEffectSet {
    /// Its effects.
    pub(crate) picks: Vec<SelectedEffect>,
    /// Weighted sum of squares of the residual, without unit.
    pub(crate) squares: f64,
    /// Number of estimated values in the effects, searched constants included.
    pub(crate) freedoms: usize,
    /// Effects whose estimates have the wrong sign, by position.
    pub(crate) wrong_sign: Vec<usize>,
    /// Effects that do little but cancel another one at their place, by position.
    pub(crate) cancelling: Vec<usize>,
    /// Effects with a value that is implausible for the machine, by position.
    pub(crate) implausible: Vec<usize>,
    /// Information criterion by which sets are compared (less is better); infinite until it is computed.
    pub(crate) score: f64,
}

impl ScoredEffectSet {
    /// Whether the estimates are physically possible.
    pub(crate) fn is_possible(&self) -> bool {
        self.wrong_sign.is_empty() && self.cancelling.is_empty() && self.implausible.is_empty()
    }
}

/// Columns and weights of a diagnosis, with the present columns of each candidate.
pub(crate) struct EffectSelector<'a> {
    /// The problem to solve.
    pub(crate) problem: &'a DiagnosisProblem,
    /// All columns with their inner products.
    pub(crate) pool: ColumnPool<'a>,
    /// Pool columns of the base parameters.
    pub(crate) base: Vec<usize>,
    /// Pool column of the measured forces.
    pub(crate) measured: usize,
    /// A column of zeros, for parameters of an effect that are fixed at zero.
    zero: usize,
    /// Weight of each channel: one over the variance of its residual, 1/N^2 or 1/(N m)^2.
    pub(crate) weights: Vec<f64>,
    /// The best choice of each candidate for the present residual; `None` if the model already explains all of it.
    pub(crate) current_choices: Vec<Option<SelectedEffect>>,
    /// Computes columns that depend on the fit or on a searched constant.
    pub(crate) provider: &'a dyn ColumnProvider,
    /// Pool columns of the friction of every drive, which are fitted when the load is estimated.
    pub(crate) friction: Vec<usize>,
    /// The base parameters alone, fitted with the present weights.
    pub(crate) base_set: ConditioningSet,
    /// Pool columns by candidate and choice.
    choices: Vec<Vec<Vec<usize>>>,
    /// Number of columns that stay in the pool during the search.
    pub(crate) permanent_columns: usize,
    /// Span tests that have been done.
    pub(crate) span_cache: RefCell<SpanCache>,
}

impl<'a> EffectSelector<'a> {
    /// Fills the pool with the known columns and sets the first weights.
    pub(crate) fn new(problem: &'a DiagnosisProblem, supply: &'a dyn ColumnProvider) -> Self {
        let mut pool = ColumnPool::new(&problem.layout).exclude_samples(&problem.undecided_samples());
        let base = problem.base.iter().map(|c| pool.add(c)).collect();
        pool.prior_equations.clone_from(&problem.prior);
        let measured = pool.add(&problem.measured);
        pool.force_scales = largest_forces(problem);
        let zero = pool.add(ForceColumn(vec![None; problem.layout.channels.len()]));
        let friction = problem.friction.iter().map(|c| pool.add(c)).collect();
        // Known columns enter the pool once, for every choice of the constants.
        let mut of_choice = |choice: &'a ColumnChoice| choice.columns.iter().map(|c| pool.add(c)).collect();
        let of_candidate = |candidate: &'a CandidateEffect| match &candidate.source {
            ColumnSource::Columns(choices) => choices.iter().map(&mut of_choice).collect(),
            _ => Vec::new(),
        };
        let choices = problem.candidates.iter().map(of_candidate).collect();
        let mut bench = Self {
            problem,
            provider: supply,
            friction,
            base_set: ConditioningSet::default(),
            pool,
            base,
            measured,
            zero,
            weights: vec![1.0; problem.layout.channels.len()],
            current_choices: vec![None; problem.candidates.len()],
            choices,
            permanent_columns: 0,
            span_cache: RefCell::default(),
        };
        // Weight channels by their residual, so that channels of very different force count equally. The second pass
        // uses the weights of the first.
        bench.weigh_channels(&[]);
        bench.weigh_channels(&[]);
        bench.initialise_columns();
        bench.permanent_columns = bench.pool.len();
        bench
    }

    /// Adds the columns with which bodies and constants are tried before they are selected: a body at the origin of its
    /// frame, a constant without error, with factors of the base alone. Only selected candidates get columns at their
    /// estimated values.
    fn initialise_columns(&mut self) {
        let problem = self.problem;
        let factors = self.base_set.factors.clone();
        for (k, candidate) in problem.candidates.iter().enumerate() {
            if let ColumnSource::Body(_) | ColumnSource::Constant(_) = candidate.source {
                let columns = self.linearise_model_change(k, &[], &factors, None).columns;
                self.choices[k].push(columns);
            }
        }
    }

    /// The candidate of a selected effect.
    pub(crate) fn candidate(&self, pick: &SelectedEffect) -> &'a CandidateEffect {
        &self.problem.candidates[pick.candidate]
    }

    /// Pool columns of the base and of some effects, base first.
    pub(crate) fn columns(&self, picks: &[SelectedEffect]) -> Vec<usize> {
        let of_picks = picks.iter().flat_map(|pick| &pick.columns);
        self.base.iter().chain(of_picks).copied().collect()
    }

    /// Factors of the base and of some effects, in the order of [`Self::columns`], and the weighted sum of squares of
    /// the residual.
    pub(crate) fn fit(&self, picks: &[SelectedEffect], on: FitScope) -> (DVector<f64>, f64) {
        let mut which = self.columns(picks);
        which.push(self.measured);
        solve_gram(&self.pool.gram(&which, &self.weights, on))
    }

    /// Residual of some effects with given factors, `[channel][sample]`.
    pub(crate) fn residual(&self, picks: &[SelectedEffect], factors: &DVector<f64>) -> Vec<Vec<f64>> {
        self.pool
            .residual(self.measured, &self.columns(picks), factors.as_slice())
    }

    /// Weights each channel by the variance of the residual of a set, but not below that of its noise or of rounding.
    pub(crate) fn weigh_channels(&mut self, picks: &[SelectedEffect]) {
        let (factors, _) = self.fit(picks, FitScope::All);
        let rest = self.residual(picks, &factors);
        // Mean square of a series.
        let size = |values: &[f64]| dot(values, values) / values.len().max(1) as f64;
        let measured = self.pool.column(self.measured);
        for (d, values) in rest.iter().enumerate() {
            let noise = self.problem.noise[d].powi(2);
            let rounding = measured.0[d].as_deref().map_or(0.0, size) * 1e-14;
            let idle = self.idle_variance(d, &rest);
            let variance = self.pool.mean_square(d, values).max(noise).max(rounding).max(idle);
            self.weights[d] = if variance > 0.0 { 1.0 / variance } else { 1.0 };
        }
        self.base_set = self.conditioning_set(&[]);
    }

    /// Mean square below which the residual of an idle channel shows nothing: the size of its terms times the least
    /// relative error of the driven channels. Zero for a driven channel. `rest` is the residual of all channels.
    pub(crate) fn idle_variance(&self, channel: usize, rest: &[Vec<f64>]) -> f64 {
        let Some(terms) = self.problem.idle_squares.get(channel).filter(|terms| **terms > 0.0) else {
            return 0.0;
        };
        let size = |values: &[f64]| dot(values, values) / values.len().max(1) as f64;
        let measured = self.pool.column(self.measured);
        let relative = (rest.iter().enumerate())
            .filter(|(d, _)| !self.problem.is_idle(*d))
            .filter_map(|(d, values)| Some(self.pool.mean_square(d, values) / size(measured.0[d].as_deref()?)))
            .filter(|relative| relative.is_finite())
            .fold(1.0, f64::min);
        terms * relative
    }

    /// Number of independent equations to which the residual of a set is equivalent on some channels, at least 2.
    pub(crate) fn effective_equations(&self, rest: &[Vec<f64>], channels: &[usize]) -> f64 {
        let mut worth = 0.0;
        for d in channels {
            let mut start = 0;
            for segment in &self.problem.layout.segments {
                let end = start + segment.samples;
                worth += effective_samples(&self.pool.counted_values(*d, &rest[*d], start..end));
                start = end;
            }
        }
        worth.max(2.0)
    }

    /// Chooses the constants of every candidate that explain the residual of a set best, and computes columns that
    /// depend on the fit.
    pub(crate) fn update_choices(&mut self, picks: &[SelectedEffect]) {
        self.current_choices = self.choose_candidates(picks, &|_| true);
    }

    /// The same for the candidates for which `is_asked` is true, `[candidate]`; `None` for the others.
    pub(crate) fn choose_candidates(
        &mut self,
        picks: &[SelectedEffect],
        is_asked: &dyn Fn(usize) -> bool,
    ) -> Vec<Option<SelectedEffect>> {
        // What the set explains already.
        let beside = self.conditioning_set(picks);
        let problem = self.problem;
        let candidates = problem.candidates.iter().enumerate();
        let mut requested = candidates.clone().filter(|(k, _)| is_asked(*k));
        // Load-dependent columns of all candidates come from one evaluation.
        let carried = if requested.any(|(_, candidate)| candidate.source == ColumnSource::LoadDependent) {
            self.load_dependent_effects(picks)
        } else {
            HashMap::new()
        };
        // Faults of force signals share the force that acts.
        let is_reading =
            |(k, one): (usize, &CandidateEffect)| is_asked(k) && matches!(one.source, ColumnSource::ReadingFault(_));
        let needs_force = candidates.clone().any(is_reading);
        let fitted = needs_force.then(|| self.fitted_force(picks, &beside.factors, &[]));
        // Products of all columns in the pool come from few passes over the samples.
        let is_in_pool = |source: &ColumnSource| matches!(source, ColumnSource::Columns(_));
        let in_pool = candidates
            .clone()
            .filter(|(k, one)| is_asked(*k) && is_in_pool(&one.source));
        let columns: Vec<usize> = in_pool
            .flat_map(|(k, _)| self.choices[k].iter().flatten().copied())
            .collect();
        self.compute_products_with(&columns, &beside);
        let mut seen = Vec::with_capacity(problem.candidates.len());
        for (k, candidate) in candidates {
            if !is_asked(k) {
                seen.push(None);
                continue;
            }
            let pick = match &candidate.source {
                // Known columns: take the best choice of the constants.
                ColumnSource::Columns(_) => self
                    .best_choice(k, &beside)
                    .map(|(best, _)| self.select_choice(k, best)),
                // Columns that were added at the start, since the effect is not selected yet.
                ColumnSource::Body(_) | ColumnSource::Constant(_) if picks.iter().all(|p| p.candidate != k) => {
                    Some(SelectedEffect {
                        candidate: k,
                        constants: Vec::new(),
                        columns: self.choices[k][0].clone(),
                        rank: candidate.parameters.len(),
                    })
                }
                // Columns that are linearised at the present estimates.
                ColumnSource::Tilt(_)
                | ColumnSource::ReadingFault(_)
                | ColumnSource::Body(_)
                | ColumnSource::Constant(_) => {
                    Some(self.linearise_model_change(k, picks, &beside.factors, fitted.as_ref()))
                }
                ColumnSource::LoadDependent => carried.get(&k).cloned(),
            };
            // Candidates whose columns are combinations of those of the set explain nothing new.
            seen.push(pick.and_then(|mut pick| {
                pick.rank = self.conditional_rank(&pick.columns, &beside);
                (pick.rank > 0).then_some(pick)
            }));
        }
        seen
    }

    /// The choice of a candidate that explains most in addition to a set, and how much; a single choice is returned
    /// with 0 without a test.
    pub(crate) fn best_choice(&self, candidate: usize, beside: &ConditioningSet) -> Option<(usize, f64)> {
        let choices = &self.choices[candidate];
        if choices.len() == 1 {
            return Some((0, 0.0));
        }
        let score = |columns: &Vec<usize>| self.explained_squares(columns, beside);
        let scored = choices.iter().map(score).enumerate();
        scored.max_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// A candidate with the constants and columns of one of its choices.
    pub(crate) fn select_choice(&self, candidate: usize, choice: usize) -> SelectedEffect {
        let ColumnSource::Columns(choices) = &self.problem.candidates[candidate].source else {
            unreachable!("only known columns have choices")
        };
        let columns = self.choices[candidate][choice].clone();
        SelectedEffect {
            candidate,
            constants: choices[choice].constants.clone(),
            rank: columns.len(),
            columns,
        }
    }

    /// Fits a set of effects to all samples.
    pub(crate) fn fit_set(&self, picks: Vec<SelectedEffect>) -> ScoredEffectSet {
        self.fit_with_signs(picks, |picks| self.fit(picks, FitScope::All))
    }

    /// Scores a set of effects by some fit. If one of several parameters of an effect has a sign that is physically
    /// impossible, it is set to zero, provided this changes the residual little: half of the estimates of absent
    /// parameters have the wrong sign. This does not apply to a kind that refines another or has a searched constant:
    /// without one of its parameters it is another kind.
    fn fit_with_signs(
        &self,
        mut picks: Vec<SelectedEffect>,
        fit: impl Fn(&[SelectedEffect]) -> (DVector<f64>, f64),
    ) -> ScoredEffectSet {
        let (mut factors, squares) = fit(&picks);
        if self.wrong_parameters(&picks, factors.as_slice()).is_empty() {
            return self.score_set(picks, factors.as_slice(), squares);
        }
        let mut trial = self.score_set(picks.clone(), factors.as_slice(), squares);
        loop {
            // Whether an effect may lose a parameter.
            let several = |i: usize| {
                let columns = picks[i].columns.iter().filter(|k| **k != self.zero);
                let candidate = self.candidate(&picks[i]);
                candidate.refines.is_none() && candidate.searched_constants == 0 && columns.count() > 1
            };
            // Set one parameter with a wrong sign to zero and fit again, as long as the residual allows it.
            let wrong = self.wrong_parameters(&picks, factors.as_slice());
            let Some((i, j)) = wrong.into_iter().find(|(i, _)| several(*i)) else {
                break;
            };
            picks[i].columns[j] = self.zero;
            picks[i].rank = picks[i].rank.saturating_sub(1).max(1);
            let less;
            (factors, less) = fit(&picks);
            if less > squares * (1.0 + RANDOM_SIGN_SHARE) {
                break;
            }
            trial = self.score_set(picks.clone(), factors.as_slice(), less);
        }
        trial
    }

    /// Number of estimated values in an effect: independent columns and searched constants.
    pub(crate) fn freedoms(&self, pick: &SelectedEffect) -> usize {
        pick.rank + self.candidate(pick).searched_constants
    }

    /// Assembles a scored set from factors of base and effects; `squares` is its weighted squared residual.
    fn score_set(&self, picks: Vec<SelectedEffect>, factors: &[f64], squares: f64) -> ScoredEffectSet {
        let wrong = self.wrong_parameters(&picks, factors);
        let mut wrong_sign: Vec<usize> = wrong.into_iter().map(|(i, _)| i).collect();
        wrong_sign.dedup();
        let freedoms = picks.iter().map(|p| self.freedoms(p)).sum();
        let cancelling = self.find_cancelling(&picks, factors);
        let implausible = self.find_implausible(&picks, factors);
        ScoredEffectSet {
            picks,
            squares,
            freedoms,
            wrong_sign,
            cancelling,
            implausible,
            score: f64::INFINITY,
        }
    }

    /// Effects that cancel an earlier effect: at the same place, if the sum of both has less than half of the amplitude
    /// of the larger one; elsewhere, if nearly nothing remains. They are nearly the same curve twice, of which only the
    /// difference is visible. Returns positions in `picks`.
    fn find_cancelling(&self, picks: &[SelectedEffect], factors: &[f64]) -> Vec<usize> {
        let first = factors.len() - n_columns(picks);
        let starts: Vec<usize> = (picks.iter())
            .scan(first, |at, pick| {
                let start = *at;
                *at += pick.columns.len();
                Some(start)
            })
            .collect();
        // Inner product of the forces of two effects, from products of their columns.
        let product = |i: usize, j: usize| -> f64 {
            let (one, other) = (&picks[i].columns, &picks[j].columns);
            let rows = one.iter().zip(&factors[starts[i]..]);
            rows.map(|(a, x)| {
                let columns = other.iter().zip(&factors[starts[j]..]);
                columns
                    .map(|(b, y)| x * y * self.pool.weighted_product(*a, *b, &self.weights))
                    .sum::<f64>()
            })
            .sum()
        };
        let effect = |i: usize| &self.candidate(&picks[i]).effect;
        let squares: Vec<f64> = (0..picks.len()).map(|i| product(i, i)).collect();
        // Squares of the sum of both forces, compared with the larger of the two.
        let cancels = |j: &usize| {
            (0..*j).any(|i| {
                let is_same_place = effect(i).at == effect(*j).at;
                if is_same_place && effect(i).kind == effect(*j).kind {
                    return false;
                }
                let most = if is_same_place {
                    CANCELLATION_SHARE
                } else {
                    FULL_CANCELLATION_SHARE
                };
                let (a, b) = (squares[i], squares[*j]);
                // Only forces of similar size can cancel.
                a.min(b) > (1.0 - most.sqrt()).powi(2) * a.max(b) && a + 2.0 * product(i, *j) + b < most * a.max(b)
            })
        };
        (0..picks.len()).filter(cancels).collect()
    }

    /// Estimates that are physically impossible, by position of effect and parameter: a wrong sign, or a body whose
    /// centre is out of reach.
    fn wrong_parameters(&self, picks: &[SelectedEffect], factors: &[f64]) -> Vec<(usize, usize)> {
        let mut at = factors.len() - n_columns(picks);
        let mut wrong = Vec::new();
        for (i, pick) in picks.iter().enumerate() {
            let parameters = &self.candidate(pick).parameters;
            let own = &factors[at..at + parameters.len()];
            at += parameters.len();
            // Values that are zero up to rounding have no sign.
            let largest = own.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            let is_wrong = |(p, x): (&EffectParameter, &f64)| match p.sign {
                SignConstraint::Positive => *x < -1e-9 * largest,
                SignConstraint::Negative => *x > 1e-9 * largest,
                SignConstraint::Any => false,
            };
            let of_pick = parameters.iter().zip(own).map(is_wrong).enumerate();
            wrong.extend(of_pick.filter(|(_, is_wrong)| *is_wrong).map(|(j, _)| (i, j)));
            if let ColumnSource::Body(body) = &self.candidate(pick).source
                && body.is_out_of_reach(own)
            {
                wrong.push((i, 0));
            }
        }
        wrong
    }

    /// Inner products of the columns of all present candidates and of `also`, with the base projected out, so that sets
    /// are tried without the base.
    pub(crate) fn projected_gram(&self, also: &[SelectedEffect]) -> ProjectedGram {
        let mut columns: Vec<usize> = Vec::new();
        // Each column once, zero and the measured forces at the end.
        let mut known = HashSet::new();
        for pick in self.current_choices.iter().flatten().chain(also) {
            columns.extend(pick.columns.iter().filter(|k| known.insert(**k)));
        }
        columns.retain(|k| *k != self.zero);
        columns.extend([self.zero, self.measured]);
        let mut which = self.base.clone();
        which.extend(&columns);
        self.pool.compute_products(&which);
        // Schur complement: G_cc - G_bc' G_bb^-1 G_bc, with b the base and c the other columns.
        let gram = self.pool.gram(&which, &self.weights, FitScope::All);
        let n = self.base.len();
        let m = columns.len();
        let factor = GramFactor::new(&gram.view((0, 0), (n, n)).into_owned());
        let mut left = gram.view((n, n), (m, m)).into_owned();
        if n > 0 {
            let halves = factor.forward_substitute(&gram.view((0, n), (n, m)).into_owned());
            left -= halves.transpose() * halves;
        }
        for i in 0..m {
            // A remainder at the level of rounding is set to zero.
            if left[(i, i)] < 1e-10 * gram[(n + i, n + i)] {
                left.row_mut(i).fill(0.0);
                left.column_mut(i).fill(0.0);
            }
        }
        let mut place = vec![usize::MAX; columns.iter().max().map_or(0, |last| last + 1)];
        for (i, k) in columns.iter().enumerate() {
            place[*k] = i;
        }
        ProjectedGram {
            gram: left,
            row_of_column: place,
        }
    }

    /// Fits a set of effects by a table that contains its columns.
    pub(crate) fn fit_from_gram(&self, table: &ProjectedGram, picks: Vec<SelectedEffect>) -> ScoredEffectSet {
        self.fit_with_signs(picks, |picks| {
            let mut which: Vec<usize> = picks
                .iter()
                .flat_map(|p| &p.columns)
                .map(|k| table.row_of_column[*k])
                .collect();
            which.push(table.gram.nrows() - 1);
            let n = which.len();
            // Entries are read one by one; copying complete rows of the table would read far more numbers.
            let part = DMatrix::from_fn(n, n, |i, j| table.gram[(which[i], which[j])]);
            solve_gram(&part)
        })
    }
}

/// Weighted inner products of the effects' columns and the measured forces, with the base projected out.
pub(crate) struct ProjectedGram {
    /// Symmetric matrix; the measured forces are the last row.
    pub(crate) gram: DMatrix<f64>,
    /// Row of each column of the pool; `usize::MAX` for columns that are not in the table.
    pub(crate) row_of_column: Vec<usize>,
}

/// Total number of columns of some effects.
pub(crate) fn n_columns(picks: &[SelectedEffect]) -> usize {
    picks.iter().map(|p| p.columns.len()).sum()
}
