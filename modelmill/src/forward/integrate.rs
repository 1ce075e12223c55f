//! Integration of the equation of motion over one sampling interval: classical Runge-Kutta steps of the fourth order,
//! with reversals located and drives that stick.
//!
//! Decision: the integrator is written here. Kept crates (`diffsol`, `ode_solvers`, `differential-equations`)
//! integrate smooth equations with events; dry friction needs a set of sticking places that changes at events, which
//! none of them has. The rest is one page.

use modelmill_codegen::PoseFault;
use modelmill_identify::float_to_count;

use super::plant::MotionPlant;
use super::thresholds::{MOST_EVENTS, STOPPED_PART};
use crate::segment::computed_forces::ComputedForces;

/// State of a simulation.
#[derive(Clone, Debug)]
pub(super) struct MotionState {
    /// Positions of the independent coordinates, rad or m.
    pub(super) q: Vec<f64>,
    /// Their rates.
    pub(super) qd: Vec<f64>,
    /// Places that stick, in increasing order.
    stuck: Vec<usize>,
}

/// Forces of the drives between two samples.
pub(super) struct ForceInterval<'a> {
    /// Recorded forces at the start; they are interpolated linearly.
    pub(super) start: &'a [f64],
    /// Recorded forces at the end.
    pub(super) end: &'a [f64],
    /// Times of both samples, s.
    pub(super) time: [f64; 2],
    /// Actuators whose forces follow from their signals and the simulated motion, in place of recorded ones.
    pub(super) computed: Option<&'a ComputedForces>,
}

impl ForceInterval<'_> {
    /// Forces at a part of the interval, 0 to 1, and a state.
    pub(super) fn forces_at(
        &self,
        plant: &MotionPlant<'_>,
        part: f64,
        [q, qd]: [&[f64]; 2],
    ) -> Result<Vec<f64>, PoseFault> {
        let pairs = self.start.iter().zip(self.end);
        let mut forces: Vec<f64> = pairs.map(|(a, b)| a + part * (b - a)).collect();
        let Some(computed) = self.computed else {
            return Ok(forces);
        };
        let [start, end] = self.time;
        let t = start + part * (end - start);
        let motion = plant.drive_motion(q, qd)?;
        for actuator in &computed.actuators {
            forces[actuator.drive] = 0.0;
        }
        for actuator in &computed.actuators {
            forces[actuator.drive] += actuator.force(&computed.time, t, motion[actuator.drive]);
        }
        Ok(forces)
    }
}

impl MotionState {
    /// A state in which no place sticks yet.
    pub(super) fn new(q: Vec<f64>, qd: Vec<f64>) -> Self {
        Self {
            q,
            qd,
            stuck: Vec::new(),
        }
    }

    /// Whether all values are finite.
    pub(super) fn is_finite(&self) -> bool {
        self.q.iter().chain(&self.qd).all(|value| value.is_finite())
    }
}

/// Advances a state over an interval of `duration` s.
///
/// Fails when a loop cannot close, or when the mechanism is singular.
pub(super) fn advance(
    plant: &MotionPlant<'_>,
    state: &mut MotionState,
    duration: f64,
    forces: &ForceInterval<'_>,
) -> Result<(), PoseFault> {
    let steps = float_to_count((duration / plant.longest_step() - 1e-6).ceil().max(1.0));
    for k in 0..steps {
        let [start, end] = [k, k + 1].map(|k| k as f64 / steps as f64);
        advance_step(plant, state, duration, [start, end], forces)?;
    }
    Ok(())
}

/// Advances a state over one step, from one part of the interval to another, with the events in it.
fn advance_step(
    plant: &MotionPlant<'_>,
    state: &mut MotionState,
    duration: f64,
    [mut start, end]: [f64; 2],
    forces: &ForceInterval<'_>,
) -> Result<(), PoseFault> {
    if plant.n_places() == 0 {
        *state = runge_kutta(plant, state, duration, [start, end], forces)?;
        return Ok(());
    }
    for event in 0..=MOST_EVENTS {
        let at = |part: f64, state: &MotionState| forces.forces_at(plant, part, [&state.q, &state.qd]);
        release(plant, state, &at(start, state)?)?;
        let next = runge_kutta(plant, state, duration, [start, end], forces)?;
        let before = plant.place_rates(&state.q, &state.qd)?;
        // Stages beyond a reversal turn the friction around, so that the end of the step may not show it. The slope
        // at the start does.
        let slope = plant.accelerations(&state.q, &state.qd, &at(start, state)?, &state.stuck)?;
        let h = duration * (end - start);
        let predicted: Vec<f64> = state.qd.iter().zip(&slope).map(|(v, a)| v + h * a).collect();
        let predicted = plant.place_rates(&state.q, &predicted)?;
        let reached = plant.place_rates(&next.q, &next.qd)?;
        let lowest = |(a, b, start): (f64, f64, f64)| if start > 0.0 { a.min(b) } else { a.max(b) };
        let all = predicted.iter().zip(&reached).zip(&before);
        let after: Vec<f64> = all.map(|((a, b), start)| lowest((*a, *b, *start))).collect();
        // The first reversal of a place that has dry friction, by linear interpolation of the rate.
        let mut first: Option<(f64, usize)> = None;
        for place in 0..plant.n_places() {
            if state.stuck.contains(&place) || before[place] * after[place] >= 0.0 {
                continue;
            }
            let part = before[place] / (before[place] - after[place]);
            if first.is_none_or(|(other, _)| part < other)
                && plant.has_dry_friction(&next.q, &next.qd, &at(end, &next)?, place)?
            {
                first = Some((part, place));
            }
        }
        let Some((part, place)) = first.filter(|_| event < MOST_EVENTS) else {
            *state = next;
            break;
        };
        let middle = start + part * (end - start);
        let mut reached = runge_kutta(plant, state, duration, [start, middle], forces)?;
        // A reversal that was predicted and did not happen is no stop.
        let rate = plant.place_rates(&reached.q, &reached.qd)?[place];
        if rate * before[place] <= 0.0 || rate.abs() < STOPPED_PART * before[place].abs() {
            reached.stuck.push(place);
            reached.stuck.sort_unstable();
            reached.qd = plant.stopped(&reached.q, &reached.qd, &reached.stuck)?;
        }
        *state = reached;
        start = middle;
        if end - start < 1e-9 {
            break;
        }
    }
    Ok(())
}

/// Releases the places whose dry friction is too small to keep them at standstill, each in the direction of the load.
fn release(plant: &MotionPlant<'_>, state: &mut MotionState, forces: &[f64]) -> Result<(), PoseFault> {
    while !state.stuck.is_empty() {
        let balance = plant.stick_balance(&state.q, &state.qd, forces, &state.stuck)?;
        let loads = balance.loads.iter().enumerate();
        let Some((at, load)) = loads.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())) else {
            break;
        };
        if load.abs() <= 1.0 {
            break;
        }
        let place = state.stuck.remove(at);
        let moves = plant.direction(&state.q, place, &state.stuck, load.signum())?;
        for (rate, small) in state.qd.iter_mut().zip(moves) {
            *rate += small;
        }
    }
    Ok(())
}

/// One step of Runge and Kutta, from one part of the interval to another, with the places that stick at its start.
fn runge_kutta(
    plant: &MotionPlant<'_>,
    state: &MotionState,
    duration: f64,
    [start, end]: [f64; 2],
    forces: &ForceInterval<'_>,
) -> Result<MotionState, PoseFault> {
    let h = duration * (end - start);
    let sum =
        |a: &[f64], factor: f64, b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a + factor * b).collect() };
    let slope = |q: &[f64], qd: &[f64], part: f64| {
        let forces = forces.forces_at(plant, part, [q, qd])?;
        plant.accelerations(q, qd, &forces, &state.stuck)
    };
    let middle = 0.5 * (start + end);
    let a1 = slope(&state.q, &state.qd, start)?;
    let v2 = sum(&state.qd, 0.5 * h, &a1);
    let a2 = slope(&sum(&state.q, 0.5 * h, &state.qd), &v2, middle)?;
    let v3 = sum(&state.qd, 0.5 * h, &a2);
    let a3 = slope(&sum(&state.q, 0.5 * h, &v2), &v3, middle)?;
    let v4 = sum(&state.qd, h, &a3);
    let a4 = slope(&sum(&state.q, h, &v3), &v4, end)?;
    let mean = |one: &[f64], two: &[f64], three: &[f64], four: &[f64]| -> Vec<f64> {
        (0..one.len())
            .map(|k| (one[k] + 2.0 * two[k] + 2.0 * three[k] + four[k]) / 6.0)
            .collect()
    };
    let mut next = MotionState {
        q: sum(&state.q, h, &mean(&state.qd, &v2, &v3, &v4)),
        qd: sum(&state.qd, h, &mean(&a1, &a2, &a3, &a4)),
        stuck: state.stuck.clone(),
    };
    if !next.stuck.is_empty() {
        next.qd = plant.stopped(&next.q, &next.qd, &next.stuck)?;
    }
    Ok(next)
}
