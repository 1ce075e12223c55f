//! The delay of each servo, by profile likelihood: for each delay on a grid the equations of its drive are solved anew,
//! and the residual decides.
//!
//! The force of the signal is the response, so that the search needs no scale: without known numbers the equation of a
//! drive determines ratios, and these are enough.

use modelmill_identify::RFactor;
use modelmill_identify::estimate::LeastSquares;

use super::ServoModel;
use super::rows::UsedSamples;
use super::thresholds::{DELAY_SAMPLES, DELAY_STEP, DELAY_STEPS, INTERVAL_FALL};
use crate::along;
use crate::error::{Error, Outcome};
use crate::segment::RecordingSegment;

/// The delay of an actuator's signal.
#[derive(Clone, Debug, PartialEq)]
pub struct ServoDelay {
    /// Name of the drive.
    pub drive: String,
    /// The delay, s.
    pub value: f64,
    /// Interval of 95 %, s; `None` if the file gives the delay.
    pub interval: Option<[f64; 2]>,
    /// Standard deviation, s; zero if the file gives the delay.
    pub std: f64,
    /// Whether the recording does not determine it: the best is at an end of the search range, or several satisfy the
    /// equations.
    pub is_open: bool,
}

/// The equations with which delays are estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DelayQuery {
    /// Those of the model.
    OfModel,
    /// Those of the model with viscous friction, dry friction and an offset of the drive: if the model lacks them, the
    /// delay would explain them. A servo that is late by `T` has nearly the force of a damping `kp*T`.
    WithFriction,
}

/// The delays of all actuators.
///
/// Fails when a pose has no solution.
pub(super) fn delays(servo: &ServoModel, segments: &[RecordingSegment], query: DelayQuery) -> Outcome<Vec<ServoDelay>> {
    let samples: Vec<UsedSamples> = segments
        .iter()
        .map(|one| UsedSamples::new(servo, one, DELAY_SAMPLES))
        .collect::<Outcome<_>>()?;
    let actuators = servo.actuators();
    let mut profiles: Vec<Vec<ResidualLevel>> = vec![Vec::new(); actuators.len()];
    if actuators.iter().any(|actuator| actuator.delay.is_none()) {
        for step in 0..=DELAY_STEPS {
            let delay = step as f64 * DELAY_STEP;
            let rows = residuals(servo, &samples, delay, query)?;
            for (profile, level) in profiles.iter_mut().zip(rows) {
                profile.push(level);
            }
        }
    }
    Ok(actuators
        .iter()
        .zip(&profiles)
        .map(|(actuator, profile)| {
            let drive = servo.drive_name(actuator).to_owned();
            match actuator.delay {
                Some(value) => ServoDelay {
                    drive,
                    value,
                    interval: None,
                    std: 0.0,
                    is_open: false,
                },
                None => best_delay(drive, profile),
            }
        })
        .collect())
}

/// The residual of one drive at one delay.
#[derive(Clone, Copy)]
struct ResidualLevel {
    /// Sum of squares.
    squares: f64,
    /// Number of equations that count as independent.
    independent: f64,
}

/// The residual of each actuator's equation if all signals have one delay.
fn residuals(
    servo: &ServoModel,
    samples: &[UsedSamples],
    delay: f64,
    query: DelayQuery,
) -> Outcome<Vec<ResidualLevel>> {
    let actuators = servo.actuators();
    let all = vec![delay; actuators.len()];
    let model = &servo.equations;
    let n = model.base.len();
    let body_rows = servo.body_rows();
    let equations = samples
        .iter()
        .map(|one| one.equations(servo, &one.delayed(servo, &all)))
        .collect::<Outcome<Vec<_>>>()?;
    let rates = samples
        .iter()
        .map(|one| match query {
            DelayQuery::OfModel => Ok(Vec::new()),
            DelayQuery::WithFriction => along::drive_rates(model, &one.segment),
        })
        .collect::<Outcome<Vec<_>>>()?;
    actuators
        .iter()
        .map(|actuator| {
            let place = body_rows.iter().position(|d| *d == actuator.drive.0).unwrap_or(0);
            let response = response_column(servo, actuator.drive.0);
            let mut table: Vec<Vec<f64>> = Vec::new();
            for ((one, rates), used) in equations.iter().zip(&rates).zip(samples) {
                let rates = rates.get(actuator.drive.0);
                let direction = rates.map(|rates| used.filtered_direction(rates)).unwrap_or_default();
                let rows = one.regressor.chunks_exact(n).skip(place).step_by(body_rows.len());
                for (sample, row) in rows.enumerate().filter(|(_, row)| row.iter().any(|x| *x != 0.0)) {
                    let friction = rates.map(|rates| [rates[sample], direction[sample], 1.0]);
                    table.push(row.iter().copied().chain(friction.into_iter().flatten()).collect());
                }
            }
            let width = table.first().map_or(n, Vec::len);
            let used: Vec<usize> = (0..width)
                .filter(|k| *k != response && table.iter().any(|row| row[*k] != 0.0))
                .collect();
            let mut regression = LeastSquares::new(used.len().max(1));
            let pick = |row: &[f64]| -> Vec<f64> {
                if used.is_empty() {
                    vec![0.0]
                } else {
                    used.iter().map(|k| row[*k]).collect()
                }
            };
            for row in &table {
                regression
                    .add_rows(&pick(row), &[-row[response]])
                    .map_err(failed(servo))?;
            }
            let solution = RFactor::new(&regression)
                .solve_near(&vec![0.0; used.len().max(1)])
                .map_err(failed(servo))?;
            let residual: Vec<f64> = table
                .iter()
                .map(|row| {
                    let fitted: f64 = pick(row).iter().zip(&solution.values).map(|(x, p)| x * p).sum();
                    -row[response] - fitted
                })
                .collect();
            let squares: f64 = residual.iter().map(|e| e * e).sum();
            let products: f64 = residual.windows(2).map(|w| w[0] * w[1]).sum();
            let lag = if squares > 0.0 {
                (products / squares).clamp(0.0, 0.999)
            } else {
                0.0
            };
            Ok(ResidualLevel {
                squares,
                independent: (residual.len() as f64 * (1.0 - lag) / (1.0 + lag)).max(1.0),
            })
        })
        .collect()
}

/// The error of a regression that cannot be solved.
fn failed(servo: &ServoModel) -> impl Fn(modelmill_identify::LeastSquaresError) -> Error {
    let path = servo.equations.path.clone();
    move |error| Error::input(format!("{path}: the delay of a servo was not found: {error}"))
}

/// The base parameter whose column contains the signal of a drive: of the proportional gain, or the known one.
fn response_column(servo: &ServoModel, drive: usize) -> usize {
    let model = &servo.equations;
    let mechanism = &model.derivation.mechanism;
    let forces = mechanism.servo_forces.iter().filter(|force| force.drive.0 == drive);
    let first = forces.flat_map(|force| &force.terms).next();
    let wanted: Vec<(usize, u32)> = first.map_or_else(Vec::new, |term| {
        term.parameters.iter().map(|(p, n)| (p.0, *n)).collect()
    });
    (0..model.base.len())
        .find(|k| model.products_of(*k).iter().any(|(product, _)| product.0 == wanted))
        .unwrap_or(0)
}

/// The minimum of a profile with its interval.
fn best_delay(drive: String, profile: &[ResidualLevel]) -> ServoDelay {
    let best = (0..profile.len())
        .min_by(|a, b| profile[*a].squares.total_cmp(&profile[*b].squares))
        .unwrap_or(0);
    let independent = profile[best].independent;
    // Twice the fall of the log likelihood relative to the minimum.
    let floor = profile[best].squares.max(f64::MIN_POSITIVE);
    let fall = |k: usize| independent * (profile[k].squares / floor).ln();
    let last = profile.len() - 1;
    let mut value = best as f64;
    // A parabola through three points refines the minimum.
    let curvature = if best > 0 && best < last {
        let (left, right) = (fall(best - 1), fall(best + 1));
        value += 0.5 * (left - right) / (left + right).max(f64::MIN_POSITIVE);
        left + right
    } else {
        let next = if best == 0 {
            fall(1.min(last))
        } else {
            fall(last.saturating_sub(1))
        };
        2.0 * next
    };
    let lower = (0..=best).rev().find(|k| fall(*k) > INTERVAL_FALL);
    let upper = (best..=last).find(|k| fall(*k) > INTERVAL_FALL);
    // Below one step of the grid the parabola gives the interval.
    let half = (INTERVAL_FALL / (0.5 * curvature).max(f64::MIN_POSITIVE)).sqrt();
    let ends = [
        lower.map_or(0.0, |k| (value - half).max(k as f64)),
        upper.map_or(last as f64, |k| (value + half).min(k as f64)),
    ];
    let seconds = |steps: f64| steps.max(0.0) * DELAY_STEP;
    ServoDelay {
        drive,
        value: seconds(value),
        interval: Some(ends.map(seconds)),
        std: (ends[1] - ends[0]) * DELAY_STEP / (2.0 * INTERVAL_FALL.sqrt()),
        is_open: upper.is_none(),
    }
}
