//! Delays of signals that fit computed forces best, by one Gauss-Newton step of least squares.
//!
//! Segments with forces that were computed with first estimates of the delays go in; out come better estimates with
//! intervals. The equations are those of the model with usual friction and an offset of each drive: a model that lacks them
//! would have a wrong delay. Regressor and forces pass the filter of the preparation, which was chosen by these forces.

use std::collections::BTreeMap;

use modelmill_codegen::ModelEvaluator;
use modelmill_identify::RFactor;
use modelmill_identify::diagnose::ForceColumn;
use modelmill_identify::estimate::LeastSquares;

use super::delay::ServoDelay;
use super::thresholds::{DELAY_SAMPLES, HALF_INTERVAL, LARGEST_DELAY, LARGEST_DELAY_STEP};
use crate::along;
use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::regressors::regressor;
use crate::segment::RecordingSegment;

/// Delays that fit the forces of some segments best, and what the forces would add to those that the file gives, s. The
/// latter, and those of which the equations determine nothing, stay as they are.
///
/// Fails when a pose has no solution.
pub(super) fn refine_delays(
    model: &Model,
    segments: &[RecordingSegment],
    delays: &[ServoDelay],
) -> Outcome<(Vec<ServoDelay>, Vec<f64>)> {
    let mut refined = delays.to_vec();
    let mut shifts = vec![0.0; delays.len()];
    let Some(equations) = DelayEquations::new(model, segments)? else {
        return Ok((refined, shifts));
    };
    for (actuator, step, std) in equations.steps(model)? {
        let one = &mut refined[actuator];
        // A step beyond the range of the search means that the equations determine nothing.
        if !std.is_finite() || step.abs() > LARGEST_DELAY_STEP {
            continue;
        }
        if one.interval.is_none() {
            shifts[actuator] = step;
            continue;
        }
        one.value = (one.value + step).clamp(0.0, LARGEST_DELAY);
        one.std = std;
        one.interval = Some([-1.0, 1.0].map(|sign: f64| (one.value + sign * HALF_INTERVAL * std).max(0.0)));
    }
    Ok((refined, shifts))
}

/// The equation of a drive at one sample.
#[derive(Clone)]
struct DelayRow {
    /// The columns.
    columns: Vec<f64>,
    /// The force.
    force: f64,
    /// Whether the row before is that of the sample before: no sample was left out, and no segment begins.
    follows: bool,
}

/// The equations of all drives at the samples that count.
struct DelayEquations {
    /// For each drive its rows.
    rows: Vec<Vec<DelayRow>>,
    /// The actuator of each of the last columns, with its drive.
    actuators: Vec<(usize, usize)>,
    /// Number of columns.
    width: usize,
}

impl DelayEquations {
    /// `None` without computed forces.
    fn new(model: &Model, segments: &[RecordingSegment]) -> Outcome<Option<Self>> {
        let n_drives = model.row_names().len();
        // The same actuators in all segments: recordings may lack some of the signals.
        let mut places: BTreeMap<usize, usize> = BTreeMap::new();
        for one in segments.iter().filter_map(|one| one.computed.as_ref()) {
            places.extend(one.delays.iter().map(|delay| (delay.actuator, delay.drive)));
        }
        let has_forces = segments.iter().all(|one| one.run.force.is_some());
        if places.is_empty() || !has_forces {
            return Ok(None);
        }
        let actuators: Vec<(usize, usize)> = places.into_iter().collect();
        let estimated: Vec<usize> = (0..model.base.len()).filter(|k| !model.is_known(*k)).collect();
        let usual = estimated.len();
        let width = usual + 3 * n_drives + actuators.len();
        let mut rows = vec![Vec::new(); n_drives];
        for one in segments {
            let base = regressor(&[(one, false)], &ModelEvaluator::new(&model.derivation), model)?;
            let measured = along::measured_forces(one)?;
            let filtered = |columns| along::filter_and_decimate(columns, one);
            let rates = along::drive_rates(model, one)?;
            let sign = |v: &f64| if *v == 0.0 { 0.0 } else { v.signum() };
            let signs = filtered(rates.iter().map(|rate| rate.iter().map(sign).collect()).collect())?;
            let rates = filtered(rates)?;
            let slopes = filtered(one.delay_sensitivities())?;
            let of_slopes: Vec<usize> = one
                .computed
                .iter()
                .flat_map(|computed| computed.delays.iter().map(|delay| delay.actuator))
                .collect();
            let value = |column: &ForceColumn, drive: usize, i: usize| {
                column
                    .0
                    .get(drive)
                    .and_then(Option::as_ref)
                    .map_or(0.0, |values| values[i])
            };
            let every = measured[0].len().div_ceil(DELAY_SAMPLES).max(1);
            for (drive, rows) in rows.iter_mut().enumerate() {
                let mut follows = false;
                for i in (0..measured[drive].len()).step_by(every) {
                    if one.has_excluded_input(drive, i) {
                        follows = false;
                        continue;
                    }
                    let mut row = vec![0.0; width];
                    let mut force = measured[drive][i];
                    for (k, column) in base.iter().enumerate().filter(|(k, _)| model.is_known(*k)) {
                        force -= model.values[k] * value(column, drive, i);
                    }
                    for (at, k) in estimated.iter().enumerate() {
                        row[at] = value(&base[*k], drive, i);
                    }
                    row[usual + 3 * drive..usual + 3 * drive + 3].copy_from_slice(&[
                        rates[drive][i],
                        signs[drive][i],
                        1.0,
                    ]);
                    for (at, (actuator, of_drive)) in actuators.iter().enumerate().filter(|(_, one)| one.1 == drive) {
                        debug_assert_eq!(*of_drive, drive, "the slope of another drive");
                        // With a delay `T + step`, the force would be larger by the slope times the step.
                        if let Some(k) = of_slopes.iter().position(|one| one == actuator) {
                            row[usual + 3 * n_drives + at] = -slopes[k][i];
                        }
                    }
                    rows.push(DelayRow {
                        columns: row,
                        force,
                        follows,
                    });
                    follows = true;
                }
            }
        }
        Ok(Some(Self { rows, actuators, width }))
    }

    /// For each actuator the step from its delay to the best one, with its standard deviation, s.
    fn steps(&self, model: &Model) -> Outcome<Vec<(usize, f64, f64)>> {
        let failed = |error: modelmill_identify::LeastSquaresError| {
            Error::input(format!("{}: the delay of a servo was not found: {error}", model.path))
        };
        let all = || self.rows.iter().flatten();
        let used: Vec<usize> = (0..self.width)
            .filter(|k| all().any(|row| row.columns[*k] != 0.0))
            .collect();
        let pick = |row: &[f64]| -> Vec<f64> { used.iter().map(|k| row[*k]).collect() };
        // Drives have equal weights first, then those of their residuals.
        let mut scales: Vec<f64> = self
            .rows
            .iter()
            .map(|rows| rms(rows.iter().map(|row| row.force)))
            .collect();
        let mut lags = vec![0.0; self.rows.len()];
        let mut solution = None;
        for _ in 0..3 {
            let mut regression = LeastSquares::new(used.len());
            for (rows, scale) in self.rows.iter().zip(&scales).filter(|(_, scale)| **scale > 0.0) {
                for row in rows {
                    let columns: Vec<f64> = pick(&row.columns).into_iter().map(|x| x / scale).collect();
                    regression.add_rows(&columns, &[row.force / scale]).map_err(failed)?;
                }
            }
            let found = RFactor::new(&regression)
                .solve_near(&vec![0.0; used.len()])
                .map_err(failed)?;
            for ((rows, scale), lag) in self.rows.iter().zip(&mut scales).zip(&mut lags) {
                let residual: Vec<f64> = rows
                    .iter()
                    .map(|row| {
                        let columns = pick(&row.columns);
                        let fitted = columns.iter().zip(&found.values).map(|(x, p)| x * p).sum::<f64>();
                        row.force - fitted
                    })
                    .collect();
                *scale = rms(residual.iter().copied()).max(f64::MIN_POSITIVE);
                *lag = neighbour_correlation(&residual, rows.iter().map(|row| row.follows));
            }
            solution = Some(found);
        }
        let Some(solution) = solution else {
            return Ok(Vec::new());
        };
        let covariance = solution.unit_covariance();
        let first = self.width - self.actuators.len();
        let steps = self.actuators.iter().enumerate().filter_map(|(at, (actuator, drive))| {
            let k = used
                .iter()
                .position(|k| *k == first + at)
                .filter(|k| solution.determined[*k])?;
            let inflation = (1.0 + lags[*drive]) / (1.0 - lags[*drive]);
            Some((*actuator, solution.values[k], (covariance[(k, k)] * inflation).sqrt()))
        });
        Ok(steps.collect())
    }
}

/// The correlation of residuals of neighbours in time, 0 to 0.999. `follows` states of each residual whether it follows the
/// one before it in time, without a gap.
pub(super) fn neighbour_correlation(residual: &[f64], follows: impl Iterator<Item = bool>) -> f64 {
    let pairs = residual.windows(2).zip(follows.skip(1)).filter(|(_, follows)| *follows);
    let (products, squares) = pairs.fold((0.0, 0.0), |(products, squares), (pair, _)| {
        (
            products + pair[0] * pair[1],
            squares + 0.5 * (pair[0] * pair[0] + pair[1] * pair[1]),
        )
    });
    if squares > 0.0 {
        f64::clamp(products / squares, 0.0, 0.999)
    } else {
        0.0
    }
}

/// Root mean square.
fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0_usize), |(sum, n), x| (sum + x * x, n + 1));
    (sum / n.max(1) as f64).sqrt()
}
