//! Thresholds of recordings: numbers that decide what counts as a number, a gap, a spike or a jump. Each states what
//! it bounds, its unit, and how it was chosen. Limits of memory and of the formats stay where they are used.

/// Largest magnitude of a number, unit of the column; a larger one counts as not finite. No measured quantity in SI
/// units is near this, and squares of smaller values cannot overflow. By judgement.
pub(super) const LARGEST_NUMBER: f64 = 1e100;

/// Steps of time above this multiple of the median step are gaps (1). No filter is applied across a gap. By judgement.
pub(crate) const GAP_LEAST_STEPS: f64 = 5.0;

/// Parts of a recording are equally slow if their median step is at least this share of the longest one (1). By
/// judgement.
pub(super) const EQUALLY_SLOW_SHARE: f64 = 0.99;

/// Spikes and jumps are searched only in recordings with at least this many times the neighbours on one side of a
/// sample. By judgement.
pub(super) const REPAIR_NEIGHBOURHOODS: usize = 8;

/// A spike differs from its neighbours by more than this multiple of the standard deviation of the noise (1). By
/// judgement.
pub(super) const SPIKE_NOISE_SIGMAS: f64 = 20.0;

/// A spike also differs by more than this share of the range of the force (1). Reversals of friction stay below it. By
/// judgement.
pub(super) const SPIKE_RANGE_SHARE: f64 = 0.5;

/// Most samples of a spike in a row; a longer event may be a contact. By judgement.
pub(super) const SPIKE_MOST_SAMPLES: usize = 3;

/// Most samples in spikes as a share of all samples (1). A more frequent deviation is a property of the signal. By
/// judgement.
pub(super) const SPIKES_MOST_SHARE: f64 = 0.01;

/// A jump exceeds this multiple of the deviation of any other step from its neighbours (1). By judgement.
pub(super) const MIN_JUMP_RATIO: f64 = 8.0;

/// Most jumps of a position as a share of its samples (1). A more frequent deviation is a property of the sensor. By
/// judgement.
pub(super) const JUMPS_MOST_SHARE: f64 = 0.002;

/// Largest deviations that may be jumps in any recording, whatever `JUMPS_MOST_SHARE` allows. By judgement.
pub(super) const JUMPS_LEAST_ALLOWED: usize = 4;

/// A step of time above this multiple of the median separates rates, because the motion has changed in the meantime
/// (1). By judgement.
pub(super) const JUMP_GAP_STEPS: f64 = 3.5;

/// Least number of neighbours on each side of a rate next to such a step of time. By judgement.
pub(super) const JUMP_FEWEST_NEIGHBOURS: usize = 2;

/// A position jumps only within a step of time below this multiple of the median (1). By judgement.
pub(super) const JUMP_LONGEST_STEP: f64 = 1.5;

/// A jump is a full turn, and not a fault of the sensor, if it differs from one by less than this share (1). By
/// judgement.
pub(super) const TURN_TOLERANCE: f64 = 0.08;

/// After jumps whose sum exceeds this share of the largest, the note says that the zero position is uncertain (1). By
/// judgement.
pub(super) const ZERO_SHIFT_SHARE: f64 = 0.5;

/// Sample intervals between episodes that are read one after another; long enough that any low-pass has them in segments
/// of their own. By judgement.
#[cfg(feature = "parquet")]
pub(super) const EPISODE_GAP_STEPS: usize = 300;
// --- Wrapped angles

/// A step of an angle is a full turn if it differs from one by less than this share of the turn (1): a joint that
/// turns fast steps further within the sample. By judgement.
pub(super) const WRAP_STEP_TOLERANCE: f64 = 0.1;

/// A full turn counts as a wrapped angle if it exceeds this many median steps (1). By judgement.
pub(super) const WRAP_LEAST_STEPS: f64 = 10.0;

/// A wrapped angle exceeds the range of one turn by less than this share of the turn (1), for noise at its ends. By
/// judgement.
pub(super) const WRAP_RANGE_MARGIN: f64 = 0.01;
