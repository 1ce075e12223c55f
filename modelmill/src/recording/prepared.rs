//! Recordings that were read and prepared for a model: the choices that recordings of one machine have in common are
//! made, states are prepared, and faults are searched.

use std::sync::Arc;

use modelmill_identify::{DerivativeSource, RecordingNote, SignalRecording as Raw, StatePreparation};

use super::common::{self, RecordingChoices, RecordingSticks};
use super::options::RecordingOptions;
use super::read::UnpreparedRecording;
use super::states::{emit_notes, note_idle_options, prepare, prepare_segments, without_intervals};
use super::thresholds::DELAY_LEAST_SHARE_OF_GAIN;
use crate::audit::{self, ForceDelayAudit};
use crate::error::{Error, Outcome};
use crate::faults::{
    ColumnOperation, FaultSubject, RecordingFaultKind, SilentInterval, SuspectedFault, find_fault, silent_intervals,
};
use crate::model::Model;
use crate::progress::SilentProgress;
use crate::segment::RecordingSegment;

/// A recording that was read and prepared for a model.
#[derive(Clone)]
pub struct PreparedRecording {
    /// The parts of the recording without gaps in time, each with its states and forces. There is one if the recording
    /// has no gaps.
    pub segments: Vec<RecordingSegment>,
    /// The recording before preparation, without forces that were not measured.
    raw: Arc<Raw>,
    /// The options with which it was prepared, including automatic choices.
    reading: RecordingOptions,
    /// The recording as it was read, with the options as they were requested.
    source: UnpreparedRecording,
    /// The suspected fault whose correction brings recording and model into the best agreement; `None` if no fault is
    /// decisive.
    suspect: Option<SuspectedFault>,
    /// By how much a delay of the forces explains it better: see [`ForceDelayAudit::log_gain`].
    delay_gain: f64,
    /// Intervals in which drives stick.
    sticks: RecordingSticks,
}

impl PreparedRecording {
    /// Whether the forces of all drives were recorded.
    pub fn has_forces(&self) -> bool {
        self.segments.iter().all(|segment| segment.run.force.is_some())
    }

    /// Prepares a recording; unless it is `unexamined`, open choices are made and the audit runs.
    pub(super) fn new(model: &Model, recording: UnpreparedRecording) -> Outcome<Self> {
        let file = recording.raw.file().to_owned();
        let only = Self::new_together(model, &[recording], 1).pop();
        only.unwrap_or_else(|| Err(Error::input(format!("{file} cannot be prepared"))))
    }

    /// As [`Self::new`], for recordings of one machine, with choices that are common to all that have the same options.
    /// The first `fitted` of them belong to a fit.
    pub(crate) fn new_together(model: &Model, recordings: &[UnpreparedRecording], fitted: usize) -> Vec<Outcome<Self>> {
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for (index, one) in recordings.iter().enumerate() {
            let has_same = |group: &&mut Vec<usize>| one.has_same_preparation(&recordings[group[0]]);
            match groups.iter_mut().find(has_same) {
                Some(group) => group.push(index),
                None => groups.push(vec![index]),
            }
        }
        let mut prepared: Vec<(usize, Outcome<Self>)> = Vec::new();
        for group in groups {
            // Validation runs with options of their own decide for themselves.
            let of_fit = group.iter().filter(|index| **index < fitted).count();
            let decisive = if of_fit == 0 { group.len() } else { of_fit };
            let members: Vec<_> = group.iter().map(|index| recordings[*index].clone()).collect();
            prepared.extend(group.into_iter().zip(Self::new_group(model, &members, decisive)));
        }
        prepared.sort_by_key(|(index, _)| *index);
        prepared.into_iter().map(|(_, one)| one).collect()
    }

    /// As [`Self::new_together`], for recordings with the same options.
    fn new_group(model: &Model, recordings: &[UnpreparedRecording], fitted: usize) -> Vec<Outcome<Self>> {
        let mut prepared = Self::prepare_group(model, recordings, None, fitted);
        if recordings.iter().any(|one| one.reading.preparation.unexamined) {
            for one in prepared.iter().flatten() {
                emit_notes(model, &one.segments);
            }
            return prepared;
        }
        // Forces that were not measured would spoil the choice of the preparation and every fit.
        let sources: Vec<_> = (prepared.iter())
            .map(|one| one.as_ref().ok().map(|one| (&*one.raw, one.segments.as_slice())))
            .collect();
        let silent: Vec<Vec<SilentInterval>> = silent_intervals(model, &sources);
        if silent.iter().any(|silent| !silent.is_empty()) {
            prepared = Self::prepare_group(model, recordings, Some(&silent), fitted);
        }
        for (prepared, silent) in prepared.iter_mut().zip(&silent) {
            let Ok(one) = prepared else { continue };
            if let Some(first) = one.segments.first_mut() {
                first.run.notes.extend(silent.iter().map(SilentInterval::note));
                first.faults.extend(silent.iter().map(SilentInterval::disturbance));
            }
            emit_notes(model, &one.segments);
            if let Err(cancelled) = one.examine(model) {
                *prepared = Err(cancelled);
                continue;
            }
            // Events are searched in all forces, so that a push during standstill is found.
            one.sticks.all.leave_out(model, one.sticks.index, &mut one.segments);
        }
        prepared
    }

    /// Makes open choices for recordings of one machine and prepares them, without passing notes to the listener and
    /// without the forces of `silent` intervals.
    fn prepare_group(
        model: &Model,
        recordings: &[UnpreparedRecording],
        silent: Option<&[Vec<SilentInterval>]>,
        fitted: usize,
    ) -> Vec<Outcome<Self>> {
        let silent = |index: usize| silent.map_or(&[][..], |silent| &silent[index]);
        let raws = recordings.iter().enumerate();
        let raws: Vec<Arc<Raw>> = raws
            .map(|(index, one)| without_intervals(&one.raw, silent(index)))
            .collect();
        let choices = common::choose_for_each(model, &raws, fitted, recordings.first().map(|one| &one.reading));
        let each = recordings.iter().zip(raws).zip(choices);
        each.map(|((recording, raw), choice)| Self::with_choices(model, recording, raw, choice?))
            .collect()
    }

    /// Prepares a recording with all choices made.
    fn with_choices(
        model: &Model,
        source: &UnpreparedRecording,
        raw: Arc<Raw>,
        choice: RecordingChoices,
    ) -> Outcome<Self> {
        let reading = RecordingOptions {
            preparation: choice.reading.preparation,
            ..source.reading.clone()
        };
        let delay = model.derivation.mechanism.force_delay;
        let mut segments = prepare(model, &raw, &reading, delay)?;
        note_idle_options(&mut segments, &reading);
        for one in &mut segments {
            one.computed.clone_from(&source.computed);
        }
        if let Some(first) = segments.first_mut() {
            first.run.notes.extend(choice.notes);
            first.faults.extend(source.faults.iter().cloned());
        }
        Ok(Self {
            segments,
            raw,
            reading,
            source: source.clone(),
            suspect: None,
            delay_gain: 0.0,
            sticks: choice.sticks,
        })
    }

    /// The sign or the exchange of columns that all recordings of a machine have, from one fit to all of them; `None` if
    /// none is decisive. One recording alone may be too short to distinguish the sign of a force from that of an angle.
    pub(crate) fn find_common_fault(model: &Model, all: &[&Self]) -> Option<SuspectedFault> {
        let [first, _, ..] = all else { return None };
        let segments: Vec<RecordingSegment> = all.iter().flat_map(|one| one.segments.iter().cloned()).collect();
        let mut fault = find_fault(&first.fault_subject(model, &segments))?;
        let is_common = [RecordingFaultKind::ExchangedColumns, RecordingFaultKind::WrongSign].contains(&fault.kind);
        let delay_gain = all.iter().map(|one| one.delay_gain).fold(0.0, f64::max);
        let is_believed = || all.iter().all(|one| one.is_believed(model, &fault, delay_gain));
        if !is_common || !fault.is_correctable() || !is_believed() {
            return None;
        }
        fault.recordings = all.iter().map(|one| one.file().to_owned()).collect();
        Some(fault)
    }

    /// Whether nothing else explains a fault: neither a delay of the forces, with the gain of [`ForceDelayAudit`], nor gears.
    fn is_believed(&self, model: &Model, fault: &SuspectedFault, delay_gain: f64) -> bool {
        // Forces that are delayed by a large part of a period resemble those of another drive, or of another sign.
        let may_be_delay = [RecordingFaultKind::ExchangedColumns, RecordingFaultKind::WrongSign].contains(&fault.kind);
        let is_delay = may_be_delay && delay_gain >= DELAY_LEAST_SHARE_OF_GAIN * fault.fit_gain.max(1.0);
        // Forces before a gear have a sign beside their factor, which the note on the gear states for each drive.
        !is_delay && !self.is_sign_of_gears(model, fault)
    }

    /// What the search for faults sees of this recording, with segments of it or of all recordings.
    fn fault_subject<'a>(&'a self, model: &'a Model, segments: &'a [RecordingSegment]) -> FaultSubject<'a> {
        let source = self.reading.preparation.source;
        FaultSubject {
            model,
            raw: &self.raw,
            segments,
            uses_recorded_derivatives: source == DerivativeSource::RecordedFirst,
            has_mapping: !self.source.reading.columns.is_empty()
                || !model.derivation.mechanism.recording.columns.is_empty(),
        }
    }

    /// Looks for faults that make the numbers meaningless; without one also for delays, contacts and pushes.
    ///
    /// Fails when the job is cancelled.
    fn examine(&mut self, model: &Model) -> Outcome {
        let says = format!("looking for faults of {}", self.file());
        let (suspect, delays) = model.host().run_job(&says, 0, |_| {
            let suspect = find_fault(&self.fault_subject(model, &self.segments));
            let of_segment = |one: &RecordingSegment| ForceDelayAudit::from_segment(model, one);
            let delays: Vec<Option<ForceDelayAudit>> = self.segments.iter().map(of_segment).collect();
            (suspect, delays)
        })?;
        self.delay_gain = delays
            .iter()
            .flatten()
            .map(ForceDelayAudit::log_gain)
            .fold(0.0, f64::max);
        self.suspect = suspect.filter(|fault| self.is_believed(model, fault, self.delay_gain));
        if let (Some(fault), Some(first)) = (&self.suspect, self.segments.first_mut()) {
            first.note(model, RecordingNote::warning(fault.note_text()));
            first.faults.push(fault.disturbance());
            return Ok(());
        }
        for (one, delays) in self.segments.iter_mut().zip(delays) {
            for note in audit::examine_forces(model, one, delays.as_ref()) {
                one.note(model, note);
            }
            audit::examine_events(model, one, self.reading.leave_out_events);
        }
        Ok(())
    }

    /// The recording before its preparation, to be prepared again together with others.
    pub fn before_preparation(&self) -> UnpreparedRecording {
        self.source.clone()
    }

    /// The suspected fault whose correction brings recording and model into the best agreement; `None` if no fault is
    /// decisive.
    pub fn suspected_fault(&self) -> Option<&SuspectedFault> {
        self.suspect.as_ref()
    }

    /// Whether a fault is a wrong sign of forces that are smaller than the nominal ones by a factor typical of a gear.
    fn is_sign_of_gears(&self, model: &Model, fault: &SuspectedFault) -> bool {
        let Some(first) = self
            .segments
            .first()
            .filter(|_| fault.kind == RecordingFaultKind::WrongSign)
        else {
            return false;
        };
        let (drives, factors) = (model.row_names(), audit::gear_factors(model, first));
        let is_geared = |at: &String| {
            let mut pairs = drives.iter().zip(&factors);
            pairs.any(|(drive, factor)| drive == at && factor.is_some())
        };
        fault.at.iter().all(is_geared)
    }

    /// The recording as it would be after operations on its columns, prepared and examined again for a model. Its notes
    /// stay in it and are not passed to the listener.
    ///
    /// Fails if it cannot be prepared then.
    pub(crate) fn corrected(&self, model: &Model, operations: &[ColumnOperation]) -> Outcome<Self> {
        let mut raw = (*self.raw).clone();
        for operation in operations {
            operation.apply(&mut raw);
        }
        let silent = model.host().clone().with_progress(Arc::new(SilentProgress));
        let corrected = UnpreparedRecording::new(raw, &self.source.reading);
        Self::new(&model.clone().with_host(&silent), corrected)
    }

    /// The same recording with other segments.
    pub(crate) fn with_segments(&self, stretches: Vec<RecordingSegment>) -> Self {
        Self {
            segments: stretches,
            raw: self.raw.clone(),
            reading: self.reading.clone(),
            source: self.source.clone(),
            suspect: self.suspect.clone(),
            delay_gain: self.delay_gain,
            sticks: self.sticks.clone(),
        }
    }

    /// Whether a rate or an acceleration of a coordinate is recorded and used.
    pub(crate) fn has_recorded_derivatives(&self, model: &Model) -> bool {
        let names = model.active_coordinates();
        let is_recorded = |name: &String| {
            ["_d", "_dd"]
                .iter()
                .any(|suffix| self.raw.has_column(&format!("{name}{suffix}")))
        };
        self.derivative_source() == DerivativeSource::RecordedFirst && names.iter().any(is_recorded)
    }

    /// Name of the file in messages.
    pub fn file(&self) -> &str {
        self.raw.file()
    }

    /// The values of a column as they were recorded, one for each sample, before any filter. `name` is its name in the
    /// model. `None` if there is no such column, or if it has values that are not finite.
    pub fn raw_column(&self, name: &str) -> Option<&[f64]> {
        self.raw.column(name).ok()
    }

    /// The preparation, including automatic choices.
    pub(crate) fn preparation(&self) -> &StatePreparation {
        &self.reading.preparation
    }

    /// Where its rates and accelerations were taken from.
    pub(crate) fn derivative_source(&self) -> DerivativeSource {
        self.reading.preparation.source
    }

    /// The notes of all segments.
    pub fn notes(&self) -> impl Iterator<Item = &RecordingNote> {
        self.segments.iter().flat_map(RecordingSegment::notes)
    }

    /// The segments without repair of sensor faults; `None` if nothing was repaired, or they cannot be prepared
    /// without.
    pub(crate) fn with_faults(&self, model: &Model) -> Option<Vec<RecordingSegment>> {
        let faulty = self.raw.restore_sensor_faults()?;
        let delay = model.derivation.mechanism.force_delay;
        let mut stretches = prepare(model, &faulty, &self.reading, delay).ok()?;
        self.sticks.all.mark(self.sticks.index, &mut stretches);
        // Weights of other exclusions are kept.
        for (faulty, repaired) in stretches.iter_mut().zip(&self.segments) {
            if faulty.samples() == repaired.samples() {
                faulty.weights.clone_from(&repaired.weights);
            }
            faulty.computed.clone_from(&repaired.computed);
        }
        Some(stretches)
    }

    /// The segments prepared again for another model of the same machine, which may have another delay of the force
    /// signal.
    pub(crate) fn prepare_for(&self, model: &Model) -> Outcome<Vec<RecordingSegment>> {
        let mut stretches = prepare_segments(model, &self.raw, &self.reading)?;
        self.sticks.all.mark(self.sticks.index, &mut stretches);
        for one in &mut stretches {
            one.computed.clone_from(&self.source.computed);
        }
        Ok(stretches)
    }
}
