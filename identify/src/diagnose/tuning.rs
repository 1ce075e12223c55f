//! Constants of effects that no linear fit finds: the best of a grid beside the rest of a set, and between its values.

use super::bench::{Bench, Pick};
use super::column::Column;
use super::problem::{Carried, Source};

/// Where values of a constant are costly one is looked at, and others up to this factor away.
const AROUND: f64 = 4.0;

impl Bench<'_> {
    /// Chooses the constants of each effect of a set anew, beside those of the others.
    pub(crate) fn retune(&mut self, mut picks: Vec<Pick>) -> Vec<Pick> {
        let problem = self.problem;
        for _ in 0..2 {
            let before = picks.clone();
            for i in 0..picks.len() {
                let candidate = picks[i].candidate;
                match &problem.candidates[candidate].source {
                    Source::Columns(choices) if choices.len() > 1 => {}
                    _ => continue,
                }
                let mut others = picks.clone();
                let old = others.remove(i);
                let beside = self.beside(&others);
                let Some((best, explained)) = self.best_choice(candidate, &beside) else {
                    continue;
                };
                if explained > self.explained(&old.columns, &beside) {
                    picks[i] = self.pick(candidate, best);
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
            let [(name, value)] = picks[i].constants.as_slice() else {
                continue;
            };
            let (name, value) = (name.clone(), *value);
            let mut grid: Vec<f64> = match &problem.candidates[candidate].source {
                Source::Columns(choices) => choices.iter().map(|c| c.constants[0].1).collect(),
                Source::Carried => vec![value / AROUND, value, value * AROUND],
                _ => continue,
            };
            grid.sort_by(f64::total_cmp);
            // Between its neighbours on the grid, but not far; beyond the grid's ends there is nothing to look for.
            let below = grid.iter().copied().filter(|x| *x < value);
            let above = grid.iter().copied().filter(|x| *x > value);
            let (mut low, mut high) = (
                below.fold(f64::NEG_INFINITY, f64::max),
                above.fold(f64::INFINITY, f64::min),
            );
            // What is positive throughout is searched by its logarithm.
            let is_positive = grid.first().is_some_and(|first| *first > 0.0);
            if is_positive {
                let is_costly = problem.candidates[candidate].source == Source::Carried;
                let [under, over] = if is_costly {
                    [1.0 / AROUND, AROUND]
                } else {
                    [0.7, 1.4]
                };
                low = low.max(under * value).max(grid[0]);
                high = high.min(over * value).min(grid[grid.len() - 1]);
            }
            low = if low.is_finite() { low } else { value };
            high = if high.is_finite() { high } else { value };
            if high <= low {
                continue;
            }
            let scale = |x: f64| if is_positive { x.ln() } else { x };
            let unscale = |x: f64| if is_positive { x.exp() } else { x };
            let mut others = picks.clone();
            others.remove(i);
            let beside = self.beside(&others);
            let load = (problem.candidates[candidate].source == Source::Carried)
                .then(|| self.load(&picks));
            let at = |x: f64| -> Option<(f64, Vec<Column>)> {
                let columns = match &load {
                    Some(load) => {
                        let which = Carried::One(candidate, Some(unscale(x)));
                        supply.carried(load, which).pop()?.1.columns
                    }
                    None => supply.finer(candidate, unscale(x))?,
                };
                Some((self.explained_by(&columns, &beside), columns))
            };
            let Some(best) = golden(scale(low), scale(high), &at) else {
                continue;
            };
            let now = self.explained(&picks[i].columns, &beside);
            let (x, (explained, columns)) = best;
            if explained > now {
                picks[i] = Pick {
                    candidate,
                    constants: vec![(name, unscale(x))],
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
