//! The prepared segments of a recording that was read: states, notes on suspicious signals, delay, variances and
//! disturbances.

use std::path::Path;
use std::sync::Arc;

use modelmill_boundary::message;
use modelmill_boundary::text::{CommandName, Message, OptionName, OptionSetting, Remedy};
use modelmill_identify::diagnose::Disturbance;
use modelmill_identify::{PreparedRun, RecordingFiles, RecordingNote, SignalRecording as Raw, StatePreparation};

use super::common;
use super::free;
use super::options::RecordingOptions;
use super::read::read_raw;
use super::sensor_faults;
use crate::error::{Error, Outcome};
use crate::faults::SilentInterval;
use crate::model::Model;
use crate::segment::{RecordingSegment, variances};

/// The prepared segments of a recording. If the model has a delay of the force signal, each force gets the states of
/// the time at which it acted.
pub(super) fn prepare_segments(model: &Model, raw: &Raw, reading: &RecordingOptions) -> Outcome<Vec<RecordingSegment>> {
    // The delay is a property of the model, not of the file.
    let delay = model.derivation.mechanism.force_delay;
    let mut data = prepare(model, raw, reading, delay)?;
    note_idle_options(&mut data, reading);
    emit_notes(model, &data);
    Ok(data)
}

/// Passes the notes of all segments to the listener.
pub(super) fn emit_notes(model: &Model, data: &[RecordingSegment]) {
    for note in data.iter().flat_map(RecordingSegment::notes) {
        model.host().note(note);
    }
}

/// The prepared segments of a recording, without compensation of a delay.
pub(crate) fn read_as_recorded(
    model: &Model,
    path: &Path,
    reading: &RecordingOptions,
) -> Outcome<Vec<RecordingSegment>> {
    let file = RecordingFiles::open(model.host().files(), &[path])?;
    let raw = read_raw(model, &file, reading)?;
    let (_, mut readings) = common::choose(model, &[&raw], 1, reading)?;
    let resolved = readings.pop();
    let (mut reading, note) = resolved.unwrap_or_else(|| (reading.clone(), None));
    if reading.preparation.chosen {
        // Decimation was chosen for fits; forces are wanted at every sample.
        reading.preparation.decimate = 1;
    }
    let reading = &reading;
    let mut data = prepare(model, &raw, reading, 0.0)?;
    if let (Some(note), Some(first)) = (note, data.first_mut()) {
        first.run.notes.push(note);
    }
    note_idle_options(&mut data, reading);
    for note in data.iter().flat_map(RecordingSegment::notes) {
        model.host().note(note);
    }
    Ok(data)
}

/// Assigns to every force the states at the time at which it acted, by the model's delay, s.
fn compensate_delay(run: &mut PreparedRun, delay: f64) -> Outcome {
    if delay == 0.0 {
        return Ok(());
    }
    let ms = 1e3 * delay;
    let Some((start, end)) = run.shift_states_by_delay(delay) else {
        return Err(Error::input(format!(
            "{}: the model's `time_delay` of {ms} ms leaves fewer than four of {} samples with states; check T, \
             which is in seconds",
            run.file,
            run.time.len()
        )));
    };
    // A delay loses samples at the start, a lead at the end.
    let (side, lost) = if start > 0 { ("first", start) } else { ("last", end) };
    let lost = match lost {
        0 => String::new(),
        1 => format!("; the {side} sample has no states and is left out"),
        n => format!("; the {side} {n} samples have no states and are left out"),
    };
    run.notes.push(RecordingNote::info(format!(
        "Forces of {} are compared with the states {ms} ms before, by the model's `time_delay`{lost}.",
        run.file
    )));
    Ok(())
}

/// Prepares all segments of a recording: states, notes on suspicious signals, delay, variances and
/// disturbances.
pub(super) fn prepare(
    model: &Model,
    recording: &Raw,
    args: &RecordingOptions,
    delay: f64,
) -> Outcome<Vec<RecordingSegment>> {
    let preparation = &args.preparation;
    // States are prepared for each segment between gaps.
    let mut runs = model
        .host()
        .run_job(&format!("preparing {}", recording.file()), 0, |_| {
            free::runs(model, recording, preparation)
        })??;
    let is_examined = !preparation.unexamined;
    // Notes on the recording are added to its first segment.
    if let Some(first) = runs.first_mut().filter(|_| is_examined) {
        let mut coordinates = model.active_coordinate_types();
        // Rates of free bodies are twists, no derivatives of the coordinates with their names.
        let free: Vec<&str> = free::free_bodies(&model.derivation.mechanism)
            .flat_map(|body| body.position.iter().chain(&body.quaternion))
            .map(|i| model.derivation.mechanism.coordinates[i.0].name.as_str())
            .collect();
        let measured = model.measured_coordinates();
        coordinates.retain(|(name, _)| !free.contains(&name.as_str()) && measured.contains(name));
        let suspicions = recording.suspicious_columns(&coordinates, preparation.source);
        first.notes.splice(0..0, suspicions);
        let mut coordinates = model.active_coordinate_types();
        coordinates.retain(|(name, _)| measured.contains(name));
        let oddities = recording.signal_notes(&coordinates, &model.row_names());
        first.notes.splice(0..0, oddities);
    }
    // Models with actuators may have recordings without forces, which few operations can use.
    let mechanism = &model.derivation.mechanism;
    let has_unused_actuators = !mechanism.actuators.is_empty() && mechanism.servo_forces.is_empty();
    if let Some(first) = runs
        .first_mut()
        .filter(|run| has_unused_actuators && run.force.is_none())
    {
        first.notes.push(RecordingNote::warning(message!(
            "{} has no forces of {}, and they cannot be computed: it lacks the signals of their actuators, or the values of \
             these are unknown. Comparisons with forces are not possible; {} estimates values from signals.",
            first.file,
            first.missing_force.join(", "),
            Remedy::command(CommandName::Identify)
        )));
    }
    // Remedies for angles in degrees are kept, in case the audit finds such angles.
    let coordinates = model.active_coordinate_types();
    let angles = coordinates.iter().filter(|(_, is_angle)| *is_angle);
    let maps_from_degrees: Vec<OptionSetting> = angles
        .flat_map(|(name, _)| recording.degree_conversion_options(name))
        .collect();
    for run in &mut runs {
        if is_examined {
            let idle = run.zero_force_notes(&model.row_names(), &model.undriven_rows());
            run.notes.extend(idle);
        }
        compensate_delay(run, delay)?;
    }
    // Faults of positions count as disturbances of every segment.
    let faults: Vec<Disturbance> = if is_examined {
        let unwrapped = recording.unwrapped_angles().iter();
        let unwrapped = unwrapped.map(|angle| sensor_faults::wrapped_angle(recording.file(), angle));
        (recording.position_faults(&model.measured_coordinates()).into_iter())
            .map(|fault| sensor_faults::position_fault(model, recording.file(), &fault))
            .chain(unwrapped)
            .chain(sensor_faults::late_rates_fault(recording))
            .collect()
    } else {
        Vec::new()
    };
    let with_variance = runs.into_iter().map(|run| {
        let variance = variances::recorded_variances(recording, &run, &model.row_names())?;
        Ok(RecordingSegment {
            run,
            variance,
            weights: None,
            load: None,
            maps_from_degrees: maps_from_degrees.clone(),
            faults: faults.clone(),
            computed: None,
        })
    });
    with_variance.collect()
}

/// A recording without the forces in some intervals.
pub(super) fn without_intervals(raw: &Arc<Raw>, silent: &[SilentInterval]) -> Arc<Raw> {
    if silent.is_empty() {
        return raw.clone();
    }
    let mut raw = (**raw).clone();
    for one in silent {
        let is_out = |t: f64| one.reach.iter().any(|[from, to]| (*from..=*to).contains(&t));
        for drive in &one.drives {
            raw.leave_out_samples(drive, &is_out);
        }
    }
    Arc::new(raw)
}

/// Warns about filter options that have no effect because all derivatives are recorded.
pub(super) fn note_idle_options(data: &mut [RecordingSegment], args: &RecordingOptions) {
    let usual = StatePreparation::default();
    // Only options that the user changed are named.
    let given: Vec<Message> = [
        args.preparation.cutoff_hz.map(|_| OptionName::CutoffHz),
        (args.preparation.order != usual.order).then_some(OptionName::Order),
    ]
    .into_iter()
    .flatten()
    .map(|name| Remedy::option(name).into())
    .collect();
    if given.is_empty() || data.iter().any(|one| one.run.prepared.cutoff_hz.is_some()) {
        return;
    }
    if let Some(one) = data.first_mut() {
        let does = if given.len() == 1 { "does" } else { "do" };
        one.run.notes.push(RecordingNote::warning(message!(
            "{} {does} nothing to {}: it has all rates and accelerations, so none are computed from positions; request \
             that with {}.",
            Message::join(given, " and "),
            one.run.file,
            Remedy::option(OptionName::Source).with_value("positions")
        )));
    }
}
