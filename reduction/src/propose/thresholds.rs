//! Thresholds of a proposed plan. Each states what it bounds, its unit, and how it was chosen.

/// Lengths that differ by less are equal, m. The same bound makes an assumption of a plan a fault. Motions are compared
/// within the tolerance of the rig's joints.
pub(super) const SAME_MOTION: f64 = crate::tolerance::TOLERANCE;

/// Values that differ by less than this share are equal and share a symbol (1). CAD programs print 6 to 12 digits, and
/// lengths between joints are differences of such values. By judgement.
pub(super) const SAME_VALUE: f64 = 1e-8;

/// Values that differ by at most this share are mentioned, with their difference, as a symbol that could be shared (1).
/// By judgement: left and right halves of a machine differ by their cables and screws.
pub(super) const SIMILAR_VALUE: f64 = 0.05;

/// Number of samples of the rig's motion, as plans have by default.
pub(super) const SAMPLES: usize = 200;

/// Number of samples from which the plane of a plan without groups is found; the reduction measures it with all samples.
pub(super) const PLANE_SAMPLES: usize = 20;

/// Ranges of the samples around the nominal configuration that are tried in turn, rad or m, until most poses can be
/// reached. The first is that of plans by default.
pub(super) const RANGES: [f64; 3] = [0.25, 0.1, 0.03];

/// A range is accepted if at least this share of the samples can be reached (1). By judgement.
pub(super) const REACHED_SHARE: f64 = 0.5;
