//! Limits of servos that the model file lacks: a saturation of the force, and a dead band of the position error.
//!
//! Segments with computed forces go in; out comes the limit that explains the residual of a drive, if there is one. With
//! the force `F` of the servo without a limit, the balance of the drive is `F - x(F) = H p`: `x` is the part of the force
//! that the servo does not make. A regression of `F` on the columns of `H`, usual friction, the change of the force by a
//! delay and `c x` gives `c`, which is 1 if the limit is the cause. Other effects that resemble `x` have no reason to give
//! 1. Gauss-Newton steps refine the limit and give its standard deviation.
//!
//! Decision: a force is limited before it is filtered, as the servo does it. A filter would round the corners, and a
//! limit that is estimated from rounded forces is wrong by some 30 %.

use modelmill_codegen::ModelEvaluator;
use modelmill_identify::diagnose::{Disturbance, EstimatedQuantity, ForceColumn};
use modelmill_spec::ModelActuator;

use super::gains::GainValues;
use super::projection::{OrthonormalSpan, dot};
use super::refine::neighbour_correlation;
use super::rows::moving_samples;
use super::thresholds::{
    CHECKED_FACTOR_ERROR, CHECKED_REDUCTION, DELAY_SAMPLES, DELAY_STEP, FEWEST_LIMITED, LARGEST_LIMIT_STEP,
    LIMIT_FACTOR_ERROR, LIMIT_GRID, LIMIT_ITERATIONS, LIMIT_REDUCTION, LIMIT_STEP, LIMIT_T, LIMIT_TOLERANCE,
};
use crate::along;
use crate::error::Outcome;
use crate::model::Model;
use crate::regressors::regressor;
use crate::segment::RecordingSegment;
use crate::segment::computed_forces::{ActuatorStates, ComputedForces};
use crate::text::table::{percent, significant};

/// A limit of a servo that the model file lacks.
#[derive(Clone, Debug)]
pub(super) struct ServoLimit {
    /// Place of the actuator in the list of its mechanism.
    pub(super) actuator: usize,
    /// The actuator with the limit.
    pub(super) limited: ModelActuator,
    /// The limit: N or N m of a saturation, rad or m of a dead band.
    pub(super) size: f64,
    /// The same as a disturbance for the diagnosis.
    pub(super) disturbance: Disturbance,
}

/// Searches limits of all servos, first in the recordings of a fit; those of a validation must confirm them.
///
/// Fails when a pose has no solution.
pub(super) fn servo_limits(
    model: &Model,
    [fit, check]: [&[RecordingSegment]; 2],
    gains: &GainValues,
) -> Outcome<Vec<ServoLimit>> {
    let mut found = Vec::new();
    let [fit, check] = [LimitData::new(model, fit)?, LimitData::new(model, check)?];
    for (k, actuator) in model.actuators().iter().enumerate() {
        // With several actuators at a drive, the force of one of them is not that of the drive.
        let all = model.actuators().iter();
        let is_only = all.filter(|other| other.drive == actuator.drive).count() == 1;
        if !is_only || !actuator.kind.is_commanded() {
            continue;
        }
        let own = DriveEquations::new(model, &fit, k, gains)?;
        let mut best: Option<(LimitFit, CandidateLimit)> = None;
        for candidate in own.candidates() {
            let Some(one) = own.fit_limit(candidate)? else {
                continue;
            };
            if best
                .as_ref()
                .is_none_or(|(known, _)| one.reduction_as_is > known.reduction_as_is)
            {
                best = Some((one, candidate));
            }
        }
        let Some((fitted, candidate)) = best.filter(|(one, _)| one.is_accepted()) else {
            continue;
        };
        let (fitted, candidate) = own.refine_limit(fitted, candidate)?;
        let is_confirmed = DriveEquations::new(model, &check, k, gains)?
            .fit_limit(candidate)?
            .is_none_or(|one| one.is_confirmed());
        if is_confirmed {
            let std = own.limit_std(candidate)?;
            found.push(ServoLimit {
                actuator: k,
                limited: candidate.applied(actuator),
                size: candidate.size,
                disturbance: disturbance(model, actuator, candidate, std, &fitted),
            });
        }
    }
    Ok(found)
}

/// A limit that is tried.
#[derive(Clone, Copy)]
struct CandidateLimit {
    /// Whether it is a saturation; otherwise a dead band.
    is_saturation: bool,
    /// Its size: N or N m, or rad or m.
    size: f64,
}

impl CandidateLimit {
    /// An actuator with the limit in addition to its own.
    fn applied(self, actuator: &ModelActuator) -> ModelActuator {
        let mut limited = actuator.clone();
        if self.is_saturation {
            limited.saturation = Some(self.size);
        } else {
            limited.dead_band = Some(self.size);
        }
        limited
    }

    /// The limit of another size.
    fn scaled(self, factor: f64) -> Self {
        Self {
            size: factor * self.size,
            ..self
        }
    }
}

/// The fit of one candidate.
struct LimitFit {
    /// The factor of the part of the force that is not made; 1 if the limit is the cause.
    factor: f64,
    /// Share of the squared residual that it explains.
    reduction: f64,
    /// The same with a factor of 1, by which limits are compared: a free factor makes up for a wrong limit.
    reduction_as_is: f64,
    /// The factor in standard deviations.
    t: f64,
}

impl LimitFit {
    /// Whether the recordings of the fit show the limit.
    fn is_accepted(&self) -> bool {
        self.reduction >= LIMIT_REDUCTION && self.t >= LIMIT_T && (self.factor - 1.0).abs() <= LIMIT_FACTOR_ERROR
    }

    /// Whether validation runs that reach the limit confirm it.
    fn is_confirmed(&self) -> bool {
        self.reduction >= CHECKED_REDUCTION && (self.factor - 1.0).abs() <= CHECKED_FACTOR_ERROR
    }
}

/// Segments with computed forces, and their regressors.
struct LimitData<'a> {
    /// The segments, with the origin of their forces.
    segments: Vec<(&'a RecordingSegment, &'a ComputedForces)>,
    /// Filtered regressors, `[segment][base parameter]`.
    regressors: Vec<Vec<ForceColumn>>,
    /// Rates of the drives, `[segment][drive][sample]`, not decimated.
    rates: Vec<Vec<Vec<f64>>>,
    /// Positions likewise.
    positions: Vec<Vec<Vec<f64>>>,
}

impl<'a> LimitData<'a> {
    /// Evaluates the regressor along all segments that have computed forces.
    fn new(model: &Model, segments: &'a [RecordingSegment]) -> Outcome<Self> {
        let computed = segments.iter().filter(|one| one.run.force.is_some());
        let mut all = Self {
            segments: computed
                .filter_map(|one| Some((one, one.computed.as_deref()?)))
                .collect(),
            regressors: Vec::new(),
            rates: Vec::new(),
            positions: Vec::new(),
        };
        let evaluator = ModelEvaluator::new(&model.derivation);
        for (one, _) in &all.segments {
            all.regressors.push(regressor(&[(one, false)], &evaluator, model)?);
            let [positions, rates] = along::drive_motion(model, one)?;
            all.positions.push(positions);
            all.rates.push(rates);
        }
        Ok(all)
    }
}

/// A segment of the equations of one drive.
struct LimitSegment<'a> {
    /// The segment.
    segment: &'a RecordingSegment,
    /// The origin of its forces.
    computed: &'a ComputedForces,
    /// What the force of the actuator was computed from.
    states: &'a ActuatorStates,
    /// At which samples before decimation the drive moves in one direction.
    moving: Vec<bool>,
    /// Samples after the filter that count.
    places: Vec<usize>,
}

/// Equations of one drive behind the filter, at the samples that count.
struct DriveEquations<'a> {
    model: &'a Model,
    gains: &'a GainValues,
    /// The actuator without a limit that the file lacks.
    actuator: &'a ModelActuator,
    /// The segments whose rows follow one another.
    segments: Vec<LimitSegment<'a>>,
    /// Columns of the regressor, usual friction and an offset.
    usual: OrthonormalSpan,
    /// Of each row whether it follows the row before it in time, without a gap.
    follows: Vec<bool>,
    /// The force without the limit.
    force: Vec<f64>,
}

impl<'a> DriveEquations<'a> {
    /// The equations of the drive of an actuator, given by its place.
    ///
    /// Fails when a segment is too short to be filtered.
    fn new(model: &'a Model, data: &'a LimitData<'a>, place: usize, gains: &'a GainValues) -> Outcome<Self> {
        let actuator = &model.actuators()[place];
        let drive = actuator.drive.0;
        let mut segments = Vec::new();
        let mut columns: Vec<Vec<f64>> = Vec::new();
        let mut follows = Vec::new();
        for (k, (segment, computed)) in data.segments.iter().enumerate() {
            let Some(states) = computed.actuators.iter().find(|one| one.actuator == place) else {
                continue;
            };
            let (positions, rates) = (&data.positions[k][drive], &data.rates[k][drive]);
            let of_rate = |f: &dyn Fn(f64) -> f64| rates.iter().map(|v| f(*v)).collect::<Vec<f64>>();
            let sign = |v: f64| if v == 0.0 { 0.0 } else { v.signum() };
            let own = along::filter_and_decimate(
                vec![
                    of_rate(&|_| 1.0),
                    of_rate(&|v| v),
                    of_rate(&sign),
                    of_rate(&|v| v * v.abs()),
                    positions.clone(),
                ],
                segment,
            )?;
            let samples = own[0].len();
            let every = (samples * data.segments.len()).div_ceil(DELAY_SAMPLES).max(1);
            // The filter spreads the jump of the friction at a reversal, which would hide a limit.
            let moving = moving_samples(&segment.run.time, rates, segment.run.prepared.cutoff_hz);
            let kept = segment.decimation();
            let counts = |i: &usize| !segment.has_excluded_input(drive, *i) && moving[kept * *i];
            let places: Vec<usize> = (0..samples).step_by(every).filter(counts).collect();
            let is_next = |k: usize| k > 0 && places[k] == places[k - 1] + every;
            follows.extend((0..places.len()).map(is_next));
            let regressor = data.regressors[k].iter().map(|column| {
                let values = column.0.get(drive).and_then(Option::as_ref);
                values.cloned().unwrap_or_else(|| vec![0.0; samples])
            });
            let all: Vec<Vec<f64>> = own.into_iter().chain(regressor).collect();
            columns.resize(all.len(), Vec::new());
            for (joined, column) in columns.iter_mut().zip(all) {
                joined.extend(places.iter().map(|i| column[*i]));
            }
            segments.push(LimitSegment {
                segment,
                computed,
                states,
                moving,
                places,
            });
        }
        let mut equations = Self {
            model,
            gains,
            actuator,
            segments,
            usual: OrthonormalSpan::new(columns),
            follows,
            force: Vec::new(),
        };
        equations.force = equations.filtered_force(actuator, 0.0)?;
        Ok(equations)
    }

    /// The force of an actuator behind the filter, with a further delay in s.
    fn filtered_force(&self, actuator: &ModelActuator, delay: f64) -> Outcome<Vec<f64>> {
        let mut all = Vec::new();
        for one in &self.segments {
            let force = if delay == 0.0 {
                one.states.forces(self.model, actuator, self.gains)
            } else {
                one.states.delayed(delay).forces(self.model, actuator, self.gains)
            };
            let force = one.computed.resample(&force, &one.segment.run.time);
            let filtered = along::filter_and_decimate(vec![force], one.segment)?;
            all.extend(one.places.iter().map(|i| filtered[0][*i]));
        }
        Ok(all)
    }

    /// Number of residuals that count as independent: those of neighbours are not.
    fn independent_samples(&self, residual: &[f64]) -> f64 {
        let lag = neighbour_correlation(residual, self.follows.iter().copied());
        residual.len() as f64 * (1.0 - lag) / (1.0 + lag)
    }

    /// The limits that are tried.
    fn candidates(&self) -> Vec<CandidateLimit> {
        // The values between two shares of a sorted column, in thousandths.
        let quantiles = |mut values: Vec<f64>, [from, to]: [usize; 2]| -> Vec<f64> {
            values.retain(|value| *value > 0.0);
            values.sort_by(f64::total_cmp);
            let last = LIMIT_GRID - 1;
            let place = |k: usize| (from * (last - k) + to * k) * values.len() / (1000 * last);
            (0..LIMIT_GRID).filter_map(|k| values.get(place(k)).copied()).collect()
        };
        let states = || self.segments.iter().map(|one| one.states);
        let limits = |is_saturation: bool, sizes: Vec<f64>| {
            let limit = move |size| CandidateLimit { is_saturation, size };
            sizes.into_iter().map(limit)
        };
        let mut all = Vec::new();
        if self.actuator.saturation.is_none() {
            let forces = states().flat_map(|one| one.forces(self.model, self.actuator, self.gains));
            all.extend(limits(true, quantiles(forces.map(f64::abs).collect(), [300, 995])));
        }
        if self.actuator.dead_band.is_none() && self.actuator.has_position_error() {
            let errors = states().flat_map(|one| one.signal.iter().zip(&one.position));
            let errors =
                errors.map(|(signal, position)| (self.actuator.effective_signal(*signal, *position) - position).abs());
            all.extend(limits(false, quantiles(errors.collect(), [5, 600])));
        }
        all
    }

    /// Usual columns and the change of a limited force by a delay: where the limit acts, it does not change.
    fn span(&self, limited: &ModelActuator, force: &[f64]) -> Outcome<OrthonormalSpan> {
        let late = self.filtered_force(limited, DELAY_STEP)?;
        let mut span = self.usual.clone();
        span.add(&difference(&late, force));
        Ok(span)
    }

    /// The limit that explains most, near one of the grid, by Gauss-Newton steps.
    ///
    /// Fails when a segment is too short to be filtered.
    fn refine_limit(&self, mut fitted: LimitFit, mut limit: CandidateLimit) -> Outcome<(LimitFit, CandidateLimit)> {
        let mut most = LARGEST_LIMIT_STEP;
        for _ in 0..LIMIT_ITERATIONS {
            let Some(slope) = self.limit_slope(limit)? else {
                break;
            };
            let step = (slope.step / limit.size).clamp(-most, most);
            let next = limit.scaled(1.0 + step);
            let fit = self.fit_limit(next)?;
            match fit.filter(|fit| fit.is_accepted() && fit.reduction_as_is > fitted.reduction_as_is) {
                Some(fit) => (fitted, limit) = (fit, next),
                None => most = 0.5 * step.abs(),
            }
            if step.abs() < LIMIT_TOLERANCE {
                break;
            }
        }
        Ok((fitted, limit))
    }

    /// Standard deviation of a limit, in its unit; `None` if no sample depends on it.
    fn limit_std(&self, limit: CandidateLimit) -> Outcome<Option<f64>> {
        Ok(self.limit_slope(limit)?.map(|slope| slope.std))
    }

    /// The Gauss-Newton step of a limit; `None` if no sample depends on it.
    fn limit_slope(&self, limit: CandidateLimit) -> Outcome<Option<LimitSlope>> {
        let force = |factor: f64| self.filtered_force(&limit.scaled(factor).applied(self.actuator), 0.0);
        let limited = limit.applied(self.actuator);
        let made = self.filtered_force(&limited, 0.0)?;
        let slope = difference(&force(1.0 + LIMIT_STEP)?, &force(1.0 - LIMIT_STEP)?);
        let span = self.span(&limited, &made)?;
        let width = 2.0 * LIMIT_STEP * limit.size;
        let slope: Vec<f64> = span.residual(&slope).into_iter().map(|x| x / width).collect();
        let left = span.residual(&made);
        let (size, n) = (dot(&slope, &slope), left.len() as f64);
        if size <= 0.0 {
            return Ok(None);
        }
        let degrees = (n - span.rank() as f64).max(1.0);
        let variance = dot(&left, &left) / degrees * n / self.independent_samples(&left);
        Ok(Some(LimitSlope {
            step: -dot(&slope, &left) / size,
            std: (variance / size).sqrt(),
        }))
    }

    /// How well a limit explains the residual; `None` if too few samples reach it.
    ///
    /// Fails when a segment is too short to be filtered.
    fn fit_limit(&self, limit: CandidateLimit) -> Outcome<Option<LimitFit>> {
        let limited = limit.applied(self.actuator);
        let is_reached = |one: &LimitSegment| {
            let [all, made] =
                [self.actuator, &limited].map(|actuator| one.states.forces(self.model, actuator, self.gains));
            let reached: Vec<f64> = all
                .iter()
                .zip(&made)
                .map(|(a, m)| f64::from(u8::from((a - m).abs() > 0.0)))
                .collect();
            let reached = one.computed.resample(&reached, &one.segment.run.time);
            // Only these samples can show the limit.
            let counts = reached
                .iter()
                .zip(&one.moving)
                .filter(|(r, moves)| **r > 0.5 && **moves);
            counts.count()
        };
        if self.segments.iter().map(is_reached).sum::<usize>() < FEWEST_LIMITED {
            return Ok(None);
        }
        let made = self.filtered_force(&limited, 0.0)?;
        let span = self.span(&limited, &made)?;
        let (force, excess) = (
            span.residual(&self.force),
            span.residual(&difference(&self.force, &made)),
        );
        // Without the limit, the force may follow a delay at all samples.
        let plain = self.span(self.actuator, &self.force)?.residual(&self.force);
        let (size, before) = (dot(&excess, &excess), dot(&plain, &plain));
        if size <= 0.0 || before <= 0.0 {
            return Ok(None);
        }
        let factor = dot(&excess, &force) / size;
        let left: Vec<f64> = force.iter().zip(&excess).map(|(y, x)| y - factor * x).collect();
        let after = dot(&left, &left).max(f64::MIN_POSITIVE);
        let as_is = difference(&force, &excess);
        // A saturation near zero leaves neither a force nor a residual, so that residuals count as shares of the force.
        let before_as_is = if limit.is_saturation {
            before * dot(&made, &made) / dot(&self.force, &self.force)
        } else {
            before
        };
        let reduction_as_is = (before_as_is - dot(&as_is, &as_is)) / before_as_is.max(f64::MIN_POSITIVE);
        let reduction = (before - after) / before;
        Ok(Some(LimitFit {
            factor,
            reduction: if limit.is_saturation {
                reduction.min(reduction_as_is)
            } else {
                reduction
            },
            reduction_as_is,
            t: (self.independent_samples(&left) * (before - after).max(0.0) / after).sqrt(),
        }))
    }
}

/// A Gauss-Newton step of a limit.
struct LimitSlope {
    /// The step, in the unit of the limit.
    step: f64,
    /// Standard deviation of the limit, in its unit.
    std: f64,
}

impl ActuatorStates {
    /// The states with a signal that comes later, s.
    fn delayed(&self, delay: f64) -> Self {
        let signal = self.signal.iter().zip(&self.signal_rate);
        Self {
            signal: signal.map(|(value, rate)| value - delay * rate).collect(),
            ..self.clone()
        }
    }
}

/// The difference of two columns.
fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(x, y)| x - y).collect()
}

/// A limit as a disturbance, with a sentence.
fn disturbance(
    model: &Model,
    plain: &ModelActuator,
    limit: CandidateLimit,
    std: Option<f64>,
    fit: &LimitFit,
) -> Disturbance {
    let drive = plain.drive.0;
    let name = model.drives()[drive].clone();
    let share = percent(Some(fit.reduction));
    let size = significant(limit.size, 3);
    let (kind, quantity, unit, says) = if limit.is_saturation {
        let unit = model.force_unit(drive);
        let says = format!(
            "the servo of {name} reaches a limit: where its command requests more than {size} {unit}, the motion shows no more; \
             this explains {share} of the squared residual. Give `saturation` in its [[actuator]]"
        );
        ("servo_saturation", "limit", unit, says)
    } else {
        let unit = plain.position_unit();
        let says = format!(
            "the servo of {name} has a dead band: position errors below {size} {unit} make no force; this explains {share} of \
             the squared residual. Give `dead_band` in its [[actuator]]"
        );
        ("servo_dead_band", "dead_band", unit, says)
    };
    Disturbance {
        kind: kind.to_owned(),
        at: vec![name],
        estimates: vec![EstimatedQuantity {
            standard_deviation: std,
            ..EstimatedQuantity::new(quantity, limit.size, unit)
        }],
        recordings: Vec::new(),
        interval: None,
        description: Some(says),
    }
}
