//! Numbers that set the accuracy of forward simulations, and the horizons over which they are judged.

/// Longest step of the integration, s. By judgement: Runge-Kutta's error of the fourth order is then far below
/// encoder noise for motions below 50 Hz.
pub(super) const LONGEST_STEP_S: f64 = 1e-3;

/// Longest step relative to the shortest time constant of the servos (1). The relative error of a step of the fourth
/// order is then 0.3^5/120 = 2e-5.
pub(super) const STEP_OF_SERVO: f64 = 0.3;

/// Shortest step of the integration, s. By judgement: a servo with a rate above 6e4 1/s has a wrong gain.
pub(super) const SHORTEST_STEP_S: f64 = 5e-6;

/// Reversals of drives that are located within one step; more are passed over. By judgement.
pub(super) const MOST_EVENTS: usize = 8;

/// A place has stopped at a predicted reversal if its rate is below this part of that before the step (1). By
/// judgement: the prediction is linear.
pub(super) const STOPPED_PART: f64 = 0.2;

/// Rate, relative to the fastest rate of the recording (1), that decides a direction of dry friction at standstill.
/// It is far above rounding and far below any motion. By judgement.
pub(super) const DIRECTION_RATE: f64 = 1e-9;

/// Dry friction below this part of the largest generalised force (1) is rounding. By judgement.
pub(super) const LEAST_DRY_FRICTION: f64 = 1e-9;

/// Horizon over which positions are verified if the file of limits gives none, s. By judgement: long enough for friction
/// and inertia to show, and short enough for most machines to depend on the model.
pub(crate) const VERIFIED_HORIZON_S: f64 = 1.0;

/// Horizons over which positions are compared, s, in addition to the whole run. Issue: users of simulators compare
/// rollouts of these lengths.
pub(super) const HORIZONS_S: [f64; 2] = [0.1, 1.0];

/// Most time that is simulated for one horizon and segment, s, in windows spread over the recording. By judgement:
/// 100 windows of 0.1 s or 10 of 1 s are enough for an rms value.
pub(super) const MOST_SIMULATED_S: f64 = 10.0;

/// Size of the disturbance of the first state whose growth is measured, rad or m. By judgement: the resolution of a
/// fine encoder.
pub(super) const DISTURBANCE: f64 = 1e-6;

/// A horizon is judged as long as a disturbance of the first state grows by less than this factor (1). By judgement:
/// errors of an encoder of 1e-5 rad stay below 1e-3 rad.
pub(super) const MOST_GROWTH: f64 = 100.0;
