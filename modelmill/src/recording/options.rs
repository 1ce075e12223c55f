//! Options for reading a recording and preparing its states.

use modelmill_identify::StatePreparation;

/// Options for reading a recording and preparing its states. [`RecordingOptions::default`] is for a file with the
/// names of the model.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordingOptions {
    /// Columns of the model, each with its name in the recording, `("theta1", "pos_left")`, or with a sum of columns,
    /// possibly in other units: `("q6", "(pos6 - pos5)/32 - 90 [deg]")`. Columns of the model are `t`, a coordinate,
    /// a coordinate with `_d` or `_dd`, a drive, and a drive with `_var` for the variance of its force.
    pub columns: Vec<(String, String)>,
    /// How positions are filtered and differentiated, and which samples are left out.
    pub preparation: StatePreparation,
    /// Whether to leave out samples with NaN, infinite or empty fields. If not, such a recording is refused.
    pub skip_bad_samples: bool,
    /// Whether to leave forces during contacts and pushes out of fits and error metrics: intervals in which no
    /// parameters explain the forces.
    pub leave_out_events: bool,
    /// Read only the samples between these times, s.
    pub between: Option<(f64, f64)>,
    /// Which forces are left out because a drive sticks or reverses there.
    pub standstill: StandstillRule,
}

/// Which forces are left out of fits and error figures because a drive sticks or reverses, where dry friction takes any
/// value up to its size.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum StandstillRule {
    /// Those in phases in which the forces show that the drive sticks.
    #[default]
    Automatic,
    /// Those at rates below this fraction of the largest rate of the drive.
    Below(f64),
    /// None.
    KeepAll,
}
