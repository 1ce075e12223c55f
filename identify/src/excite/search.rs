//! Local optimisation from a start: sequential quadratic programming (D. Kraft, 1988, the crate `slsqp`) on the
//! coefficients of eq. (17), with limits as smooth constraints. The period is one of them if it has a range.
//!
//! The largest excess over a limit is approximated by `log(sum of exp(r * excess)) / r`, which is smooth and never
//! below it (G. Kreisselmeier and R. Steinhauser, 1979); r grows from one round to the next.
//!
//! Decision: gradients are central differences over about thirty coefficients, because evaluation in blocks makes each
//! of them cheap. They need smooth functions: the logarithm of the condition number and smooth largest excesses.

use std::cell::{Cell, RefCell};
use std::f64::consts::PI;

use slsqp::{StopTols, minimize};

use super::measure::{TrajectoryEvaluator, excess, half_width};
use super::{ExcitationCriterion, ExcitationMotion, FourierSeries, SearchFlow};

/// Sharpness r of the smooth maximum, in the first round and in the refining ones.
const FIRST: f64 = 50.0;
const POLISH: [f64; 2] = [200.0, 800.0];
/// Step of the differences, for coefficients of size 1.
const STEP: f64 = 1e-5;
/// The same if effects are to be distinguished. Many of them jump with the sign of a rate, whose zero moves from one
/// sample to the next only for large steps. A difference over many such steps gives the mean slope. On the SpiderMill
/// it separates dry from viscous friction 6 % better than short steps, and it costs nothing where nothing jumps.
const SEPARATION_STEP: f64 = 1e-2;
/// Value of a trajectory that the mechanism cannot follow.
const INFEASIBLE_VALUE: f64 = 1e3;

/// Objective and constraints at a point, with their derivatives.
struct ConstraintLinearisation {
    /// Coefficients of the point.
    point: Vec<f64>,
    /// The objective, then the constraints.
    values: Vec<f64>,
    /// Their gradients, in the same order.
    gradients: Vec<Vec<f64>>,
}

/// Number of refining rounds.
pub(super) const POLISHES: usize = POLISH.len();

/// Improves a trajectory; the result may exceed limits slightly.
pub(super) fn improve(
    measure: &TrajectoryEvaluator<'_>,
    start: &[FourierSeries],
    progress: &dyn Fn(usize) -> SearchFlow,
) -> Vec<FourierSeries> {
    let scales = CoefficientScales::new(measure);
    let x = optimise_round(measure, &scales, &scales.encode(start), FIRST, progress);
    scales.decode(&x)
}

/// Refines an improved trajectory with sharper constraints, closer to the limits.
pub(super) fn polish(
    measure: &TrajectoryEvaluator<'_>,
    start: &[FourierSeries],
    progress: &dyn Fn(usize) -> SearchFlow,
) -> Vec<FourierSeries> {
    let scales = CoefficientScales::new(measure);
    let mut x = scales.encode(start);
    for sharpness in POLISH {
        x = optimise_round(measure, &scales, &x, sharpness, progress);
    }
    scales.decode(&x)
}

/// One run of the optimiser with a sharpness of the constraints; returns the coefficients at its end.
fn optimise_round(
    measure: &TrajectoryEvaluator<'_>,
    scales: &CoefficientScales<'_, '_>,
    start: &[f64],
    sharpness: f64,
    progress: &dyn Fn(usize) -> SearchFlow,
) -> Vec<f64> {
    // Objective and constraints are requested one by one; they are computed together and kept for the point.
    let known: RefCell<Option<ConstraintLinearisation>> = RefCell::new(None);
    let flow = Cell::new(SearchFlow::Continue(()));
    let entry = |x: &[f64], k: usize, gradient: Option<&mut [f64]>| -> f64 {
        if flow.get().is_break() {
            // With zero gradients the optimiser ends by itself.
            if let Some(gradient) = gradient {
                gradient.fill(0.0);
            }
            return 0.0;
        }
        let is_known = known.borrow().as_ref().is_some_and(|known| known.point == x);
        if !is_known {
            flow.set(progress(usize::from(k == 0)));
            *known.borrow_mut() = Some(linearise(measure, scales, x, sharpness));
        }
        let known = known.borrow();
        let known = known.as_ref().expect("just looked");
        if let Some(gradient) = gradient {
            gradient.copy_from_slice(&known.gradients[k]);
        }
        known.values[k]
    };
    let n_constraints = objective_and_constraints(measure, scales, start, sharpness).len() - 1;
    let entry = &entry;
    let constraint = |k: usize| move |x: &[f64], gradient: Option<&mut [f64]>, (): &mut ()| entry(x, k, gradient);
    let constraints: Vec<_> = (1..=n_constraints).map(constraint).collect();
    // Coefficients of size 1 reach a limit; four times that is far beyond.
    let mut bounds = vec![(-4.0, 4.0); start.len()];
    // The last coefficient is the position of the period in its range.
    if measure.options.period_range.is_some()
        && let Some(last) = bounds.last_mut()
    {
        *last = (-1.0, 1.0);
    }
    let tolerances = StopTols {
        ftol_rel: 1e-6,
        ..StopTols::default()
    };
    let outcome = minimize(
        constraint(0),
        start,
        &bounds,
        &constraints,
        (),
        measure.options.steps,
        Some(tolerances),
    );
    let end = match outcome {
        Ok((_, x, _)) | Err((_, x, _)) => x,
    };
    if end.iter().all(|x| x.is_finite()) {
        end
    } else {
        start.to_vec()
    }
}

/// Objective and constraints at a point, with gradients by central differences.
fn linearise(
    measure: &TrajectoryEvaluator<'_>,
    scales: &CoefficientScales<'_, '_>,
    x: &[f64],
    sharpness: f64,
) -> ConstraintLinearisation {
    let at = x.to_vec();
    let step = match measure.options.criterion {
        ExcitationCriterion::Separation => SEPARATION_STEP,
        ExcitationCriterion::Condition | ExcitationCriterion::LogDet => STEP,
    };
    let middle = objective_and_constraints(measure, scales, x, sharpness);
    let mut gradients = vec![vec![0.0; x.len()]; middle.len()];
    let mut moved = at.clone();
    for i in 0..x.len() {
        moved[i] = x[i] + step;
        let high = objective_and_constraints(measure, scales, &moved, sharpness);
        moved[i] = x[i] - step;
        let low = objective_and_constraints(measure, scales, &moved, sharpness);
        moved[i] = x[i];
        for (gradient, (high, low)) in gradients.iter_mut().zip(high.iter().zip(&low)) {
            let slope = (high - low) / (2.0 * step);
            gradient[i] = if slope.is_finite() { slope } else { 0.0 };
        }
    }
    ConstraintLinearisation {
        point: at,
        values: middle,
        gradients,
    }
}

/// The objective, then all constraints (not above 0 inside the limits), at a point.
fn objective_and_constraints(
    measure: &TrajectoryEvaluator<'_>,
    scales: &CoefficientScales<'_, '_>,
    x: &[f64],
    sharpness: f64,
) -> Vec<f64> {
    let motion = measure.sample_motion(&scales.decode(x));
    let value = measure.criterion_value(&motion);
    let mut values = vec![if value.is_finite() { value } else { INFEASIBLE_VALUE }];
    for (i, derivative, range) in measure.ranges() {
        let ExcitationMotion { q, qd, qdd } = &motion;
        let column = [q, qd, qdd][derivative];
        let excesses = column[i].iter().map(|v| excess(*v, range));
        values.push(smooth_largest(excesses, sharpness));
    }
    let n = measure.plant.limits().len();
    match measure.plant.excess(&motion) {
        Some(all) => {
            let peaks = all.iter().map(|one| smooth_largest(one.iter().copied(), sharpness));
            values.extend(peaks);
        }
        None => values.extend(std::iter::repeat_n(INFEASIBLE_VALUE, n)),
    }
    values
}

/// Smooth maximum, never below the largest value.
fn smooth_largest(values: impl Iterator<Item = f64> + Clone, sharpness: f64) -> f64 {
    let largest = values.clone().fold(f64::NEG_INFINITY, f64::max);
    if !largest.is_finite() {
        return INFEASIBLE_VALUE;
    }
    let sum: f64 = values.map(|v| (sharpness * (v - largest)).exp()).sum();
    largest + sum.ln() / sharpness
}

/// Scales between coefficients of size 1 and those of a series.
struct CoefficientScales<'m, 'a> {
    /// Limits and options.
    measure: &'m TrajectoryEvaluator<'a>,
}

impl<'m, 'a> CoefficientScales<'m, 'a> {
    /// The scales within the limits of a search.
    fn new(measure: &'m TrajectoryEvaluator<'a>) -> Self {
        Self { measure }
    }

    /// Largest amplitude of the harmonic with the angular frequency `w` (rad/s) within the tightest limit of a
    /// coordinate, rad or m.
    fn amplitude(&self, coordinate: usize, w: f64) -> f64 {
        let limits = &self.measure.limits[coordinate];
        let by_rate = limits.rate.map_or(f64::INFINITY, |r| half_width(r) / w);
        let by_acceleration = limits.acceleration.map_or(f64::INFINITY, |r| half_width(r) / (w * w));
        half_width(limits.position).min(by_rate).min(by_acceleration)
    }

    /// Coefficients of size 1 for some series: for each coordinate the mean, then sines and cosines; at the end the
    /// period, if it is a variable.
    fn encode(&self, series: &[FourierSeries]) -> Vec<f64> {
        let mut x = Vec::new();
        for (i, one) in series.iter().enumerate() {
            let [low, high] = self.measure.limits[i].position;
            x.push((one.offset - 0.5 * (low + high)) / half_width([low, high]));
            for list in [&one.mu, &one.nu] {
                for (k, coefficient) in list.iter().enumerate() {
                    let w = (k + 1) as f64 * one.omega;
                    x.push(coefficient / (w * self.amplitude(i, w)));
                }
            }
        }
        let options = self.measure.options;
        if options.period_range.is_some() {
            let period = series.first().map_or(options.period, FourierSeries::period);
            x.push(options.period_position(period));
        }
        x
    }

    /// The series of some coefficients; the inverse of `encode`.
    fn decode(&self, x: &[f64]) -> Vec<FourierSeries> {
        let options = self.measure.options;
        let n = options.harmonics;
        // The differences step a little beyond the ends of the range.
        let position = x.last().filter(|_| options.period_range.is_some());
        let omega = 2.0 * PI / options.period_at(position.map_or(0.0, |x| x.clamp(-1.0, 1.0)));
        let each = x.chunks_exact(1 + 2 * n).take(self.measure.limits.len()).enumerate();
        each.map(|(i, x)| {
            let [low, high] = self.measure.limits[i].position;
            let list = |from: usize| {
                (0..n)
                    .map(|k| {
                        let w = (k + 1) as f64 * omega;
                        x[from + k] * (k + 1) as f64 * omega * self.amplitude(i, w)
                    })
                    .collect()
            };
            FourierSeries {
                offset: 0.5 * (low + high) + half_width([low, high]) * x[0],
                mu: list(1),
                nu: list(1 + n),
                omega,
            }
        })
        .collect()
    }
}
