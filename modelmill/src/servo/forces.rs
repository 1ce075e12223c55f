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

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};
use modelmill_identify::{DECIMATION_PASSBAND, RecordingNote, SignalRecording as Raw};
use modelmill_spec::{DriveKind, ModelActuator, ModelSymbol, PlaceQuantity};

use super::ServoModel;
use super::delay::{DelayQuery, ServoDelay, delays};
use super::gains::{GainValues, delay_phrase};
use super::logs::ReadRuns;
use super::refine::refine_delays;
use super::suspects::{ServoLimit, servo_limits};
use super::thresholds::{CERTAIN_LIMIT_SHARE, DELAY_STEP, FEWEST_DECIMATED};
use super::turns::{turn_offset, turn_sentence};
use crate::along;
use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::progress::SilentProgress;
use crate::recording::{PreparedRecording, RecordingOptions, SmoothingMethod, StatePreparation, UnpreparedRecording};
use crate::segment::RecordingSegment;
use crate::segment::computed_forces::{ComputedForces, DelaySensitivity};
use crate::segment::simulated_actuator::{SimulatedActuator, interpolate_at};
use crate::text::table::significant;

/// Rounds in which limits and delays of servos are estimated in turn.
const LIMIT_ROUNDS: usize = 4;

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

    /// As [`Model::prepare_recordings_with_signals`], with the forces of all actuators computed from their signals, also
    /// where the recording has measured forces.
    ///
    /// A recording that lacks the signals becomes an error, and so does each if the model has no actuators.
    pub fn prepare_recordings_from_signals(
        &self,
        runs: [&[Vec<&Path>]; 2],
        reading: &RecordingOptions,
    ) -> [Vec<Outcome<PreparedRecording>>; 2] {
        let read = |paths: &Vec<&Path>| self.without_measured_forces(&self.read_recording(paths, reading)?);
        let read = runs.map(|runs| runs.iter().map(read).collect());
        self.prepare_together(self.add_actuator_forces(read))
    }

    /// A recording without the measured forces of drives with actuators.
    ///
    /// Fails when the model has no actuators, or the recording lacks their signals.
    fn without_measured_forces(&self, recording: &UnpreparedRecording) -> Outcome<UnpreparedRecording> {
        let mechanism = &self.derivation.mechanism;
        if mechanism.actuators.is_empty() {
            return Err(Error::input(format!(
                "{}: the model has no `[[actuator]]`, so that no force follows from a command or another signal; add the actuators \
                 of the drives, or use a recording of forces",
                self.path
            )));
        }
        let lacking = mechanism.actuators.iter().map(|one| one.signal.as_str());
        let lacking: Vec<&str> = lacking.filter(|signal| !recording.raw().has_column(signal)).collect();
        if !lacking.is_empty() {
            return Err(Error::input(format!(
                "{} has no column for {}, the signals of the actuators of {}; name their columns in [recording.columns]",
                recording.raw().file(),
                lacking.join(", "),
                self.path
            )));
        }
        let mut raw = recording.raw().clone();
        for actuator in &mechanism.actuators {
            raw.remove_column(&mechanism.drives[actuator.drive.0].name);
        }
        Ok(recording.with_signals(raw))
    }

    /// Adds the forces of actuators to recordings that lack the forces of their drives: those of a fit, and those of its
    /// validation. Gains have their nominal values; gains without one, and delays that the file does not give, are
    /// estimated from the recordings of the fit. A note of each recording states the formula and the values.
    ///
    /// A recording with all forces, or without the signals of an actuator, is passed on unchanged. If values are unknown
    /// and cannot be estimated, recordings without forces become errors that state the reason.
    pub fn add_actuator_forces(&self, runs: ReadRuns) -> ReadRuns {
        let is_affected = |one: &Outcome<UnpreparedRecording>| self.lacks_computable_forces(one);
        let affected = || runs.iter().map(|run| run.iter().filter(|one| is_affected(one)).count());
        if affected().sum::<usize>() == 0 {
            return runs;
        }
        match ActuatorForces::new(self, &runs) {
            Ok(forces) => {
                let mut prepared = forces.motion.iter().flatten();
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

    /// Whether a recording lacks forces that follow from its signals.
    fn lacks_computable_forces(&self, one: &Outcome<UnpreparedRecording>) -> bool {
        one.as_ref()
            .is_ok_and(|one| !self.drives_to_compute(one.raw()).is_empty())
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
    /// The recordings without forces, prepared for the servo equations, in their order: those of the fit and those of the
    /// validation.
    motion: [Vec<Outcome<PreparedRecording>>; 2],
    /// Values of the gains.
    gains: GainValues,
    /// Delays of the actuators.
    delays: Vec<ServoDelay>,
    /// What the forces would add to the delays that the file gives, s, by actuator.
    shifts: Vec<f64>,
    /// The actuators, with limits that the file lacks and the recordings show.
    actuators: Vec<ModelActuator>,
    /// These limits.
    limits: Vec<ServoLimit>,
    /// The preparation that was chosen by the forces; `None` if the user gave one.
    preparation: Option<StatePreparation>,
    /// The cut-off of this preparation, Hz.
    cutoff_hz: Option<f64>,
}

impl<'a> ActuatorForces<'a> {
    /// Prepares the motion of all affected recordings, and estimates the values that the file does not give.
    fn new(model: &'a Model, runs: &ReadRuns) -> Outcome<Self> {
        let silent = model.host().clone().with_progress(Arc::new(SilentProgress));
        let mut servo = model.clone().with_host(&silent).servo_model_for_forces()?;
        servo.equations = servo.equations.with_host(&silent);
        let motion = prepare_motion(model, &servo, runs, None);
        let fitted: Vec<&PreparedRecording> = deciding_recordings(&motion).iter().flatten().collect();
        let segments: Vec<RecordingSegment> = fitted.iter().flat_map(|one| one.segments.clone()).collect();
        let delays = delays(&servo, &segments, DelayQuery::WithFriction)?;
        let gains = GainValues::new(model, &servo, &fitted)?;
        let mut all = Self {
            actuators: model.actuators().to_vec(),
            limits: Vec::new(),
            model,
            servo,
            motion,
            gains,
            delays,
            preparation: None,
            cutoff_hz: None,
            shifts: vec![0.0; model.actuators().len()],
        };
        let cutoff = all.choose_preparation(runs);
        // A low cut-off rounds the corners at which a limit shows. A limit and the delays bias each other until both are
        // known.
        for _ in 0..LIMIT_ROUNDS {
            all.find_limits()?;
            if all.limits.is_empty() {
                break;
            }
            all.refine(runs)?;
        }
        all.motion = prepare_motion(model, &all.servo, runs, cutoff);
        all.refine(runs)?;
        Ok(all)
    }

    /// Lets the forces choose the preparation, as they do for measured forces, and returns its cut-off, Hz. The cut-off
    /// that was chosen from positions alone passes more noise.
    fn choose_preparation(&mut self, runs: &ReadRuns) -> Option<f64> {
        let chosen = self.prepare_deciding_recordings(runs);
        let first = chosen.first()?;
        let preparation = first.preparation();
        let cutoff = first.segments.first().and_then(|one| one.run.prepared.cutoff_hz);
        if preparation.chosen {
            self.preparation = Some(preparation.clone());
            self.cutoff_hz = cutoff;
        }
        cutoff
    }

    /// Estimates the delays once more, from the forces behind the filter of the preparation.
    ///
    /// Fails when a pose has no solution.
    fn refine(&mut self, runs: &ReadRuns) -> Outcome {
        let prepared = self.prepare_deciding_recordings(runs);
        let segments: Vec<RecordingSegment> = prepared.into_iter().flat_map(|one| one.segments).collect();
        (self.delays, self.shifts) = refine_delays(self.model, &segments, &self.delays)?;
        Ok(())
    }

    /// The recordings that decide, with their forces; those of the validation if there are no others.
    fn prepare_deciding_recordings(&self, runs: &ReadRuns) -> Vec<PreparedRecording> {
        let k = usize::from(self.motion[0].is_empty());
        let affected = runs[k]
            .iter()
            .filter(|one| self.model.lacks_computable_forces(one))
            .flatten();
        let completed = affected
            .zip(&self.motion[k])
            .map(|(one, motion)| self.complete(one, Some(motion)));
        let quiet = self.model.clone().with_host(self.servo.equations.host());
        let [prepared, _] = quiet.prepare_together([completed.collect(), Vec::new()]);
        prepared.into_iter().flatten().collect()
    }

    /// Searches limits of servos that the file lacks.
    ///
    /// Fails when a pose has no solution.
    fn find_limits(&mut self) -> Outcome {
        let segments = |all: &[Outcome<PreparedRecording>]| -> Vec<RecordingSegment> {
            all.iter().flatten().flat_map(|one| one.segments.clone()).collect()
        };
        let check = if self.motion[0].is_empty() {
            Vec::new()
        } else {
            segments(&self.motion[1])
        };
        let seconds: Vec<f64> = self.delays.iter().map(|delay| delay.value).collect();
        let all = [&*segments(deciding_recordings(&self.motion)), &check];
        self.limits = servo_limits(self.model, &self.servo, all, &seconds, &self.gains)?;
        self.actuators = self.model.actuators().to_vec();
        for limit in &self.limits {
            // A saturation is known roughly: forces about it are left out, and none is cut off.
            self.actuators[limit.actuator] = ModelActuator {
                saturation: self.model.actuators()[limit.actuator].saturation,
                ..limit.limited.clone()
            };
        }
        Ok(())
    }

    /// Leaves out the forces of a drive that do not follow from its signals: those before the first command arrives, and
    /// those near a saturation that the file lacks.
    ///
    /// Fails when the recording has no such column.
    fn leave_out_unknown(&self, raw: &mut Raw, drive: usize, time: &[f64]) -> Outcome {
        let name = &self.model.derivation.mechanism.drives[drive].name;
        // Before the first command arrives, the force is not known.
        let latest = self
            .delays
            .iter()
            .zip(&self.actuators)
            .filter(|(_, one)| one.drive.0 == drive);
        let latest = latest.map(|(delay, _)| delay.value).fold(0.0, f64::max);
        if latest > 0.0 {
            raw.leave_out_samples(name, &|t| t < time[0] + latest);
        }
        let found = self
            .limits
            .iter()
            .filter(|limit| self.actuators[limit.actuator].drive.0 == drive);
        let found = found.filter_map(|limit| limit.limited.saturation.filter(|_| limit.is_saturation));
        if let Some(limit) = found.reduce(f64::min) {
            let force = raw.column(name)?.to_vec();
            let at = |t: f64| time.partition_point(|x| *x < t);
            raw.leave_out_samples(name, &|t| {
                force
                    .get(at(t))
                    .is_some_and(|force| force.abs() > CERTAIN_LIMIT_SHARE * limit)
            });
        }
        Ok(())
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
        raw.unwrap_angles(&self.angle_signals());
        let mechanism = &self.model.derivation.mechanism;
        let time = raw.column("t")?.to_vec();
        let motion = SmoothMotion::new(&self.servo, prepared)?;
        let mut phrases = Vec::new();
        let mut added_turns = Vec::new();
        let mut computed = ComputedForces {
            time: time.clone(),
            delays: Vec::new(),
            actuators: Vec::new(),
        };
        for drive in self.model.drives_to_compute(&raw) {
            let position = match mechanism.drives[drive].kind {
                DriveKind::Joint(i) => raw.column(&mechanism.coordinates[i.0].name).ok().map(<[f64]>::to_vec),
                DriveKind::Linear { .. } => None,
            };
            let position = position.unwrap_or_else(|| motion.interpolate_at(&motion.positions[drive], &time, 0.0));
            let mut force = vec![0.0; time.len()];
            let own = self.actuators.iter().zip(&self.delays).enumerate();
            let rate = motion.interpolate_at(&motion.rates[drive], &time, 0.0);
            for (k, (actuator, delay)) in own.filter(|(_, (actuator, _))| actuator.drive.0 == drive) {
                let signal = raw.column(&actuator.signal)?;
                let turns = turn_offset(actuator, signal, &position);
                let signal: Vec<f64> = signal.iter().map(|value| value + turns).collect();
                added_turns.extend(turn_sentence(actuator, turns));
                let forces_at = |delay: f64| {
                    let states = ActuatorStates {
                        signal: interpolate(&time, &signal, &time, delay),
                        signal_rate: motion.interpolate_at(&motion.signal_rates[k], &time, delay),
                        rate: rate.clone(),
                        position: position.clone(),
                    };
                    states.forces(self.model, actuator, &self.gains)
                };
                for (sum, force) in force.iter_mut().zip(forces_at(delay.value)) {
                    *sum += force;
                }
                // A delay of the file may be far from the true one: a secant has the force of the difference exactly.
                let [from, to] = match self.shifts[k] {
                    shift if shift.abs() > DELAY_STEP => [0.0, shift],
                    _ => [-DELAY_STEP, DELAY_STEP],
                };
                let [before, after] = [from, to].map(|step| forces_at(delay.value + step));
                let slopes = before.iter().zip(&after).map(|(a, b)| (b - a) / (to - from));
                computed.delays.push(DelaySensitivity {
                    drive,
                    actuator: k,
                    is_estimated: delay.interval.is_some(),
                    is_commanded: actuator.kind.is_commanded(),
                    values: slopes.collect(),
                });
                let delayed = |column: &[f64], times: &[f64]| interpolate(times, column, &time, delay.value);
                let signals = [delayed(&signal, &time), delayed(&motion.signal_rates[k], &motion.time)];
                let simulated = SimulatedActuator::new(actuator, self.gains.slopes(self.model, actuator), signals);
                computed.actuators.push(simulated);
                phrases.push(self.phrase(actuator, delay));
            }
            let name = &mechanism.drives[drive].name;
            raw.set_column(name, force);
            self.leave_out_unknown(&mut raw, drive, &time)?;
        }
        raw.add_note(RecordingNote::info(self.note(raw.file(), &phrases)));
        for says in added_turns {
            raw.add_note(RecordingNote::info(format!("{}: {says}.", raw.file())));
        }
        let preparation = self.preparation_of(&time);
        if let Some((chosen, passed)) = &preparation {
            raw.add_note(RecordingNote::info(message!(
                "{}: forces and regressor pass a low-pass at {} Hz and are decimated by {}. The positions are smoothed by one at \
                 {} Hz, which the forces chose; above it the forces contain jumps of friction and \
                 noise, and the smoothed motion does not. Set it yourself with {} and {}.",
                raw.file(),
                significant(*passed, 3),
                chosen.decimate,
                significant(self.cutoff_hz.unwrap_or(0.0), 3),
                Remedy::option(OptionName::CutoffHz),
                Remedy::option(OptionName::Decimate),
            )));
        }
        for limit in &self.limits {
            let says = limit.disturbance.description.clone().unwrap_or_default();
            raw.add_note(RecordingNote::warning(format!("{}: {says}.", raw.file())));
        }
        let limits = self.limits.iter().map(|limit| limit.disturbance.clone());
        let completed = recording.with_computed_forces(raw, computed, limits.collect());
        Ok(match preparation {
            Some((preparation, _)) => completed.with_preparation(preparation),
            None => completed,
        })
    }

    /// The signals of actuators, with whether they are commands of angles.
    fn angle_signals(&self) -> Vec<(String, bool)> {
        let is_angle = |one: &ModelActuator| one.has_position_error() && one.motion.is_angle();
        let all = self.actuators.iter();
        all.map(|one| (one.signal.clone(), is_angle(one))).collect()
    }

    /// The preparation of a recording with computed forces, and the highest frequency that its decimation passes, Hz;
    /// `None` if the usual choice is made.
    ///
    /// Positions are smoothed, and signals are not. The decimation passes no frequency above the
    /// cut-off, so that forces and regressor have passed equal filters.
    fn preparation_of(&self, time: &[f64]) -> Option<(StatePreparation, f64)> {
        let (chosen, cutoff) = (self.preparation.as_ref()?, self.cutoff_hz?);
        let rate = mean_rate(time);
        let most = time.len() / FEWEST_DECIMATED;
        let factor = (1..most).find(|factor| DECIMATION_PASSBAND * rate <= cutoff * *factor as f64);
        let factor = factor.unwrap_or(most).max(chosen.decimate).max(1);
        let mut own = chosen.clone();
        own.decimate = factor;
        // Each recording has a period of its own.
        if let SmoothingMethod::Fourier { period } = &mut own.smoothing {
            *period = None;
        }
        Some((own, DECIMATION_PASSBAND * rate / factor as f64))
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
        if let Some(limit) = actuator.rate_limit {
            let per = if actuator.has_position_error() { "s" } else { "s^2" };
            limits.push(format!(
                "rate limit {limit} {}/{per}",
                if drive.kind.force_unit(&mechanism.coordinates) == "N" {
                    "m"
                } else {
                    "rad"
                }
            ));
        }
        let signals = actuator.kind.signals();
        let formula = if signals.len() > 1 {
            // Each signal has a part of the force.
            format!("part of {}", actuator.kind.formula())
        } else {
            actuator.kind.formula().to_owned()
        };
        let values: Vec<String> = gains.into_iter().chain(limits).chain([delay_phrase(delay)]).collect();
        format!(
            "{} = {} of `{}`, with {}",
            drive.name,
            formula,
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
            " Wrong constants of the actuators appear as errors of the model."
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

/// The recordings that lack computable forces, prepared for the servo equations, with a cut-off in Hz if one is given.
fn prepare_motion(
    model: &Model,
    servo: &ServoModel,
    runs: &ReadRuns,
    cutoff: Option<f64>,
) -> [Vec<Outcome<PreparedRecording>>; 2] {
    let affected = runs.each_ref().map(|run| {
        let all = run.iter().filter(|one| model.lacks_computable_forces(one)).flatten();
        all.map(|one| {
            let mut reading = ServoModel::reading(one.options());
            reading.preparation.cutoff_hz = reading.preparation.cutoff_hz.or(cutoff);
            one.for_model(&servo.equations, &reading)
        })
        .collect::<Vec<_>>()
    });
    servo.equations.prepare_together(affected)
}

/// Samples per second.
fn mean_rate(time: &[f64]) -> f64 {
    match time {
        [first, .., last] if last > first => (time.len() - 1) as f64 / (last - first),
        _ => 0.0,
    }
}

/// The recordings of the fit; those of the validation if there are no others.
fn deciding_recordings(motion: &[Vec<Outcome<PreparedRecording>>; 2]) -> &[Outcome<PreparedRecording>] {
    if motion[0].is_empty() { &motion[1] } else { &motion[0] }
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
        let n_drives = servo.equations.row_names().len();
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

/// A column at some times less a delay, see [`interpolate_at`].
fn interpolate(time: &[f64], column: &[f64], times: &[f64], delay: f64) -> Vec<f64> {
    times.iter().map(|t| interpolate_at(time, column, t - delay)).collect()
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
        let slopes = gains.slopes(model, actuator);
        (0..self.signal.len())
            .map(|sample| {
                let states = [&self.signal, &self.signal_rate, &self.position, &self.rate];
                actuator.force(&slopes, states.map(|column| column[sample]))
            })
            .collect()
    }
}
