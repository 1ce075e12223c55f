//! Limits of servos that the model file lacks: a saturation of the force, and a dead band of the position error.
//!
//! The equations of one drive go in; out comes the limit that explains their residual, if there is one. With the force
//! `F` of the servo without a limit, the balance of the drive is `F - x(F) = H p`: `x` is the part of the force that the
//! servo does not make. A regression of `F` on the columns of `H`, usual friction and `c x` gives `c`, which is 1 if the
//! limit is the cause. Other effects that resemble `x` have no reason to give 1.

use modelmill_codegen::ModelEvaluator;
use modelmill_identify::RFactor;
use modelmill_identify::diagnose::{Disturbance, EstimatedQuantity};
use modelmill_identify::estimate::LeastSquares;
use modelmill_spec::ModelActuator;

use super::ServoModel;
use super::forces::ActuatorStates;
use super::gains::GainValues;
use super::rows::UsedSamples;
use super::thresholds::{
    CERTAIN_LIMIT_SHARE, CHECKED_FACTOR_ERROR, CHECKED_REDUCTION, DELAY_SAMPLES, FEWEST_LIMITED, LIMIT_FACTOR_ERROR,
    LIMIT_GRID, LIMIT_REDUCTION, LIMIT_T,
};
use crate::along;
use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::segment::RecordingSegment;
use crate::text::table::{percent, significant};

/// Steps by which a limit of the grid is refined, as shares of it.
const LIMIT_STEPS: [f64; 5] = [0.04, 0.02, 0.01, 0.005, 0.002];
/// Most steps of one size.
const MOST_LIMIT_STEPS: usize = 4;

/// A limit of a servo that the model file lacks.
#[derive(Clone, Debug)]
pub(super) struct ServoLimit {
    /// Place of the actuator in the list of its mechanism.
    pub(super) actuator: usize,
    /// The actuator with the limit.
    pub(super) limited: ModelActuator,
    /// Whether it is a saturation; otherwise a dead band.
    pub(super) is_saturation: bool,
    /// The same as a disturbance for the diagnosis.
    pub(super) disturbance: Disturbance,
}

/// Searches limits of all servos, first in the recordings of a fit; those of a validation must confirm them.
///
/// Fails when a pose has no solution.
pub(super) fn servo_limits(
    model: &Model,
    servo: &ServoModel,
    [fit, check]: [&[RecordingSegment]; 2],
    delays: &[f64],
    gains: &GainValues,
) -> Outcome<Vec<ServoLimit>> {
    let mut found = Vec::new();
    for (k, actuator) in model.actuators().iter().enumerate() {
        // With several actuators at a drive, the force of one of them is not that of the drive.
        let is_only = model
            .actuators()
            .iter()
            .filter(|other| other.drive == actuator.drive)
            .count()
            == 1;
        if !is_only || !actuator.kind.is_commanded() {
            continue;
        }
        let equations = |segments: &[RecordingSegment]| DriveEquations::new(model, servo, segments, delays, k);
        let (own, validation) = (equations(fit)?, equations(check)?);
        let mut best: Option<(LimitFit, ModelActuator)> = None;
        for limited in own.candidates(model, actuator, gains) {
            let Some(one) = own.fit_limit(model, [actuator, &limited], gains)? else {
                continue;
            };
            if best
                .as_ref()
                .is_none_or(|(known, _)| one.reduction_as_is > known.reduction_as_is)
            {
                best = Some((one, limited));
            }
        }
        let best = best.filter(|(one, _)| one.is_accepted());
        let best = best
            .map(|best| own.refine_limit(model, actuator, gains, best))
            .transpose()?;
        let Some((fitted, limited)) = best else {
            continue;
        };
        let is_confirmed = validation.force_rows.is_empty()
            || validation
                .fit_limit(model, [actuator, &limited], gains)?
                .is_none_or(|one| one.is_confirmed());
        if is_confirmed {
            found.push(ServoLimit {
                actuator: k,
                is_saturation: limited.saturation.is_some() && actuator.saturation.is_none(),
                disturbance: disturbance(model, actuator, &limited, &fitted),
                limited,
            });
        }
    }
    Ok(found)
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

/// Equations of one drive at the samples that count.
struct DriveEquations {
    /// Columns of the regressor, usual friction and an offset, by sample.
    force_rows: Vec<Vec<f64>>,
    /// What the force of the actuator depends on.
    states: ActuatorStates,
}

impl DriveEquations {
    /// The equations of the drive of an actuator, given by its place.
    fn new(
        model: &Model,
        servo: &ServoModel,
        segments: &[RecordingSegment],
        delays: &[f64],
        place: usize,
    ) -> Outcome<Self> {
        let actuator = &servo.actuators()[place];
        let drive = actuator.drive.0;
        let row = servo.body_rows().iter().position(|d| *d == drive).unwrap_or(0);
        let signal = servo.signal_position(actuator);
        let n_drives = model.row_names().len();
        let mut all = Self {
            force_rows: Vec::new(),
            states: ActuatorStates::default(),
        };
        for segment in segments {
            let used = UsedSamples::new(servo, segment, DELAY_SAMPLES / segments.len().max(1))?;
            let delayed = used.delayed(servo, delays);
            let own = without_signals(model, &delayed);
            let counts = &used.between_reversals[row];
            let states = own.states(0, own.samples());
            let regressor = ModelEvaluator::new(&model.derivation)
                .regressor(&states)
                .map_err(|fault| own.pose_error(model, fault, 0))?;
            let [positions, rates] = along::drive_motion(model, &own)?;
            for sample in (0..own.samples()).filter(|sample| counts[*sample]) {
                let (position, rate) = (positions[drive][sample], rates[drive][sample]);
                let usual = [1.0, rate, rate.signum(), rate * rate.abs(), position];
                all.force_rows.push(
                    regressor
                        .row(sample * n_drives + drive)
                        .iter()
                        .copied()
                        .chain(usual)
                        .collect(),
                );
                all.states.signal.push(delayed.run.q[signal][sample]);
                all.states.signal_rate.push(delayed.run.qd[signal][sample]);
                all.states.position.push(position);
                all.states.rate.push(rate);
            }
        }
        Ok(all)
    }

    /// The actuator with each limit that is tried.
    fn candidates(&self, model: &Model, actuator: &ModelActuator, gains: &GainValues) -> Vec<ModelActuator> {
        // The values between two shares of a sorted column, in thousandths.
        let quantiles = |mut values: Vec<f64>, [from, to]: [usize; 2]| -> Vec<f64> {
            values.retain(|value| *value > 0.0);
            values.sort_by(f64::total_cmp);
            let last = LIMIT_GRID - 1;
            let place = |k: usize| (from * (last - k) + to * k) * values.len() / (1000 * last);
            (0..LIMIT_GRID).filter_map(|k| values.get(place(k)).copied()).collect()
        };
        let mut all = Vec::new();
        if actuator.saturation.is_none() {
            let without_band = ModelActuator {
                dead_band: None,
                ..actuator.clone()
            };
            let forces = self.states.forces(model, &without_band, gains);
            let limits = quantiles(forces.iter().map(|force| force.abs()).collect(), [300, 995]);
            all.extend(limits.into_iter().map(|limit| ModelActuator {
                saturation: Some(limit),
                ..actuator.clone()
            }));
        }
        if actuator.dead_band.is_none() && actuator.has_position_error() {
            let errors = self.states.signal.iter().zip(&self.states.position);
            let errors = errors.map(|(signal, position)| (signal - position).abs());
            let bands = quantiles(errors.collect(), [5, 600]);
            all.extend(bands.into_iter().map(|band| ModelActuator {
                dead_band: Some(band),
                ..actuator.clone()
            }));
        }
        all
    }

    /// The limit that explains most, near one of the grid.
    ///
    /// Fails when a regression fails.
    fn refine_limit(
        &self,
        model: &Model,
        actuator: &ModelActuator,
        gains: &GainValues,
        (mut fitted, mut limited): (LimitFit, ModelActuator),
    ) -> Outcome<(LimitFit, ModelActuator)> {
        let scaled = |one: &ModelActuator, factor: f64| {
            let scale = |new: Option<f64>, old: Option<f64>| if old.is_none() { new.map(|x| factor * x) } else { new };
            ModelActuator {
                saturation: scale(one.saturation, actuator.saturation),
                dead_band: scale(one.dead_band, actuator.dead_band),
                ..one.clone()
            }
        };
        for step in LIMIT_STEPS {
            // In the direction in which it explains more, as long as it does.
            for factor in [1.0 + step, 1.0 - step] {
                for _ in 0..MOST_LIMIT_STEPS {
                    let next = scaled(&limited, factor);
                    let fit = self.fit_limit(model, [actuator, &next], gains)?;
                    match fit.filter(|fit| fit.is_accepted() && fit.reduction_as_is > fitted.reduction_as_is) {
                        Some(fit) => (fitted, limited) = (fit, next),
                        None => break,
                    }
                }
            }
        }
        Ok((fitted, limited))
    }

    /// How well the difference between two versions of an actuator explains the residual; `None` if too few samples
    /// differ.
    fn fit_limit(
        &self,
        model: &Model,
        [plain, limited]: [&ModelActuator; 2],
        gains: &GainValues,
    ) -> Outcome<Option<LimitFit>> {
        // The signal contains the effect of a dead band of the file already.
        let is_applied = plain.dead_band.is_some();
        let forces = |one: &ModelActuator| {
            let without_band = ModelActuator {
                dead_band: one.dead_band.filter(|_| !is_applied),
                ..one.clone()
            };
            self.states.forces(model, &without_band, gains)
        };
        let (force, limited) = (forces(plain), forces(limited));
        let excess: Vec<f64> = force.iter().zip(&limited).map(|(all, made)| all - made).collect();
        if excess.iter().filter(|x| **x != 0.0).count() < FEWEST_LIMITED {
            return Ok(None);
        }
        let (force, excess) = (self.residual(model, &force)?, self.residual(model, &excess)?);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let (size, before) = (dot(&excess, &excess), dot(&force, &force));
        if size <= 0.0 || before <= 0.0 {
            return Ok(None);
        }
        let factor = dot(&excess, &force) / size;
        let left: Vec<f64> = force.iter().zip(&excess).map(|(y, x)| y - factor * x).collect();
        let after = dot(&left, &left).max(f64::MIN_POSITIVE);
        // Residuals of neighbours are not independent.
        let lag = (dot(&left[1..], &left[..left.len() - 1]) / after).clamp(0.0, 0.999);
        let independent = left.len() as f64 * (1.0 - lag) / (1.0 + lag);
        Ok(Some(LimitFit {
            factor,
            reduction: (before - after) / before,
            reduction_as_is: (2.0 * dot(&excess, &force) - size) / before,
            t: (independent * (before - after).max(0.0) / after).sqrt(),
        }))
    }

    /// What the columns do not explain of a force.
    fn residual(&self, model: &Model, force: &[f64]) -> Outcome<Vec<f64>> {
        let width = self.force_rows.first().map_or(0, Vec::len);
        let failed = |error: modelmill_identify::LeastSquaresError| {
            Error::input(format!("{}: limits of a servo cannot be searched: {error}", model.path))
        };
        // Columns that are zero everywhere, such as those of other drives, would make the regression singular.
        let used: Vec<usize> = (0..width)
            .filter(|k| self.force_rows.iter().any(|row| row[*k] != 0.0))
            .collect();
        let pick = |row: &[f64]| -> Vec<f64> { used.iter().map(|k| row[*k]).collect() };
        let mut regression = LeastSquares::new(used.len());
        for (row, force) in self.force_rows.iter().zip(force) {
            regression.add_rows(&pick(row), &[*force]).map_err(failed)?;
        }
        let solution = RFactor::new(&regression)
            .solve_near(&vec![0.0; used.len()])
            .map_err(failed)?;
        let fitted = |row: &Vec<f64>| pick(row).iter().zip(&solution.values).map(|(x, p)| x * p).sum::<f64>();
        Ok(self
            .force_rows
            .iter()
            .zip(force)
            .map(|(row, force)| force - fitted(row))
            .collect())
    }
}

/// A segment for the model without servo equations: signals are its last coordinates, and their rows its last drives.
fn without_signals(model: &Model, segment: &RecordingSegment) -> RecordingSegment {
    let mut own = segment.clone();
    let (n, n_drives) = (model.active_coordinates().len(), model.row_names().len());
    for columns in [&mut own.run.q, &mut own.run.qd, &mut own.run.qdd] {
        columns.truncate(n);
    }
    if let Some(force) = &mut own.run.force {
        force.truncate(n_drives);
    }
    own.run.left_out.truncate(n_drives);
    own
}

/// A limit as a disturbance, with a sentence.
fn disturbance(model: &Model, plain: &ModelActuator, limited: &ModelActuator, fit: &LimitFit) -> Disturbance {
    let drive = plain.drive.0;
    let name = model.row_names()[drive].clone();
    let share = percent(Some(fit.reduction));
    let (kind, estimate, says) = match limited.saturation.filter(|_| plain.saturation.is_none()) {
        Some(limit) => {
            let unit = model.force_unit(drive);
            let says = format!(
                "the servo of {name} reaches a limit: where its command requests more than about {} {unit}, the motion shows no \
                 more; this explains {share} of the squared residual. The limit is known roughly, so forces above {} {unit} are \
                 left out. Give `saturation` in its [[actuator]]",
                significant(limit, 2),
                significant(CERTAIN_LIMIT_SHARE * limit, 2)
            );
            ("servo_saturation", EstimatedQuantity::new("limit", limit, unit), says)
        }
        None => {
            let band = limited.dead_band.unwrap_or(0.0);
            let unit = limited.position_unit();
            let says = format!(
                "the servo of {name} has a dead band: position errors below {} {unit} make no force; this explains {share} of \
                 the squared residual. Give `dead_band` in its [[actuator]]",
                significant(band, 3)
            );
            ("servo_dead_band", EstimatedQuantity::new("dead_band", band, unit), says)
        }
    };
    Disturbance {
        kind: kind.to_owned(),
        at: vec![name],
        estimates: vec![estimate],
        recordings: Vec::new(),
        interval: None,
        description: Some(says),
    }
}
