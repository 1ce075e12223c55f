//! Options for reading a recording and preparing its states.

use modelmill_identify::StatePreparation;

/// Options for reading a recording and preparing its states. [`RecordingOptions::default`] is for a file with the
/// names of the model.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordingOptions {
    /// Assigns columns of the recording to signals that the model needs, as pairs. The first text of a pair is the
    /// signal: `t`, a coordinate, a coordinate with `_d` (rate) or `_dd` (acceleration), a drive (its force), or a
    /// drive with `_var` (variance of its force). The second text is the name of the column: `("theta1", "pos_left")`.
    /// It may also be a sum of columns, possibly in other units: `("q6", "(pos6 - pos5)/32 - 90 [deg]")`.
    pub columns: Vec<(String, String)>,
    /// How positions are filtered and differentiated, and which samples are left out.
    pub preparation: StatePreparation,
    /// Whether to leave out samples with NaN, infinite or empty fields. If not, such a recording is refused.
    pub skip_bad_samples: bool,
    /// Whether to exclude contacts and pushes from fits and error figures. These are intervals in which forces act that
    /// no parameters explain.
    pub leave_out_events: bool,
    /// Read only the samples between these times, s.
    pub between: Option<(f64, f64)>,
    /// Sampling rate of recordings without a column of times, Hz. The times of the samples follow from it.
    pub rate: Option<f64>,
    /// Which forces are left out because a drive sticks or reverses there.
    pub standstill: StandstillRule,
}

/// Which forces a prepared recording leaves out of all fits and error figures, because a drive sticks or reverses: dry
/// friction may have any value there, between zero and its value in motion.
///
/// [`EstimatorOptions::standstill`](crate::identify::EstimatorOptions::standstill) leaves out equations of one fit only.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum StandstillRule {
    /// Forces of stick phases, which are detected from rates and forces.
    #[default]
    Automatic,
    /// Forces at rates below this fraction of the largest rate of the drive.
    Below(f64),
    /// No forces are left out.
    KeepAll,
}

impl StandstillRule {
    /// The fraction of the largest rate below which forces are left out. It is above 0, as
    /// [`EstimatorOptions::standstill`](crate::identify::EstimatorOptions::standstill) expects it. None for the
    /// automatic rule, and if no forces are left out.
    pub fn bound(self) -> Option<f64> {
        match self {
            Self::Below(part) if part > 0.0 => Some(part),
            Self::Automatic | Self::Below(_) | Self::KeepAll => None,
        }
    }
}
