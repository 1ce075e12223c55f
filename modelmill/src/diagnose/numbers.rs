//! Values along all recordings of a diagnosis: forces, variables and motions of places. Recordings are stacked
//! one after the other, and all columns are decimated alike.

use modelmill_codegen::ModelEvaluator;
use modelmill_identify::diagnose::{SampleLayout, SampleSegment as LaidOut};
use modelmill_spec::EffectPlace;

use crate::along::filter_and_decimate;
use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::regressors::SegmentList;
use crate::segment::RecordingSegment;

/// Names of the channels, lengths of the segments, and samples that are left out.
pub(crate) fn layout(model: &Model, all: &SegmentList<'_>) -> SampleLayout {
    let stretch = |(one, is_check): &(&RecordingSegment, bool)| {
        let time = one.time();
        let mean = |time: &[f64]| match time {
            [first, .., last] => (last - first) / (time.len() - 1) as f64,
            _ => 1.0,
        };
        LaidOut {
            name: one.run.file.clone(),
            samples: time.len(),
            start: time.first().copied().unwrap_or(0.0),
            step: mean(&time),
            recorded_step: mean(&one.run.time),
            is_check: *is_check,
        }
    };
    let all_count = (all.iter()).all(|(one, _)| one.run.left_out.iter().flatten().all(|out| !out));
    // A decimated sample is left out if its filter used an excluded force.
    let of_drive = |drive: usize| {
        let of = |(one, _): &(&RecordingSegment, bool)| -> Vec<bool> {
            let kept = 0..one.time().len();
            kept.map(|i| one.has_excluded_input(drive, i)).collect()
        };
        all.iter().flat_map(of).collect()
    };
    // Without left-out samples the layout has no masks, which saves memory.
    let drives = if all_count { 0 } else { model.row_names().len() };
    SampleLayout {
        channels: model.row_names(),
        segments: all.iter().map(stretch).collect(),
        left_out: (0..drives).map(of_drive).collect(),
    }
}

/// Channels of all recordings one after the other, decimated like the forces.
pub(crate) fn stack(
    all: &SegmentList<'_>,
    mut of: impl FnMut(&RecordingSegment) -> Outcome<Vec<Vec<f64>>>,
) -> Outcome<Vec<Vec<f64>>> {
    let mut stacked: Vec<Vec<f64>> = Vec::new();
    for (one, _) in all {
        let columns = of(one)?;
        stacked.resize(columns.len().max(stacked.len()), Vec::new());
        for (whole, column) in stacked.iter_mut().zip(filter_and_decimate(columns, one)?) {
            whole.extend(column);
        }
    }
    Ok(stacked)
}

/// Variables on which an unknown force may depend: position, rate and acceleration of each active coordinate.
pub(crate) fn variables(model: &Model, all: &SegmentList<'_>) -> Vec<(String, Vec<f64>)> {
    let mut variables = Vec::new();
    for (i, name) in model.active_coordinates().into_iter().enumerate() {
        for (suffix, order) in [("", 0), ("_d", 1), ("_dd", 2)] {
            let of = |one: &RecordingSegment| -> Vec<f64> {
                let run = &one.run;
                let values = [&run.q, &run.qd, &run.qdd][order];
                values[i].iter().copied().step_by(one.decimation()).collect()
            };
            let values = all.iter().flat_map(|(one, _)| of(one)).collect();
            variables.push((format!("{name}{suffix}"), values));
        }
    }
    variables
}

/// Motions of drives and coordinates along all recordings.
pub(crate) struct PlaceMotions {
    /// Positions of the drives, then their rates, then derivatives by the active coordinates.
    drives: Vec<Vec<f64>>,
    /// Indices of the active coordinates.
    active: Vec<usize>,
    /// Their positions and rates.
    active_motion: Vec<[Vec<f64>; 2]>,
    /// Indices of the passive coordinates.
    passive: Vec<usize>,
    /// Their positions, then their rates.
    passive_motion: Vec<Vec<f64>>,
}

impl PlaceMotions {
    /// Evaluates all motions once.
    ///
    /// Fails when a pose has no solution.
    pub(crate) fn new(model: &Model, all: &SegmentList<'_>) -> Outcome<Self> {
        let evaluator = ModelEvaluator::new(&model.derivation);
        let (active, passive) = model.derivation.coordinates();
        let drives = stack_states(all, model, |states| evaluator.drive_motion(states))?;
        // Without passive coordinates there is nothing to compute.
        let passive_motion = if passive.is_empty() {
            Vec::new()
        } else {
            stack_states(all, model, |states| evaluator.passive_motion(states))?
        };
        let motion = |order: usize, i: usize| -> Vec<f64> {
            let one = |(data, _): &(&RecordingSegment, bool)| [&data.run.q, &data.run.qd][order][i].clone();
            all.iter().flat_map(one).collect()
        };
        Ok(Self {
            drives,
            active_motion: (0..active.len()).map(|i| [motion(0, i), motion(1, i)]).collect(),
            active,
            passive,
            passive_motion,
        })
    }

    /// Largest rate (per s) and travel of a place; zero for a place that does not move.
    pub(crate) fn scale(&self, place: EffectPlace) -> [f64; 2] {
        // Columns of the evaluator: positions, rates, and one derivative for each active coordinate.
        let n = self.drives.len() / (2 + self.active.len()).max(1);
        let found = match place {
            EffectPlace::Drive(d) => Some((&self.drives[n + d.0], &self.drives[d.0])),
            EffectPlace::Coordinate(i) => {
                let at = |list: &[usize]| list.iter().position(|k| *k == i.0);
                let passive =
                    at(&self.passive).map(|k| (&self.passive_motion[self.passive.len() + k], &self.passive_motion[k]));
                let active = at(&self.active).map(|k| &self.active_motion[k]);
                active.map(|[q, qd]| (qd, q)).or(passive)
            }
            _ => None,
        };
        // The scale of searched constants: largest rate, and travel.
        let largest = |values: &[f64]| values.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let travel = |values: &[f64]| {
            let low = values.iter().copied().fold(f64::INFINITY, f64::min);
            let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            high - low
        };
        found.map_or([0.0; 2], |(rate, value)| [largest(rate), travel(value)])
    }
}

/// Values of a function of the states along all recordings, one after the other, without decimation.
///
/// Fails when a pose has no solution.
fn stack_states(
    all: &SegmentList<'_>,
    model: &Model,
    mut evaluate: impl FnMut(&modelmill_codegen::MotionStates<'_>) -> Result<Vec<Vec<f64>>, modelmill_codegen::PoseFault>,
) -> Outcome<Vec<Vec<f64>>> {
    let mut stacked: Vec<Vec<f64>> = Vec::new();
    // The first block determines the number of columns.
    for (one, _) in all {
        one.for_each_block(model, |states| {
            Ok::<_, Error>(evaluate(states).map(|columns| {
                stacked.resize(columns.len(), Vec::new());
                for (whole, column) in stacked.iter_mut().zip(columns) {
                    whole.extend(column);
                }
            }))
        })?;
    }
    Ok(stacked)
}
