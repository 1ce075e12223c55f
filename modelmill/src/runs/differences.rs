//! Changes between recordings with the forces that they cause, for a diagnosis, which subtracts them.

use modelmill_identify::diagnose::ForceColumn;
use nalgebra::DVector;

use crate::error::Outcome;
use crate::model::Model;
use crate::recording::PreparedRecording;
use crate::runs::payload::PayloadColumns;
use crate::runs::rows::RunRows;
use crate::runs::time_base::time_scaling;
use crate::runs::{RunAnalyser, RunChange, RunStatistics, changes};

/// A change between two recordings, with its force.
pub(crate) struct RecordingDifference {
    /// The recording of the reference.
    pub(crate) first: String,
    /// The later one.
    pub(crate) later: String,
    /// The change.
    pub(crate) changed: RunChange,
    /// The force of the change along all recordings, zero except in the later one.
    pub(crate) force: ForceColumn,
}

impl RecordingDifference {
    /// Whether it causes a force at a drive.
    pub(crate) fn acts_on(&self, drive: usize) -> bool {
        let values = self.force.0.get(drive).and_then(Option::as_ref);
        values.is_some_and(|values| values.iter().any(|force| *force != 0.0))
    }

    /// Sum of its squared forces, each relative to the force of its drive; `forces` are those of the drives, `[channel]`.
    pub(crate) fn relative_power(&self, forces: &[f64]) -> f64 {
        let columns = self.force.0.iter().zip(forces).filter(|(_, force)| **force > 0.0);
        let squares = |(values, force): (&Option<Vec<f64>>, &f64)| {
            let values = values.iter().flatten();
            values.map(|value| (value / force).powi(2)).sum::<f64>()
        };
        columns.map(squares).sum()
    }
}

/// A change with its columns and their values.
struct ValuedChange {
    /// The change.
    changed: RunChange,
    /// Indices of its columns.
    columns: Vec<usize>,
    /// Their values.
    values: DVector<f64>,
}

/// Changes of later recordings relative to the first, with the forces that they cause.
pub(crate) fn differences(model: &Model, recordings: &[&PreparedRecording]) -> Outcome<Vec<RecordingDifference>> {
    let [first, later @ ..] = recordings else {
        return Ok(Vec::new());
    };
    let payloads = PayloadColumns::new(model)?;
    let bench = RunAnalyser::new(model, &payloads);
    let before = bench.analyse_run(first, None)?;
    // Forces are placed within the samples of all recordings.
    let samples = |one: &PreparedRecording| -> usize { one.segments.iter().map(|one| one.time().len()).sum() };
    let total: usize = recordings.iter().map(|one| samples(one)).sum();
    let mut start = samples(first);
    let mut differences = Vec::new();
    for recording in later {
        let run = bench.analyse_run(recording, Some(before.reference()))?;
        let end = start + samples(recording);
        let found = valued_changes(&bench, &before, &run);
        let rows = match found[..] {
            [] => None,
            // The forces are those along the motion as recorded, with nothing left out.
            _ => Some(RunRows::new(
                model,
                &recording.segments,
                &payloads,
                &time_scaling(model, recording),
                Some(&before.values),
            )?),
        };
        for one in found {
            let Some(rows) = &rows else { continue };
            let own = rows.force(&one.columns, &one.values)?;
            // Another decimation would give other samples.
            if own.iter().any(|values| values.len() != end - start) {
                continue;
            }
            let along_all = |values: Vec<f64>| {
                let mut all = vec![0.0; total];
                all[start..end].copy_from_slice(&values);
                all
            };
            differences.push(RecordingDifference {
                first: first.file().to_owned(),
                later: recording.file().to_owned(),
                changed: one.changed,
                force: ForceColumn::new(own.into_iter().map(along_all).collect()),
            });
        }
        start = end;
    }
    Ok(differences)
}

/// The changes of a run, with a clock that recorded rates show.
fn valued_changes(bench: &RunAnalyser<'_>, before: &RunStatistics, run: &RunStatistics) -> Vec<ValuedChange> {
    let clock = run.clock.map(|clock| ValuedChange {
        changed: changes::clock_change(clock),
        columns: vec![bench.layout.clock()],
        values: DVector::from_element(1, clock.value - 1.0),
    });
    let found = bench.compare_pair(before, run).found;
    let identified = bench.identified_changes(&found, &before.values);
    let others = found.iter().zip(identified).map(|(one, changed)| ValuedChange {
        changed,
        columns: bench.possible[one.candidate].candidate.columns.clone(),
        values: one.values.clone(),
    });
    clock.into_iter().chain(others).collect()
}
