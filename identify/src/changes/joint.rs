//! A joint fit of many runs: some coefficients are shared by all runs, others belong to one run. Input: additive
//! statistics of the runs; output: values with covariance.
//!
//! ```text
//! y_rd = s_d (Z_rd [x, o_r, f_r] + e)
//! ```
//!
//! for run r and channel d, with shared `x`, own `o_r`, and known `f_r`. The scale `s_d` of a channel is 1, or
//! estimated too: a load of known mass in one of the runs determines it (Gautier and Briot, IEEE ICRA 2012). Own values
//! are eliminated run by run, so that the cost grows linearly with the number of runs.

use nalgebra::{DMatrix, DVector};

use crate::changes::moments::{EliminatedValues, NormalEquations};

/// Largest number of Gauss-Newton steps if scales are estimated.
const STEPS: usize = 60;
/// Steps end when they change the sum of squares by less than this share of it.
const CONVERGENCE_TOLERANCE: f64 = 1e-12;

/// One run of a joint fit.
#[derive(Clone, Debug)]
pub struct JointRun {
    /// Additive statistics of rows with variance 1, `[channel]`.
    pub channels: Vec<NormalEquations>,
    /// Columns with values of their own in this run; columns that are neither shared nor own nor known have the value
    /// 0.
    pub own: Vec<usize>,
    /// Columns with known values in this run, as (column, value).
    pub known: Vec<(usize, f64)>,
}

/// Values with their covariance.
#[derive(Clone, Debug, PartialEq)]
pub struct JointValues {
    /// The values.
    pub values: DVector<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
    /// Which of the values the runs determine.
    pub determined: Vec<bool>,
}

/// The result of a joint fit.
#[derive(Clone, Debug, PartialEq)]
pub struct JointFit {
    /// Shared values in the requested order, then the scales of the channels if these are estimated.
    pub shared: JointValues,
    /// Own values of each run, in the order of [`JointRun::own`].
    pub own: Vec<JointValues>,
}

/// Fits all runs at once; `shared` are the shared columns. If `scaled`, the scale of each channel is estimated.
pub fn fit_jointly(parts: &[JointRun], shared: &[usize], scaled: bool) -> JointFit {
    let mut at = JointIterate {
        shared: DVector::zeros(shared.len()),
        scales: vec![1.0; parts.first().map_or(0, |part| part.channels.len())],
        own: parts.iter().map(|part| DVector::zeros(part.own.len())).collect(),
    };
    // With fixed scales the problem is linear, so one step is exact.
    let mut step = GaussNewtonStep::new(parts, shared, &at, false);
    at = step.apply_step(&at, 1.0);
    if scaled {
        for _ in 0..STEPS {
            step = GaussNewtonStep::new(parts, shared, &at, true);
            // Shorten the step until the sum of squares falls.
            let tried = [1.0, 0.5, 0.25, 0.1, 0.01].map(|part| step.apply_step(&at, part));
            let rest = |point: &JointIterate| GaussNewtonStep::new(parts, shared, point, true).squares_before;
            let best = tried.into_iter().find_map(|point| {
                let left = rest(&point);
                (left < step.squares_before).then_some((left, point))
            });
            let Some((left, point)) = best else { break };
            at = point;
            if step.squares_before - left <= CONVERGENCE_TOLERANCE * step.squares_before {
                break;
            }
        }
        step = GaussNewtonStep::new(parts, shared, &at, true);
    }
    step.result(&at)
}

/// Present values of an iteration.
#[derive(Clone)]
struct JointIterate {
    /// Shared values.
    shared: DVector<f64>,
    /// Scale of each channel.
    scales: Vec<f64>,
    /// Own values of each run.
    own: Vec<DVector<f64>>,
}

/// The linearised problem at a point, solved.
struct GaussNewtonStep {
    /// Solution for the shared values and the scales, relative to the point.
    solution: crate::changes::moments::NormalSolution,
    /// Own values of each run as functions of the shared ones.
    own: Vec<EliminatedValues>,
    /// Sum of squares at the point.
    squares_before: f64,
    /// Variance of the residual, at least 1.
    noise: f64,
    scaled: bool,
}

impl GaussNewtonStep {
    /// Linearises all runs at a point, eliminates their own values and solves for the shared ones.
    fn new(parts: &[JointRun], shared: &[usize], at: &JointIterate, scaled: bool) -> Self {
        let n = shared.len() + if scaled { at.scales.len() } else { 0 };
        let mut sum = NormalEquations::new(n);
        let mut before = 0.0;
        let mut own = Vec::new();
        for (part, values) in parts.iter().zip(&at.own) {
            let around = linearise_run(part, shared, at, values, scaled);
            before += around.total;
            // Statistics of the shared columns after elimination add up over the runs.
            let (left, one) = around.eliminate(part.own.len());
            sum.merge(&left);
            own.push(one);
        }
        let solved = sum.solve();
        let rank = solved.rank + own.iter().map(EliminatedValues::rank).sum::<usize>();
        Self {
            noise: (solved.residual_squares / (sum.rows as f64 - rank as f64).max(1.0)).max(1.0),
            solution: solved,
            own,
            squares_before: before,
            scaled,
        }
    }

    /// The point after a part of the step.
    fn apply_step(&self, at: &JointIterate, part: f64) -> JointIterate {
        let mut next = at.clone();
        let n = next.shared.len();
        next.shared += part * self.solution.values.rows(0, n);
        if self.scaled {
            for (scale, step) in next.scales.iter_mut().zip(self.solution.values.iter().skip(n)) {
                *scale += part * step;
            }
        }
        for (own, one) in next.own.iter_mut().zip(&self.own) {
            *own += part * one.values(&self.solution.values);
        }
        next
    }

    /// Values at the point with covariances from the linearised problem.
    fn result(&self, at: &JointIterate) -> JointFit {
        let scales = at.scales.iter().filter(|_| self.scaled);
        let own = at.own.iter().zip(&self.own).map(|(values, one)| JointValues {
            values: values.clone(),
            covariance: self.noise * one.covariance(&self.solution.covariance),
            determined: one.determined_flags(&self.solution.determined),
        });
        JointFit {
            shared: JointValues {
                values: DVector::from_iterator(self.solution.values.len(), at.shared.iter().chain(scales).copied()),
                covariance: self.noise * &self.solution.covariance,
                determined: self.solution.determined.clone(),
            },
            own: own.collect(),
        }
    }
}

/// Normal equations of one run around a point, with columns in the order: own values, shared values, scales.
fn linearise_run(
    part: &JointRun,
    shared: &[usize],
    at: &JointIterate,
    own: &DVector<f64>,
    scaled: bool,
) -> NormalEquations {
    let columns: Vec<usize> = part.own.iter().chain(shared).copied().collect();
    let n = columns.len();
    let mut all = NormalEquations::new(n + if scaled { at.scales.len() } else { 0 });
    for (d, (sums, scale)) in part.channels.iter().zip(&at.scales).enumerate() {
        let mut values = DVector::zeros(sums.rhs.len());
        let own = part.own.iter().zip(own.iter());
        for (k, x) in own.chain(shared.iter().zip(at.shared.iter())) {
            values[*k] += x;
        }
        for (k, x) in &part.known {
            values[*k] = *x;
        }
        // Products of the columns with the model's forces, and with the residual.
        let made = &sums.gram * &values;
        let left = &sums.rhs - *scale * &made;
        for (i, a) in columns.iter().enumerate() {
            for (j, b) in columns.iter().enumerate() {
                all.gram[(i, j)] += scale * scale * sums.gram[(*a, *b)];
            }
            all.rhs[i] += scale * left[*a];
            if scaled {
                all.gram[(i, n + d)] += scale * made[*a];
                all.gram[(n + d, i)] += scale * made[*a];
            }
        }
        let size = values.dot(&made);
        let measured = values.dot(&sums.rhs);
        if scaled {
            all.gram[(n + d, n + d)] += size;
            all.rhs[n + d] += measured - scale * size;
        }
        all.total += (sums.total - 2.0 * scale * measured + scale * scale * size).max(0.0);
        all.rows += sums.rows;
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::TestNoise;

    /// Two channels, two shared columns and one that is a run's own; forces times a scale of each channel.
    fn part(noise: &mut TestNoise, shared: [f64; 2], own: f64, scales: [f64; 2]) -> Vec<NormalEquations> {
        let channel = |scale: f64| {
            let z: Vec<Vec<f64>> = (0..3).map(|_| (0..300).map(|_| noise.normal()).collect()).collect();
            let y: Vec<f64> = (0..300)
                .map(|i| {
                    let force = shared[0] * z[0][i] + shared[1] * z[1][i] + own * z[2][i];
                    100.0 * scale * force + noise.normal()
                })
                .collect();
            let z: Vec<Vec<f64>> = (z.iter())
                .map(|column| column.iter().map(|x| 100.0 * x).collect())
                .collect();
            let mut sums = NormalEquations::new(3);
            let z: Vec<Option<&[f64]>> = z.iter().map(|column| Some(&column[..])).collect();
            sums.add_rows(&z, &y);
            sums
        };
        scales.map(channel).to_vec()
    }

    fn is_near(found: &JointValues, truth: &[f64]) {
        for (i, truth) in truth.iter().enumerate() {
            let deviation = found.covariance[(i, i)].sqrt();
            assert!(found.determined[i], "{found:?}");
            assert!(
                deviation < 0.01 && (found.values[i] - truth).abs() < 5.0 * deviation,
                "{found:?} is not {truth}"
            );
        }
    }

    #[test]
    fn shared_and_own_values_are_told_apart() {
        for seed in 0..20 {
            let mut noise = TestNoise::new(seed);
            let owns = [0.0, 0.7, -0.3];
            let parts: Vec<JointRun> = (owns.iter())
                .map(|own| JointRun {
                    channels: part(&mut noise, [2.0, -1.0], *own, [1.0, 1.0]),
                    own: vec![2],
                    known: Vec::new(),
                })
                .collect();
            let found = fit_jointly(&parts, &[0, 1], false);
            is_near(&found.shared, &[2.0, -1.0]);
            for (own, truth) in found.own.iter().zip(owns) {
                is_near(own, &[truth]);
            }
            // The same by one problem with all columns.
            let mut all = NormalEquations::new(5);
            for (r, part) in parts.iter().enumerate() {
                for sums in &part.channels {
                    let places = [0, 1, 2 + r];
                    for i in 0..3 {
                        for j in 0..3 {
                            all.gram[(places[i], places[j])] += sums.gram[(i, j)];
                        }
                        all.rhs[places[i]] += sums.rhs[i];
                    }
                    all.total += sums.total;
                    all.rows += sums.rows;
                }
            }
            let expected = all.solve();
            assert!((found.shared.values[1] - expected.values[1]).abs() < 1e-9);
            assert!((found.own[2].values[0] - expected.values[4]).abs() < 1e-9);
            let ratio = found.own[2].covariance[(0, 0)] / expected.covariance[(4, 4)];
            assert!((1.0 - 1e-9..2.0).contains(&ratio), "{ratio}");
        }
    }

    /// A known load determines the scales of both channels.
    #[test]
    fn a_known_load_tells_scales() {
        let mut noise = TestNoise::new(5);
        let scales = [0.8, 1.3];
        let unloaded = part(&mut noise, [2.0, -1.0], 0.0, scales);
        let loaded = part(&mut noise, [2.0, -1.0], 0.5, scales);
        let parts = |mass: &[(usize, f64)]| {
            [(unloaded.clone(), Vec::new()), (loaded.clone(), mass.to_vec())].map(|(channels, known)| JointRun {
                channels,
                own: Vec::new(),
                known,
            })
        };
        let found = fit_jointly(&parts(&[(2, 0.5)]), &[0, 1], true);
        is_near(&found.shared, &[2.0, -1.0, 0.8, 1.3]);
        // Without a load only products are known.
        let found = fit_jointly(&parts(&[])[..1], &[0, 1], true);
        assert!(!found.shared.determined[0] && !found.shared.determined[2]);
    }
}
