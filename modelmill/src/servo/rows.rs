//! Equations of a servo log: rows of the regressor along a segment with delayed signals, and the samples that count.

use modelmill_codegen::ModelEvaluator;
use modelmill_identify::differentiate_by_seven_points;
use modelmill_spec::ModelActuator;

use super::ServoModel;
use super::direction::DirectionColumns;
use super::forces::ActuatorStates;
use super::gains::GainValues;
use super::thresholds::{LARGEST_DELAY, MOST_SAMPLES, SATURATION_SHARE};
use super::turns::turn_offset;
use crate::along;
use crate::error::Outcome;
use crate::segment::RecordingSegment;

/// Equations of one segment, interleaved per sample.
#[derive(Clone)]
pub(super) struct EquationRows {
    /// Rows of the regressor, `[sample][row][base parameter]`; zero where an equation does not count.
    pub(super) regressor: Vec<f64>,
    /// Measured forces, `[sample][row]`; zero for drives with actuators.
    pub(super) measured: Vec<f64>,
}

/// The samples of a segment that are used, with the equations that count there.
pub(super) struct UsedSamples {
    /// The segment without its first samples, which a delay would need from before its start.
    pub(super) segment: RecordingSegment,
    /// `counts[row][sample]`, by position among the rows of bodies.
    pub(super) counts: Vec<Vec<bool>>,
    /// Which samples are away from reversals, indexed as `counts`.
    pub(super) between_reversals: Vec<Vec<bool>>,
    /// The columns that jump at a reversal.
    direction: DirectionColumns,
    /// The complete segment, from which delayed signals are taken.
    complete: RecordingSegment,
    /// Positions of the drives, `[drive][sample]`.
    positions: Vec<Vec<f64>>,
}

impl UsedSamples {
    /// Selects at most `most` samples of a segment, evenly.
    ///
    /// Fails when a pose has no solution.
    pub(super) fn new(servo: &ServoModel, complete: &RecordingSegment, most: usize) -> Outcome<Self> {
        let is_commanded = servo.actuators().iter().any(|actuator| actuator.kind.is_commanded());
        let complete = if is_commanded {
            with_accurate_derivatives(complete)
        } else {
            complete.clone()
        };
        let time = &complete.run.time;
        let start = time.first().copied().unwrap_or(0.0) + LARGEST_DELAY;
        let first = time.partition_point(|t| *t < start);
        let every = (time.len() - first).div_ceil(most.clamp(1, MOST_SAMPLES)).max(1);
        let places: Vec<usize> = (first..time.len()).step_by(every).collect();
        let segment = pick(&complete, &places);
        let direction = DirectionColumns::new(servo, &segment);
        let chosen = direction.choose_samples(servo, &segment)?;
        let [positions, _] = along::drive_motion(&servo.equations, &segment)?;
        Ok(Self {
            segment,
            counts: chosen.counts,
            between_reversals: chosen.between_reversals,
            direction,
            complete,
            positions,
        })
    }

    /// The used samples with signals delayed, `delays` in s by actuator. Commands are those that have the same effect on a
    /// servo without a dead band.
    pub(super) fn delayed(&self, servo: &ServoModel, delays: &[f64]) -> RecordingSegment {
        let mut segment = self.segment.clone();
        let from = &self.complete.run;
        let turns = self.added_turns(servo);
        for ((actuator, delay), turns) in servo.actuators().iter().zip(delays).zip(turns) {
            let i = servo.signal_position(actuator);
            let (q, qd, qdd) = (&from.q[i], &from.qd[i], &from.qdd[i]);
            let position = &self.positions[actuator.drive.0];
            for (sample, t) in self.segment.run.time.iter().enumerate() {
                let [value, rate, acceleration] = interpolate(&from.time, [q, qd, qdd], t - delay);
                segment.run.q[i][sample] = actuator.effective_signal(value + turns, position[sample]);
                segment.run.qd[i][sample] = rate;
                segment.run.qdd[i][sample] = acceleration;
            }
        }
        segment
    }

    /// The full turns that are added to the command of each actuator, rad.
    pub(super) fn added_turns(&self, servo: &ServoModel) -> Vec<f64> {
        let all = servo.actuators().iter().map(|actuator| {
            let command = &self.segment.run.q[servo.signal_position(actuator)];
            turn_offset(actuator, command, &self.positions[actuator.drive.0])
        });
        all.collect()
    }

    /// Leaves out the samples at which an actuator requests nearly as much as its saturation, or more: its force is not
    /// that of its formula there.
    pub(super) fn leave_out_saturated(&mut self, servo: &ServoModel, delays: &[f64], gains: &GainValues) {
        let delayed = self.delayed(servo, delays);
        let Ok([_, rates]) = along::drive_motion(&servo.equations, &delayed) else {
            return;
        };
        for actuator in servo.actuators() {
            let (drive, i) = (actuator.drive.0, servo.signal_position(actuator));
            let Some(limit) = actuator.saturation else {
                continue;
            };
            let states = ActuatorStates {
                signal: delayed.run.q[i].clone(),
                signal_rate: delayed.run.qd[i].clone(),
                position: self.positions[drive].clone(),
                rate: rates[drive].clone(),
            };
            let unlimited = ModelActuator {
                saturation: None,
                dead_band: None,
                ..actuator.clone()
            };
            let row = servo.body_rows().iter().position(|d| *d == drive).unwrap_or(0);
            let forces = states.forces(&servo.equations, &unlimited, gains);
            for (counts, force) in self.counts[row].iter_mut().zip(forces) {
                *counts &= force.abs() < SATURATION_SHARE * limit;
            }
        }
    }

    /// The direction of a motion at the used samples, filtered as the columns of friction are; `rates` in rad/s or m/s.
    pub(super) fn filtered_direction(&self, rates: &[f64]) -> Vec<f64> {
        let direction = rates.iter().map(|rate| if *rate == 0.0 { 0.0 } else { rate.signum() });
        self.direction.filter_series(direction.collect())
    }

    /// The equations along a segment with the same samples.
    ///
    /// Fails when a pose has no solution.
    pub(super) fn equations(&self, servo: &ServoModel, segment: &RecordingSegment) -> Outcome<EquationRows> {
        let model = &servo.equations;
        let evaluator = ModelEvaluator::new(&model.derivation);
        let n_drives = model.row_names().len();
        let states = segment.states(0, segment.samples());
        let all = evaluator
            .regressor(&states)
            .map_err(|fault| segment.pose_error(model, fault, 0))?;
        let force = segment.run.force.as_deref().unwrap_or(&[]);
        let body_rows = servo.body_rows();
        let (mut regressor, mut measured) = (Vec::new(), Vec::new());
        for sample in 0..segment.samples() {
            for d in &body_rows {
                regressor.extend(all.row(sample * n_drives + d).iter());
            }
        }
        self.direction.filter(&mut regressor, body_rows.len(), model.base.len());
        let forces: Vec<Option<Vec<f64>>> = body_rows
            .iter()
            .map(|d| Some(self.direction.filter_series(force.get(*d)?.clone())))
            .collect();
        let rows = (0..segment.samples()).flat_map(|sample| (0..body_rows.len()).map(move |row| (sample, row)));
        for ((sample, row), columns) in rows.zip(regressor.chunks_exact_mut(model.base.len())) {
            let weight = f64::from(u8::from(self.counts[row][sample]));
            for x in columns {
                *x *= weight;
            }
            measured.push(weight * forces[row].as_ref().map_or(0.0, |force| force[sample]));
        }
        Ok(EquationRows { regressor, measured })
    }
}

/// A segment with derivatives that are accurate enough for the equations of a servo that follows its command, whose terms
/// nearly cancel. At uneven times the derivatives of the preparation stay. Where nothing cancels, central differences
/// have less noise.
fn with_accurate_derivatives(segment: &RecordingSegment) -> RecordingSegment {
    let mut accurate = segment.clone();
    let run = &mut accurate.run;
    for (q, (qd, qdd)) in run.q.iter().zip(run.qd.iter_mut().zip(&mut run.qdd)) {
        if let Some([rates, accelerations]) = differentiate_by_seven_points(&run.time, q) {
            (*qd, *qdd) = (rates, accelerations);
        }
    }
    accurate
}

/// A segment with some of its samples.
fn pick(segment: &RecordingSegment, places: &[usize]) -> RecordingSegment {
    let mut picked = segment.clone();
    let run = &mut picked.run;
    let columns = run.q.iter_mut().chain(&mut run.qd).chain(&mut run.qdd);
    for column in columns.chain(run.force.iter_mut().flatten()) {
        *column = places.iter().map(|at| column[*at]).collect();
    }
    run.left_out = run
        .left_out
        .iter()
        .map(|out| places.iter().map(|at| out[*at]).collect())
        .collect();
    run.lines = places.iter().filter_map(|at| run.lines.get(*at).copied()).collect();
    run.time = places.iter().map(|at| run.time[*at]).collect();
    picked.variance = None;
    picked.weights = None;
    picked.load = None;
    picked
}

/// Position, rate and acceleration of a signal at a time between its samples: cubic polynomials through values and
/// slopes, and a line for the acceleration. Before the first sample it has the first value.
fn interpolate(time: &[f64], [q, qd, qdd]: [&[f64]; 3], t: f64) -> [f64; 3] {
    let last = time.len() - 1;
    if t <= time[0] || last == 0 {
        return [q[0], qd[0], qdd[0]];
    }
    let b = time.partition_point(|x| *x < t).clamp(1, last);
    let a = b - 1;
    let h = time[b] - time[a];
    let s = (t - time[a]) / h;
    let cubic = |y: &[f64], slope: &[f64]| {
        let (s2, s3) = (s * s, s * s * s);
        (2.0 * s3 - 3.0 * s2 + 1.0) * y[a]
            + (s3 - 2.0 * s2 + s) * h * slope[a]
            + (3.0 * s2 - 2.0 * s3) * y[b]
            + (s3 - s2) * h * slope[b]
    };
    [cubic(q, qd), cubic(qd, qdd), qdd[a] + s * (qdd[b] - qdd[a])]
}
