//! Delays of signals by instrumental variables, together with all other unknowns.
//!
//! A system of equations goes in with first estimates of the delays, better ones with standard deviations come out. The
//! change of the equations by a delay is a further column, whose factor is the step of the delay. It follows from the
//! commands, so that it is its own instrument. Least squares would be biased: noise of the accelerations makes inertias
//! too small, and a delay makes up for it.

use std::collections::BTreeMap;

use super::delay::ServoDelay;
use super::estimate::{ServoEstimator, ServoSystem};
use super::rows::EquationRows;
use super::thresholds::{
    DELAY_ITERATIONS, DELAY_RESTARTS, DELAY_STEP, DELAY_TOLERANCE, HALF_INTERVAL, LARGEST_DELAY, LARGEST_DELAY_STEP,
};
use crate::error::Outcome;

/// Changes of the equations by delays, for some actuators.
#[derive(Default)]
pub(super) struct DelayColumns {
    /// The actuators, by place.
    pub(super) actuators: Vec<usize>,
    /// Derivatives by the delays, `[row][actuator]`, in units of the force per s.
    pub(super) values: Vec<f64>,
}

/// Improves the delays that the file does not give, from equations that may be fewer than those of the estimate.
///
/// A servo that follows its command nearly without error has several solutions: a longer delay with a smaller damping and a
/// negative inertia satisfies the equations nearly as well. If an estimate has an impossible sign, or a delay is at the end
/// of the search, the steps begin again at shorter delays of the drive, and the solution whose signs are least impossible
/// is taken.
///
/// Fails when a pose has no solution.
pub(super) fn find_delays(system: &ServoSystem<'_>, delays: &mut [ServoDelay]) -> Outcome {
    let estimated = estimated(delays);
    if estimated.is_empty() {
        return Ok(());
    }
    let actuators = system.servo.actuators();
    let first_estimates = delays.to_vec();
    refine_by_instruments(system, delays)?;
    let Some(mut impossible) = impossible_drives(system, delays)? else {
        return Ok(());
    };
    let mut undecided = Vec::new();
    for share in DELAY_RESTARTS {
        let of_impossible = |k: &&usize| impossible.contains_key(&actuators[**k].drive.0);
        let moved: Vec<usize> = estimated.iter().filter(of_impossible).copied().collect();
        if moved.is_empty() {
            break;
        }
        let mut other = delays.to_vec();
        for k in &moved {
            other[*k].value = share * first_estimates[*k].value;
            other[*k].is_open = false;
        }
        let start = other.clone();
        let has_converged = step_to_solution(system, &mut other, &estimated).unwrap_or(false);
        if !has_converged {
            // The equations do not decide between this delay and the first estimate.
            other = start;
            for k in &moved {
                let one = &mut other[*k];
                let distance = (first_estimates[*k].value - one.value).abs();
                one.std = distance / HALF_INTERVAL;
                one.interval = Some([(one.value - distance).max(0.0), one.value + distance]);
            }
        }
        let Ok(Some(others)) = impossible_drives(system, &other) else {
            continue;
        };
        // First the number of drives whose delay is at the end of the search, then the signs.
        let size = |all: &BTreeMap<usize, f64>| {
            let finite = all.values().filter(|x| x.is_finite());
            (all.values().filter(|x| x.is_infinite()).count(), finite.sum::<f64>())
        };
        if size(&others) < size(&impossible) {
            impossible = others;
            delays.clone_from_slice(&other);
            undecided = if has_converged { Vec::new() } else { moved };
        }
    }
    for k in undecided {
        delays[k].is_open = true;
    }
    Ok(())
}

/// Improves delays that are nearly right. Those stay that the equations do not determine, and all of them if the steps do
/// not converge: they are worse than the estimate with which they began.
///
/// Fails when a pose has no solution.
pub(super) fn refine_by_instruments(system: &ServoSystem<'_>, delays: &mut [ServoDelay]) -> Outcome {
    let estimated = estimated(delays);
    let mut refined = delays.to_vec();
    if !estimated.is_empty() && step_to_solution(system, &mut refined, &estimated)? {
        delays.clone_from_slice(&refined);
    }
    Ok(())
}

/// The delays that the file does not give, by place.
fn estimated(delays: &[ServoDelay]) -> Vec<usize> {
    (0..delays.len()).filter(|k| delays[*k].interval.is_some()).collect()
}

/// The drives in whose equations estimates are negative that must be positive, with the sum of the squares of these
/// estimates in standard deviations; infinite for a drive whose delay is at the end of the search. `None` without
/// instruments: signs of biased estimates decide nothing.
fn impossible_drives(system: &ServoSystem<'_>, delays: &[ServoDelay]) -> Outcome<Option<BTreeMap<usize, f64>>> {
    let values: Vec<f64> = delays.iter().map(|delay| delay.value).collect();
    let solved = system.solve(&values)?;
    if !matches!(solved.estimator, ServoEstimator::Instruments { .. }) {
        return Ok(None);
    }
    let body_rows = system.servo.body_rows();
    let width = system.servo.equations.base.len();
    let at_end = delays.iter().zip(system.servo.actuators());
    let at_end = at_end.filter(|(delay, _)| delay.is_open);
    let mut impossible: BTreeMap<usize, f64> = at_end.map(|(_, one)| (one.drive.0, f64::INFINITY)).collect();
    for (k, sigmas) in system.negative_estimates(&solved) {
        let mut squares = vec![0.0; body_rows.len()];
        for (i, row) in solved.equations.regressor.chunks_exact(width).enumerate() {
            let row_of_body = i % body_rows.len();
            squares[row_of_body] += (solved.weights[row_of_body] * row[k]).powi(2);
        }
        // A parameter belongs to the drive in whose equation it has the largest effect.
        let largest = (0..squares.len()).max_by(|a, b| squares[*a].total_cmp(&squares[*b]));
        *impossible.entry(largest.map_or(0, |row| body_rows[row])).or_insert(0.0) += sigmas * sigmas;
    }
    Ok(Some(impossible))
}

/// Gauss-Newton steps of some delays, given by place, from their present values. Returns whether they converged.
fn step_to_solution(system: &ServoSystem<'_>, delays: &mut [ServoDelay], estimated: &[usize]) -> Outcome<bool> {
    let (mut last_step, mut is_determined) = (f64::INFINITY, true);
    for _ in 0..DELAY_ITERATIONS {
        let values: Vec<f64> = delays.iter().map(|delay| delay.value).collect();
        let solved = system.solve(&values)?;
        if !matches!(solved.estimator, ServoEstimator::Instruments { .. }) {
            last_step = f64::INFINITY;
            break;
        }
        let columns = delay_columns(system, &values, estimated, &system.base_values(&solved))?;
        let joint = system.solve_weighted(
            &solved.equations,
            solved.instruments.as_ref(),
            &solved.weights,
            &columns,
        )?;
        let (solution, uncertainty, estimator) = joint;
        if !matches!(estimator, ServoEstimator::Instruments { .. }) {
            last_step = f64::INFINITY;
            break;
        }
        let first = solution.values.len() - estimated.len();
        let mut largest: f64 = 0.0;
        is_determined = true;
        for (at, k) in estimated.iter().enumerate() {
            let (step, std) = (solution.values[first + at], uncertainty.std[first + at]);
            if !solution.determined[first + at] || !std.is_finite() {
                is_determined = false;
                continue;
            }
            let one = &mut delays[*k];
            let before = one.value;
            one.value = (before + step.clamp(-LARGEST_DELAY_STEP, LARGEST_DELAY_STEP)).clamp(0.0, LARGEST_DELAY);
            one.std = std;
            one.is_open = one.value + HALF_INTERVAL * std >= LARGEST_DELAY;
            one.interval = Some([-1.0, 1.0].map(|sign: f64| (one.value + sign * HALF_INTERVAL * std).max(0.0)));
            largest = largest.max((one.value - before).abs());
        }
        last_step = largest;
        if largest < DELAY_TOLERANCE {
            break;
        }
    }
    Ok(is_determined && last_step <= DELAY_STEP)
}

/// The change of all equations by the delays of some actuators.
fn delay_columns(system: &ServoSystem<'_>, delays: &[f64], estimated: &[usize], base: &[f64]) -> Outcome<DelayColumns> {
    let actuators = system.servo.actuators();
    let body_rows = system.servo.body_rows();
    let n = estimated.len();
    let mut values: Vec<f64> = Vec::new();
    // Signals of different drives are in different rows and are moved together.
    let rank = |k: usize| {
        actuators[..k]
            .iter()
            .filter(|one| one.drive == actuators[k].drive)
            .count()
    };
    let last = (0..actuators.len()).map(rank).max().unwrap_or(0);
    for round in 0..=last {
        let moved = |step: f64| -> Outcome<EquationRows> {
            let shifted: Vec<f64> = delays
                .iter()
                .enumerate()
                .map(|(k, delay)| if rank(k) == round { delay + step } else { *delay })
                .collect();
            system.own_equations(&shifted)
        };
        let [before, after] = [moved(-DELAY_STEP)?, moved(DELAY_STEP)?];
        let width = base.len();
        let rows = after
            .regressor
            .chunks_exact(width)
            .zip(before.regressor.chunks_exact(width));
        values.resize(rows.len() * n, 0.0);
        for (row, (after, before)) in rows.enumerate() {
            let drive = body_rows[row % body_rows.len()];
            let own = estimated
                .iter()
                .position(|k| rank(*k) == round && actuators[*k].drive.0 == drive);
            if let Some(at) = own {
                let change: f64 = after.iter().zip(before).zip(base).map(|((a, b), p)| (a - b) * p).sum();
                values[row * n + at] = change / (2.0 * DELAY_STEP);
            }
        }
    }
    Ok(DelayColumns {
        actuators: estimated.to_vec(),
        values,
    })
}
