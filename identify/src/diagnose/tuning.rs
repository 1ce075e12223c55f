//! Constants of effects that no linear fit finds: the best of a grid beside the rest of a set, and between its values.

use super::bench::{EffectSelector, SelectedEffect};
use super::column::ForceColumn;
use super::problem::{ColumnSource, LoadDependentQuery};

/// Where values of a constant are costly one is looked at, and others up to this factor away.
const COARSE_SEARCH_FACTOR: f64 = 4.0;

impl EffectSelector<'_> {
    /// Chooses the constants of each effect of a set anew, beside those of the others.
    pub(crate) fn choose_constants(
        &mut self,
        mut picks: Vec<SelectedEffect>,
    ) -> Vec<SelectedEffect> {
        let problem = self.problem;
        for _ in 0..2 {
            let before = picks.clone();
            for i in 0..picks.len() {
                let candidate = picks[i].candidate;
                match &problem.candidates[candidate].source {
                    ColumnSource::Columns(choices) if choices.len() > 1 => {}
                    _ => continue,
                }
                let mut others = picks.clone();
                let old = others.remove(i);
                let beside = self.conditioning_set(&others);
                let Some((best, explained)) = self.best_choice(candidate, &beside) else {
                    continue;
                };
                if explained > self.explained_squares(&old.columns, &beside) {
                    picks[i] = self.select_choice(candidate, best);
                }
            }
            if picks == before {
                break;
            }
        }
        picks
    }

    /// Searches for the constants of a set's effects between the values of their grids.
    pub(crate) fn refine_constants(&mut self, picks: Vec<SelectedEffect>) -> Vec<SelectedEffect> {
        let all = 0..picks.len();
        self.refine_members(picks, all)
    }

    /// The same where one member is new in a set: of those that act on a drive on which it acts. Others feel it through the
    /// base alone.
    pub(crate) fn refine_around_member(
        &mut self,
        picks: Vec<SelectedEffect>,
        member: usize,
    ) -> Vec<SelectedEffect> {
        let channels = self.affected_channels(&picks[member..=member]);
        let acts_there = |pick: &SelectedEffect| {
            let own = self.affected_channels(std::slice::from_ref(pick));
            own.iter().any(|channel| channels.contains(channel))
        };
        let near: Vec<usize> = (0..picks.len())
            .filter(|i| acts_there(&picks[*i]))
            .collect();
        self.refine_members(picks, near)
    }

    /// The same of some members.
    pub(crate) fn refine_members(
        &mut self,
        mut picks: Vec<SelectedEffect>,
        which: impl IntoIterator<Item = usize>,
    ) -> Vec<SelectedEffect> {
        let problem = self.problem;
        let supply = self.provider;
        for i in which {
            let candidate = picks[i].candidate;
            let [(name, value)] = picks[i].constants.as_slice() else {
                continue;
            };
            let (name, value) = (name.clone(), *value);
            let mut grid: Vec<f64> = match &problem.candidates[candidate].source {
                ColumnSource::Columns(choices) => {
                    choices.iter().map(|c| c.constants[0].1).collect()
                }
                ColumnSource::LoadDependent => vec![
                    value / COARSE_SEARCH_FACTOR,
                    value,
                    value * COARSE_SEARCH_FACTOR,
                ],
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
                let is_costly = problem.candidates[candidate].source == ColumnSource::LoadDependent;
                let [under, over] = if is_costly {
                    [1.0 / COARSE_SEARCH_FACTOR, COARSE_SEARCH_FACTOR]
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
            let beside = self.conditioning_set(&others);
            let load = (problem.candidates[candidate].source == ColumnSource::LoadDependent)
                .then(|| self.load(&picks));
            let at = |x: f64| -> Option<(f64, Vec<ForceColumn>)> {
                let columns = match &load {
                    Some(load) => {
                        let which = LoadDependentQuery::One(candidate, Some(unscale(x)));
                        supply.load_dependent_columns(load, which).pop()?.1.columns
                    }
                    None => supply.columns_for_constant(candidate, unscale(x))?,
                };
                Some((self.explained_by_columns(&columns, &beside), columns))
            };
            let Some(best) = maximise(scale(low), scale(high), &at) else {
                continue;
            };
            let now = self.explained_squares(&picks[i].columns, &beside);
            let (x, (explained, columns)) = best;
            if explained > now {
                picks[i] = SelectedEffect {
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

/// Half of how near the place of a largest value is found at worst, as a share of the interval.
const NEAR: f64 = 0.003;
/// How often a function is asked for its largest value; no more than golden sections alone would need.
const MAX_EVALUATIONS: usize = 14;

/// Where a function is largest between two bounds, and what it is there: by parabolas through the best three values, and by
/// golden sections where these lead nowhere (R. P. Brent, Algorithms for Minimization without Derivatives, 1973, ch. 5).
fn maximise<T>(
    mut low: f64,
    mut high: f64,
    at: &dyn Fn(f64) -> Option<(f64, T)>,
) -> Option<(f64, (f64, T))> {
    let golden = 0.5 * (3.0 - 5.0_f64.sqrt());
    let near = NEAR * (high - low);
    let mut best = low + golden * (high - low);
    let mut of_best = at(best)?;
    // The second and the third best, with their values; there are no parabolas before there are three.
    let mut second = (best, f64::NEG_INFINITY);
    let mut third = second;
    let (mut step, mut step_before) = (0.0_f64, 0.0_f64);
    for _ in 1..MAX_EVALUATIONS {
        let middle = 0.5 * (low + high);
        if (best - middle).abs() + 0.5 * (high - low) <= 2.0 * near {
            break;
        }
        let r = (best - second.0) * (third.1 - of_best.0);
        let q = (best - third.0) * (second.1 - of_best.0);
        let p = (best - third.0) * q - (best - second.0) * r;
        let q = 2.0 * (q - r);
        let parabola = -p / q;
        let halves = parabola.abs() < 0.5 * step_before.abs();
        let is_inside = (low + near..=high - near).contains(&(best + parabola));
        (step_before, step) = if halves && is_inside {
            (step, parabola)
        } else {
            let side = if best < middle { high } else { low } - best;
            (side, golden * side)
        };
        let x = best
            + if step.abs() < near {
                near.copysign(step)
            } else {
                step
            };
        let of_x = at(x)?;
        if of_x.0 >= of_best.0 {
            *(if x < best { &mut high } else { &mut low }) = best;
            third = second;
            second = (best, of_best.0);
            (best, of_best) = (x, of_x);
        } else {
            *(if x < best { &mut low } else { &mut high }) = x;
            if of_x.0 >= second.1 {
                third = second;
                second = (x, of_x.0);
            } else if of_x.0 >= third.1 {
                third = (x, of_x.0);
            }
        }
    }
    Some((best, of_best))
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    /// Curves with one top, of which some are flat, bent or at an end: the place is found, and more seldom asked for than by
    /// golden sections alone.
    #[test]
    fn largest_values_are_found() {
        type Curve = fn(f64) -> f64;
        let curves: [(&str, f64, Curve); 5] = [
            ("parabola", 0.3, |x| 1.0 - (x - 0.3).powi(2)),
            ("bell", 0.71, |x| (-(9.0 * (x - 0.71)).powi(2)).exp()),
            ("kink", 0.42, |x| -(x - 0.42_f64).abs()),
            ("left end", 0.0, |x| -x),
            ("right end", 1.0, |x| x.powi(3)),
        ];
        for (name, top, curve) in curves {
            let asked = Cell::new(0);
            let at = |x: f64| {
                asked.set(asked.get() + 1);
                Some((curve(x), ()))
            };
            let (x, (value, ())) = maximise(0.0, 1.0, &at).expect("a value");
            assert!((x - top).abs() <= 2.0 * NEAR, "{name}: {x}");
            assert!((value - curve(x)).abs() < 1e-15, "{name}");
            assert!(asked.get() <= MAX_EVALUATIONS, "{name}: {}", asked.get());
        }
        let asked = Cell::new(0);
        maximise(0.0, 1.0, &|x: f64| {
            asked.set(asked.get() + 1);
            Some((1.0 - (x - 0.3).powi(2), ()))
        });
        assert!(asked.get() <= 7, "{}", asked.get());
    }

    #[test]
    fn nothing_is_found_where_nothing_is_said() {
        assert!(maximise::<()>(0.0, 1.0, &|_| None).is_none());
    }
}
