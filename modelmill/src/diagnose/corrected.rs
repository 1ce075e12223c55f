//! Hypothetical corrections before a diagnosis: recordings with faults that make all numbers meaningless go in, the same
//! recordings as they would be without these faults come out, with the list of what was corrected.
//!
//! Decision: a fault that one recording shows clearly is corrected in the other recordings as well if it explains them
//! better, and better than a fault of their own, since one machine and one logger made them.

use std::sync::Arc;

use modelmill_identify::diagnose::{DiagnosisVerdict, Disturbance};

use crate::error::{Error, Outcome};
use crate::faults::{ColumnOperation, FaultCorrection, RecordingFaultKind, SuspectedFault, correction_score};
use crate::model::Model;
use crate::progress::SilentProgress;
use crate::recording::{PreparedRecording, UnpreparedRecording};
use crate::text::names::joined_by_and;

use super::completion::ModelCompletion;
use super::findings::DiagnosisFindings;
use super::thresholds::{CORRECTION_ROUNDS, SHARED_FAULT_LEAST_SCORE};
use super::words;

/// Recordings after hypothetical corrections.
pub(super) struct CorrectedRecordings {
    /// The model, with another direction of gravity if that was corrected.
    pub(super) model: Model,
    /// The fitted recordings.
    pub(super) fit: Vec<PreparedRecording>,
    /// The validation runs.
    pub(super) check: Vec<PreparedRecording>,
    /// What was corrected.
    pub(super) corrected: Vec<SuspectedFault>,
    /// Faults that remain: several explain a recording equally well, or the correction of one fails.
    pub(super) unresolved: Vec<SuspectedFault>,
    /// Files of recordings that contradict a direction of gravity which others show.
    disagreeing: Vec<String>,
}

impl CorrectedRecordings {
    /// Corrects faults as long as some are found; `None` if the recordings have none.
    ///
    /// Fails if a recording cannot be prepared with another direction of gravity, and when the job is cancelled.
    pub(super) fn new(
        model: &Model,
        fit: &[&PreparedRecording],
        check: &[&PreparedRecording],
    ) -> Outcome<Option<Self>> {
        let each: Vec<&PreparedRecording> = fit.iter().chain(check).copied().collect();
        let has_fault = each.iter().any(|one| one.suspected_fault().is_some());
        let mut common = PreparedRecording::find_common_fault(model, &each);
        if !has_fault && common.is_none() {
            return Ok(None);
        }
        let copies = |all: &[&PreparedRecording]| all.iter().map(|one| (*one).clone()).collect();
        let mut all = Self {
            model: model.clone(),
            fit: copies(fit),
            check: copies(check),
            corrected: Vec::new(),
            unresolved: Vec::new(),
            disagreeing: Vec::new(),
        };
        // Several faults may be present, and one may hide another.
        for _ in 0..CORRECTION_ROUNDS {
            let Some(fault) = common.take().or_else(|| all.next_fault()) else {
                break;
            };
            let Some(correction) = fault.correction.clone() else {
                break;
            };
            // The same fault of another recording may have been hidden.
            let is_same = |one: &SuspectedFault| {
                one.clause == fault.clause && fault.recordings.iter().any(|file| one.recordings.contains(file))
            };
            let known = all.corrected.iter().any(is_same);
            match correction {
                // The same fault of a recording once more would undo its correction.
                _ if known => break,
                FaultCorrection::Gravity(gravity) => {
                    if !all.correct_gravity(fault, gravity)? {
                        break;
                    }
                }
                FaultCorrection::Columns(operations) => {
                    if !all.correct_columns(fault, &operations)? {
                        break;
                    }
                }
            }
        }
        let left = all
            .fit
            .iter()
            .chain(&all.check)
            .filter_map(PreparedRecording::suspected_fault);
        all.unresolved = merge_faults(left.cloned());
        for fault in &mut all.unresolved {
            if fault.kind == RecordingFaultKind::GravityDirection && !all.disagreeing.is_empty() {
                let others = joined_by_and(&all.disagreeing);
                let verb = if all.disagreeing.len() == 1 { "agrees" } else { "agree" };
                fault.clause = format!("{}, but {others} {verb} with the model file", fault.clause);
            }
        }
        Ok(Some(all))
    }

    /// The first fault that is found, with all recordings that have it. A sign or an exchange that all have comes first, then
    /// a fault that several hypotheses explain, since nothing can be corrected then.
    fn next_fault(&self) -> Option<SuspectedFault> {
        let each: Vec<&PreparedRecording> = self.fit.iter().chain(&self.check).collect();
        if let Some(common) = PreparedRecording::find_common_fault(&self.model, &each) {
            return Some(common);
        }
        let found = self
            .fit
            .iter()
            .chain(&self.check)
            .filter_map(PreparedRecording::suspected_fault);
        let merged = merge_faults(found.cloned());
        let unclear = merged.iter().position(|fault| !fault.is_correctable());
        merged.into_iter().nth(unclear.unwrap_or(0))
    }

    /// Prepares all recordings again for the model with another direction of gravity. Those that it explains better are
    /// named. `false` if some contradict it: one model has one gravity, so nothing can be corrected then.
    ///
    /// Fails when a recording cannot be prepared, or when the job is cancelled.
    fn correct_gravity(&mut self, mut fault: SuspectedFault, gravity: [f64; 3]) -> Outcome<bool> {
        let turned = self.model.with_gravity(gravity)?;
        let mut all: Vec<PreparedRecording> = self.fit.iter().chain(&self.check).cloned().collect();
        for one in &mut all {
            let corrected = one.corrected(&turned, &[])?;
            if !fault.recordings.iter().any(|file| file == one.file()) && one.suspected_fault().is_none() {
                let score = correction_score((&self.model, &one.segments), (&turned, &corrected.segments));
                let score = score.map_or(0.0, |score| score.gain);
                if score > SHARED_FAULT_LEAST_SCORE {
                    fault.recordings.push(one.file().to_owned());
                } else if score < -SHARED_FAULT_LEAST_SCORE {
                    self.disagreeing.push(one.file().to_owned());
                }
            }
            *one = corrected;
        }
        if !self.disagreeing.is_empty() {
            return Ok(false);
        }
        self.model = turned;
        self.prepare_together(&all)?;
        self.corrected.push(fault);
        Ok(true)
    }

    /// Corrects columns of the recordings that have a fault, and of those that it explains better. `false` if one that has
    /// it cannot be prepared then, so that the fault stays.
    ///
    /// Fails when the job is cancelled.
    fn correct_columns(&mut self, mut fault: SuspectedFault, operations: &[ColumnOperation]) -> Outcome<bool> {
        let mut all: Vec<PreparedRecording> = self.fit.iter().chain(&self.check).cloned().collect();
        let all_have_it = fault.recordings.len() == all.len();
        for one in &mut all {
            let has_it = fault.recordings.iter().any(|file| file == one.file());
            // A recording that cannot be prepared with the correction does not have the fault.
            let corrected = match one.corrected(&self.model, operations) {
                Ok(corrected) => corrected,
                Err(Error::Cancelled) => return Err(Error::Cancelled),
                Err(_) if has_it => return Ok(false),
                Err(_) => continue,
            };
            if !has_it || all_have_it {
                let score = correction_score((&self.model, &one.segments), (&self.model, &corrected.segments));
                let gain = score.as_ref().map_or(0.0, |score| score.gain);
                let is_sign = fault.kind == RecordingFaultKind::WrongSign;
                let is_asked = is_sign && score.as_ref().is_some_and(|score| score.is_asked_by_friction);
                let is_refused = !is_sign || score.is_some_and(|score| score.is_refused_by_friction);
                // One fit to all recordings may find a fault that one of them does not have.
                if has_it && gain < -SHARED_FAULT_LEAST_SCORE && is_refused {
                    fault.recordings.retain(|file| file != one.file());
                    continue;
                }
                if !has_it && gain <= SHARED_FAULT_LEAST_SCORE && !is_asked {
                    continue;
                }
                // Another fault of this recording may explain more.
                if let Some(own) = one.suspected_fault().filter(|_| !has_it)
                    && gain <= self.gain_of_correction(one, own)?
                {
                    continue;
                }
                if !has_it {
                    fault.recordings.push(one.file().to_owned());
                }
            }
            *one = corrected;
        }
        self.prepare_together(&all)?;
        match self.corrected.iter_mut().find(|one| one.clause == fault.clause) {
            Some(one) => one.recordings.extend(fault.recordings),
            None => self.corrected.push(fault),
        }
        Ok(true)
    }

    /// Gain of the correction of a fault of a recording, as [`correction_score`] states it: infinite if it is no correction of
    /// columns, and below all others if the recording cannot be prepared with it.
    ///
    /// Fails when the job is cancelled.
    fn gain_of_correction(&self, one: &PreparedRecording, fault: &SuspectedFault) -> Outcome<f64> {
        let Some(FaultCorrection::Columns(operations)) = &fault.correction else {
            return Ok(f64::INFINITY);
        };
        match one.corrected(&self.model, operations) {
            Ok(corrected) => {
                let score = correction_score((&self.model, &one.segments), (&self.model, &corrected.segments));
                Ok(score.map_or(f64::NEG_INFINITY, |score| score.gain))
            }
            Err(Error::Cancelled) => Err(Error::Cancelled),
            Err(_) => Ok(f64::NEG_INFINITY),
        }
    }

    /// Takes corrected recordings, those of the fit first, and prepares them again with common choices: those of the
    /// recordings with the fault mean nothing.
    ///
    /// Fails when the job is cancelled.
    fn prepare_together(&mut self, all: &[PreparedRecording]) -> Outcome<()> {
        let sources: Vec<UnpreparedRecording> = all.iter().map(PreparedRecording::before_preparation).collect();
        let silent = self.model.host().clone().with_progress(Arc::new(SilentProgress));
        let silent = self.model.clone().with_host(&silent);
        let prepared = PreparedRecording::new_together(&silent, &sources, self.fit.len());
        let mut prepared = match prepared.into_iter().collect::<Outcome<Vec<_>>>() {
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            // Then each keeps its own choices.
            Err(_) => all.to_vec(),
            Ok(prepared) => prepared,
        };
        self.check = prepared.split_off(self.fit.len());
        self.fit = prepared;
        Ok(())
    }
}

/// Faults with the same clause as one, with all their recordings.
fn merge_faults(all: impl Iterator<Item = SuspectedFault>) -> Vec<SuspectedFault> {
    let mut merged: Vec<SuspectedFault> = Vec::new();
    for fault in all {
        match merged.iter_mut().find(|one| one.clause == fault.clause) {
            Some(one) => one.recordings.extend(fault.recordings),
            None => merged.push(fault),
        }
    }
    merged
}

impl DiagnosisFindings {
    /// The verdict with figures, as sentences. Suspected mistakes come first. If one of them could not be corrected,
    /// the verdict states nothing else.
    pub fn verdict_text(&self) -> String {
        let says = if self.unresolved.is_empty() {
            let verdict = words::verdict(&self.diagnosis, self.channels(), self.validation);
            let more = words::geometry_alternative_text(&self.geometry_alternatives, !self.missing.is_empty());
            let elastic = words::elastic_alternative_text(&self.elastic_alternatives);
            [Some(verdict), more, elastic]
                .into_iter()
                .flatten()
                .collect::<Vec<_>>()
                .join(" ")
        } else {
            words::unresolved_text(&self.unresolved)
        };
        if self.corrected.is_empty() {
            return says;
        }
        // The sentence goes on after the corrections.
        let mut letters = says.chars();
        let first = letters.next().map(|letter| letter.to_lowercase().to_string());
        words::corrected_text(&self.corrected) + &first.unwrap_or_default() + letters.as_str()
    }

    /// Adds what was corrected. Where a fault remains, nothing else is claimed.
    pub(super) fn add_corrections(&mut self, corrected: Vec<SuspectedFault>, unresolved: Vec<SuspectedFault>) {
        if !unresolved.is_empty() {
            let diagnosis = &mut self.diagnosis;
            diagnosis.effects.clear();
            diagnosis.steps.truncate(1);
            diagnosis.verdict = DiagnosisVerdict::Unexplained;
            diagnosis.disturbances.retain(is_recording_fault);
            diagnosis.possible_effects.clear();
            diagnosis.undecided_effects.clear();
            diagnosis.candidates.clear();
            diagnosis.time_residuals.clear();
            diagnosis.unexplained.clear();
            diagnosis.laws.clear();
            self.possible.clear();
            self.undecided.clear();
            self.off_nominal.clear();
            self.geometry_alternatives.clear();
            self.elastic_alternatives.clear();
            self.regions.clear();
            self.missing.clear();
            self.laws.clear();
            self.entries.clear();
            self.edited = None;
            self.after = ModelCompletion::NothingToAdd;
            self.with_nominal = None;
        }
        self.corrected = corrected;
        self.unresolved = unresolved;
    }

    /// Makes the verdict [`DiagnosisVerdict::Unexplained`] if the model explains everything but a recording was at fault:
    /// the recording as it is stays unexplained until the fault is corrected.
    pub(super) fn respect_faults(&mut self) {
        let dead = |one: &Disturbance| one.kind == RecordingFaultKind::DeadChannel.name();
        let is_at_fault = !self.corrected.is_empty() || self.diagnosis.disturbances.iter().any(dead);
        if is_at_fault && self.diagnosis.verdict == DiagnosisVerdict::Adequate {
            self.diagnosis.verdict = DiagnosisVerdict::Unexplained;
        }
    }

    /// All disturbances, those with a trial correction first.
    pub fn disturbances(&self) -> Vec<Disturbance> {
        let corrected = self.corrected.iter().map(SuspectedFault::disturbance);
        corrected.chain(self.diagnosis.disturbances.iter().cloned()).collect()
    }
}

/// Whether a disturbance is an entry of the list of faults of recordings.
fn is_recording_fault(one: &Disturbance) -> bool {
    RecordingFaultKind::ALL.iter().any(|kind| kind.name() == one.kind)
}
