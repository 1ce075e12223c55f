//! Choices that are common to all recordings of one machine: the phases in which drives stick, and how the recordings
//! are smoothed and decimated.

use modelmill_identify::{PreparedRun, RecordingNote, SignalRecording as Raw, StatePreparation};

use super::choice;
use super::free;
use super::options::RecordingOptions;
use super::stick::StickPhases;
use crate::error::Outcome;
use crate::model::Model;

/// The reading options of a recording with all open choices of the preparation made, and the note on the choice.
pub(super) type ChosenReading = (RecordingOptions, Option<RecordingNote>);

/// Makes the open choices of recordings of one machine, of which the first `fitted` belong to a fit: these decide about
/// smoothing and decimation. Without examination there are no choices.
pub(super) fn choose(
    model: &Model,
    raws: &[&Raw],
    fitted: usize,
    reading: &RecordingOptions,
) -> Outcome<(StickPhases, Vec<ChosenReading>)> {
    if reading.preparation.unexamined {
        return Ok((StickPhases::default(), vec![(reading.clone(), None); raws.len()]));
    }
    let sticks = stick_phases(model, raws, reading)?;
    let readings = resolve_readings(model, raws, fitted, reading, &sticks)?;
    Ok((sticks, readings))
}

/// The stick phases of recordings of one machine, from states that are prepared with the options of the user; none in
/// recordings without forces, or if states cannot be prepared, which is reported where they are needed.
fn stick_phases(model: &Model, raws: &[&Raw], reading: &RecordingOptions) -> Outcome<StickPhases> {
    let drives = model.drives();
    if reading.preparation.unexamined || drives.is_empty() || model.base.is_empty() {
        return Ok(StickPhases::default());
    }
    let preparation = StatePreparation {
        unexamined: true,
        ..reading.preparation.clone()
    };
    model.host().run_job("finding where drives stick", 0, |_| {
        let runs = |raw: &&Raw| {
            let has_forces = drives.iter().all(|drive| raw.has_column(drive));
            let runs = has_forces.then(|| free::runs(model, raw, &preparation).ok());
            runs.flatten().unwrap_or_default()
        };
        let runs: Vec<Vec<PreparedRun>> = raws.iter().map(runs).collect();
        StickPhases::find(model, &runs, reading.standstill)
    })
}

/// The reading options of each recording with all open choices of the preparation made, each with a note on the choice
/// at the first recording that it concerns.
fn resolve_readings(
    model: &Model,
    raws: &[&Raw],
    fitted: usize,
    reading: &RecordingOptions,
    sticks: &StickPhases,
) -> Outcome<Vec<(RecordingOptions, Option<RecordingNote>)>> {
    let files: Vec<&str> = raws.iter().map(|raw| raw.file()).collect();
    let says = format!("choosing how {} is smoothed", files.join(", "));
    let chosen = model.host().run_job(&says, 0, |_| {
        choice::choose_preparation(model, raws, fitted, reading, sticks)
    })??;
    let mut all = vec![(reading.clone(), None); raws.len()];
    for choice in chosen {
        let mut note = Some(choice.note);
        for (index, reading) in choice.readings {
            all[index] = (reading, note.take());
        }
    }
    Ok(all)
}
