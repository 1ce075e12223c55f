//! Thresholds of the diagnosis: the numbers that decide what is reported of a recording or a model. Each states what it
//! bounds, its unit, and how it was chosen. Numbers that only set an accuracy, a grid or the effort of a search stay
//! where they are used. With all of them together, 200 recordings with white noise and without any effect raised no
//! alarm (`docs/guide/src/figures.md`).

// --- evidence for a change of the set

/// A change must lower the squared error on its channels by this share where it was not fitted (1). By judgement.
pub(super) const LEAST_GAIN: f64 = 0.02;

/// If the residual is white noise, the least gain is this many times its variance on data that was not fitted (1). By
/// judgement. With fit and validation runs used together, such limits lower the detectable size by 15 to 40 %
/// (CHANGELOG.md).
pub(super) const NOISE_LEAST_GAIN_VARIANCES: f64 = 8.0;

/// Least gain of any change (1): half of it is the fall of the error itself, which shows in the third printed digit of
/// the error at the latest. By judgement.
pub(super) const MATERIAL_LEAST_GAIN: f64 = 0.005;

/// A kind with at least this many more estimated numbers is a refinement, which must lower the squared error on its
/// channels by [`REFINEMENT_LEAST_GAIN`]. By judgement.
pub(super) const REFINEMENT_FEWEST_NUMBERS: usize = 3;

/// Least gain of a general kind that replaces simpler members (1). By judgement.
pub(super) const REFINEMENT_LEAST_GAIN: f64 = 0.1;

/// An exchange or a removal must not raise the squared error on data that was not fitted by more than this share (1).
/// By judgement.
pub(super) const GIVEN_BACK_MOST_SHARE: f64 = 0.04;

/// A rise of the error that is below this many standard errors over the blocks (1) is noise. By judgement.
pub(super) const GIVEN_BACK_LEAST_T: f64 = 1.0;

/// A step may raise the relative error of all drives together by this part (1), if it lowers that of its own drive. By
/// judgement.
pub(super) const STEP_MOST_RISE: f64 = 1e-3;

/// Least t value of the gain over the blocks if the residual is white noise (1): only noise makes blocks differ then.
/// By judgement.
pub(super) const NOISE_LEAST_T: f64 = 1.0;

/// A residual is white noise if its effective samples are more than this share of its samples (1). By judgement.
pub(super) const WHITE_LEAST_EFFECTIVE_SHARE: f64 = 0.5;

/// A residual is white noise only if its squares are below this many times those of the noise between neighbouring
/// samples (1). By judgement.
pub(super) const WHITE_MOST_NOISE_RATIO: f64 = 1.5;

/// A gain below this part of the squares that other effects explain (1) may come from the uncertainty of these effects.
/// By judgement.
pub(super) const MIN_SHARE_OF_OTHERS: f64 = 1e-4;

/// A gain below this part of the squares of subtracted differences between recordings (1) may be what they leave: their
/// sizes are estimates. By judgement: a payload that differs by 1.5 kg left a Dahl friction of 0.8 % of its force.
pub(super) const MIN_SHARE_OF_REMOVED: f64 = 3e-4;

/// A gain below this part of a force's squares (1) may come from the smoothing of the positions. By judgement.
pub(super) const MIN_SHARE_OF_FORCE: f64 = 1e-5;

/// Squared errors below this, relative to the variance of the noise (1), contain nothing to explain. By judgement.
pub(super) const EXPLICABLE_LEAST_NOISE_RATIO: f64 = 0.8;

/// Least t value of the gain (1): its mean over the blocks, divided by its standard error. By judgement.
pub(super) const BLOCKS_LEAST_T: f64 = 2.5;

/// From this gain on (1), it is enough that the blocks gain relative to their own error. By judgement.
pub(super) const LARGE_GAIN: f64 = 0.15;

/// Least t value of the gain of each block relative to its own error (1), if the gain is large. By judgement.
pub(super) const LEAST_SHARES_T: f64 = 4.0;

// --- possible estimates

/// If an estimate with the wrong sign explains less than this share of the squared error (1), its sign is random. By
/// judgement.
pub(super) const RANDOM_SIGN_SHARE: f64 = 0.05;

/// Two effects at a place cancel if their sum has less than this share of the squares of the larger one (1). A quarter
/// of the squares is half of the amplitude. By judgement.
pub(super) const CANCELLATION_SHARE: f64 = 0.25;

/// The same for two effects at different places: their columns differ, so that only what cancels nearly completely is
/// no effect (1). By judgement.
pub(super) const FULL_CANCELLATION_SHARE: f64 = 0.03;

/// A force of a parameter is implausible if half of its range is above this many times the largest force of its drive
/// (1). A spring or a counterweight that carries most of the weight may be several times as strong as its drive. By
/// judgement.
pub(super) const PLAUSIBLE_MOST_FORCE_RATIO: f64 = 5.0;

/// Half of the change of friction over a recording is at most this multiple of the friction in its middle (1): beyond 1
/// friction drives the machine at the start or at the end. By judgement.
pub(super) const PLAUSIBLE_MOST_FRICTION_CHANGE: f64 = 1.1;

/// A column of the model has the shape of friction if less than this share of its squares is left (1): decimation smooths
/// the switch of dry friction, which leaves 0.07 on a fast pendulum; a sinusoidal rate leaves 0.19 of a switch.
pub(super) const SAME_SHAPE_MOST_REST: f64 = 0.12;

/// Largest plausible error of a length, as a part of the largest distance of two frames (1). By judgement.
pub(super) const PLAUSIBLE_MOST_LENGTH_SHARE: f64 = 0.3;

/// Largest plausible error of an angle or of the zero of an encoder, rad: what is larger is another fault. By judgement.
pub(super) const PLAUSIBLE_MOST_ANGLE: f64 = 0.7;

/// Largest plausible play of a gear or eccentricity of an encoder, rad. By judgement.
pub(super) const PLAUSIBLE_MOST_PLAY: f64 = 0.1;

/// The same for a length, as a part of the largest distance of two frames (1). By judgement.
pub(super) const PLAUSIBLE_MOST_PLAY_SHARE: f64 = 0.05;

/// Largest plausible delay or time constant of a force signal, s. By judgement.
pub(super) const PLAUSIBLE_MOST_DELAY: f64 = 0.1;

/// Largest plausible friction as a share of the load (1): a drive with more could not move. By judgement.
pub(super) const PLAUSIBLE_MOST_LOAD_SHARE: f64 = 1.0;

/// Largest plausible error of a clock or a sampling rate (1). By judgement: larger ones are other units.
pub(super) const PLAUSIBLE_MOST_CLOCK_SHARE: f64 = 0.1;

/// A constant above this part of the largest value of its grid (1) is at the end of its range. By judgement.
pub(super) const GRID_END_SHARE: f64 = 0.99;

/// Least plausible relative error of the scale of a force signal (1). A signal at -1 does not follow the motion at all.
/// By judgement, from the torso of a robot with -1.085 and joints with pushes with -0.94 to -0.99 (issue 28).
pub(super) const GAIN_LEAST: f64 = -0.75;

/// Largest plausible relative error of the scale of a force signal (1). By judgement.
pub(super) const GAIN_MOST: f64 = 3.0;

/// Least plausible relative change of the scale of a force signal during a recording (1): at -1 the signal is dead, beyond
/// it has the wrong sign. By judgement, with some uncertainty.
pub(super) const GAIN_CHANGE_LEAST: f64 = -1.1;

/// A wrong scale of a force signal must leave at most this share of the squared error of its drive, on data that was not
/// fitted (1). By judgement.
pub(super) const SCALE_MOST_REMAINING_SHARE: f64 = 0.5;

/// Largest difference of its values in the two halves of the data, relative to the larger one (1). By judgement.
pub(super) const SCALE_MOST_DIFFERENCE: f64 = 0.3;

/// Samples on either side of a reversal that are near it. By judgement.
pub(super) const FAR_REVERSAL_SAMPLES: usize = 4;

/// Share of the samples that must be far from reversals (1), so that a delay can be confirmed there. By judgement.
pub(super) const FAR_LEAST_SHARE: f64 = 0.2;

/// A delay or low-pass must have at least this part of its gain far from reversals too (1). By judgement.
pub(super) const DELAY_LEAST_SHARE_FAR: f64 = 0.25;

/// A column of an effect is dependent if less than this share of its squares remains after the projection on the others
/// (1). By judgement.
pub(super) const EFFECT_INDEPENDENCE_TOLERANCE: f64 = 1e-6;

/// An estimate is determined if its variance is below this many times what its column alone would give (1). By
/// judgement.
pub(super) const ESTIMATE_MOST_VARIANCE_RATIO: f64 = 1e9;

// --- search

/// A rival whose squares are within this factor (1) is tried with finer constants. By judgement.
pub(super) const RIVAL_MOST_RATIO: f64 = 1.5;

/// The same for a rival whose constant has only been searched on a grid so far (1). By judgement.
pub(super) const RIVAL_MOST_GRID_RATIO: f64 = 20.0;

/// A rival is tried with finer constants if this factor (1) times what it explains with a constant of the grid would be
/// enough. By judgement.
pub(super) const RIVAL_FINER_GAIN_FACTOR: f64 = 2.0;

/// A simpler kind comes before a more general one that contains it, if it reaches this share of the gain (1). By
/// judgement.
pub(super) const SIMPLER_KIND_SHARE: f64 = 0.97;

/// Another simple kind comes before a refinement of a member, if it reaches this share of the gain (1). By judgement.
pub(super) const OTHER_KIND_SHARE: f64 = 0.7;

/// A set with fewer estimated numbers comes before the best one if its criterion (twice the logarithm of the
/// likelihood) is worse by at most this (1). By judgement.
pub(super) const SIMPLER_SET_MOST_LOSS: f64 = 2.0;

/// By how much the criterion (twice the logarithm of the likelihood) of another set must be below that of a set that
/// only grows (1). By judgement.
pub(super) const OTHER_SET_LEAST_ADVANTAGE: f64 = 20.0;

/// Share of the squared error on its channels by which such a set must improve on the grown one (1). By judgement.
pub(super) const OTHER_SET_LEAST_GAIN: f64 = 0.1;

/// Price of each place of an effect in the criterion (1), which decides only between sets that are otherwise equal. By
/// judgement.
pub(super) const PLACE_PRICE: f64 = 0.01;

// --- the last set

/// Least decrease of the criterion for an exchange of members (1). By judgement.
pub(super) const EXCHANGE_LEAST_DECREASE: f64 = 1.0;

/// Two members whose criteria differ by less than this (1) are equally good. By judgement.
pub(super) const EQUALLY_GOOD_DIFFERENCE: f64 = 5.0;

/// An effect is dropped if it explains less than this many times the squares that stay unexplained on its channels (1): an
/// unknown law is as likely there. By definition.
pub(super) const EFFECT_LEAST_UNEXPLAINED_RATIO: f64 = 1.0;

/// A drift stays in a set with other effects if the error on the validation runs becomes this many times as large without it
/// (1): the evidence for the others was computed with it. By judgement, from recordings of a double pendulum whose friction
/// was less likely than not without a drift.
pub(super) const SPOILED_LEAST_RISE: f64 = 1.25;

/// A residual of this share of the force (1) counts as unexplained even if it is not repeatable. By judgement, from a
/// pendulum whose measured torque does not follow its motion.
pub(super) const LARGE_RESIDUAL_SHARE: f64 = 0.5;

// --- alternatives, probabilities and what is undecided

/// A set is distinguishable from the best one if its criterion is worse by this much (1): twice the logarithm of the
/// likelihood, with the effective number of samples. By judgement.
pub(super) const MIN_DISTINCTION: f64 = 9.0;

/// Place of the forces on the line from the fit with a delay (0) to that with a low-pass (1), or the other way round,
/// up to which the fit at 0 is shown (1). By judgement: a quarter of the way to the other one.
pub(super) const SIGNAL_FAULT_MOST_PLACE: f64 = 0.25;

/// Squares of the difference between the fits with a delay and with a low-pass, relative to those of the residual,
/// from which on they can be distinguished (1). By judgement: smoothing of positions causes errors of a fifth of the
/// noise. A true low-pass of 35 Hz on the spidermill, at some 0.02, was bent to a delay.
pub(super) const SIGNAL_FAULT_LEAST_DIFFERENCE: f64 = 0.05;

/// A clock and a wrong length are not distinguished if the squared residual with the one is at most this many times that
/// with the other (1): scaled times are scaled lengths, and what differs is as small as errors of smoothing. By judgement.
pub(super) const CLOCK_OR_LENGTH_MOST_RATIO: f64 = 1.05;

/// An alternative must explain at least this share of what the effect explains (1). By judgement.
pub(super) const MIN_SUBSTITUTE_SHARE: f64 = 0.8;

/// A force signal fault or a body is evaluated with a column at its estimated value, if the squares of its set are
/// below this factor times those of the best set (1). By judgement.
pub(super) const SUBSTITUTE_MOST_RATIO: f64 = 3.0;

/// An effect that explains less than this share of the squares (1) has no alternatives. By judgement.
pub(super) const NEGLIGIBLE_EFFECT_SHARE: f64 = 1e-6;

/// Logarithm of the odds of an effect with the gain and the t value of reference and nothing unexplained (1).
/// This and the next three were chosen by the largest likelihood on 43 claims with known truth (38 of them true) of
/// `spidermill-harsh`, `spidermill-cases` and `beyond` in `shared/data`, rounded.
pub(super) const ODDS_AT_REFERENCE: f64 = 0.9;

/// Rise of these for each factor e of the t value (1). By the same likelihood.
pub(super) const ODDS_PER_T: f64 = 1.5;

/// Rise of these for each factor e of the gain (1). By the same likelihood.
pub(super) const ODDS_PER_GAIN: f64 = 1.0;

/// Fall of these for each factor e of one plus the unexplained ratio (1). By the same likelihood.
pub(super) const ODDS_PER_UNEXPLAINED: f64 = 2.0;

/// Odds of an alternative that explains as much, relative to the effect that was preferred as the simpler one (1). By
/// judgement.
pub(super) const ODDS_OF_ALTERNATIVE: f64 = 0.5;

/// The t value of reference, and the range to which a t value is limited (1). By judgement.
pub(super) const SUPPORT_T_REFERENCE: f64 = 4.0;
pub(super) const SUPPORT_T_RANGE: [f64; 2] = [0.2, 12.0];

/// The gain of reference, and the range to which a gain is limited (1). By judgement.
pub(super) const SUPPORT_GAIN_REFERENCE: f64 = 0.3;
pub(super) const SUPPORT_GAIN_RANGE: [f64; 2] = [0.005, 1.0];

/// Largest probability of an effect: no data exclude a cause that is no candidate (1). By judgement.
pub(super) const PROBABILITY_MOST: f64 = 0.99;

/// A parameter differs clearly from zero if it exceeds this many standard deviations (1). By convention.
pub(super) const CLEAR_LEAST_DEVIATIONS: f64 = 2.0;

/// Terms of an effect cancel each other if the square of their sum is below this share of the sum of their squares (1). By
/// judgement; a single term has 1.
pub(super) const CANCELLING_MOST_SHARE: f64 = 0.5;

/// Largest probability of an effect of which no parameter differs clearly from zero and whose terms cancel (1): it is possible, but not lacking.
/// By judgement; a cable torque on EMPS with a step of the force has such values (`lab/measured/planted.py`).
pub(super) const UNCLEAR_MOST_PROBABILITY: f64 = 0.4;

/// Below this probability an effect is possible and does not count as missing by itself. By definition.
pub const LACKING_LEAST_PROBABILITY: f64 = 0.5;

/// A column whose share of squares outside of the others is below this (1) is a combination of them along any motion,
/// and its effect is not listed as undecided. Below it is rounding. By judgement.
pub(super) const UNDECIDED_LEAST_SHARE: f64 = 1e-18;

/// An effect is undecided if the squares of a force as large as the drives' own, without what the other columns
/// explain of it, are below this many variances of the residual (1): the uncertainty of the effect is then larger than
/// that force. By definition.
pub(super) const UNDECIDED_MOST_VARIANCES: f64 = 1.0;

// --- noise

/// Errors below this share of a force are rounding, of the recording or of its simulation. By judgement.
pub const FORCE_ROUNDING: f64 = 3e-6;

/// The noise of a residual is coloured if its effective number of samples is at most this share of all samples (1). By
/// judgement.
pub(super) const COLOURED_MOST_EFFECTIVE_SHARE: f64 = 0.5;

/// Coloured noise is reported only if at most this share of the squared residual is repeatable (1). Chosen on a mechanism with a
/// neglected offset of 20 mm without noise: 73 to 86 % are repeatable there, and what remains is no noise.
pub(super) const COLOURED_MOST_REPEATABLE_SHARE: f64 = 0.5;

/// The variance of coloured noise must exceed that of the white noise by this factor (1). By judgement.
pub(super) const COLOURED_LEAST_VARIANCE_RATIO: f64 = 1.5;

// --- outliers, reversals and coarse readings

/// Least distance of an outlier from the median of its neighbours, in robust standard deviations (1). By judgement.
pub(super) const FORCE_OUTLIER_DEVIATIONS: f64 = 7.0;

/// Distances below this share of the rms force (1) are rounding and no outliers. By judgement.
pub(super) const OUTLIER_LEAST_FORCE_SHARE: f64 = 1e-3;

/// Least distance of an outlier from the polynomial through the samples around it, relative to its distance from their
/// median (1): a smooth peak is close to the polynomial. By judgement.
pub(super) const OUTLIER_LEAST_STEP: f64 = 0.5;

/// If at least this share of the samples stands out (1), they are part of the force and no outliers. By judgement.
pub(super) const OUTLIERS_MOST_SHARE: f64 = 0.05;

/// Samples on either side of a reversal in which no outliers are searched. By judgement.
pub(super) const REVERSAL_OUTLIER_SAMPLES: usize = 4;

/// Samples on either side of a reversal that decide nothing. By judgement.
pub(super) const REVERSAL_UNDECIDED_SAMPLES: usize = 1;

/// If the samples next to reversals are at least this share of all samples (1), they decide like the others. By
/// judgement.
pub(super) const REVERSALS_MOST_SHARE: f64 = 0.1;

/// Different values that a quantised force must have at least. By judgement.
pub(super) const QUANTISED_FEWEST_VALUES: usize = 3;

/// Samples per different value that a quantised force must have at least: quantised values repeat. By judgement.
pub(super) const QUANTISED_FEWEST_REPEATS: usize = 4;

/// Largest distance of a difference between values from a multiple of the step, in steps (1). By judgement.
pub(super) const QUANTISED_MOST_OFF_STEP: f64 = 1e-3;

/// The error of the steps must exceed this part of the noise (1); otherwise they are not reported. By judgement.
pub(super) const QUANTISED_LEAST_NOISE_PART: f64 = 0.3;

// --- hum

/// Least ratio of a spectral line to the median of the spectrum around it (1). By judgement.
pub(super) const MIN_LINE_RATIO: f64 = 60.0;

/// Lines below this frequency, Hz, may come from the motion, and are found only in the residual of a diagnosis. By
/// judgement.
pub(super) const LINE_LOWEST_HZ: f64 = 3.0;

/// Below this frequency, Hz, a line must be most of the residual of a channel. By judgement.
pub(super) const LINE_LOW_HZ: f64 = 8.0;

/// A line is most of the residual if it explains this share of the squares (1). By judgement.
pub(super) const LINE_MAIN_SHARE: f64 = 0.6;

/// Largest number of lines in a residual; more are a periodic motion and no hum. By judgement.
pub(super) const MOST_LINES: usize = 6;

/// Least share of a channel's squared residual that all of its lines together must explain (1). By judgement.
pub(super) const MIN_LINE_SHARE: f64 = 0.02;

/// Periods of a slow line that every segment must have at least (1). By judgement.
pub(super) const SLOW_LINE_LEAST_PERIODS: f64 = 4.0;

/// Parts of every segment in each of which a slow line must explain most of the residual, with the same amplitude and
/// phase. By judgement.
pub(super) const SLOW_LINE_PARTS: usize = 4;

/// Largest share of the non-repeatable residual that may remain after a slow line, where a part of the residual is
/// repeatable (1). By judgement.
pub(super) const SLOW_LINE_MOST_REMAINING_SHARE: f64 = 0.5;

/// Least share of every segment that a slow line must explain before its frequency is refined (1). By judgement.
pub(super) const SLOW_LINE_LEAST_SEGMENT_SHARE: f64 = 0.3;

// --- changes in time

/// A change in time must explain this share of the squared residual of its recording on its channels (1). By judgement.
pub(super) const CHANGE_LEAST_SHARE: f64 = 0.05;

/// A step must explain this many times what a slow change of the same shape explains (1): drift is slow. By judgement.
pub(super) const CHANGE_LEAST_ADVANTAGE: f64 = 1.1;

/// An interval must explain this many times what a step explains (1), since it has a second time. By judgement.
pub(super) const INTERVAL_LEAST_ADVANTAGE: f64 = 1.3;

/// Two changes begin together if their times differ by less than this share of the longer one (1). By judgement.
pub(super) const SAME_CHANGE_TIME_SHARE: f64 = 0.1;

/// A change with fewer parameters is kept if it explains this share of what the more general one explains (1). By
/// judgement.
pub(super) const SIMPLER_CHANGE_SHARE: f64 = 0.9;

/// A change with more parameters is taken if it leaves less than this share of the squares that the simpler one leaves (1).
/// Chosen on loads that are taken up during a recording (`lab/numpy-plant/unseen.py`): six more parameters of a wrong change
/// lower the rest by a few percent, the inertia of a heavy load by half.
pub(super) const GENERAL_CHANGE_REST: f64 = 0.7;

/// A drive that is slower than this share of its top speed (1) hardly moves. The KUKA KR300 creeps for 2 s before its
/// motion.
pub(super) const SLOW_RATE_SHARE: f64 = 0.05;

/// A change of a signal is believed only if its drive moves for this share of the time (1), with the change and without it.
/// By judgement.
pub(super) const MOVING_LEAST_SHARE: f64 = 0.2;

// --- verdict

/// Noise of this share of the force (1) hides what may be missing: without a finding a model is not called adequate. By
/// judgement, from a pendulum whose torque has noise of 0.83.
pub(super) const HIDING_NOISE_SHARE: f64 = 0.5;

// --- residual that follows the time

/// A residual is tested for a part that follows the time if its variance is this many times that of the white noise
/// (1): twice the noise. By the truth sets of `beyond`: no error above twice the noise is adequate.
pub(super) const TIME_RESIDUAL_LEAST_NOISE_RATIO: f64 = 4.0;

/// Below this share of its top speed a drive is near standstill (1). By judgement.
pub(super) const STANDSTILL_RATE_SHARE: f64 = 0.02;

/// The top speed of a drive is this quantile of its speeds (1), also in a comparison of runs. By judgement.
pub(super) const TOP_SPEED_QUANTILE: f64 = 0.98;

/// Standstill from this time on, s, is left out of the diagnosis. By judgement: reversals of a motion are shorter.
pub(super) const STANDSTILL_SHORTEST_S: f64 = 0.3;

/// A channel that stands for more than this share of the samples (1) keeps all of them. By judgement.
pub(super) const STANDSTILL_MOST_SHARE: f64 = 0.6;

/// Fewest samples of a window. By judgement: outliers that a filter has spread cover a few samples only.
pub(super) const WINDOW_FEWEST_SAMPLES: f64 = 25.0;

/// A window is loud if its power is this many times the median power (1). By judgement: with eight independent samples
/// in a window, stationary noise exceeds four times its median in one window of 100.
pub(super) const LOUD_LEAST_RATIO: f64 = 6.0;

/// Loud windows must have this share of the squares (1). By judgement.
pub(super) const LOUD_LEAST_SHARE: f64 = 0.5;

/// Loud windows may last for this share of the time at most (1); else they are no exception. By judgement.
pub(super) const LOUD_MOST_DURATION: f64 = 0.4;

/// Half width of the band of a resonance, relative to its frequency (1). By judgement: noise of positions, derived twice and
/// cut off by a low-pass, has two thirds of its power within a fifth of the cut-off, but less than half within a tenth.
pub(super) const RESONANCE_HALF_WIDTH: f64 = 0.1;

/// Share of the power above the white noise that must lie in this band (1). By judgement: a low-pass leaves at most a
/// quarter in any such band.
pub(super) const RESONANCE_LEAST_SHARE: f64 = 0.6;

/// Largest share of the power below half of the frequency (1): coloured noise and drift are low. By judgement.
pub(super) const RESONANCE_MOST_LOW_SHARE: f64 = 0.2;

/// Lowest frequency of a resonance, Hz: below it lie motions. By judgement.
pub(super) const RESONANCE_LOWEST_HZ: f64 = 2.0;

/// From this share of the squared force on, a residual that follows the time is too large for noise (1): a tenth of the
/// force. By judgement.
pub(super) const LARGE_RESIDUAL_LEAST_SHARE: f64 = 0.01;

/// The same relative to the variance of the white noise (1). By judgement.
pub(super) const LARGE_RESIDUAL_LEAST_NOISE_RATIO: f64 = 16.0;

// --- proposed laws

/// From this mean square of the residual on, relative to white noise (1), a law is searched even if nothing else shows
/// that the residual is repeatable. By judgement.
pub(super) const LAW_LEAST_NOISE_RATIO: f64 = 4.0;

/// Least share of the repeatable residual that a law must explain (1). By judgement.
pub(super) const LAW_LEAST_REPEATABLE_SHARE: f64 = 0.5;

/// Least share of the total residual that a law must explain where nothing else shows that it is repeatable (1). By
/// judgement.
pub(super) const LAW_LEAST_SHARE_ALONE: f64 = 0.6;

/// Part of that share which a term must reach with its first constants, for a search of better ones (1). By judgement.
pub(super) const LAW_HOPEFUL_PART: f64 = 0.2;

/// Independent columns of the grammar of laws (1), of which the best is compared with chance. By judgement.
pub(super) const LAW_INDEPENDENT_COLUMNS: f64 = 1e5;

/// Largest probability that one of these columns does as well by chance (1). By judgement.
pub(super) const LAW_MOST_CHANCE: f64 = 1e-3;

/// Standard deviations over the blocks by which two terms must be better than one (1). By judgement.
pub(super) const SECOND_TERM_LEAST_T: f64 = 3.0;

/// Differences between laws below this share of what the best one explains (1) are not significant: errors of sensors
/// and derivatives are not noise. By judgement.
pub(super) const LAW_SAME_SHARE: f64 = 0.002;

/// Largest number of nearly equal laws that are reported. By judgement.
pub(super) const MAX_NEAR_TIES: usize = 8;

/// A column of a law is dependent if at most this share of its squares remains after the projection (1). By judgement.
pub(super) const LAW_INDEPENDENCE_TOLERANCE: f64 = 1e-5;

/// A proposed law that explains at least this share of the residual (1) may replace effects that it makes unnecessary.
/// By judgement.
pub(super) const REPLACING_LAW_LEAST_SHARE: f64 = 0.5;
