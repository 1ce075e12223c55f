//! Thresholds of faults of recordings. Each states what it bounds, its unit, and the data by which it was chosen.
//! Numbers that only set an accuracy or a grid stay where they are used.

// --- Errors under a hypothesis

/// Samples at which all forces were measured, below which no hypothesis is tested. By judgement.
pub(super) const BENCH_FEWEST_SAMPLES: usize = 100;

/// Fitted relative errors below this one count as this one (1): below it, noise decides. By judgement.
pub(super) const FIT_ERROR_FLOOR: f64 = 5e-3;

/// Errors with nominal values below this one count as this one (1): nominal values are no better. By judgement.
pub(super) const NOMINAL_ERROR_FLOOR: f64 = 0.05;

/// Errors with nominal values above this one count as this one (1), so that one wrong unit does not outweigh all other
/// drives. By judgement.
pub(super) const NOMINAL_ERROR_CAP: f64 = 2.0;

// --- Decisions

/// Sum over the drives of the logarithms by which fitted errors must fall (1). Planted faults give 3.9 and more, sound
/// recordings 0.5 and less (data sets `beyond`, spidermill, machines).
pub(super) const FIT_GAIN_DECISIVE: f64 = 1.6;

/// The fitted error of at least one drive falls below this share (1). By judgement.
pub(super) const FIT_MOST_RATIO: f64 = 0.5;

/// The same for errors with nominal values, where these decide (1). By judgement.
pub(super) const NOMINAL_GAIN_DECISIVE: f64 = 0.4;

/// Rise of errors with nominal values up to which a fall of fitted errors is believed, as a sum of logarithms (1). By
/// judgement.
pub(super) const NOMINAL_LOSS_TOLERANCE: f64 = 0.3;

/// Rise of fitted errors up to which nominal values are believed, as a sum of logarithms (1). By judgement.
pub(super) const FIT_LOSS_TOLERANCE: f64 = 0.1;

/// Nominal values decide on a drive whose error with them is above this one as it is recorded (1). By judgement.
pub(super) const NOMINAL_BEFORE_LEAST: f64 = 0.9;

/// ... and below this one after the correction (1). By judgement.
pub(super) const NOMINAL_AFTER_MOST: f64 = 0.6;

/// A hypothesis is a rival of the best one if its sum of logarithms is smaller by less than this (1). By judgement.
pub(super) const RIVAL_MARGIN: f64 = 0.4;

/// Power that friction dissipates, relative to the rms values of rate and force (1), beyond which its direction is
/// certain. The drives of the Cloos, the KUKA KR300, the Panda and a TX40 have 0.09 to 0.56.
pub(super) const LEAST_DISSIPATION: f64 = 0.06;

/// Where the direction of friction decides on a sign, fitted errors fall by this sum of logarithms (1). Turned forces of
/// the Cloos and the KUKA give 0.28 and 0.71; a joint of a double pendulum whose friction is not visible -0.07.
pub(super) const FRICTION_LEAST_FIT_GAIN: f64 = 0.15;

/// As [`RIVAL_MARGIN`], where the direction of friction decides (1): the sign of a force and that of its coordinate differ
/// by 0.34 and 1.1 on these two.
pub(super) const SIGN_RIVAL_MARGIN: f64 = 0.25;

/// Hypotheses are equivalent if all errors differ by less than this share (1). By judgement.
pub(super) const EQUIVALENT_ERROR_TOLERANCE: f64 = 1e-3;

/// Fitted error of a drive (1) up to which no fault of the motion is searched. By judgement.
pub(super) const MOTION_LEAST_ERROR: f64 = 0.03;

/// Mean error with nominal values (1) up to which no fault of the motion is searched, if the fit is good. By judgement.
pub(super) const MOTION_LEAST_NOMINAL_ERROR: f64 = 0.5;

// --- Units

/// Mean step of the time above which it is hardly in s, s. By judgement.
pub(super) const LONGEST_PLAUSIBLE_STEP_S: f64 = 0.5;

/// Mean step of the time up to which no other unit is tested, s. By judgement.
pub(super) const LONGEST_USUAL_STEP_S: f64 = 0.06;

/// Shortest mean step of a recording of forces, s. By judgement.
pub(super) const SHORTEST_PLAUSIBLE_STEP_S: f64 = 1e-5;

/// An angle beyond this value may be in degrees, rad: one turn. By judgement.
pub(super) const LARGEST_USUAL_ANGLE_RAD: f64 = 2.0 * std::f64::consts::PI;

/// An angle within this value is not in degrees (degrees): a joint that is recorded moves further. By judgement.
pub(super) const LEAST_ANGLE_IN_DEGREES: f64 = 2.0;

/// A length within this value is not in millimetres (mm). By judgement.
pub(super) const LEAST_LENGTH_IN_MILLIMETRES: f64 = 2.0;

// --- Gravity

/// Error of a drive with nominal values (1) up to which it does not question the direction of gravity. By judgement.
pub(super) const GRAVITY_LEAST_NOMINAL_ERROR: f64 = 0.3;

/// The estimated gravity has the size of that of the file within this share (1). By judgement.
pub(super) const GRAVITY_SIZE_TOLERANCE: f64 = 0.25;

/// Directions that differ by less are the same, rad. A tilted base is an effect of the library. By judgement.
pub(super) const GRAVITY_LEAST_ANGLE_RAD: f64 = 0.6;

/// A direction of gravity this near to an axis of the base is that of the axis, rad. By judgement.
pub(super) const GRAVITY_AXIS_TOLERANCE_RAD: f64 = 0.12;

/// Mean error with nominal values and the new direction that is not exceeded (1), relative to friction alone. With gravity
/// along x in the model file, the recordings of the Panda give 0.37: they were smoothed by the wrong model.
pub(super) const GRAVITY_MOST_NOMINAL_ERROR: f64 = 0.5;

/// Mean over the drives of the logarithms by which errors with nominal values fall (1): they halve. The same recordings
/// give 1.4.
pub(super) const GRAVITY_LEAST_GAIN_OF_DRIVE: f64 = 0.7;

/// Fewest drives that must question the direction of gravity: with one, any missing effect of the position may look like
/// it. By judgement.
pub(super) const GRAVITY_FEWEST_DRIVES: usize = 2;

/// The component of gravity along an axis must be known to this share of gravity (1). By judgement.
pub(super) const GRAVITY_MOST_UNCERTAINTY: f64 = 0.15;

// --- Forces that were not measured

/// An interval without a force signal lasts at least this long, s. By judgement.
pub(super) const SILENCE_SHORTEST_S: f64 = 0.3;

/// ... and has at least this many samples. By judgement.
pub(super) const SILENCE_FEWEST_SAMPLES: usize = 30;

/// Samples of an interval lie within this many standard deviations of white noise of its level. By judgement.
pub(super) const SILENCE_NOISE_SIGMAS: f64 = 5.0;

/// A drive with more such intervals has a dead band or a limit, and none is reported. By judgement.
pub(super) const SILENCE_MOST_INTERVALS: usize = 4;

/// In an interval the residual must exceed that of the rest of the recording by this factor (1). By judgement.
pub(super) const SILENCE_RESIDUAL_FACTOR: f64 = 4.0;

/// ... and this share of the rms force of the drive (1). By judgement.
pub(super) const SILENCE_LEAST_FORCE_SHARE: f64 = 0.15;

/// A joint stands if it moves by less than this share of its travel (1). By judgement.
pub(super) const SILENCE_STANDSTILL_SHARE: f64 = 0.002;

/// ... and moves if it moves by more than this share (1). In between nothing is reported, since friction may hold a slow
/// joint. By judgement.
pub(super) const SILENCE_MOTION_SHARE: f64 = 0.05;

/// A channel whose values repeat exactly is stuck if elsewhere at most this share of its values repeats (1). By
/// judgement: readings with a dead band or coarse steps repeat often.
pub(super) const FROZEN_MOST_REPEATS: f64 = 0.05;

/// ... and if at most this share of the readings is stuck (1). By judgement.
pub(super) const FROZEN_MOST_SHARE: f64 = 0.5;

/// Readings have noise if it exceeds this share of their rms value (1). By judgement: forces of a simulation without noise
/// may repeat where a motion is uniform.
pub(super) const FROZEN_LEAST_NOISE_SHARE: f64 = 1e-4;

/// A force is at a limit if its largest or smallest value repeats for at least this many samples ...
pub(super) const LIMIT_FEWEST_REPEATS: usize = 3;

/// ... and is there for at least this many samples in all ...
pub(super) const LIMIT_FEWEST_SAMPLES: usize = 20;

/// ... which are this share of all samples (1). By judgement.
pub(super) const LIMIT_LEAST_SHARE: f64 = 0.005;

/// At a limit of a sensor the model predicts larger forces for at least this share of the samples (1). By judgement.
pub(super) const LIMIT_LEAST_SHARE_BEYOND: f64 = 0.8;

/// As many neighbouring samples have about the same error of the model. By judgement: 0.15 s at 200 Hz.
pub(super) const SILENCE_DEPENDENT_SAMPLES: f64 = 30.0;

/// With brakes on, no drive has a force above this many times its white noise (1) ...
pub(super) const BRAKED_NOISE_FACTOR: f64 = 3.0;

/// ... or this share of its rms force, since sensors have an offset (1). By judgement.
pub(super) const BRAKED_FORCE_SHARE: f64 = 0.03;

/// While a channel is stuck, the predicted force varies by at least this many times the residual of the rest of the
/// recording (1). By judgement.
pub(super) const SILENCE_VARIATION_FACTOR: f64 = 2.0;
