//! From a start to a local optimum: sequential quadratic programming (D. Kraft, 1988, the crate `slsqp`) on the
//! coefficients of eq. (17), with limits as smooth constraints.
//!
//! The largest excess over a limit is taken as `log(sum of exp(r * excess)) / r`, which is smooth and never below it
//! (G. Kreisselmeier and R. Steinhauser, 1979); r grows from one round to the next.
//!
//! Decision: gradients are central differences over the some thirty coefficients, because evaluation in blocks
//! makes each of them cheap. They need smooth functions: the logarithm of the condition number and smooth largest
//! excesses.

use std::cell::{Cell, RefCell};

use slsqp::{StopTols, minimize};

use super::measure::{Measure, excess, half};
use super::{Criterion, Flow, Motion, Series};

/// Sharpness of the smooth largest value, in the first round and in those that polish.
const FIRST: f64 = 50.0;
const POLISH: [f64; 2] = [200.0, 800.0];
/// Step of the differences, in coefficients that are of size 1.
const STEP: f64 = 1e-5;
/// The same where effects are told apart. Many of them jump with the sign of a rate, which moves from one sample to the next
/// only now and then: a difference over many such steps has the slope of their mean. On the SpiderMill it takes dry from
/// viscous friction 6 % farther apart than short steps do, and costs nothing where nothing jumps.
const WIDE: f64 = 1e-2;
/// The value of a trajectory that the mechanism cannot follow.
const REFUSED: f64 = 1e3;

/// Objective and constraints at a point, with their derivatives.
struct Known {
    at: Vec<f64>,
    values: Vec<f64>,
    gradients: Vec<Vec<f64>>,
}

/// Rounds of polishing.
pub(super) const POLISHES: usize = POLISH.len();

/// Improves a trajectory; it may exceed limits a little.
pub(super) fn improve(
    measure: &Measure<'_>,
    start: &[Series],
    progress: &dyn Fn(usize) -> Flow,
) -> Vec<Series> {
    let scales = Scales::new(measure);
    let x = round(measure, &scales, &scales.encode(start), FIRST, progress);
    scales.decode(&x)
}

/// Improves a trajectory that was improved before: closer to the limits.
pub(super) fn polish(
    measure: &Measure<'_>,
    start: &[Series],
    progress: &dyn Fn(usize) -> Flow,
) -> Vec<Series> {
    let scales = Scales::new(measure);
    let mut x = scales.encode(start);
    for sharpness in POLISH {
        x = round(measure, &scales, &x, sharpness, progress);
    }
    scales.decode(&x)
}

fn round(
    measure: &Measure<'_>,
    scales: &Scales<'_, '_>,
    start: &[f64],
    sharpness: f64,
    progress: &dyn Fn(usize) -> Flow,
) -> Vec<f64> {
    let known: RefCell<Option<Known>> = RefCell::new(None);
    let flow = Cell::new(Flow::Continue(()));
    let entry = |x: &[f64], k: usize, gradient: Option<&mut [f64]>| -> f64 {
        if flow.get().is_break() {
            // Where nothing changes any more, the search ends by itself.
            if let Some(gradient) = gradient {
                gradient.fill(0.0);
            }
            return 0.0;
        }
        let is_known = known.borrow().as_ref().is_some_and(|known| known.at == x);
        if !is_known {
            flow.set(progress(usize::from(k == 0)));
            *known.borrow_mut() = Some(look(measure, scales, x, sharpness));
        }
        let known = known.borrow();
        let known = known.as_ref().expect("just looked");
        if let Some(gradient) = gradient {
            gradient.copy_from_slice(&known.gradients[k]);
        }
        known.values[k]
    };
    let n_constraints = values(measure, scales, start, sharpness).len() - 1;
    let entry = &entry;
    let constraint = |k: usize| {
        move |x: &[f64], gradient: Option<&mut [f64]>, (): &mut ()| entry(x, k, gradient)
    };
    let constraints: Vec<_> = (1..=n_constraints).map(constraint).collect();
    let bounds = vec![(-4.0, 4.0); start.len()];
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

/// Values and central differences.
fn look(measure: &Measure<'_>, scales: &Scales<'_, '_>, x: &[f64], sharpness: f64) -> Known {
    let at = x.to_vec();
    let step = match measure.options.criterion {
        Criterion::Separation => WIDE,
        Criterion::Condition | Criterion::LogDet => STEP,
    };
    let middle = values(measure, scales, x, sharpness);
    let mut gradients = vec![vec![0.0; x.len()]; middle.len()];
    let mut moved = at.clone();
    for i in 0..x.len() {
        moved[i] = x[i] + step;
        let high = values(measure, scales, &moved, sharpness);
        moved[i] = x[i] - step;
        let low = values(measure, scales, &moved, sharpness);
        moved[i] = x[i];
        for (gradient, (high, low)) in gradients.iter_mut().zip(high.iter().zip(&low)) {
            let slope = (high - low) / (2.0 * step);
            gradient[i] = if slope.is_finite() { slope } else { 0.0 };
        }
    }
    Known {
        at,
        values: middle,
        gradients,
    }
}

/// The objective, then all constraints.
fn values(measure: &Measure<'_>, scales: &Scales<'_, '_>, x: &[f64], sharpness: f64) -> Vec<f64> {
    let motion = measure.motion(&scales.decode(x));
    let value = measure.value(&motion);
    let mut values = vec![if value.is_finite() { value } else { REFUSED }];
    for (i, derivative, range) in measure.ranges() {
        let Motion { q, qd, qdd } = &motion;
        let column = [q, qd, qdd][derivative];
        let excesses = column[i].iter().map(|v| excess(*v, range));
        values.push(smooth_largest(excesses, sharpness));
    }
    let n = measure.plant.limits().len();
    match measure.plant.excess(&motion) {
        Some(all) => {
            let peaks = all
                .iter()
                .map(|one| smooth_largest(one.iter().copied(), sharpness));
            values.extend(peaks);
        }
        None => values.extend(std::iter::repeat_n(REFUSED, n)),
    }
    values
}

/// Smooth, and never below the largest value.
fn smooth_largest(values: impl Iterator<Item = f64> + Clone, sharpness: f64) -> f64 {
    let largest = values.clone().fold(f64::NEG_INFINITY, f64::max);
    if !largest.is_finite() {
        return REFUSED;
    }
    let sum: f64 = values.map(|v| (sharpness * (v - largest)).exp()).sum();
    largest + sum.ln() / sharpness
}

/// What makes coefficients of size 1 out of those of a series.
struct Scales<'m, 'a> {
    measure: &'m Measure<'a>,
    /// Amplitude of each harmonic that one limit or another allows, for each coordinate.
    amplitudes: Vec<Vec<f64>>,
}

impl<'m, 'a> Scales<'m, 'a> {
    fn new(measure: &'m Measure<'a>) -> Self {
        let amplitudes = measure.limits.iter().map(|limits| {
            let harmonics = 1..=measure.options.harmonics;
            harmonics
                .map(|k| {
                    let w = k as f64 * measure.omega();
                    let by_rate = limits.rate.map_or(f64::INFINITY, |r| half(r) / w);
                    let by_acceleration = limits
                        .acceleration
                        .map_or(f64::INFINITY, |r| half(r) / (w * w));
                    half(limits.position).min(by_rate).min(by_acceleration)
                })
                .collect()
        });
        Self {
            measure,
            amplitudes: amplitudes.collect(),
        }
    }

    fn encode(&self, series: &[Series]) -> Vec<f64> {
        let mut x = Vec::new();
        for (i, one) in series.iter().enumerate() {
            let [low, high] = self.measure.limits[i].position;
            x.push((one.offset - 0.5 * (low + high)) / half([low, high]));
            for list in [&one.mu, &one.nu] {
                for (k, coefficient) in list.iter().enumerate() {
                    let w = (k + 1) as f64 * one.omega;
                    x.push(coefficient / (w * self.amplitudes[i][k]));
                }
            }
        }
        x
    }

    fn decode(&self, x: &[f64]) -> Vec<Series> {
        let n = self.measure.options.harmonics;
        let omega = self.measure.omega();
        let each = x.chunks_exact(1 + 2 * n).enumerate();
        each.map(|(i, x)| {
            let [low, high] = self.measure.limits[i].position;
            let list = |from: usize| {
                (0..n)
                    .map(|k| x[from + k] * (k + 1) as f64 * omega * self.amplitudes[i][k])
                    .collect()
            };
            Series {
                offset: 0.5 * (low + high) + half([low, high]) * x[0],
                mu: list(1),
                nu: list(1 + n),
                omega,
            }
        })
        .collect()
    }
}
