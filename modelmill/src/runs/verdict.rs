//! The verdict on a run compared with the first: what changed, that nothing did, or that the runs cannot show it.
//!
//! Decision: the verdict is not stored. It is computed whenever it is needed, from the changes, the moved parameters and
//! the drives whose forces cannot show a change. So no sentence can contradict the table below it.

use modelmill_identify::changes::SearchSensitivity;

use crate::runs::rows::UnexplainedShares;
use crate::runs::thresholds::{MOST_UNEXPLAINED_SHARE, ROWS_PER_PARAMETER, UNDETECTABLE_FORCE_SHARE};
use crate::runs::{PhysicalChange, RunReport};

/// The verdict on a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunVerdict {
    /// At least one physical change was found.
    Changed,
    /// The run differs, but no change that is searched explains it plausibly.
    DifferentWithoutCause,
    /// No change was found, and the forces of at least one drive would have shown one.
    Unchanged,
    /// No drive could show a change.
    Undecided,
}

impl RunVerdict {
    /// The word for scripts.
    pub fn keyword(self) -> &'static str {
        match self {
            Self::Changed => "changed",
            Self::DifferentWithoutCause => "different",
            Self::Unchanged => "unchanged",
            Self::Undecided => "cannot_tell",
        }
    }
}

/// A reason why the forces of a drive cannot show a change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum UndecidedReason {
    /// The run has fewer equations than its parameters need.
    TooFewEquations {
        /// Number of equations of all drives.
        equations: usize,
        /// Number of base parameters.
        parameters: usize,
    },
    /// The model leaves most of the force unexplained.
    UnexplainedForce {
        /// Share of the rms force in the worse run.
        share: f64,
    },
    /// A change would be reported only if it were a large part of the force.
    SmallestChange {
        /// The smallest change that would be reported, as a share of the force; infinite if no change would be.
        share: f64,
    },
    /// The drive is at standstill nearly all the time, so that its friction is unknown.
    Standstill,
}

impl UndecidedReason {
    /// The word for scripts.
    pub fn keyword(self) -> &'static str {
        match self {
            Self::TooFewEquations { .. } => "too_few_equations",
            Self::UnexplainedForce { .. } => "unexplained_force",
            Self::SmallestChange { .. } => "smallest_change",
            Self::Standstill => "standstill",
        }
    }

    /// Whether a fit to such forces describes nothing, so that its values must not be compared either.
    pub(crate) fn spoils_fit(self) -> bool {
        matches!(self, Self::TooFewEquations { .. } | Self::UnexplainedForce { .. })
    }
}

/// A drive whose forces cannot show a change.
#[derive(Clone, Debug, PartialEq)]
pub struct UndecidedDrive {
    /// The drive.
    pub drive: String,
    /// The reason.
    pub reason: UndecidedReason,
}

impl RunReport {
    /// The verdict on this run.
    pub fn verdict(&self) -> RunVerdict {
        // A contact within a run is no change of the machine.
        let is_event = |change: &PhysicalChange| matches!(change, PhysicalChange::ContactEvent { .. });
        if !self.changes.iter().all(|one| is_event(&one.change)) {
            return RunVerdict::Changed;
        }
        if self.undecided.len() >= self.drives {
            return RunVerdict::Undecided;
        }
        if !self.moved.is_empty() || self.has_rejected_changes {
            return RunVerdict::DifferentWithoutCause;
        }
        RunVerdict::Unchanged
    }
}

/// What is known of one of two runs.
pub(crate) struct RunKnowledge<'a> {
    /// Shares of the forces that the model leaves unexplained.
    pub(crate) unexplained: &'a UnexplainedShares,
    /// Whether each drive stands nearly all the time.
    pub(crate) stands: &'a [bool],
    /// Number of equations that count.
    pub(crate) equations: usize,
}

/// For each drive the reason why its forces cannot show a change; `None` if they can. `parameters` is the number of
/// base parameters, and `sensitivity` has the smallest change of the scale of each drive.
pub(crate) fn undecided_reasons(
    runs: [&RunKnowledge<'_>; 2],
    parameters: usize,
    sensitivity: &SearchSensitivity,
) -> Vec<Option<UndecidedReason>> {
    let equations = runs.map(|run| run.equations).into_iter().min().unwrap_or(0);
    let of_drive = |drive: usize| {
        let unexplained = runs.map(|run| run.unexplained.0[drive]);
        let unexplained = unexplained.into_iter().fold(0.0, f64::max);
        let smallest = sensitivity.smallest_values[drive];
        if (equations as f64) < ROWS_PER_PARAMETER * parameters as f64 {
            Some(UndecidedReason::TooFewEquations { equations, parameters })
        } else if unexplained > MOST_UNEXPLAINED_SHARE {
            Some(UndecidedReason::UnexplainedForce { share: unexplained })
        } else if runs.iter().any(|run| run.stands[drive]) {
            Some(UndecidedReason::Standstill)
        } else if smallest.is_nan() || smallest > UNDETECTABLE_FORCE_SHARE {
            Some(UndecidedReason::SmallestChange { share: smallest })
        } else {
            None
        }
    };
    (0..sensitivity.smallest_values.len()).map(of_drive).collect()
}
