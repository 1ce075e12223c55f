//! Forces of drives computed from the signals of their actuators, for recordings without force columns.
//!
//! Recordings that were read for a model go in; out come the same recordings with a force column for each drive whose
//! actuators have their signals. Every operation that needs measured forces then works on servo logs.
//!
//! Decision: positions and signals enter the forces as they were recorded, without a filter. A measured force has the
//! noise of its sensor, and so does this one: the noise of the encoder times the gain. Operations estimate the noise of
//! forces from these columns, and a filter would hide it. Rates come from the prepared motion.

use std::path::Path;
use std::sync::Arc;

use modelmill_identify::{RecordingNote, SignalRecording as Raw};
use modelmill_spec::{DriveKind, ModelActuator, ModelSymbol, PlaceQuantity};

use super::ServoModel;
use super::delay::{DelayQuery, ServoDelay, delays};
use super::gains::{GainValues, delay_phrase};
use super::suspects::{ServoLimit, servo_limits};
use crate::along;
use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::progress::SilentProgress;
use crate::recording::{PreparedRecording, RecordingOptions, UnpreparedRecording};
use crate::segment::RecordingSegment;

/// Recordings of a fit, and those of its validation, each with its own result.
type ReadRuns = [Vec<Outcome<UnpreparedRecording>>; 2];

impl Model {
    /// As [`Model::prepare_recordings`], for recordings that may lack forces if the model has actuators: forces of the
    /// drives are then computed from the signals, see [`Model::add_actuator_forces`].
    pub fn prepare_recordings_with_signals(
        &self,
        runs: [&[Vec<&Path>]; 2],
        reading: &RecordingOptions,
    ) -> [Vec<Outcome<PreparedRecording>>; 2] {
        let read = |paths: &Vec<&Path>| self.read_recording(paths, reading);
        let read = runs.map(|runs| runs.iter().map(read).collect());
        self.prepare_together(self.add_actuator_forces(read))
    }

    /// Adds the forces of actuators to recordings that lack the forces of their drives: those of a fit, and those of its
    /// validation. Gains have their nominal values; gains without one, and delays that the file does not give, are
    /// estimated from the recordings of the fit. A note of each recording states the formula and the values.
    ///
    /// A recording with all forces, or without the signals of an actuator, is passed on unchanged. If values are unknown
    /// and cannot be estimated, recordings without forces become errors that state the reason.
    pub fn add_actuator_forces(&self, runs: ReadRuns) -> ReadRuns {
        let is_affected = |one: &Outcome<UnpreparedRecording>| {
            one.as_ref()
                .is_ok_and(|one| !self.drives_to_compute(one.raw()).is_empty())
        };
        let affected = || runs.iter().map(|run| run.iter().filter(|one| is_affected(one)).count());
        if affected().sum::<usize>() == 0 {
            return runs;
        }
        match ActuatorForces::new(self, &runs, is_affected) {
            Ok(forces) => {
                let mut prepared = forces.prepared.iter();
                runs.map(|run| {
                    let complete = |one: Outcome<UnpreparedRecording>| {
                        if !is_affected(&one) {
                            return one;
                        }
                        let motion = prepared.next();
                        one.and_then(|one| forces.complete(&one, motion))
                    };
                    run.into_iter().map(complete).collect()
                })
            }
            Err(error) => {
                let says = error.message();
                let mut error = Some(error);
                runs.map(|run| {
                    let refuse = |one: Outcome<UnpreparedRecording>| {
                        if is_affected(&one) {
                            Err(error.take().unwrap_or_else(|| Error::input(says.clone())))
                        } else {
                            one
                        }
                    };
                    run.into_iter().map(refuse).collect()
                })
            }
        }
    }

    /// The drives whose force is not in a recording, and whose actuators have all their signals there.
    fn drives_to_compute(&self, raw: &Raw) -> Vec<usize> {
        let mechanism = &self.derivation.mechanism;
        if !mechanism.servo_forces.is_empty() {
            return Vec::new();
        }
        let is_computable = |drive: &usize| {
            let mut own = mechanism
                .actuators
                .iter()
                .filter(|one| one.drive.0 == *drive)
                .peekable();
            own.peek().is_some()
                && !raw.has_column(&mechanism.drives[*drive].name)
                && own.all(|actuator| raw.has_column(&actuator.signal))
        };
        (0..mechanism.drives.len()).filter(is_computable).collect()
    }

    /// The equations with the actuators of the model, without effects that depend on the load of a drive: forces of
    /// actuators are the same with and without these.
    fn servo_model_for_forces(&self) -> Outcome<ServoModel> {
        let is_loaded = |expression: &modelmill_spec::ExactExpression| {
            expression.mentions(&|symbol| symbol == ModelSymbol::Place(PlaceQuantity::Load))
        };
        let mut loaded = (*self.loaded).clone();
        let effects = &mut loaded.mechanism.effects;
        effects.retain(|effect| !effect.terms.iter().any(|term| is_loaded(&term.expression)));
        if effects.len() == self.loaded.mechanism.effects.len() {
            return self.servo_model();
        }
        self.host().derive(&self.path, loaded)?.servo_model()
    }
}

/// What the forces of some recordings are computed from.
struct ActuatorForces<'a> {
    /// The model without servo equations.
    model: &'a Model,
    /// The equations with the signals as coordinates.
    servo: ServoModel,
    /// The recordings without forces, prepared for the servo equations, in their order.
    prepared: Vec<Outcome<PreparedRecording>>,
    /// Values of the gains.
    gains: GainValues,
    /// Delays of the actuators.
    delays: Vec<ServoDelay>,
    /// The actuators, with limits that the file lacks and the recordings show.
    actuators: Vec<ModelActuator>,
    /// These limits.
    limits: Vec<ServoLimit>,
}

impl<'a> ActuatorForces<'a> {
    /// Prepares the motion of all affected recordings, and estimates the values that the file does not give.
    fn new(
        model: &'a Model,
        runs: &ReadRuns,
        is_affected: impl Fn(&Outcome<UnpreparedRecording>) -> bool,
    ) -> Outcome<Self> {
        let silent = model.host().clone().with_progress(Arc::new(SilentProgress));
        let mut servo = model.clone().with_host(&silent).servo_model_for_forces()?;
        servo.equations = servo.equations.with_host(&silent);
        let affected = runs.each_ref().map(|run| {
            let all = run.iter().filter(|one| is_affected(one)).flatten();
            all.map(|one| one.for_model(&servo.equations, &ServoModel::reading(one.options())))
                .collect::<Vec<_>>()
        });
        let [fit, check] = servo.equations.prepare_together(affected);
        let of_fit = if fit.is_empty() { &check } else { &fit };
        let fitted: Vec<&PreparedRecording> = of_fit.iter().flatten().collect();
        let segments = |all: &mut dyn Iterator<Item = &PreparedRecording>| -> Vec<RecordingSegment> {
            all.flat_map(|one| one.segments.clone()).collect()
        };
        let fit_segments = segments(&mut of_fit.iter().flatten());
        let check_segments = if fit.is_empty() {
            Vec::new()
        } else {
            segments(&mut check.iter().flatten())
        };
        let delays = delays(&servo, &fit_segments, DelayQuery::WithFriction)?;
        let gains = GainValues::new(model, &servo, &fitted)?;
        let seconds: Vec<f64> = delays.iter().map(|delay| delay.value).collect();
        let limits = servo_limits(model, &servo, [&fit_segments, &check_segments], &seconds, &gains)?;
        let mut actuators = model.actuators().to_vec();
        for limit in &limits {
            actuators[limit.actuator] = limit.limited.clone();
        }
        Ok(Self {
            actuators,
            limits,
            model,
            servo,
            prepared: fit.into_iter().chain(check).collect(),
            gains,
            delays,
        })
    }

    /// A recording with the forces of its actuators.
    fn complete(
        &self,
        recording: &UnpreparedRecording,
        motion: Option<&Outcome<PreparedRecording>>,
    ) -> Outcome<UnpreparedRecording> {
        let prepared = match motion {
            Some(Ok(prepared)) => prepared,
            Some(Err(error)) => return Err(Error::input(error.message())),
            None => return Ok(recording.clone()),
        };
        let mut raw = recording.raw().clone();
        let mechanism = &self.model.derivation.mechanism;
        let time = raw.column("t")?.to_vec();
        let motion = SmoothMotion::new(&self.servo, prepared)?;
        let mut phrases = Vec::new();
        for drive in self.model.drives_to_compute(&raw) {
            let position = match mechanism.drives[drive].kind {
                DriveKind::Joint(i) => raw.column(&mechanism.coordinates[i.0].name).ok().map(<[f64]>::to_vec),
                DriveKind::Linear { .. } => None,
            };
            let position = position.unwrap_or_else(|| motion.interpolate_at(&motion.positions[drive], &time, 0.0));
            let mut force = vec![0.0; time.len()];
            let own = self.actuators.iter().zip(&self.delays).enumerate();
            for (k, (actuator, delay)) in own.filter(|(_, (actuator, _))| actuator.drive.0 == drive) {
                let signal = raw.column(&actuator.signal)?;
                let states = ActuatorStates {
                    signal: interpolate(&time, signal, &time, delay.value),
                    signal_rate: motion.interpolate_at(&motion.signal_rates[k], &time, delay.value),
                    rate: motion.interpolate_at(&motion.rates[drive], &time, 0.0),
                    position: position.clone(),
                };
                for (sum, force) in force.iter_mut().zip(states.forces(self.model, actuator, &self.gains)) {
                    *sum += force;
                }
                phrases.push(self.phrase(actuator, delay));
            }
            raw.set_column(&mechanism.drives[drive].name, force);
        }
        raw.add_note(RecordingNote::info(self.note(raw.file(), &phrases)));
        for limit in &self.limits {
            let says = limit.disturbance.description.clone().unwrap_or_default();
            raw.add_note(RecordingNote::warning(format!("{}: {says}.", raw.file())));
        }
        let limits = self.limits.iter().map(|limit| limit.disturbance.clone());
        Ok(recording.with_signals(raw, limits.collect()))
    }

    /// How the force of an actuator is computed.
    fn phrase(&self, actuator: &ModelActuator, delay: &ServoDelay) -> String {
        let mechanism = &self.model.derivation.mechanism;
        let drive = &mechanism.drives[actuator.drive.0];
        let gains = self.gains.phrase(mechanism, actuator.terms.iter());
        let mut limits = Vec::new();
        if let Some(limit) = actuator.saturation {
            let unit = drive.kind.force_unit(&mechanism.coordinates);
            limits.push(format!("saturation {limit} {unit}"));
        }
        if let Some(band) = actuator.dead_band {
            limits.push(format!("dead band {band} {}", actuator.position_unit()));
        }
        let values: Vec<String> = gains.into_iter().chain(limits).chain([delay_phrase(delay)]).collect();
        format!(
            "{} = {} of `{}`, with {}",
            drive.name,
            actuator.kind.formula(),
            actuator.signal,
            values.join(", ")
        )
    }

    /// The note on the origin of the forces of a recording.
    fn note(&self, file: &str, phrases: &[String]) -> String {
        let noise = if self
            .model
            .actuators()
            .iter()
            .any(|actuator| actuator.kind.is_commanded())
        {
            " They contain the noise of the encoder times the gain; wrong gains and limits of the servo appear as errors \
             of the model."
        } else {
            " Wrong constants of the motor appear as errors of the model."
        };
        let origin = if self.gains.has_identified() {
            " Gains were identified with the effects that the model has: an effect that it lacks may be part of them."
        } else {
            ""
        };
        format!(
            "{file} has no forces; they are computed from the signals of the actuators: {}.{noise}{origin}",
            phrases.join("; ")
        )
    }
}

/// The motion of drives and signals after the filter.
struct SmoothMotion {
    /// Times, s.
    time: Vec<f64>,
    /// Positions by drive.
    positions: Vec<Vec<f64>>,
    /// Rates by drive.
    rates: Vec<Vec<f64>>,
    /// Rates of the signals by actuator.
    signal_rates: Vec<Vec<f64>>,
}

impl SmoothMotion {
    /// The motion of all segments of a recording, one after another.
    fn new(servo: &ServoModel, recording: &PreparedRecording) -> Outcome<Self> {
        let n_drives = servo.equations.drives().len();
        let mut all = Self {
            time: Vec::new(),
            positions: vec![Vec::new(); n_drives],
            rates: vec![Vec::new(); n_drives],
            signal_rates: vec![Vec::new(); servo.actuators().len()],
        };
        for segment in &recording.segments {
            let [positions, rates] = along::drive_motion(&servo.equations, segment)?;
            all.time.extend(&segment.run.time);
            for (joined, own) in all.positions.iter_mut().zip(positions) {
                joined.extend(own);
            }
            for (joined, own) in all.rates.iter_mut().zip(rates) {
                joined.extend(own);
            }
            for (joined, actuator) in all.signal_rates.iter_mut().zip(servo.actuators()) {
                joined.extend(&segment.run.qd[servo.signal_position(actuator)]);
            }
        }
        Ok(all)
    }

    /// A column at some times less a delay.
    fn interpolate_at(&self, column: &[f64], times: &[f64], delay: f64) -> Vec<f64> {
        interpolate(&self.time, column, times, delay)
    }
}

/// A column at some times less a delay, linear between its samples and constant beyond its ends.
fn interpolate(time: &[f64], column: &[f64], times: &[f64], delay: f64) -> Vec<f64> {
    let last = time.len().saturating_sub(1);
    times
        .iter()
        .map(|t| {
            let t = t - delay;
            if last == 0 || t <= time[0] {
                return column.first().copied().unwrap_or(0.0);
            }
            if t >= time[last] {
                return column[last];
            }
            let b = time.partition_point(|x| *x < t).clamp(1, last);
            let width = time[b] - time[b - 1];
            let share = if width > 0.0 { (t - time[b - 1]) / width } else { 1.0 };
            column[b - 1] + share * (column[b] - column[b - 1])
        })
        .collect()
}

/// What the force of one actuator depends on, by sample.
#[derive(Default)]
pub(super) struct ActuatorStates {
    /// The delayed signal.
    pub(super) signal: Vec<f64>,
    /// Its rate.
    pub(super) signal_rate: Vec<f64>,
    /// The position of the drive.
    pub(super) position: Vec<f64>,
    /// Its rate.
    pub(super) rate: Vec<f64>,
}

impl ActuatorStates {
    /// The force of the actuator, N or N m.
    pub(super) fn forces(&self, model: &Model, actuator: &ModelActuator, gains: &GainValues) -> Vec<f64> {
        let constants = &model.derivation.mechanism.constants;
        let values: Vec<f64> = actuator.terms.iter().map(|term| gains.term_value(term)).collect();
        (0..self.signal.len())
            .map(|sample| {
                let position = self.position[sample];
                let signal = actuator.effective_signal(self.signal[sample], position);
                let symbol = |symbol: ModelSymbol| match symbol {
                    ModelSymbol::Constant(c) => constants[c.0].value,
                    ModelSymbol::Place(PlaceQuantity::Coordinate) => position,
                    ModelSymbol::Place(PlaceQuantity::Rate) => self.rate[sample],
                    ModelSymbol::Place(PlaceQuantity::OtherCoordinate) => signal,
                    ModelSymbol::Place(PlaceQuantity::OtherRate) => self.signal_rate[sample],
                    _ => 0.0,
                };
                let terms = actuator.terms.iter().zip(&values);
                let force: f64 = terms.map(|(term, value)| value * term.factor.evaluate(&symbol)).sum();
                actuator.limited_force(force)
            })
            .collect()
    }
}
