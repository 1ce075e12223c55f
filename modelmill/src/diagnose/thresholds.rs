//! Thresholds of the diagnosis: the numbers that decide what is reported of a recording or a model. Each states
//! what it bounds, its unit, and how it was chosen. Numbers that only set an accuracy or a grid stay where they
//! are used.

/// Most relative error on validation data, as a part of the force (1), for which findings are reported: above 1
/// the prediction that all forces are zero would be better. By definition.
pub(super) const MOST_VALIDATION_ERROR: f64 = 1.0;

/// Differences between recordings are assumed only if leaving them out makes the mean square residual this many
/// times as large (1). Otherwise what the model lacks may look like a difference. A drift or a step replaces a
/// difference only if its mean square residual is smaller by this factor. By judgement.
pub(super) const DIFFERENCE_LEAST_GAIN: f64 = 1.5;

/// If this part of the error stays after the last step (1), the verdict quotes the drive whose error falls most
/// instead of all drives together. By judgement.
pub(super) const HARDLY_LOWER: f64 = 0.99;

/// Forces are called noise-free if their noise is at most this many times the rounding of recorded numbers (1).
/// By judgement.
pub(super) const NOISE_FREE_ROUNDINGS: f64 = 2.0;

/// Samples that each recording must have after decimation; fewer cannot separate effects from chance. By judgement.
pub(super) const FEWEST_SAMPLES: usize = 60;

/// A base parameter differs from its nominal value if the difference is above this many standard deviations
/// (1). By judgement.
pub(super) const OFF_NOMINAL_SIGMAS: f64 = 5.0;

/// A base parameter differs from its nominal value if the difference is also above this part of the value (1).
/// By judgement.
pub(super) const OFF_NOMINAL_PART: f64 = 0.01;

/// Every parameter of a body may differ from the file by this factor (1) before the sign of a base parameter is called
/// impossible. By judgement.
pub(super) const BODY_PARAMETER_FACTOR: f64 = 3.0;

/// Random bodies within `BODY_PARAMETER_FACTOR` that must all agree on the sign of a base parameter. By judgement.
pub(super) const SIGN_TRIALS: usize = 200;

/// The force of a contact must exceed the rms value of a residual that follows the time at the same drive by this factor
/// (1): the peaks of a ringing joint reach 4.6 (`flexible-motor-encoder`). By judgement.
pub(super) const CONTACT_LEAST_RESIDUAL_RATIO: f64 = 5.5;

/// A contact of the audit is there only if the residual with the effects found reaches this share of its force (1). A delay,
/// a slow clock or outliers make the audit see forces of which 0.05 to 0.3 are left; of a contact at least 0.7 is left, since
/// a low-pass rounds it. By judgement between them.
pub(super) const CONTACT_LEAST_REST_SHARE: f64 = 0.5;

/// Contacts that last for more than this share of a recording may be a change in time (1): a load that is taken up after a third
/// of a recording makes the time before it look like contacts (`lab/numpy-plant/unseen.py`, seeds 59 and 61: 25 and 31 %).
pub(super) const CONTACTS_MOST_SHARE: f64 = 0.2;

/// A residual shows whether a contact is there only if this share of its samples (1) is in motion and not left out for
/// another reason. By judgement.
pub(super) const CONTACT_LEAST_KNOWN_SHARE: f64 = 0.5;

/// Contacts with less time between them are reported as one, s. By judgement.
pub(super) const CONTACT_GAP_S: f64 = 0.3;

/// Samples beyond the place of a contact, at other times, that decide whether the force is a function of the
/// position. By judgement.
pub(super) const REPEATED_PLACE_FEWEST_SAMPLES: usize = 10;

/// The rms residual beyond the place at other times is at least this share of that of the event (1). By judgement, from a
/// push on a KUKA KR300, where it is 0.03.
pub(super) const REPEATED_PLACE_LEAST_SHARE: f64 = 0.3;

/// The force of an event is a function of the position, such as an end stop, if the line fitted during the event leaves
/// less than this part of the squared force at other times (1). By judgement.
pub(super) const REPEATED_PLACE_MOST_RESIDUAL: f64 = 0.5;

/// A tilt of the base about an axis is tried if it changes a base column by more than this (unit of the
/// column). Below it is rounding. By judgement.
pub(super) const TILT_LEAST_EFFECT: f64 = 1e-6;

/// A zero of an encoder acts as a tilt of the base if the columns of both differ by at most this part (1). It is rounding of
/// the central differences. By judgement.
pub(super) const ZERO_AS_TILT_MOST_DIFFERENCE: f64 = 1e-4;

/// A tilt is about the axis of a joint if its other components are within this many standard deviations (1). By
/// judgement.
pub(super) const TILT_AXIS_MOST_DEVIATIONS: f64 = 3.0;

/// A column of a payload has no effect if its largest value is below this part of the largest of all payload
/// columns (1). Below it is rounding. By judgement.
pub(super) const PAYLOAD_LEAST_EFFECT: f64 = 1e-9;

/// A column of a length or an angle has no effect if its largest difference is below this (unit of the column).
/// Below it is rounding of the central differences. By judgement.
pub(super) const CONSTANT_LEAST_EFFECT: f64 = 1e-7;

/// Samples that each wave of an encoder error must have; errors with fewer are not tried. By judgement.
pub(super) const ENCODER_WAVE_SAMPLES: f64 = 12.0;

/// A central difference above this many times the median is a jump of a sign, such as that of dry friction, and
/// is set to zero (1). By judgement.
pub(super) const SLOPE_JUMP_MEDIANS: f64 = 100.0;

/// A kind of effect repeats along the travel of its place if its shortest wavelength is below this part of the
/// travel (1). By judgement.
pub(super) const WAVE_SHORTEST_TRAVEL: f64 = 0.5;

// --- Hypothetical corrections of recordings

/// Rounds of looking for a fault of the recordings and correcting it. By judgement.
pub(super) const CORRECTION_ROUNDS: usize = 3;

/// A fault of one recording is corrected in another one if the errors fall by at least this sum of logarithms over the
/// drives there (1). By judgement.
pub(super) const SHARED_FAULT_LEAST_SCORE: f64 = 0.3;
/// Fewest significant digits of an estimate, however uncertain it is: estimates of an effect with several parameters may be
/// uncertain one by one although their force is not. By judgement.
pub(super) const ESTIMATE_FEWEST_DIGITS: usize = 5;
/// Most significant digits of an estimate. By judgement: recordings have at most this many.
pub(super) const ESTIMATE_MOST_DIGITS: usize = 9;

/// Errors of the geometry are alternatives to the effects found if their squared residual is at most this many times
/// that with the effects (1). In 0.3 % of noise, other constants than the true one leave 1.3 times as much and more
/// (`lab/numpy-plant`). By judgement.
pub(super) const ALTERNATIVE_MOST_RESIDUAL: f64 = 1.05;

/// Part of the squared residual of the given model (1) that their fit may leave in addition, since it ends after few
/// rounds. By judgement.
pub(super) const ALTERNATIVE_ROUNDING: f64 = 1e-7;

/// Largest error of a length as a part of the machine's size, or of an angle as a part of a radian (1), that counts as an
/// alternative: larger ones would be seen. By judgement.
pub(super) const ALTERNATIVE_MOST_ERROR: f64 = 0.1;

/// Alternatives are searched only if the effects found explain at least this part of the squared residual (1): with
/// less, any error would seem to explain as much. By judgement.
pub(super) const ALTERNATIVE_LEAST_GAIN: f64 = 0.1;

/// The answer of a repeated search replaces the one before if its mean square residual is at most this many times as large
/// (1): fewer effects leave a little more. By judgement.
pub(super) const CONSTANT_MOST_RESIDUAL: f64 = 1.1;

/// A search is not repeated if the errors of constants that it claims changed by at most this share (1). By judgement.
pub(super) const CONSTANT_SETTLED_SHARE: f64 = 0.01;

/// An error of the geometry that explains at least this part of what the effects found explain (1) cannot be
/// distinguished from them. By judgement.
pub(super) const EQUAL_ALTERNATIVE_LEAST_SHARE: f64 = 0.97;

/// A search with effects at the claimed lengths replaces the one with effects at the lengths of the file if its mean
/// square residual is at most this part (1). By judgement: where both lengths explain equally much, the answer stays.
pub(super) const CLAIMED_LENGTH_MOST_RESIDUAL: f64 = 0.8;

/// A search with zeros as candidates replaces the one without, if it needs fewer effects and its mean square residual is
/// at most this many times as large (1). By judgement.
pub(super) const ZEROS_MOST_RESIDUAL: f64 = 1.05;

/// It also replaces it with as many effects, or where something was unexplained, if its mean square residual is below
/// this part (1). By judgement.
pub(super) const ZEROS_LEAST_RESIDUAL: f64 = 0.8;

/// Most alternatives that are reported. By judgement: more do not help to decide what to measure.
pub(super) const MOST_ALTERNATIVES: usize = 3;

/// A model with more products of parameters than this is not derived again for zeros of its file: the derivation of a
/// Gough-Stewart platform with 142 takes 17 s, that of all other bundled models below 1 s.
pub(super) const ZEROS_MOST_PRODUCTS: usize = 100;

/// Most zeros that are named; with more, too many sets of errors explain the same. By judgement: the legs of a delta
/// robot have twelve.
pub(super) const MOST_ZEROS: usize = 12;

/// An eccentric encoder may be an elastic drive if the weight on it explains this share of the variance of the encoder's error
/// (1). By judgement.
pub(super) const ELASTIC_LEAST_SHARE: f64 = 0.8;

/// An offset of a force that returns within this time may be a contact or a push (s): both act for as long. By judgement.
pub(super) const BRIEF_MOST_S: f64 = 1.0;
