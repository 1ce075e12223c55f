//! Numbers that decide about estimates from servo logs.

/// Singular values of the equations below this share of the largest count as zero: columns are scaled, and states are
/// exact to rounding, so that true zeros are below 1e-12. By judgement.
pub(super) const NULL_SHARE: f64 = 1e-9;
/// An entry of a direction without effect below this share of its largest entry is rounding. By judgement.
pub(super) const NULL_ENTRY: f64 = 1e-6;
/// Equations for each unknown in the search for directions without effect. By judgement.
pub(super) const SCALE_ROWS_PER_COLUMN: usize = 6;
/// Samples that a decimation of computed forces keeps at least. By judgement.
pub(super) const FEWEST_DECIMATED: usize = 400;
/// Step of the search for a delay, s; the minimum is interpolated by a parabola. By judgement.
pub(super) const DELAY_STEP: f64 = 0.001;
/// Steps of the search.
pub(super) const DELAY_STEPS: usize = 100;
/// Largest delay of a servo that is searched, s: field buses and controllers of machines need less. By judgement.
pub(super) const LARGEST_DELAY: f64 = DELAY_STEPS as f64 * DELAY_STEP;
/// Largest correction of a delay by forces, s: beyond it a Gauss-Newton step is not accurate. By judgement.
pub(super) const LARGEST_DELAY_STEP: f64 = 0.02;
/// Gauss-Newton steps of delays with instruments at most; some three suffice near the solution.
pub(super) const DELAY_ITERATIONS: usize = 6;
/// Shares of the first estimates of delays at which the steps begin again. By judgement.
pub(super) const DELAY_RESTARTS: [f64; 5] = [0.7, 0.45, 0.2, 0.1, 0.0];
/// Change of a delay, s, below which it is known. By judgement: a hundredth of a sample at 1 kHz.
pub(super) const DELAY_TOLERANCE: f64 = 1e-5;
/// Most samples for the search of a delay. By judgement.
pub(super) const DELAY_SAMPLES: usize = 4000;
/// Fall of the log likelihood, times two, at the ends of an interval of 95 % of one parameter.
pub(super) const INTERVAL_FALL: f64 = 3.84;
/// Samples whose rate is below this share of the rms rate of the drive are left out: friction has no known direction
/// there. By judgement.
pub(super) const STANDSTILL_SHARE: f64 = 0.02;
/// Samples nearer to a reversal than this many periods of the filter's cut-off are left out: the filter mixes both
/// directions of the friction there. By judgement.
pub(super) const REVERSAL_PERIODS: f64 = 1.0;
/// As [`REVERSAL_PERIODS`], where the columns of friction pass the same filter: what remains is that real
/// friction near a reversal is no step. Chosen with MuJoCo's friction, which turns 9 ms early, and encoders of 12 and 18 bits at cut-offs of 6 to
/// 20 Hz: with a quarter, dry friction is up to 10 % too small; with one period its deviations are twice as large.
pub(super) const FILTERED_REVERSAL_PERIODS: f64 = 0.5;
/// A drive whose rate is below this share of its rms rate for [`STANDING_PERIODS`] stands. By judgement.
pub(super) const STANDING_SHARE: f64 = 0.05;
/// Periods of the filter's cut-off: in less, a filtered rate passes zero without a standstill. By judgement.
pub(super) const STANDING_PERIODS: f64 = 0.5;
/// Samples for each period of the filter's cut-off that filtered columns need at least; with fewer, their jumps appear as
/// other frequencies. By judgement: with 5, the values of the arm in `recordings/servo-arm` are within 0.5 %.
pub(super) const SAMPLES_PER_PERIOD: f64 = 4.0;
/// Periods of the filter's cut-off at both ends of a recording in which filtered columns have transients. By judgement:
/// transients fall tenfold in each period.
pub(super) const TRANSIENT_PERIODS: f64 = 2.0;
/// Lags of the commands from which instruments are formed, s. A servo follows its command within some tenths of a
/// second. By judgement.
pub(super) const INSTRUMENT_LAGS: [f64; 8] = [0.0, 0.01, 0.02, 0.04, 0.08, 0.16, 0.24, 0.32];
/// Instruments need this correlation with the regressor at least; below it, least squares is used. By judgement.
pub(super) const INSTRUMENT_CORRELATION: f64 = 0.2;
/// Ridge of the fit of instruments, as a share of the trace: lagged commands are nearly dependent. By judgement.
pub(super) const INSTRUMENT_RIDGE: f64 = 1e-10;
/// Ridge of the projection of the regressor on instruments of unit norm: above the rounding of their products. By
/// judgement.
pub(super) const PROJECTION_RIDGE: f64 = 1e-12;
/// A value of an impossible sign is reported if it is this many standard deviations beyond zero. By judgement.
pub(super) const IMPOSSIBLE_SIGMAS: f64 = 3.0;
/// A balance error above this share of the force of a drive (1) is reported. By judgement: the EMPS axis has 0.044 on
/// the fitted recording and 0.089 on another one.
pub(super) const LARGE_BALANCE_ERROR: f64 = 0.1;
/// Most samples of the estimate; more are thinned evenly. By judgement.
pub(super) const MOST_SAMPLES: usize = 40_000;
/// Values that are tried for a saturation or a dead band of a servo, at quantiles of its force or error. By judgement.
pub(super) const LIMIT_GRID: usize = 24;
/// Samples beyond a limit (1) below which it is not judged. By judgement.
pub(super) const FEWEST_LIMITED: usize = 20;
/// A limit of a servo explains this share of the squared residual of its drive at least (1). By judgement.
pub(super) const LIMIT_REDUCTION: f64 = 0.3;
/// The factor of a limit, which is 1 if the limit is the cause, has this many standard deviations at least. By judgement.
pub(super) const LIMIT_T: f64 = 6.0;
/// Largest error of this factor (1) in the fit. By judgement.
pub(super) const LIMIT_FACTOR_ERROR: f64 = 0.2;
/// As [`LIMIT_REDUCTION`], for validation runs, which may reach the limit less often. By judgement.
pub(super) const CHECKED_REDUCTION: f64 = 0.1;
/// As [`LIMIT_FACTOR_ERROR`], for validation runs. By judgement.
pub(super) const CHECKED_FACTOR_ERROR: f64 = 0.3;
/// Samples at which a servo requests this share of its saturation (1) are left out: the filter spreads the corner. By
/// judgement.
pub(super) const SATURATION_SHARE: f64 = 0.9;
/// Passes of the estimate with a saturation. By judgement.
pub(super) const SATURATION_PASSES: usize = 3;
/// A saturation that was found is certainly above this share of its estimate (1). By judgement: planted ones of 1.6 N m were
/// estimated as 1.3 to 2.1 N m, since the smoothed motion rounds the corners of the force.
pub(super) const CERTAIN_LIMIT_SHARE: f64 = 0.6;
/// Half an interval of 95 % in standard deviations.
pub(super) const HALF_INTERVAL: f64 = 1.96;
