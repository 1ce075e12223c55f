//! Faults of recordings that make all numbers meaningless. There are two sorts:
//!
//! - Suspected mistakes ([`SuspectedFault`]): a wrong time unit, unit or sign of a column, exchanged columns, or a
//!   wrong direction of gravity. An operation on columns, or on gravity, corrects them.
//! - Forces that were not measured for some time (`silent`): dead, frozen or clipped force signals, and brakes. These
//!   samples are left out.
//!
//! A prepared recording goes in; faults come out, each with what was found and what to do. In results, both sorts are
//! also listed as [`Disturbance`], the word for everything in a recording that is not a missing effect.
//!
//! The mistakes are entries of one list. An entry proposes hypotheses. The criterion is the same for all hypotheses:
//! how much the correction lowers the error of the model, with all parameters fitted and with nominal values. The
//! decrease must be clear, and no other hypothesis may explain the recording equally well.
//!
//! Decision: reading a recording reports mistakes and does not correct them. Only a diagnosis corrects them, and its
//! verdict begins with them. Exceptions are wrapped angles, which are unwrapped, and forces that were not measured,
//! which are left out, both with a note.

mod angle_units;
mod bench;
mod correction;
mod exchanged;
mod force_units;
mod gravity;
mod judge;
mod length_units;
mod signs;
mod silent;
mod thresholds;
mod time_base;

use modelmill_boundary::text::{Message, OptionName, OptionSetting, Remedy, RemedyWording};
use modelmill_identify::SignalRecording;
use modelmill_identify::diagnose::Disturbance;
use modelmill_spec::{DriveKind, Mechanism};

use crate::answers::CorrectedFaultAnswer;
use crate::model::Model;
use crate::segment::RecordingSegment;
use crate::text::names::joined_by_and;

use bench::FaultBench;
pub(crate) use correction::{ColumnOperation, FaultCorrection};
use correction::{ForceChange, MotionChange};
pub(crate) use judge::{correction_score, find_fault};
pub(crate) use silent::{SilentInterval, silent_intervals};

/// Kinds of faults of recordings. The first five are mistakes, which a [`SuspectedFault`] states with their correction.
/// The others are disturbances of single signals, which are repaired or left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum RecordingFaultKind {
    /// The time is in another unit.
    TimeBase,
    /// A column is in another unit.
    Units,
    /// Two columns are exchanged.
    ExchangedColumns,
    /// A column has the opposite sign.
    WrongSign,
    /// Gravity has another direction than in the model file.
    GravityDirection,
    /// An angle jumps by full turns.
    Wrapped,
    /// A force reads zero although the model predicts one.
    DeadChannel,
    /// A force stays at one value for some time while the machine moves, although it is noisy at other times, or
    /// although the model predicts another value.
    FrozenForce,
    /// The largest or smallest readings of a force repeat one number, because the signal is clipped at this number.
    Saturation,
    /// Brakes hold the joints, and the drives are off.
    Brakes,
}

impl RecordingFaultKind {
    /// All kinds.
    pub const ALL: [Self; 10] = [
        Self::TimeBase,
        Self::Units,
        Self::ExchangedColumns,
        Self::WrongSign,
        Self::GravityDirection,
        Self::Wrapped,
        Self::DeadChannel,
        Self::FrozenForce,
        Self::Saturation,
        Self::Brakes,
    ];

    /// Its name in JSON and in scripts.
    pub fn name(self) -> &'static str {
        match self {
            Self::TimeBase => "time_base",
            Self::Units => "units",
            Self::ExchangedColumns => "exchanged_columns",
            Self::WrongSign => "wrong_sign",
            Self::GravityDirection => "gravity_direction",
            Self::Wrapped => "wrapped",
            Self::DeadChannel => "dead_channel",
            Self::FrozenForce => "frozen_force",
            Self::Saturation => "saturation",
            Self::Brakes => "brakes",
        }
    }
}

/// A suspected mistake: a wrong name, sign or unit of a recorded column, or a wrong direction of gravity in the model
/// file. Unlike other disturbances, it can be corrected; until then, all results are doubtful.
#[derive(Clone, Debug, PartialEq)]
pub struct SuspectedFault {
    /// Its kind.
    pub kind: RecordingFaultKind,
    /// The coordinates, drives or columns that have it.
    pub at: Vec<String>,
    /// Files of the recordings that have it.
    pub recordings: Vec<String>,
    /// What was found, as a clause: `the force of joint3 has the wrong sign`.
    pub clause: String,
    /// What to do, as a sentence.
    pub advice: Message,
    /// Errors of the best fit before and after the correction, as a sentence; empty if they do not differ clearly.
    pub evidence: String,
    /// Sum over the drives of the logarithms by which the fitted errors fall with the correction.
    pub(crate) fit_gain: f64,
    /// What corrects it; `None` if several faults explain the recording equally well.
    pub(crate) correction: Option<FaultCorrection>,
}

impl SuspectedFault {
    /// The fault as a disturbance in the results of a diagnosis.
    pub(crate) fn disturbance(&self) -> Disturbance {
        Disturbance {
            kind: self.kind.name().to_owned(),
            at: self.at.clone(),
            estimates: Vec::new(),
            recordings: self.recordings.clone(),
            interval: None,
            description: Some(self.clause.replace('`', "")),
        }
    }

    /// What comes before the advice in a list of next steps.
    pub(crate) fn advice_heading(&self) -> &'static str {
        match self.kind {
            // It may be an error of the model file.
            RecordingFaultKind::GravityDirection => "Before the next diagnosis",
            _ => "Correct the recording first",
        }
    }

    /// The fault with its advice, in the answer of a diagnosis.
    pub(crate) fn answer(&self, wording: &dyn RemedyWording) -> CorrectedFaultAnswer {
        CorrectedFaultAnswer {
            kind: self.kind.name().to_owned(),
            at: self.at.clone(),
            recordings: self.recordings.clone(),
            says: self.clause.clone(),
            todo: self.advice.format_for(wording),
            heading: self.advice_heading().to_owned(),
        }
    }

    /// Whether a trial correction is possible.
    pub fn is_correctable(&self) -> bool {
        self.correction.is_some()
    }
}

/// Whether the verdict of a diagnosis names a disturbance, so that lists do not repeat it: the direction of gravity may be
/// an error of the model file.
pub(crate) fn is_named_by_verdict(one: &Disturbance) -> bool {
    one.kind == RecordingFaultKind::GravityDirection.name()
}

/// Whether a disturbance is a suspected mistake that makes all other findings doubtful until it is corrected.
pub(crate) fn is_suspicion(one: &Disturbance) -> bool {
    const SUSPICIONS: [RecordingFaultKind; 4] = [
        RecordingFaultKind::ExchangedColumns,
        RecordingFaultKind::WrongSign,
        RecordingFaultKind::Units,
        RecordingFaultKind::GravityDirection,
    ];
    // A time base differs between recordings too, with both of them named, and is no suspicion then.
    let is_clock = one.kind == RecordingFaultKind::TimeBase.name() && one.at == ["t"] && one.estimates.is_empty();
    is_clock || SUSPICIONS.iter().any(|kind| kind.name() == one.kind)
}

/// A recording whose faults are searched: as it was read, and prepared.
pub(crate) struct FaultSubject<'a> {
    /// The model.
    pub(crate) model: &'a Model,
    /// The recording as it was read.
    pub(crate) raw: &'a SignalRecording,
    /// Its segments as they were prepared.
    pub(crate) segments: &'a [RecordingSegment],
    /// Whether recorded derivatives are used.
    pub(crate) uses_recorded_derivatives: bool,
    /// Whether columns have other names or formulas in the file.
    pub(crate) has_mapping: bool,
}

impl FaultSubject<'_> {
    /// The options that read columns in another way. Where the file has other names, only the option itself is named,
    /// since its value depends on the present one.
    fn column_remedy(&self, maps: impl IntoIterator<Item = OptionSetting>) -> Remedy {
        if self.has_mapping {
            Remedy::option(OptionName::Columns)
        } else {
            Remedy::options(maps)
        }
    }

    /// Whether the derivative of a coordinate of an order, 1 or 2, is recorded and used.
    fn is_recorded(&self, coordinate: &str, order: usize) -> bool {
        let suffix = if order == 1 { "_d" } else { "_dd" };
        self.uses_recorded_derivatives && self.raw.has_column(&format!("{coordinate}{suffix}"))
    }
}

/// A possible fault with what it would change.
struct FaultHypothesis {
    /// Its kind.
    kind: RecordingFaultKind,
    /// Where it is.
    at: Vec<String>,
    /// What would be the case, as a clause.
    clause: String,
    /// What to do about it, as a sentence without the full stop.
    advice: Message,
    /// Its correction of sampled motion.
    motion: MotionChange,
    /// Its correction of sampled forces.
    forces: ForceChange,
    /// Its correction of the recording.
    operations: Vec<ColumnOperation>,
    /// Whether the numbers are implausible as they are, whatever the model.
    is_implausible_now: bool,
}

/// An entry of the list of faults.
trait RecordingFaultEntry: Sync {
    /// The hypotheses for a recording.
    fn hypotheses(&self, subject: &FaultSubject<'_>, bench: &FaultBench<'_>) -> Vec<FaultHypothesis>;
}

/// The list of mistakes that are corrected by an operation on columns.
const ENTRIES: [&dyn RecordingFaultEntry; 8] = [
    &time_base::TimeUnit,
    &angle_units::AngleUnit,
    &length_units::LengthUnit,
    &force_units::ForceUnit,
    &signs::ForceSign,
    &signs::CoordinateSign,
    &exchanged::ExchangedForces,
    &exchanged::ExchangedCoordinates,
];

/// Names in words: `a`, `a and b`, `a, b and c`, each in backquotes.
fn name_list(names: &[String]) -> String {
    let quoted: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    joined_by_and(&quoted)
}

/// The drive that acts on the coordinate with a name itself, if there is one.
fn drive_of_coordinate(mechanism: &Mechanism, name: &str) -> Option<usize> {
    let is_its = |kind: DriveKind| matches!(kind, DriveKind::Joint(k) if mechanism.coordinates[k.0].name == name);
    let mut drives = mechanism.drives.iter();
    drives.position(|drive| drive.is_driven && is_its(drive.kind))
}
