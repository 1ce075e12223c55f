//! Searched constants of effects, such as a transition velocity. Input: a set of effects. Output: the set with the
//! constants that explain most, from a grid or between its values.

use super::bench::{EffectSelector, SelectedEffect};
use super::column::ForceColumn;
use super::problem::{ColumnSource, LoadDependentQuery};

/// Load-dependent columns are costly: the search starts at one value and goes up to this factor below and above it.
const COARSE_SEARCH_FACTOR: f64 = 4.0;

impl EffectSelector<'_> {
    /// Chooses the constants of each effect of a set from its grid, with the other effects fixed; two rounds at most.
    pub(crate) fn choose_constants(&mut self, mut picks: Vec<SelectedEffect>) -> Vec<SelectedEffect> {
        let problem = self.problem;
        // The constants of one effect depend on those of the others, so there is a second round.
        for _ in 0..2 {
            let before = picks.clone();
            for i in 0..picks.len() {
                let candidate = picks[i].candidate;
                // Only effects with a grid of constants have a choice.
                match &problem.candidates[candidate].source {
                    ColumnSource::Columns(choices) if choices.len() > 1 => {}
                    _ => continue,
                }
                let mut others = picks.clone();
                let old = others.remove(i);
                let beside = self.conditioning_set(&others);
                // The best choice of the grid must explain more than the present one.
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

    /// Searches the constants of a set's effects between the values of their grids.
    pub(crate) fn refine_constants(&mut self, picks: Vec<SelectedEffect>) -> Vec<SelectedEffect> {
        let all = 0..picks.len();
        self.refine_members(picks, all)
    }

    /// The same for one new member and for members that act on the same channels. Other members are affected through
    /// the base only.
    pub(crate) fn refine_around_member(&mut self, picks: Vec<SelectedEffect>, member: usize) -> Vec<SelectedEffect> {
        let channels = self.affected_channels(&picks[member..=member]);
        // Members that act on at least one of the channels of the new one.
        let acts_there = |pick: &SelectedEffect| {
            let own = self.affected_channels(std::slice::from_ref(pick));
            own.iter().any(|channel| channels.contains(channel))
        };
        let near: Vec<usize> = (0..picks.len()).filter(|i| acts_there(&picks[*i])).collect();
        self.refine_members(picks, near)
    }

    /// The same for the members at some positions, one after the other. Members with none or several constants stay as
    /// they are.
    pub(crate) fn refine_members(
        &mut self,
        mut picks: Vec<SelectedEffect>,
        which: impl IntoIterator<Item = usize>,
    ) -> Vec<SelectedEffect> {
        let problem = self.problem;
        let supply = self.provider;
        for i in which {
            let candidate = picks[i].candidate;
            // Exactly one searched constant is refined.
            let [(name, value)] = picks[i].constants.as_slice() else {
                continue;
            };
            let (name, value) = (name.clone(), *value);
            // Values of the constant that are known already.
            let mut grid: Vec<f64> = match &problem.candidates[candidate].source {
                ColumnSource::Columns(choices) => choices.iter().map(|c| c.constants[0].1).collect(),
                ColumnSource::LoadDependent => vec![value / COARSE_SEARCH_FACTOR, value, value * COARSE_SEARCH_FACTOR],
                _ => continue,
            };
            // The grid limits the search: its ends and the neighbours of the present value.
            grid.sort_by(f64::total_cmp);
            // Search between the neighbours on the grid, but not far, and not beyond the ends of the grid.
            let below = grid.iter().copied().filter(|x| *x < value);
            let above = grid.iter().copied().filter(|x| *x > value);
            let (mut low, mut high) = (
                below.fold(f64::NEG_INFINITY, f64::max),
                above.fold(f64::INFINITY, f64::min),
            );
            // A positive constant is searched on a logarithmic scale.
            let is_positive = grid.first().is_some_and(|first| *first > 0.0);
            if is_positive {
                let is_costly = problem.candidates[candidate].source == ColumnSource::LoadDependent;
                // Limits relative to the present value; wider for the coarse search of load-dependent effects.
                let [under, over] = if is_costly {
                    [1.0 / COARSE_SEARCH_FACTOR, COARSE_SEARCH_FACTOR]
                } else {
                    [0.7, 1.4]
                };
                low = low.max(under * value).max(grid[0]);
                high = high.min(over * value).min(grid[grid.len() - 1]);
            }
            // At an end of the grid the search stays on one side.
            low = if low.is_finite() { low } else { value };
            high = if high.is_finite() { high } else { value };
            if high <= low {
                continue;
            }
            // The search runs on the logarithm of a positive constant.
            let scale = |x: f64| if is_positive { x.ln() } else { x };
            let unscale = |x: f64| if is_positive { x.exp() } else { x };
            let mut others = picks.clone();
            others.remove(i);
            let beside = self.conditioning_set(&others);
            // The load is that of the set with its present constants.
            let load = (problem.candidates[candidate].source == ColumnSource::LoadDependent).then(|| self.load(&picks));
            // What the effect explains in addition to the others with one value of the constant; `None` if it has no
            // columns there.
            let at = |x: f64| -> Option<(f64, Vec<ForceColumn>)> {
                // Load-dependent columns need the load; others depend on the constant only.
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
            // What the effect explains with its present constant.
            let now = self.explained_squares(&picks[i].columns, &beside);
            let (x, (explained, columns)) = best;
            // Only an improvement is kept, so that only its columns enter the pool.
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

/// Half of the tolerance of the position of a maximum, as a share of the interval.
const NEAR: f64 = 0.003;
/// Largest number of evaluations of a function, which is no more than golden section search would need.
const MAX_EVALUATIONS: usize = 14;

/// Maximum of a function between two bounds: its position and the value there, with what `at` returned. Uses parabolas
/// through the best three points, and golden section steps where these fail (R. P. Brent, Algorithms for Minimization
/// without Derivatives, 1973, ch. 5). `None` if the function has no value at a point.
fn maximise<T>(mut low: f64, mut high: f64, at: &dyn Fn(f64) -> Option<(f64, T)>) -> Option<(f64, (f64, T))> {
    let golden = 0.5 * (3.0 - 5.0_f64.sqrt());
    // Tolerance of the position.
    let near = NEAR * (high - low);
    // The first point divides the interval in the golden section.
    let mut best = low + golden * (high - low);
    let mut of_best = at(best)?;
    // The second and third best points with their values; parabolas need three points.
    let mut second = (best, f64::NEG_INFINITY);
    let mut third = second;
    let (mut step, mut step_before) = (0.0_f64, 0.0_f64);
    for _ in 1..MAX_EVALUATIONS {
        // Stop when the interval around the best point is small enough.
        let middle = 0.5 * (low + high);
        if (best - middle).abs() + 0.5 * (high - low) <= 2.0 * near {
            break;
        }
        // Vertex of the parabola through the three points, relative to the best one.
        let r = (best - second.0) * (third.1 - of_best.0);
        let q = (best - third.0) * (second.1 - of_best.0);
        let p = (best - third.0) * q - (best - second.0) * r;
        let q = 2.0 * (q - r);
        let parabola = -p / q;
        // Accept it if it lies inside the interval and the steps shrink; else take a golden section step into the
        // larger part.
        let halves = parabola.abs() < 0.5 * step_before.abs();
        let is_inside = (low + near..=high - near).contains(&(best + parabola));
        (step_before, step) = if halves && is_inside {
            (step, parabola)
        } else {
            let side = if best < middle { high } else { low } - best;
            (side, golden * side)
        };
        // Points closer than the tolerance are not distinguished.
        let x = best + if step.abs() < near { near.copysign(step) } else { step };
        let of_x = at(x)?;
        // Narrow the interval and keep the three best points.
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

    /// Curves with one maximum, some of them flat, with a kink or with the maximum at an end: it is found with fewer
    /// evaluations than by golden section search.
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
            let evaluations = Cell::new(0);
            let at = |x: f64| {
                evaluations.set(evaluations.get() + 1);
                Some((curve(x), ()))
            };
            let (x, (value, ())) = maximise(0.0, 1.0, &at).expect("a value");
            assert!((x - top).abs() <= 2.0 * NEAR, "{name}: {x}");
            assert!((value - curve(x)).abs() < 1e-15, "{name}");
            assert!(evaluations.get() <= MAX_EVALUATIONS, "{name}: {}", evaluations.get());
        }
        let evaluations = Cell::new(0);
        maximise(0.0, 1.0, &|x: f64| {
            evaluations.set(evaluations.get() + 1);
            Some((1.0 - (x - 0.3).powi(2), ()))
        });
        assert!(evaluations.get() <= 7, "{}", evaluations.get());
    }

    #[test]
    fn nothing_is_found_where_nothing_is_said() {
        assert!(maximise::<()>(0.0, 1.0, &|_| None).is_none());
    }
}
