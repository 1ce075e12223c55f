//! Delays of the signals from which forces were computed. Segments with computed forces go in; out come columns of these
//! delays, and candidates for faults of sensors that do not exist there are removed.
//!
//! Decision: a delay that was estimated is estimated together with all effects, as a parameter of the model is. Otherwise
//! what remains of it would look like an effect: a command that acts 0.1 ms later than assumed changes a force by `kp` times
//! the rate times 0.1 ms, which is more than the noise of an encoder.

use modelmill_identify::RecordingNote;
use modelmill_identify::diagnose::{
    CandidateEffect, CandidateNature, ColumnChoice, ColumnSource, EffectParameter, ForceColumn, ForceReadingFault,
    LocatedEffect, ReadingFaultKind, SignConstraint,
};

use crate::error::Outcome;
use crate::model::Model;
use crate::regressors::SegmentList;
use crate::text::names::joined_by_and;

use super::numbers::stack;

/// The kind of a wrong delay of a signal.
const SIGNAL_DELAY: &str = "signal_delay";

/// Kinds of effects that act by the derivatives of a force, or within the distance that the filter of the positions blurs
/// at a reversal.
const BLURRED_KINDS: [&str; 3] = ["drive_compliance", "backlash", "dahl_friction"];

/// Delays of the signals of computed forces.
pub(super) struct SignalDelays {
    /// Forces per second of each delay that was estimated.
    pub(super) estimated: Vec<ForceColumn>,
    /// Candidates for each delay that the model file gives.
    pub(super) candidates: Vec<CandidateEffect>,
    /// Drives whose forces were computed, each with whether it was from a command.
    computed: Vec<(usize, bool)>,
}

impl SignalDelays {
    /// The delays of all signals; none if all forces were measured.
    ///
    /// Fails when a segment is too short for the filter of its decimation.
    pub(super) fn new(model: &Model, all: &SegmentList<'_>) -> Outcome<Self> {
        let sensitivities = || {
            all.iter()
                .flat_map(|(one, _)| one.computed.iter().flat_map(|computed| &computed.delays))
        };
        let mut actuators: Vec<usize> = sensitivities().map(|one| one.actuator).collect();
        actuators.sort_unstable();
        actuators.dedup();
        // A segment that lacks an actuator has measured forces.
        let slopes = stack(all, |one| {
            let own = one.delay_sensitivities();
            let known = one.computed.iter().flat_map(|computed| &computed.delays);
            let places: Vec<usize> = known.map(|one| one.actuator).collect();
            let of = |actuator: &usize| {
                let k = places.iter().position(|place| place == actuator);
                k.map_or_else(|| vec![0.0; one.samples()], |k| own[k].clone())
            };
            Ok(actuators.iter().map(of).collect())
        })?;
        let mut found = Self {
            estimated: Vec::new(),
            candidates: Vec::new(),
            computed: Vec::new(),
        };
        for (actuator, slope) in actuators.iter().zip(slopes) {
            let Some(one) = sensitivities().find(|one| one.actuator == *actuator) else {
                continue;
            };
            if !found.computed.iter().any(|(drive, _)| *drive == one.drive) {
                found.computed.push((one.drive, one.is_commanded));
            }
            // A force that was computed with a delay too small by `shift` is too large by the slope times `-shift`.
            let mut column = ForceColumn(vec![None; model.row_names().len()]);
            column.0[one.drive] = Some(slope.into_iter().map(|x| -x).collect());
            if one.is_estimated {
                found.estimated.push(column);
            } else {
                found.candidates.push(candidate(&model.row_names()[one.drive], column));
            }
        }
        Ok(found)
    }

    /// Whether a candidate is a fault of a force sensor that a computed force cannot have. A delay of the force is a delay
    /// of the signal there, and its lag is one only if the signal is measured. Compliance and backlash of a gear move the
    /// load by the force and its derivatives. If the force contains the position of the same encoder, they cannot be
    /// distinguished from its noise and from jumps of friction.
    pub(super) fn excludes(&self, model: &Model, candidate: &CandidateEffect) -> bool {
        let is_of_command = |(drive, is_commanded): &(usize, bool)| {
            *is_commanded && candidate.effect.at.contains(&model.row_names()[*drive])
        };
        if BLURRED_KINDS.contains(&candidate.effect.kind.as_str()) {
            return self.computed.iter().any(is_of_command);
        }
        let ColumnSource::ReadingFault(ForceReadingFault { kind, channel }) = candidate.source else {
            return false;
        };
        let concerns = |drive: usize| channel.is_none_or(|channel| channel == drive);
        let mut concerned = self.computed.iter().filter(|(drive, _)| concerns(*drive));
        match kind {
            ReadingFaultKind::Delayed => concerned.next().is_some(),
            ReadingFaultKind::LowPassed => concerned.any(|(_, is_commanded)| *is_commanded),
            ReadingFaultKind::Scaled => false,
        }
    }

    /// For each drive whether its force was computed from a command.
    pub(super) fn is_commanded(&self, model: &Model) -> Vec<bool> {
        let is_it = |drive: usize| self.computed.contains(&(drive, true));
        (0..model.row_names().len()).map(is_it).collect()
    }

    /// What the diagnosis does not search in computed forces, as a note; `None` if all forces were measured.
    pub(super) fn note(&self, model: &Model) -> Option<RecordingNote> {
        let names = |is_wanted: &dyn Fn(bool) -> bool| -> Vec<String> {
            let drives = self
                .computed
                .iter()
                .filter(|(_, is_commanded)| is_wanted(*is_commanded));
            drives.map(|(drive, _)| model.row_names()[*drive].clone()).collect()
        };
        let all = names(&|_| true);
        if all.is_empty() {
            return None;
        }
        let commanded = names(&|is_commanded| is_commanded);
        let lag = if commanded.is_empty() {
            String::new()
        } else {
            format!(
                " A lag and a hum of the force of {} were not searched, since commands have no sensor. Compliance, backlash and \
                 Dahl friction of these drives were not searched: the force contains the noise of the same encoder. Record a current.",
                joined_by_and(&commanded)
            )
        };
        Some(RecordingNote::info(format!(
            "The forces of {} are computed from signals. Delays of these signals that the model file does not give are \
             estimated together with the effects, so that a delay of a force signal is no candidate.{lag}",
            joined_by_and(&all)
        )))
    }
}

/// A wrong delay of the signal of a drive as a candidate.
fn candidate(drive: &str, column: ForceColumn) -> CandidateEffect {
    CandidateEffect {
        effect: LocatedEffect {
            kind: SIGNAL_DELAY.to_owned(),
            at: vec![drive.to_owned()],
        },
        parameters: vec![EffectParameter {
            symbol: "shift".to_owned(),
            unit: "s".to_owned(),
            sign: SignConstraint::Any,
        }],
        searched_constants: 0,
        is_part_of_load: false,
        refines: None,
        nature: CandidateNature::Disturbance,
        is_per_run: false,
        source: ColumnSource::Columns(vec![ColumnChoice {
            constants: Vec::new(),
            columns: vec![column],
        }]),
    }
}
