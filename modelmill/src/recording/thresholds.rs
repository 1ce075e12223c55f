//! Thresholds of reading and preparing recordings: the numbers that decide which recordings are refused, which force
//! peaks are outliers, and which smoothing is chosen. Each states what it bounds, its unit, and how it was chosen.
//! Numbers that only set an accuracy or a grid stay where they are used.

/// Largest difference of the length of a recorded quaternion from 1 (1). A larger one is not rounding, but another
/// column. By judgement.
pub(super) const QUATERNION_LENGTH_TOLERANCE: f64 = 0.02;

/// Smallest over largest singular value of the closure equations in the passive rates (1). Below it, forces of redundant
/// drives are not projected, since rounding of a pose would be amplified by its inverse. By judgement.
pub(super) const PROJECTION_CONDITION: f64 = 1e-9;

/// The mechanism itself causes a force peak, which is no outlier, where a drive needs more than this many times the
/// force that it needs at the samples around (1). By judgement.
pub(super) const LEVERAGE_PEAK_RATIO: f64 = 3.0;

/// Samples of a window of a recording; with fewer no smoothing is chosen. By judgement.
pub(super) const WINDOW_FEWEST_SAMPLES: usize = 40;

/// Rows for each column of the regressor; with fewer no smoothing is chosen. By judgement.
pub(super) const SMOOTHING_ROWS_PER_COLUMN: usize = 3;

/// A smoothing or decimation must lower the error by more than this share (1) to be preferred to one that smooths or
/// decimates more, and a Fourier series to be preferred to a low-pass. By judgement.
pub(super) const SMOOTHING_LEAST_GAIN: f64 = 0.005;

/// Decrease of the sum of both logarithms (1) from which validation runs raise the cut-off of the fit. A double pendulum
/// whose validation run is three times as fast has 0.17.
pub(super) const FOLLOWERS_LEAST_GAIN: f64 = 0.05;

/// Decrease of the logarithm of the residual (1) at the lowest cut-off from which lower ones are tried. A double pendulum
/// with vibrations has 0.15 to 0.4 at each step; recordings whose motion sets the band have 0.05 and less.
pub(super) const EXTENSION_LEAST_GAIN: f64 = 0.1;

/// Residual at the lowest cut-off (1) from which lower ones are tried: what a model explains so far is no noise. By
/// judgement, with 0.4 on the double pendulum.
pub(super) const EXTENSION_LEAST_RESIDUAL: f64 = 0.1;

/// Residuals that differ by less than this share (1) are called equal in the note on the choice. By judgement.
pub(super) const SAME_RESIDUAL_TOLERANCE: f64 = 1e-3;

// --- Delays and wrong columns

/// Exchanged columns and wrong signs are not suspected if a delay lowers the errors by at least this share of the sum of
/// logarithms by which the correction of the columns does (1). By judgement.
pub(super) const DELAY_LEAST_SHARE_OF_GAIN: f64 = 0.7;

// --- Stick phases

/// Bounds of the rates at which friction is compared with that of clear motion, as shares of the fastest rate of the
/// drive (1). A drive sticks up to one of them but the last; what reaches the last is a law of friction. Dahl friction
/// that builds up over a hundredth of the travel reaches a third of the fastest rate. Chosen on ur5-mujoco, where
/// sticking reaches 0.5 to 3 %.
pub(super) const STICK_RATE_SHARES: [f64; 7] = [0.002, 0.005, 0.01, 0.02, 0.03, 0.05, 0.08];

/// A drive moves clearly above this share of its fastest rate (1). By judgement, the last of [`STICK_RATE_SHARES`].
pub(super) const STICK_CLEAR_MOTION: f64 = 0.08;

/// Samples of a bin of rates below which it is joined with the next. By judgement.
pub(super) const STICK_BIN_FEWEST_SAMPLES: usize = 8;

/// At the lowest rates friction must fall short of that of motion by this share (1). Half of the samples of a reversal
/// have the wrong sign if the drive sticks, which is a shortfall of 1. By judgement.
pub(super) const STICK_LOWEST_SHORTFALL: f64 = 0.2;

/// Friction falls short in a bin if it lacks more than this share of that of motion (1). By judgement.
pub(super) const STICK_LEAST_SHORTFALL: f64 = 0.06;

/// A stick phase is widened through bins in which friction still lacks more than this share (1). By judgement: the
/// error of a parameter is about the share of such samples times it.
pub(super) const STICK_FAINT_SHORTFALL: f64 = 0.002;

/// It is also widened through bins whose shortfalls are larger than those of clear motion by this factor, as rms values
/// (1). By judgement.
pub(super) const STICK_NOISE_RATIO: f64 = 2.0;

/// Standard deviations by which a shortfall must exceed zero. By judgement.
pub(super) const STICK_SHORTFALL_SIGMAS: f64 = 2.5;

/// Dry friction must exceed this many standard deviations of its mean during motion. By judgement.
pub(super) const DRY_FRICTION_LEAST_SIGMAS: f64 = 10.0;

/// Dry friction must exceed this share of the rms force of its drive (1): less is rounding. By judgement.
pub(super) const DRY_FRICTION_LEAST_SHARE: f64 = 1e-3;

/// A drive that would stick for more than this share of the time has no clear motion to compare with (1). By judgement,
/// above the 97 % of the arm of TIAGo.
pub(super) const STICK_MOST_SHARE: f64 = 0.99;

/// Stick phases that take more than this share of the samples of a drive (1) must be times at which it is slow. Chosen
/// on arms that never stick, whose reversals under a low cut-off take 30 to 95 %; the phases of ur5-mujoco take 4 to
/// 13 %, those of real machines up to 20 %.
pub(super) const BLUR_MOST_SHARE: f64 = 0.25;

/// Least share of such samples in which the drive is slow (1); the others are blur. By judgement.
pub(super) const BLUR_LEAST_SLOW_SHARE: f64 = 0.5;

/// Half width by which smoothing blurs a reversal, periods of its cut-off: the quarter of a period. By judgement.
pub(super) const STICK_BLUR_PERIODS: f64 = 0.25;

/// Fewest decimated samples that a decimation keeps of a recording. A diagnosis needs 60 samples at least; 250 were too
/// few for 16 effects of a six-axis arm like ur5-mujoco, in which drives stick for up to a fifth of the time.
pub(super) const DECIMATION_FEWEST_KEPT: usize = 400;

/// Ratios of the cut-off of positions to the passband of the decimation (1) that are tried, the best one first.
/// Butterworth's filter of order 4, run both ways, passes 99.98 % at a third of its cut-off; with a ratio of 0.7 drive
/// inertias were 4 % high on arms like ur5-mujoco, with 2 one of them was 0.8 % high.
pub(super) const SUITED_CUTOFF_PASSBANDS: [f64; 3] = [3.0, 2.0, 1.5];

/// Largest share by which a cut-off that suits the decimation may raise the residual in the passband (1). Chosen between
/// ur5-mujoco, where it grows by 0.4 %, and a Panda, where the error of validation rises with a growth of 3 %; on a
/// pendulum with coarse encoders it grows by 65 % and the inertia falls to a sixth.
pub(super) const SUITED_MOST_GROWTH: f64 = 0.02;

/// Largest mean square of what such a cut-off changes in the model's forces, unless it is motion, relative to the white
/// noise of the measured forces in the same band (1): noise of the positions then stays below that of the forces. By
/// judgement.
pub(super) const RAISED_MOST_NOISE_RATIO: f64 = 1.0;

/// The change is motion if the residual falls by this share of it (1); by noise it does not fall at all. By judgement.
pub(super) const RAISED_LEAST_MOTION_SHARE: f64 = 0.5;

/// Standard deviations by which it must exceed this share. By judgement.
pub(super) const RAISED_MOTION_SIGMAS: f64 = 2.0;

/// Sampling rates that differ by less than this share count as equal (1). By judgement.
pub(super) const SAME_RATE_TOLERANCE: f64 = 0.02;
