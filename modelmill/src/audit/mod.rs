//! Checks of a recording with the model, before any result is computed: delays between force and motion, forces that
//! were measured on the motor side of a gear, contacts and pushes. All findings become notes. Wrong columns and the
//! direction of gravity are faults of recordings, which have a list of their own in `faults`.

mod delay;
pub(crate) mod events;
mod nominal_forces;
pub(crate) mod rows;
mod thresholds;

use modelmill_codegen::{ModelEvaluator, MotionStates};
use modelmill_identify::RecordingNote;
use nalgebra::{DMatrix, DVector};

use crate::model::Model;
use crate::segment::RecordingSegment;
pub(crate) use delay::ForceDelayAudit;
use thresholds::AUDIT_FEWEST_SAMPLES;

/// Largest number of samples, spread over the recording; fewer for many drives, but at least [`FEWEST_LOOKED_AT`].
const LOOKED_AT: usize = 1500;
/// Largest number of rows, over all drives.
const ROWS_LOOKED_AT: usize = 12_000;
/// Smallest number of samples, even for many drives.
const FEWEST_LOOKED_AT: usize = 300;

/// Notes on forces measured on the motor side of a gear, or on delays if there are none.
pub(crate) fn examine_forces(
    model: &Model,
    data: &RecordingSegment,
    delays: Option<&ForceDelayAudit>,
) -> Vec<RecordingNote> {
    let file = &data.run.file;
    let before_gear = nominal_forces::gear_note(&model.derivation.mechanism, &gear_factors(model, data), file);
    // A delay is reported only if nothing else is suspicious.
    let found = before_gear.or_else(|| delays.and_then(|late| late.delay_note(file)));
    found.into_iter().collect()
}

/// For each drive the factor by which its force is smaller than with the nominal values, with its sign, if that is
/// typical of a gear; empty for recordings that are too short or without forces.
pub(crate) fn gear_factors(model: &Model, data: &RecordingSegment) -> Vec<Option<f64>> {
    let n = data.samples();
    let Some(forces) = data.run.force.as_deref().filter(|_| n > AUDIT_FEWEST_SAMPLES) else {
        return Vec::new();
    };
    // Samples are spread evenly over the recording.
    let wanted = (ROWS_LOOKED_AT / forces.len().max(1)).clamp(FEWEST_LOOKED_AT, LOOKED_AT);
    let samples: Vec<usize> = (0..n).step_by((n / wanted).max(1)).collect();
    // Poses without a solution are reported with their place when the complete recording is evaluated.
    let Some(regressor) = regressor(model, data, &samples) else {
        return Vec::new();
    };
    let expected = regressor * DVector::from_column_slice(&model.values);
    let of_drive = |d: usize| {
        // Rows are interleaved by drive.
        let expected: Vec<f64> = expected.iter().skip(d).step_by(forces.len()).copied().collect();
        let measured: Vec<f64> = samples.iter().map(|k| forces[d][*k]).collect();
        nominal_forces::gear_factor(&measured, &expected)
    };
    (0..forces.len()).map(of_drive).collect()
}

/// Adds notes on contacts and pushes. With `leave_out`, forces during these are excluded.
pub(crate) fn examine_events(model: &Model, data: &mut RecordingSegment, leave_out: bool) {
    for note in events::event_notes(model, data, leave_out) {
        data.note(model, note);
    }
}

/// The regressor at some samples; `None` if a pose has no solution.
fn regressor(model: &Model, data: &RecordingSegment, samples: &[usize]) -> Option<DMatrix<f64>> {
    let run = &data.run;
    let pick = |columns: &[Vec<f64>]| rows::select_samples(columns, samples);
    let states = [&run.q, &run.qd, &run.qdd].map(|columns| pick(columns));
    let load = pick(run.force.as_deref().unwrap_or(&[]));
    let states = MotionStates {
        q: states[0].iter().map(Vec::as_slice).collect(),
        qd: states[1].iter().map(Vec::as_slice).collect(),
        qdd: states[2].iter().map(Vec::as_slice).collect(),
        load: load.iter().map(Vec::as_slice).collect(),
    };
    ModelEvaluator::new(&model.derivation).regressor(&states).ok()
}
