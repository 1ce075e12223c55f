//! Disturbances that are known before the search: contacts, coarse quantisation, and differences between recordings of
//! the machine. All are reported and subtracted or left out, so that none is taken for an effect.

use modelmill_identify::diagnose::{DiagnosisProblem, Disturbance, EstimatedQuantity, quantisation_step};

use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::recording::PreparedRecording;
use crate::runs::{PhysicalChange, RecordingDifference, differences};

use super::contacts::leave_out_known_contacts;
use crate::regressors::SegmentList;

/// Differences of later recordings from the first one; none if they cannot be compared.
///
/// Fails when the job is cancelled.
pub(crate) fn run_differences(model: &Model, recordings: &[&PreparedRecording]) -> Outcome<Vec<RecordingDifference>> {
    // A single recording has nothing to compare.
    if recordings.len() < 2 {
        return Ok(Vec::new());
    }
    match differences(model, recordings) {
        Err(Error::Cancelled) => Err(Error::Cancelled),
        compared => Ok(compared.unwrap_or_default()),
    }
}

/// Subtracts known disturbances from the measured forces of a problem, and adds them to its disturbances. Returns the
/// samples that were left out before the contacts were, `[channel][sample]`.
///
/// Fails when a recording has no forces.
pub(crate) fn subtract_known(
    problem: &mut DiagnosisProblem,
    model: &Model,
    all: &SegmentList<'_>,
    between: &[RecordingDifference],
) -> Outcome<Vec<Vec<bool>>> {
    problem.removed.resize(model.row_names().len(), 0.0);
    problem.removed_differences.resize(model.row_names().len(), 0.0);
    // Powers are means over all samples.
    let samples = problem.layout.samples().max(1) as f64;
    // Differences between recordings are subtracted, and their power is counted as removed.
    for one in between {
        for (d, force) in one.force.0.iter().enumerate() {
            let (Some(force), Some(measured)) = (force, &mut problem.measured.0[d]) else {
                continue;
            };
            // Another decimation would give other samples.
            if force.len() != measured.len() {
                continue;
            }
            for (y, f) in measured.iter_mut().zip(force) {
                *y -= f;
            }
            let power = force.iter().map(|f| f * f).sum::<f64>() / samples;
            problem.removed[d] += power;
            problem.removed_differences[d] += power;
        }
        problem.disturbances.push(difference(one));
    }
    // Noise of quantisation and events come from the signals themselves.
    add_quantisation_noise(problem, model, all)?;
    let without_contacts = problem.left_out.clone();
    leave_out_known_contacts(problem, all);
    // Faults from the preparation are listed once, with all of their recordings.
    for one in all.iter().flat_map(|(one, _)| &one.faults) {
        if one.kind == "contact_event" {
            continue;
        }
        // The same fault in several recordings becomes one entry.
        let is_same = |reported: &&mut Disturbance| {
            reported.description.is_some() && (&reported.kind, &reported.description) == (&one.kind, &one.description)
        };
        match problem.disturbances.iter_mut().find(is_same) {
            // Only files that are not listed yet.
            Some(reported) => {
                let files = one.recordings.iter().filter(|file| !reported.recordings.contains(file));
                let new: Vec<String> = files.cloned().collect();
                reported.recordings.extend(new);
            }
            None => problem.disturbances.push(one.clone()),
        }
    }
    Ok(without_contacts)
}

/// A difference of two recordings as a disturbance.
fn difference(one: &RecordingDifference) -> Disturbance {
    // Changes of load and clock have kinds of their own, all others share one.
    let (_, at, values) = one.changed.change.parts(one.changed.unit);
    let kind = match one.changed.change {
        PhysicalChange::Payload { .. } => "payload_change",
        PhysicalChange::Clock { .. } => "time_base",
        _ => "different_runs",
    };
    // Sizes of the change with standard deviations.
    let estimates = values.into_iter().map(|(name, value, unit)| EstimatedQuantity {
        name: name.to_owned(),
        value: value.value,
        standard_deviation: Some(value.std),
        unit: unit.to_owned(),
    });
    Disturbance {
        kind: kind.to_owned(),
        at: at.into_iter().map(str::to_owned).collect(),
        estimates: estimates.collect(),
        recordings: vec![one.first.clone(), one.later.clone()],
        interval: None,
        description: Some(format!(
            "{} differs between the recordings, {} compared with {}: {}",
            match one.changed.change {
                PhysicalChange::Payload { .. } => "the payload",
                PhysicalChange::Friction { .. } => "the friction",
                PhysicalChange::Offset { .. } => "a constant force",
                PhysicalChange::Scale { .. } => "the scale of a force",
                PhysicalChange::Clock { .. } => "the clock",
                PhysicalChange::EncoderZero { .. } => "the zero of an encoder",
                PhysicalChange::ContactEvent { .. } => "a push",
            },
            one.later,
            one.first,
            one.changed.says
        )),
    }
}

/// Forces with a quantisation step coarser than their noise. Uniform rounding then gives the noise, step / sqrt(12).
///
/// Fails when a recording has no forces.
fn add_quantisation_noise(problem: &mut DiagnosisProblem, model: &Model, all: &SegmentList<'_>) -> Outcome<()> {
    for (d, drive) in model.row_names().iter().enumerate() {
        // Steps are found in the recorded values, before any filter.
        let mut recorded = Vec::new();
        for (one, _) in all {
            recorded.extend_from_slice(&one.run.measured_forces()?[d]);
        }
        // A low-pass removes the steps, so that decimated forces show none.
        let is_decimated = all.iter().any(|(one, _)| one.decimation() > 1);
        let Some(step) = quantisation_step(&recorded, problem.noise[d]).filter(|_| !is_decimated) else {
            continue;
        };
        // Standard deviation of a uniform distribution over one step.
        problem.noise[d] = problem.noise[d].max(step / 12.0_f64.sqrt());
        problem.disturbances.push(Disturbance {
            kind: "quantised_force".to_owned(),
            at: vec![drive.clone()],
            estimates: vec![EstimatedQuantity::new("step", step, model.force_unit(d))],
            recordings: Vec::new(),
            interval: None,
            description: None,
        });
    }
    Ok(())
}
