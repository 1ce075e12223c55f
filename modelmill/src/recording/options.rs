//! How a recording is read and its states are prepared.

use modelmill_identify::StatePreparation;

/// How a recording is read and its states are prepared; [`RecordingOptions::default`] suits a file with our names.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordingOptions {
    /// Our columns with what the recording calls them, `("theta1", "pos_left")`, or with a sum of its columns, in other
    /// units perhaps: `("q6", "(pos6 - pos5)/32 - 90 [deg]")`. Ours are `t`, a coordinate, a coordinate with `_d` or `_dd`,
    /// a drive, and a drive with `_var` for the variance of its force.
    pub columns: Vec<(String, String)>,
    /// How positions are filtered and differentiated, and what is left out.
    pub preparation: StatePreparation,
    /// Leave out samples with NaN, infinite or empty fields instead of refusing the recording.
    pub skip_bad_samples: bool,
    /// Leave the forces of contacts and pushes out of fits and figures: intervals in which no parameters explain them.
    pub leave_out_events: bool,
    /// Read only the samples between these times, s.
    pub between: Option<(f64, f64)>,
}
