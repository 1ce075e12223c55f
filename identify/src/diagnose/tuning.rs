//! Constants of effects that no linear fit finds: the best of a grid beside the rest of a set, and between its values.

use super::bench::{Bench, Pick};
use super::factored::Factored;
use super::pool::On;
use super::problem::{Choice, Column, Source};

impl Bench<'_> {
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
                let factor = Factored::new(&self.pool.gram(&which, &self.weights, On::All));
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
            let factor = Factored::new(&self.pool.gram(&which, &self.weights, On::All));
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
