//! Choices that are common to all recordings of one machine: the phases in which drives stick, and how the recordings
//! are smoothed and decimated.

use std::sync::Arc;

use modelmill_identify::{PreparedRun, RecordingNote, SignalRecording as Raw, StatePreparation};

use super::choice;
use super::free;
use super::options::RecordingOptions;
use super::stick::StickPhases;
use crate::error::{Error, Outcome};
use crate::model::Model;

/// The reading options of a recording with all open choices of the preparation made, and the note on the choice.
pub(super) type ChosenReading = (RecordingOptions, Option<RecordingNote>);

/// The stick phases of one of several recordings.
#[derive(Clone, Default)]
pub(super) struct RecordingSticks {
    /// Those of all recordings.
    pub(super) all: Arc<StickPhases>,
    /// Index of this recording.
    pub(super) index: usize,
}

/// The choices for one of several recordings.
pub(super) struct RecordingChoices {
    /// The reading options with all open choices of the preparation made.
    pub(super) reading: RecordingOptions,
    /// What was chosen, and why.
    pub(super) notes: Vec<RecordingNote>,
    /// Intervals in which drives stick.
    pub(super) sticks: RecordingSticks,
}

/// Makes the open choices of recordings of one machine, as [`choose`]. A recording that has no valid choice by itself
/// gets its own error, and the choice of the others is made without it.
pub(super) fn choose_for_each(
    model: &Model,
    raws: &[Arc<Raw>],
    fitted: usize,
    reading: Option<&RecordingOptions>,
) -> Vec<Outcome<RecordingChoices>> {
    let Some(reading) = reading else {
        return Vec::new();
    };
    let together = |indices: &[usize], fitted: usize| {
        let chosen: Vec<&Raw> = indices.iter().map(|index| raws[*index].as_ref()).collect();
        choose(model, &chosen, fitted, reading).map(assign_choices)
    };
    let every: Vec<usize> = (0..raws.len()).collect();
    let failure = match together(&every, fitted) {
        Ok(choices) => return choices.into_iter().map(Ok).collect(),
        Err(error) if raws.len() < 2 => return vec![Err(error)],
        Err(Error::Cancelled) => return raws.iter().map(|_| Err(Error::Cancelled)).collect(),
        Err(error) => error,
    };
    // What fails by itself is the fault of that recording alone.
    let mut each: Vec<Outcome<RecordingChoices>> = Vec::new();
    for index in &every {
        each.extend(together(&[*index], 1).map(|mut choices| choices.pop()).transpose());
    }
    let valid: Vec<usize> = every.into_iter().filter(|index| each[*index].is_ok()).collect();
    if valid.len() == raws.len() {
        note_separate_choices(raws, &mut each, &failure);
        return each;
    }
    let fitted = valid.iter().filter(|index| **index < fitted).count();
    if let Ok(choices) = together(&valid, if fitted == 0 { valid.len() } else { fitted }) {
        for (index, choices) in valid.into_iter().zip(choices) {
            each[index] = Ok(choices);
        }
    } else {
        note_separate_choices(raws, &mut each, &failure);
    }
    each
}

/// The choices of several recordings, one by one.
fn assign_choices((sticks, readings): (StickPhases, Vec<ChosenReading>)) -> Vec<RecordingChoices> {
    let all = Arc::new(sticks);
    let each = readings.into_iter().enumerate();
    each.map(|(index, (reading, note))| RecordingChoices {
        reading,
        notes: note.into_iter().collect(),
        sticks: RecordingSticks {
            all: all.clone(),
            index,
        },
    })
    .collect()
}

/// Adds a warning that recordings are prepared one by one, because a common choice failed.
fn note_separate_choices(raws: &[Arc<Raw>], each: &mut [Outcome<RecordingChoices>], failure: &Error) {
    let files: Vec<&str> = raws.iter().map(|raw| raw.file()).collect();
    if let Some(first) = each.iter_mut().flatten().next() {
        first.notes.push(RecordingNote::warning(format!(
            "No common preparation was found for {}: {failure}. Each is smoothed and decimated by itself, so that their \
             parameters may differ for that reason. Compare the notes on each of them, and give the same cut-off to all.",
            files.join(", ")
        )));
    }
}

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
    let drives = model.row_names();
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
