//! Simulated positions compared with recorded ones over horizons: recordings go in, rms errors for each horizon and
//! coordinate come out, with the longest horizon over which they depend on the model.
//!
//! Decision: the growth of a small disturbance of the first state bounds the horizons. Beyond this bound, errors come
//! from the encoder and the first state, whatever the model.

use modelmill_identify::float_to_count;
use rayon::prelude::*;

use crate::error::Outcome;
use crate::model::Model;
use crate::recording::PreparedRecording;
use crate::segment::RecordingSegment;

use super::plant::MotionPlant;
use super::thresholds::{DISTURBANCE, HORIZONS_S, MOST_GROWTH, MOST_SIMULATED_S};
use super::{SimulationCursor, SimulationInput, rollout};

/// Position errors of a simulated model over several horizons.
#[derive(Clone, Debug, PartialEq)]
pub struct ForwardComparison {
    /// What drives the simulated model.
    pub input: SimulationInput,
    /// Names of the active (independent) coordinates, as in [`Model::active_coordinates`].
    pub coordinates: Vec<String>,
    /// Whether each coordinate is an angle (rad) or a length (m).
    pub is_angle: Vec<bool>,
    /// The errors, the shortest horizon first; the last one is the longest whole run.
    pub horizons: Vec<HorizonError>,
    /// The longest time over which an error of the initial state grows by less than a factor of 100, s. Over longer
    /// horizons, the position errors do not show whether the model is correct. `None` if the factor is not reached
    /// within the recordings.
    pub longest_horizon: Option<f64>,
}

/// Position errors over one horizon.
#[derive(Clone, Debug, PartialEq)]
pub struct HorizonError {
    /// Length of the horizon, s.
    pub seconds: f64,
    /// Whether it is the whole run.
    pub is_whole_run: bool,
    /// Number of simulations, each from a recorded state.
    pub windows: usize,
    /// Simulations that ended early, since the motion left the reach of the mechanism.
    pub ended_early: usize,
    /// Rms error of each coordinate over all samples of all simulations, rad or m; `None` if none was finished, or
    /// the horizon is not judged.
    pub rms: Option<Vec<f64>>,
    /// Largest error of each coordinate, rad or m; `None` as for `rms`.
    pub largest: Option<Vec<f64>>,
    /// Whether the horizon is short enough for a statement about the model; others are not simulated.
    pub is_judged: bool,
}

impl Model {
    /// Compares simulated with recorded positions over horizons of 0.1 s, 1 s and the whole run. Simulations start at
    /// recorded states. `values` are those of the base parameters.
    ///
    /// Fails if a recording has no forces, or the model has free bodies.
    pub fn compare_forward(&self, recordings: &[&PreparedRecording], values: &[f64]) -> Outcome<ForwardComparison> {
        self.compare_over(recordings, values, &HORIZONS_S)
    }

    /// As [`Model::compare_forward`], over other horizons than 0.1 s and 1 s, in s, in increasing order.
    pub(crate) fn compare_over(
        &self,
        recordings: &[&PreparedRecording],
        values: &[f64],
        seconds: &[f64],
    ) -> Outcome<ForwardComparison> {
        let dynamics = self.forward_programs()?;
        let segments: Vec<&RecordingSegment> = recordings.iter().flat_map(|one| &one.segments).collect();
        let plants: Vec<MotionPlant<'_>> = segments
            .iter()
            .map(|segment| MotionPlant::new(self, &dynamics, values, segment))
            .collect();
        self.host().run_job("simulating forward in time", 0, |_| {
            let longest_horizon = divergence_horizon(&plants, &segments)?;
            let whole = segments.iter().map(|one| duration(one)).fold(0.0, f64::max);
            let shorter = seconds.iter().filter(|seconds| **seconds < whole);
            let all: Vec<(f64, bool)> = shorter.map(|s| (*s, false)).chain([(whole, true)]).collect();
            // Horizons that say nothing about the model are not simulated.
            let one = |(seconds, is_whole_run): (f64, bool)| {
                let is_judged = longest_horizon.is_none_or(|longest| seconds <= longest);
                horizon_error(&plants, &segments, seconds, is_whole_run, is_judged)
            };
            let horizons = all.into_iter().map(one).collect::<Outcome<Vec<_>>>()?;
            Ok(ForwardComparison {
                input: SimulationInput::from_segments(&segments),
                coordinates: self.active_coordinates(),
                is_angle: self
                    .active_coordinate_types()
                    .into_iter()
                    .map(|(_, is_angle)| is_angle)
                    .collect(),
                horizons,
                longest_horizon,
            })
        })?
    }
}

/// Errors over one horizon, or over whole segments.
///
/// Fails when a recording has no forces.
fn horizon_error(
    plants: &[MotionPlant<'_>],
    segments: &[&RecordingSegment],
    seconds: f64,
    is_whole_run: bool,
    is_judged: bool,
) -> Outcome<HorizonError> {
    let windows: Vec<(usize, usize, usize)> = segments
        .iter()
        .enumerate()
        .filter(|_| is_judged)
        .flat_map(|(k, segment)| {
            let all = if is_whole_run {
                vec![[0, segment.samples()]]
            } else {
                windows(segment, seconds)
            };
            all.into_iter().map(move |[start, end]| (k, start, end))
        })
        .collect();
    let found = windows
        .par_iter()
        .map(|(k, start, end)| {
            let made = rollout(&plants[*k], segments[*k], [*start, *end])?;
            let run = &segments[*k].run;
            let errors: Vec<Vec<f64>> = (made.q.iter().zip(&run.q))
                .map(|(made, q)| made.iter().zip(&q[*start..]).map(|(a, b)| a - b).collect())
                .collect();
            Ok((errors, made.fault.is_some()))
        })
        .collect::<Outcome<Vec<_>>>()?;
    let n = segments.first().map_or(0, |one| one.run.q.len());
    let finished: Vec<&Vec<Vec<f64>>> = found
        .iter()
        .filter(|(_, is_early)| !is_early)
        .map(|(errors, _)| errors)
        .collect();
    let of_coordinate = |k: usize| finished.iter().flat_map(move |errors| errors[k].iter().copied());
    let rms = |k: usize| {
        let (sum, count) = of_coordinate(k).fold((0.0, 0), |(sum, count), e| (sum + e * e, count + 1));
        (sum / f64::from(count.max(1))).sqrt()
    };
    let largest = |k: usize| of_coordinate(k).map(f64::abs).fold(0.0, f64::max);
    let has_finished = !finished.is_empty();
    Ok(HorizonError {
        seconds,
        is_whole_run,
        windows: windows.len(),
        ended_early: found.len() - finished.len(),
        rms: has_finished.then(|| (0..n).map(rms).collect()),
        largest: has_finished.then(|| (0..n).map(largest).collect()),
        is_judged,
    })
}

/// First and last sample, exclusive, of the simulations of a segment.
fn windows(segment: &RecordingSegment, seconds: f64) -> Vec<[usize; 2]> {
    let time = &segment.run.time;
    let n = time.len();
    let mut all = Vec::new();
    let mut start = 0;
    while start < n {
        let end = time.partition_point(|t| *t <= time[start] + seconds * (1.0 + 1e-9));
        if end >= n {
            break;
        }
        // A window of its first state alone compares nothing.
        if end > start + 1 {
            all.push([start, end]);
        }
        start = end;
    }
    // Many windows are thinned out evenly.
    let most = float_to_count((MOST_SIMULATED_S / seconds).ceil().max(1.0));
    let every = all.len().div_ceil(most).max(1);
    all.into_iter().step_by(every).collect()
}

/// The time until a disturbance of the first state has grown by the largest allowed factor, the shortest over the
/// segments; `None` if it never does.
///
/// Fails when a recording has no forces.
fn divergence_horizon(plants: &[MotionPlant<'_>], segments: &[&RecordingSegment]) -> Outcome<Option<f64>> {
    let mut shortest: Option<f64> = None;
    for (plant, segment) in plants.iter().zip(segments) {
        let n = segment.run.q.len();
        // Neighbours are disturbed in the same direction, then in opposite ones.
        let alternating = |k: usize| if k.is_multiple_of(2) { DISTURBANCE } else { -DISTURBANCE };
        let offsets = [vec![0.0; n], vec![DISTURBANCE; n], (0..n).map(alternating).collect()];
        let cursors = offsets.iter().map(|offset| SimulationCursor::new(segment, 0, offset));
        let mut cursors = cursors.collect::<Outcome<Vec<_>>>()?;
        for sample in 1..segment.samples() {
            let is_lost = cursors.par_iter_mut().any(|cursor| cursor.step(plant).is_err());
            let distance = |other: &SimulationCursor<'_>| {
                let pairs = other.state.q.iter().zip(&cursors[0].state.q);
                pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
            };
            if is_lost || cursors.iter().any(|one| distance(one) > MOST_GROWTH * DISTURBANCE) {
                let time = segment.run.time[sample] - segment.run.time[0];
                shortest = Some(shortest.map_or(time, |other: f64| other.min(time)));
                break;
            }
        }
    }
    Ok(shortest)
}

/// Duration of a segment, s.
fn duration(segment: &RecordingSegment) -> f64 {
    let time = &segment.run.time;
    time.last().zip(time.first()).map_or(0.0, |(last, first)| last - first)
}
