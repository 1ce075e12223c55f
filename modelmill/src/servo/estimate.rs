//! Base parameters and gains from servo logs: `[H, -S] p = 0` with known columns on the right-hand side, by
//! instrumental variables where a command is recorded, otherwise by least squares.
//!
//! Decision: without a known number in a group of parameters, the reference of the group is set to 1 and the values of
//! the others are ratios to it. A solution of unit norm would depend on the choice of units.

use modelmill_boundary::message;
use modelmill_identify::estimate::{EstimateOptions, RowVisitor, estimate, estimate_with_instruments};
use modelmill_identify::{
    FitFile, LeastSquaresError, ParameterUncertainty, RecordingNote, RegressionSolution, float_to_count,
};

use modelmill_spec::Sign;

use nalgebra::{DMatrix, DVector};

use super::ServoModel;
use super::delay::{DelayQuery, ServoDelay, delays};
use super::delay_steps::{DelayColumns, find_delays, refine_by_instruments};
use super::gains::GainValues;
use super::instruments::{commanded_segment, project_on_instruments};
use super::rows::{EquationRows, UsedSamples};
use super::scale::ServoScale;
use super::thresholds::{
    DELAY_SAMPLES, IMPOSSIBLE_SIGMAS, INSTRUMENT_CORRELATION, LARGE_BALANCE_ERROR, MOST_SAMPLES, SAMPLES_PER_PERIOD,
    SATURATION_PASSES,
};
use super::turns::turn_sentence;
use crate::error::{Error, Outcome};
use crate::recording::PreparedRecording;
use crate::segment::RecordingSegment;
use crate::text::table::{count, number, percent};

/// The estimator that was used.
#[derive(Clone, Debug, PartialEq)]
pub enum ServoEstimator {
    /// Instrumental variables from the commands.
    Instruments {
        /// Smallest canonical correlation between instruments and regressor, 0 to 1.
        strength: f64,
    },
    /// Least squares, with the reason.
    LeastSquares {
        /// Why there are no instruments.
        reason: String,
    },
}

/// What an estimated value means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ServoStatus {
    /// The value itself.
    Identified,
    /// A ratio to the reference of its group.
    Ratio,
    /// The reference of a group: 1, because only ratios can be known.
    Reference,
    /// A number of the model file.
    Known,
    /// The recording does not determine it.
    Undetermined,
}

/// A base parameter from a servo log.
#[derive(Clone, Debug, PartialEq)]
pub struct ServoParameter {
    /// Its name.
    pub name: String,
    /// Its expression in parameters and gains.
    pub expression: String,
    /// Its unit; for a ratio, the unit of the quotient.
    pub unit: String,
    /// The value.
    pub value: f64,
    /// Standard deviation, with autocorrelation and the uncertainty of delays; `None` if the value is not estimated.
    pub std: Option<f64>,
    /// What the value means.
    pub status: ServoStatus,
    /// Expression of the reference of a ratio.
    pub relative_to: Option<String>,
}

/// The error of the equation of one drive.
#[derive(Clone, Debug, PartialEq)]
pub struct ServoRowError {
    /// Name of the drive.
    pub drive: String,
    /// Rms value of the part that the model does not explain, in `unit`.
    pub error: f64,
    /// Rms value of the force of the actuator, or of the measured force.
    pub force: f64,
    /// N or N m; relative to the reference where only ratios are known.
    pub unit: String,
}

/// An identification from servo logs.
#[derive(Clone, Debug)]
pub struct ServoIdentification {
    /// Name of the model.
    pub model: String,
    /// Number of samples.
    pub samples: usize,
    /// The estimator that was used.
    pub estimator: ServoEstimator,
    /// The base parameters, in the order of the model.
    pub parameters: Vec<ServoParameter>,
    /// Condition number after scaling the columns to equal norm.
    pub scaled_condition_number: Option<f64>,
    /// Delays of the actuators.
    pub delays: Vec<ServoDelay>,
    /// Errors of the drives on the recordings of the fit.
    pub fit: Vec<ServoRowError>,
    /// Errors of the drives on validation runs; empty without any.
    pub check: Vec<ServoRowError>,
    /// Groups of base parameters of which the signals determine only ratios; empty if all values can be identified.
    pub scale: ServoScale,
    /// The base parameters of the model without actuators, and the gains, for files that are read again; `None` if only
    /// ratios can be known.
    pub model_fit: Option<FitFile>,
    /// Notes on the result.
    pub notes: Vec<RecordingNote>,
}

impl ServoModel {
    /// Identifies base parameters and gains from recordings that were prepared for [`ServoModel::equations`], and
    /// validates them with those of `check`.
    ///
    /// Fails when the recordings are too short or do not determine any parameter, or when a pose has no solution.
    pub fn identify(&self, fit: &[&PreparedRecording], check: &[&PreparedRecording]) -> Outcome<ServoIdentification> {
        let segments = |all: &[&PreparedRecording]| -> Vec<RecordingSegment> {
            all.iter().flat_map(|one| one.segments.clone()).collect()
        };
        let (fit, check) = (segments(fit), segments(check));
        self.check_length(&fit)?;
        let mut delays = delays(self, &fit, DelayQuery::OfModel)?;
        let mut system = ServoSystem::new(self, &fit, MOST_SAMPLES)?;
        if system.unknown.is_empty() {
            return Err(Error::input(format!(
                "{}: every base parameter and gain is a number of the file, so there is nothing to identify; compare the \
                 model with the recording, or declare values as parameters",
                self.equations.path
            )));
        }
        find_delays(&ServoSystem::new(self, &fit, delay_samples(&fit))?, &mut delays)?;
        refine_by_instruments(&system, &mut delays)?;
        let mut values: Vec<f64> = delays.iter().map(|delay| delay.value).collect();
        let mut solved = system.solve(&values)?;
        if self.actuators().iter().any(|actuator| actuator.saturation.is_some()) {
            // The forces at a saturation are known only with the gains, which are better with each pass.
            for _ in 0..SATURATION_PASSES {
                system.leave_out_saturated(&values, &solved)?;
                refine_by_instruments(&system, &mut delays)?;
                values = delays.iter().map(|delay| delay.value).collect();
                solved = system.solve(&values)?;
            }
        }
        let covariance = system.covariance(&delays, &solved)?;
        let base = system.base_values(&solved);
        let checked = if check.is_empty() {
            Vec::new()
        } else {
            let mut system = ServoSystem::new(self, &check, MOST_SAMPLES)?;
            system.leave_out_saturated(&values, &solved)?;
            system.row_errors(&system.equations(&values)?.0, &base)
        };
        let fitted = system.row_errors(&solved.equations, &base);
        let mut notes = remarks(&system, &solved, &delays);
        notes.extend(system.turn_notes());
        notes.extend(large_errors(&fitted, "the fitted recordings"));
        notes.extend(large_errors(&checked, "the validation run"));
        for note in &notes {
            self.equations.host().note(note);
        }
        notes.extend(fit.iter().flat_map(|one| one.run.notes.iter().cloned()));
        let samples = system.samples.iter().map(|one| one.segment.samples()).sum();
        let parameters = system.parameters(&solved, &covariance, &base);
        Ok(ServoIdentification {
            model: self.equations.name.clone(),
            samples,
            model_fit: self.model_fit(&parameters, &covariance, &delays, samples),
            parameters,
            scaled_condition_number: Some(solved.solution.scaled_condition_number).filter(|c| c.is_finite()),
            fit: fitted,
            check: checked,
            estimator: solved.estimator,
            delays,
            scale: self.scale.clone(),
            notes,
        })
    }

    /// Fails unless there are several equations for each unknown.
    fn check_length(&self, fit: &[RecordingSegment]) -> Outcome {
        let samples: usize = fit.iter().map(RecordingSegment::samples).sum();
        let unknown = self.equations.base.len();
        if samples > 4 * unknown {
            return Ok(());
        }
        Err(Error::input(format!(
            "{} are too few for {}; use a longer recording",
            count(samples, "sample", "samples"),
            count(unknown, "base parameter", "base parameters")
        )))
    }
}

/// The system of equations of some recordings.
pub(super) struct ServoSystem<'a> {
    /// The model.
    pub(super) servo: &'a ServoModel,
    /// The samples that are used, by segment.
    samples: Vec<UsedSamples>,
    /// Estimated base parameters.
    unknown: Vec<usize>,
    /// Base parameters with a value that is not estimated: numbers of the file, and references of groups.
    fixed: Vec<(usize, f64)>,
}

/// A solution with its equations.
pub(super) struct ServoSolution {
    solution: RegressionSolution,
    uncertainty: ParameterUncertainty,
    pub(super) estimator: ServoEstimator,
    /// The equations of the recordings, all segments after one another.
    pub(super) equations: EquationRows,
    /// The same at the instruments.
    pub(super) instruments: Option<EquationRows>,
    /// Weights of the drives.
    pub(super) weights: Vec<f64>,
}

impl<'a> ServoSystem<'a> {
    /// Selects at most `most` samples of all segments, and the unknowns.
    fn new(servo: &'a ServoModel, segments: &[RecordingSegment], most: usize) -> Outcome<Self> {
        let model = &servo.equations;
        let most = most / segments.len().max(1);
        let samples = segments
            .iter()
            .map(|one| UsedSamples::new(servo, one, most))
            .collect::<Outcome<_>>()?;
        let references = servo.scale.freedoms.iter().map(|freedom| (freedom.reference, 1.0));
        let known = (0..model.base.len())
            .filter(|k| model.is_known(*k))
            .map(|k| (k, model.values[k]));
        let fixed: Vec<(usize, f64)> = known.chain(references).collect();
        let unknown = (0..model.base.len())
            .filter(|k| fixed.iter().all(|(one, _)| one != k))
            .collect();
        Ok(Self {
            servo,
            samples,
            unknown,
            fixed,
        })
    }

    /// The equations with some delays, and those at the instruments; `None` without commands or if the instruments
    /// leave the range of the mechanism.
    fn equations(&self, delays: &[f64]) -> Outcome<(EquationRows, Option<EquationRows>)> {
        let mut own = EquationRows {
            regressor: Vec::new(),
            measured: Vec::new(),
        };
        let mut instruments = Some(own.clone());
        for one in &self.samples {
            let segment = one.delayed(self.servo, delays);
            own.append(one.equations(self.servo, &segment)?);
            let theirs = commanded_segment(self.servo, &segment).and_then(|at| one.equations(self.servo, &at).ok());
            instruments = instruments.zip(theirs).map(|(mut all, theirs)| {
                all.append(theirs);
                all
            });
        }
        Ok((own, instruments))
    }

    /// Notes on full turns that were added to commands, one for each recording and actuator.
    fn turn_notes(&self) -> Vec<RecordingNote> {
        let mut notes = Vec::new();
        for one in &self.samples {
            let turns = one.added_turns(self.servo);
            let added = self.servo.actuators().iter().zip(turns);
            notes.extend(added.filter_map(|(actuator, turns)| turn_sentence(actuator, turns)));
        }
        notes.dedup();
        notes
            .into_iter()
            .map(|says| RecordingNote::info(format!("{}: {says}.", self.servo.equations.path)))
            .collect()
    }

    /// The equations with some delays, without instruments.
    ///
    /// Fails when a pose has no solution.
    pub(super) fn own_equations(&self, delays: &[f64]) -> Outcome<EquationRows> {
        let mut own = EquationRows {
            regressor: Vec::new(),
            measured: Vec::new(),
        };
        for one in &self.samples {
            own.append(one.equations(self.servo, &one.delayed(self.servo, delays))?);
        }
        Ok(own)
    }

    /// Leaves out samples at which the actuators reach their saturation, with the gains of a solution.
    ///
    /// Fails when only ratios of gains can be known.
    fn leave_out_saturated(&mut self, delays: &[f64], solved: &ServoSolution) -> Outcome {
        let base = self.base_values(solved);
        let gains = GainValues::from_base_values(self.servo, &base);
        for actuator in self.servo.actuators().iter().filter(|one| one.saturation.is_some()) {
            if actuator.terms.iter().any(|term| self.servo.is_ratio(term)) {
                return Err(Error::input(format!(
                    "{}: the saturation of the servo of {} is a force, but only ratios of forces can be known; give a gain or \
                     another number that fixes the scale, or delete `saturation`",
                    self.servo.equations.path,
                    self.servo.drive_name(actuator)
                )));
            }
        }
        for one in &mut self.samples {
            one.leave_out_saturated(self.servo, delays, &gains);
        }
        Ok(())
    }

    /// Number of rows of a sample.
    fn n_rows(&self) -> usize {
        self.servo.body_rows().len()
    }

    /// Solves the equations with some delays: first with equal weights, then with weights by drive.
    pub(super) fn solve(&self, delays: &[f64]) -> Outcome<ServoSolution> {
        let (own, instruments) = self.equations(delays)?;
        let mut weights = vec![1.0; self.n_rows()];
        let first = self.solve_weighted(&own, instruments.as_ref(), &weights, &DelayColumns::default())?;
        if weights.len() > 1 {
            let values = self.base_values_of(&first.0);
            for (weight, row) in weights.iter_mut().zip(self.row_errors(&own, &values)) {
                *weight = if row.error > 0.0 { row.error.recip() } else { 1.0 };
            }
        }
        let (solution, uncertainty, estimator) =
            self.solve_weighted(&own, instruments.as_ref(), &weights, &DelayColumns::default())?;
        Ok(ServoSolution {
            solution,
            uncertainty,
            estimator,
            equations: own,
            instruments,
            weights,
        })
    }

    /// Solves the equations with some weights of the drives, for the unknowns and for steps of some delays behind them.
    ///
    /// Fails when the equations cannot be solved.
    pub(super) fn solve_weighted(
        &self,
        own: &EquationRows,
        instruments: Option<&EquationRows>,
        weights: &[f64],
        delays: &DelayColumns,
    ) -> Outcome<(RegressionSolution, ParameterUncertainty, ServoEstimator)> {
        let n = self.unknown.len() + delays.actuators.len();
        let failed = |error: LeastSquaresError| Error::input(format!("{}: {error}", self.servo.equations.path));
        let right = self.right_side(own, weights);
        let plain = self.columns(own, weights, delays);
        let mut reason = "the recording has no command that is free of the noise of sensors".to_owned();
        if let Some(instruments) = instruments {
            let columns = self.columns(instruments, weights, delays);
            let known = self.known_part(instruments, weights);
            let projected = project_on_instruments(&columns, &known, &plain, weights.len());
            let theirs = projected.unwrap_or(columns);
            let joined: Vec<f64> = (theirs.chunks_exact(n).zip(plain.chunks_exact(n)))
                .flat_map(|(z, w)| z.iter().chain(w).copied())
                .collect();
            let found =
                estimate_with_instruments(n, weights.len(), |visit: &mut RowVisitor<'_>| visit(&joined, &right));
            match found {
                Ok(found) if found.strength >= INSTRUMENT_CORRELATION => {
                    let strength = found.strength;
                    return Ok((
                        found.solution,
                        found.uncertainty,
                        ServoEstimator::Instruments { strength },
                    ));
                }
                Ok(found) => {
                    reason = format!(
                        "instruments from the commands are weak, with a correlation of {}",
                        number(found.strength)
                    );
                }
                Err(LeastSquaresError::WeakInstruments { correlation }) => {
                    reason = format!(
                        "instruments from the commands are weak, with a correlation of {}",
                        number(correlation)
                    );
                }
                Err(error) => return Err(failed(error)),
            }
        }
        let mut nominal: Vec<f64> = self.unknown.iter().map(|k| self.servo.equations.values[*k]).collect();
        nominal.resize(n, 0.0);
        let options = EstimateOptions::default();
        let found = estimate(&nominal, weights.len(), &options, |visit: &mut RowVisitor<'_>| {
            visit(&plain, &right)
        });
        let found = found.map_err(failed)?;
        Ok((
            found.solution,
            found.uncertainty,
            ServoEstimator::LeastSquares { reason },
        ))
    }

    /// Weighted columns of the unknowns, and of steps of delays.
    fn columns(&self, rows: &EquationRows, weights: &[f64], delays: &DelayColumns) -> Vec<f64> {
        let (n, n_delays) = (self.servo.equations.base.len(), delays.actuators.len());
        let weighted = rows.regressor.chunks_exact(n).zip(weights.iter().cycle());
        let all = weighted.enumerate().flat_map(|(i, (row, weight))| {
            let steps = &delays.values[i * n_delays..(i + 1) * n_delays];
            let unknown = self.unknown.iter().map(move |k| weight * row[*k]);
            unknown.chain(steps.iter().map(move |x| weight * x))
        });
        all.collect()
    }

    /// Weighted right-hand side: measured forces less the columns with fixed values.
    fn right_side(&self, rows: &EquationRows, weights: &[f64]) -> Vec<f64> {
        let known = self.known_part(rows, weights);
        let measured = rows.measured.iter().zip(weights.iter().cycle());
        measured
            .zip(known)
            .map(|((y, weight), known)| weight * y - known)
            .collect()
    }

    /// Weighted sum of the columns with fixed values.
    fn known_part(&self, rows: &EquationRows, weights: &[f64]) -> Vec<f64> {
        let n = self.servo.equations.base.len();
        let all = rows.regressor.chunks_exact(n).zip(weights.iter().cycle());
        all.map(|(row, weight)| weight * self.fixed.iter().map(|(k, p)| row[*k] * p).sum::<f64>())
            .collect()
    }

    /// Values of all base parameters.
    pub(super) fn base_values(&self, solved: &ServoSolution) -> Vec<f64> {
        self.base_values_of(&solved.solution)
    }

    /// Values of all base parameters from a solution.
    fn base_values_of(&self, solution: &RegressionSolution) -> Vec<f64> {
        let mut values = vec![0.0; self.servo.equations.base.len()];
        for (k, value) in &self.fixed {
            values[*k] = *value;
        }
        for (k, value) in self.unknown.iter().zip(&solution.values) {
            values[*k] = *value;
        }
        values
    }

    /// Estimates that must be positive and are not: the base parameter, and by how many standard deviations it is negative.
    pub(super) fn negative_estimates(&self, solved: &ServoSolution) -> Vec<(usize, f64)> {
        let estimates = solved.solution.values.iter().zip(&solved.uncertainty.std);
        let sigmas = estimates.zip(&self.unknown).map(|((value, std), k)| (*k, -value / std));
        let must_be_positive = |k: usize| self.servo.equations.sign_of_base_parameter(k) == Sign::Positive;
        sigmas
            .filter(|(k, sigmas)| *sigmas > 0.0 && must_be_positive(*k))
            .collect()
    }

    /// Covariance of all base parameters, zero for fixed ones: that of the solution, and for each delay the change of the
    /// solution over one standard deviation of the delay.
    fn covariance(&self, delays: &[ServoDelay], solved: &ServoSolution) -> Outcome<DMatrix<f64>> {
        let n = self.unknown.len();
        let mut of_unknown = solved.uncertainty.covariance.view((0, 0), (n, n)).clone_owned();
        for (i, delay) in delays.iter().enumerate().filter(|(_, delay)| delay.std > 0.0) {
            let mut moved: Vec<f64> = delays.iter().map(|one| one.value).collect();
            moved[i] += delay.std;
            let other = self.solve(&moved)?;
            let changes = other.solution.values.iter().zip(&solved.solution.values);
            let change = DVector::from_iterator(n, changes.map(|(a, b)| a - b));
            of_unknown += &change * change.transpose();
        }
        let n_base = self.servo.equations.base.len();
        let mut covariance = DMatrix::zeros(n_base, n_base);
        for (i, a) in self.unknown.iter().enumerate() {
            for (j, b) in self.unknown.iter().enumerate() {
                covariance[(*a, *b)] = of_unknown[(i, j)];
            }
        }
        Ok(covariance)
    }

    /// The base parameters with their meaning.
    fn parameters(&self, solved: &ServoSolution, covariance: &DMatrix<f64>, base: &[f64]) -> Vec<ServoParameter> {
        let model = &self.servo.equations;
        let infos = model.parameter_infos();
        (infos.iter().enumerate())
            .map(|(k, info)| {
                let freedom = self
                    .servo
                    .scale
                    .freedoms
                    .iter()
                    .find(|freedom| freedom.base.contains(&k));
                let at = self.unknown.iter().position(|one| *one == k);
                let std = at.map(|at| solved.uncertainty.std[at].max(covariance[(k, k)].sqrt()));
                let status = match (at, freedom) {
                    (None, Some(_)) => ServoStatus::Reference,
                    (None, None) => ServoStatus::Known,
                    (Some(at), _) if !solved.solution.determined[at] => ServoStatus::Undetermined,
                    (Some(_), Some(freedom)) if freedom.open > 1 => ServoStatus::Undetermined,
                    (Some(_), Some(_)) => ServoStatus::Ratio,
                    (Some(_), None) => ServoStatus::Identified,
                };
                let reference = freedom
                    .filter(|_| status == ServoStatus::Ratio)
                    .map(|freedom| &infos[freedom.reference]);
                ServoParameter {
                    name: info.name.clone(),
                    expression: info.expression.clone(),
                    unit: match (status, reference) {
                        (ServoStatus::Reference, _) => "1".to_owned(),
                        (_, Some(reference)) => format!("({})/({})", info.unit, reference.unit),
                        _ => info.unit.clone(),
                    },
                    value: base[k],
                    std: std.filter(|std| std.is_finite() && status != ServoStatus::Undetermined),
                    status,
                    relative_to: reference.map(|reference| reference.expression.clone()),
                }
            })
            .collect()
    }

    /// The error of each drive: the balance of the equation, and the size of the force of its actuator.
    fn row_errors(&self, rows: &EquationRows, base: &[f64]) -> Vec<ServoRowError> {
        let model = &self.servo.equations;
        let mechanism = &model.derivation.mechanism;
        let (n, body_rows) = (base.len(), self.servo.body_rows());
        let is_scaled = self.servo.scale.freedoms.is_empty();
        body_rows
            .iter()
            .enumerate()
            .map(|(place, d)| {
                let gains = self.gain_columns(*d);
                let (mut error, mut force, mut counted) = (0.0, 0.0, 0.0);
                let own = rows
                    .regressor
                    .chunks_exact(n)
                    .zip(&rows.measured)
                    .skip(place)
                    .step_by(body_rows.len());
                for (row, y) in own.filter(|(row, y)| **y != 0.0 || row.iter().any(|x| *x != 0.0)) {
                    let total: f64 = row.iter().zip(base).map(|(x, p)| x * p).sum();
                    let actuated: f64 = gains.iter().map(|k| row[*k] * base[*k]).sum();
                    error += (y - total).powi(2);
                    force += (y - actuated).powi(2);
                    counted += 1.0;
                }
                let rms = |sum: f64| if counted > 0.0 { f64::sqrt(sum / counted) } else { 0.0 };
                ServoRowError {
                    drive: mechanism.drives[*d].name.clone(),
                    error: rms(error),
                    force: rms(force),
                    unit: if is_scaled {
                        model.force_unit(*d).to_owned()
                    } else {
                        "relative".to_owned()
                    },
                }
            })
            .collect()
    }

    /// Base parameters whose column contains the signal of the drive.
    fn gain_columns(&self, drive: usize) -> Vec<usize> {
        let model = &self.servo.equations;
        let forces = model
            .derivation
            .mechanism
            .servo_forces
            .iter()
            .filter(|force| force.drive.0 == drive);
        let products: Vec<Vec<(usize, u32)>> = forces
            .flat_map(|force| &force.terms)
            .map(|term| term.parameters.iter().map(|(p, n)| (p.0, *n)).collect())
            .collect();
        (0..model.base.len())
            .filter(|k| {
                model
                    .products_of(*k)
                    .iter()
                    .any(|(product, _)| products.contains(&product.0))
            })
            .collect()
    }
}

/// Number of samples with which delays are searched: enough for the filter of the motion.
fn delay_samples(segments: &[RecordingSegment]) -> usize {
    let of = |segment: &RecordingSegment| match (segment.run.time.as_slice(), segment.run.prepared.cutoff_hz) {
        ([first, .., last], Some(cutoff)) => float_to_count(SAMPLES_PER_PERIOD * cutoff * (last - first)),
        _ => 0,
    };
    segments.iter().map(of).sum::<usize>().max(DELAY_SAMPLES)
}

impl EquationRows {
    /// Adds the equations of another segment behind these.
    fn append(&mut self, other: Self) {
        self.regressor.extend(other.regressor);
        self.measured.extend(other.measured);
    }
}

/// A note on each drive whose balance error is no small part of its force. `place` states the recordings.
fn large_errors(rows: &[ServoRowError], place: &str) -> Vec<RecordingNote> {
    let is_large = |row: &&ServoRowError| row.error > LARGE_BALANCE_ERROR * row.force;
    let note = |row: &ServoRowError| {
        RecordingNote::warning(message!(
            "The balance of {} misses {} of the force on {place}: the values may be wrong by more than their standard deviations. \
             Look for a limit or dead band of the servo, and for friction that the model lacks.",
            row.drive,
            percent(Some(row.error / row.force))
        ))
    };
    rows.iter().filter(is_large).map(note).collect()
}

/// Notes on the result.
fn remarks(system: &ServoSystem<'_>, solved: &ServoSolution, delays: &[ServoDelay]) -> Vec<RecordingNote> {
    let (servo, unknown) = (system.servo, &system.unknown);
    let negative = system.negative_estimates(solved);
    let mut notes = Vec::new();
    for freedom in &servo.scale.freedoms {
        let base = &servo.equations.base;
        let reference = &base[freedom.reference].expression;
        notes.push(RecordingNote::warning(if freedom.fixed_by.is_empty() {
            message!(
                "Only ratios to {reference} can be known: no number of the model fixes the scale of its equations; give a gain as a \
                 number, or record the force of a drive."
            )
        } else {
            message!(
                "Only ratios to {reference} can be known: no number of the model fixes the scale of its equations; give a number \
                 for one of {} in the model file.",
                freedom.fixed_by.join(", ")
            )
        }));
    }
    if let ServoEstimator::LeastSquares { reason } = &solved.estimator {
        notes.push(RecordingNote::warning(message!(
            "Least squares was used, because {reason}: noise of the positions makes its estimates too small; record the command \
             of a position controller, or filter more strongly."
        )));
    }
    for (k, _) in negative.iter().filter(|(_, sigmas)| *sigmas > IMPOSSIBLE_SIGMAS) {
        notes.push(RecordingNote::warning(message!(
            "{} is negative, which is not possible: the model of the servo or of the machine is wrong; check the kind of \
             actuator, its signal, and whether the controller adds a feed-forward force.",
            servo.equations.base[*k].expression
        )));
    }
    let names: Vec<String> = unknown
        .iter()
        .map(|k| servo.equations.base[*k].expression.clone())
        .collect();
    for direction in solved.solution.describe_undetermined(&names) {
        notes.push(RecordingNote::warning(message!(
            "The recording does not determine {direction}; record a motion that excites it."
        )));
    }
    for delay in delays.iter().filter(|delay| delay.is_open) {
        notes.push(RecordingNote::warning(message!(
            "The recording does not determine the delay of {}: {} to {} ms are possible; give it as `delay` of the actuator, or \
             record a faster motion.",
            delay.drive,
            number(1e3 * delay.interval.map_or(0.0, |[from, _]| from)),
            number(1e3 * delay.interval.map_or(delay.value, |[_, to]| to))
        )));
    }
    notes
}
