//! `identify`: base parameters from recordings by least squares, eq. (12), with standard deviations and error figures
//! (such as the NRMS).

mod influence;
mod instruments;
mod options;
mod refine;
pub mod regression;
mod standstill;
mod thresholds;

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};
use modelmill_identify::estimate::FEWEST_ROWS;
use modelmill_identify::fit_parameters;
use modelmill_identify::{
    ErrorFigures, EstimatorOutput, FitFile, FitParameter, ParameterInfo, ParameterStatus, RateDependence,
    RecordingNote, RunRepeatability,
};
use modelmill_spec::Sign;

use crate::along;
use crate::compare;
use crate::error::{Error, Outcome};
use crate::faults::SuspectedFault;
use crate::model::Model;
use crate::recording::{self, PreparedRecording};
use crate::segment::RecordingSegment;
use crate::text::table::{count, number};

pub use instruments::Instruments;
pub use modelmill_identify::estimate::HUBER_BOUND;
pub use options::{EquationWeights, EstimatorOptions};
pub use refine::{EstimateRefinement, RefinementResult};
use regression::{InstrumentStatistics, RegressionEstimate};
use thresholds::{IMPOSSIBLE_SIGN_SIGMAS, WEAK_INSTRUMENT_CORRELATION};

/// Result of [`Model::identify`]: the fit, and the error figures of the nominal parameters on the same recordings.
pub struct Identification {
    /// The result as `identify` writes it to a fit file: values and standard deviations of all base parameters, error
    /// figures and notes.
    pub fit: FitFile,
    /// Error figures of the nominal parameters on the recordings of the fit.
    pub nominal_fit: ErrorFigures,
    /// Error figures of the nominal parameters on the validation runs; `None` if there are none.
    pub nominal_check: Option<ErrorFigures>,
    /// The suspected mistake of the first recording that has one: until it is corrected, all values are doubtful.
    pub suspect: Option<SuspectedFault>,
    /// The solution of the least-squares problem from which `fit` was written: only the estimated parameters, with their
    /// covariance and further statistics.
    pub found: RegressionEstimate,
    /// The options of the estimator, with automatic weights replaced by the chosen ones.
    pub options: EstimatorOptions,
    /// Notes on the result. `fit` contains them too, together with the notes on the recordings.
    pub notes: Vec<RecordingNote>,
    /// File names of the periodic recordings, each with the period and the noise floor.
    pub repeats: Vec<(String, RunRepeatability)>,
    /// How the residuals of the fitted recordings depend on the velocities of their drives. Empty if there is no such
    /// dependence, or if the model was identified from segments instead of recordings.
    pub by_rate: Vec<RateDependence>,
    /// Whether the model has nominal values, so that their errors mean something.
    pub(crate) has_nominal: bool,
}

impl Model {
    /// Identifies the base parameters from the recordings of `fit`, eq. (12), and validates the result with those of
    /// `check`.
    ///
    /// Fails when there are fewer equations than unknown parameters, when no force was measured, or when a recording
    /// contains a pose that the mechanism cannot reach.
    pub fn identify(
        &self,
        fit: &[&PreparedRecording],
        check: &[&PreparedRecording],
        options: &EstimatorOptions,
    ) -> Outcome<Identification> {
        self.identify_with(fit, &Instruments::None, check, options)
    }

    /// As [`Model::identify`], by instrumental variables. They avoid the bias of least squares if the controller
    /// correlates the measurement noise with the states.
    ///
    /// ```no_run
    /// use modelmill::Model;
    /// use modelmill::identify::{EstimatorOptions, Instruments};
    /// use modelmill::recording::RecordingOptions;
    ///
    /// let model = Model::open("arm.toml")?;
    /// let run = model.recording("run.csv", &RecordingOptions::default())?;
    /// // The motion has a period of 8 s, so that the next period provides the instruments.
    /// let instruments = Instruments::Period(8.0);
    /// let fit = model.identify_with(&[&run], &instruments, &[], &EstimatorOptions::default())?;
    /// println!("{:?}", fit.values());
    /// # Ok::<(), modelmill::Error>(())
    /// ```
    pub fn identify_with(
        &self,
        fit: &[&PreparedRecording],
        instruments: &Instruments<'_>,
        check: &[&PreparedRecording],
        options: &EstimatorOptions,
    ) -> Outcome<Identification> {
        let (recordings, validations) = (fit, check);
        // Segments are copied, since some of their equations may be excluded.
        let [mut fit, check] = recording::segments(self, fit, check);
        // Equations at standstill are excluded before instruments are assigned.
        if let Some(part) = options.standstill {
            standstill::exclude_standstill(self, &mut fit, part)?;
        }
        // Instruments must match the segments of the fit.
        let instruments = instruments::instrument_segments(&fit, instruments, options)?;
        let options = EstimatorOptions {
            weights: resolve_weights(self, &fit, &instruments, options.weights),
            ..options.clone()
        };
        let mut found = identify(self, &fit, &instruments, &check, &options)?;
        found.suspect = compare::first_suspect(recordings).or_else(|| compare::first_suspect(validations));
        // The influence of faults costs a second fit, which instruments do not support.
        let (by_rate, influence) = self.host().run_job("examining the residuals", 0, |_| {
            let by_rate = compare::residual_dependences(self, &fit, &found.values());
            let influence = if instruments.is_empty() {
                influence::fault_influence(self, recordings, &found.found, &options)
            } else {
                Ok(None)
            };
            (by_rate, influence)
        })?;
        found.by_rate = by_rate?;
        if let Some(note) = influence? {
            found.fit.data.push(note.clone());
            found.notes.push(note);
        }
        for note in &found.notes {
            self.host().note(note);
        }
        Ok(found)
    }
}

/// The weights if they are left open: by drive if drives have different units, so that squares of different units
/// would be added, or if the preparation was chosen automatically. Instruments use none.
fn resolve_weights(
    model: &Model,
    data: &[RecordingSegment],
    instruments: &[RecordingSegment],
    weights: EquationWeights,
) -> EquationWeights {
    if weights != EquationWeights::Automatic {
        return weights;
    }
    let drives = model.row_names().len();
    // Squares of N and N m must not be added without weights.
    let differ = (1..drives).any(|d| model.force_unit(d) != model.force_unit(0));
    let chosen = data.iter().any(|one| one.run.prepared.decimate_chosen);
    if instruments.is_empty() && drives > 1 && (differ || chosen) {
        EquationWeights::Channels
    } else {
        EquationWeights::None
    }
}

/// Identifies a model from the segments `data`, and validates the result with the segments `check`.
///
/// Fails when the equations cannot be solved, when a pose has no solution, or when the job is cancelled.
pub fn identify(
    model: &Model,
    data: &[RecordingSegment],
    instruments: &[RecordingSegment],
    check: &[RecordingSegment],
    options: &EstimatorOptions,
) -> Outcome<Identification> {
    let found = regression::identify(model, data, instruments, options)?;
    // Parameters known from the file are inserted between the identified ones, in the order of the
    // model.
    let solution = &found.solution;
    let infos = model.parameter_infos();
    let unknown: Vec<ParameterInfo> = found.unknown.iter().map(|k| infos[*k].clone()).collect();
    // Values, standard deviations and status of the estimated parameters.
    let mut parameters = fit_parameters(&unknown, solution, &found.uncertainty);
    for one in found.refined.removed_parameters() {
        parameters[one].status = ParameterStatus::NotEssential;
    }
    for (k, info) in infos.iter().enumerate() {
        if model.is_known(k) {
            parameters.insert(k, known_parameter(info, model.values[k]));
        }
    }
    // Notes need all parameters, in the order of the model.
    let notes = remarks(model, &found, &parameters);
    let values: Vec<f64> = parameters.iter().map(|p| p.value).collect();
    let names: Vec<String> = unknown.into_iter().map(|info| info.expression).collect();
    // Fit and validation use one band, so that their error figures can be compared.
    let band = compare::band(data);
    // Error figures of identified and nominal values, on fit and validation runs.
    let (fit, nominal_fit) = both_figures(model, data, &values, band)?;
    let recordings = data.iter().chain(check);
    let repeats = recordings
        .clone()
        .filter_map(|one| Some((one.run.file.clone(), one.run.repeatability.clone()?)))
        .collect();
    let (check, nominal_check) = if check.is_empty() {
        (None, None)
    } else {
        let (identified, nominal) = both_figures(model, check, &values, band)?;
        (Some(identified), Some(nominal))
    };
    let finite = |value: f64| value.is_finite().then_some(value);
    let of_recordings = recordings.flat_map(RecordingSegment::notes).cloned();
    // The fit file contains all notes, also those of the recordings.
    let mut all_notes: Vec<RecordingNote> = model.caution().into_iter().chain(of_recordings).collect();
    all_notes.extend(notes.iter().cloned());
    let constants = &model.derivation.mechanism.constants;
    Ok(Identification {
        fit: FitFile {
            gains: Vec::new(),
            delays: Vec::new(),
            model: model.name.clone(),
            samples: fit.samples,
            condition_number: finite(solution.condition_number),
            scaled_condition_number: finite(solution.scaled_condition_number),
            covariance: covariance(&found, parameters.len()),
            parameters,
            constants: constants.iter().map(|c| (c.name.clone(), c.value)).collect(),
            equation_sample: model.equation_sample(),
            undetermined: solution.describe_undetermined(&names),
            fit,
            check,
            data: all_notes,
            estimator: EstimatorOutput::default(),
        },
        nominal_fit,
        nominal_check,
        suspect: None,
        found,
        options: options.clone(),
        notes,
        repeats,
        by_rate: Vec::new(),
        has_nominal: (0..model.base.len()).any(|k| model.has_values(k)),
    })
}

/// The covariance of all base parameters, with zeros for known ones; `None` unless all values are finite.
fn covariance(found: &RegressionEstimate, n: usize) -> Option<Vec<Vec<f64>>> {
    // Known parameters have no uncertainty.
    let mut rows = vec![vec![0.0; n]; n];
    for (a, i) in found.unknown.iter().enumerate() {
        for (b, j) in found.unknown.iter().enumerate() {
            rows[*i][*j] = found.uncertainty.covariance[(a, b)];
        }
    }
    let is_known = found.uncertainty.std.iter().all(|s| s.is_finite()) && rows.iter().flatten().all(|c| c.is_finite());
    is_known.then_some(rows)
}

/// The entry of a parameter that is known from the model file.
fn known_parameter(info: &ParameterInfo, value: f64) -> FitParameter {
    FitParameter {
        name: info.name.clone(),
        expression: info.expression.clone(),
        value,
        std: None,
        classical_std: None,
        effective_samples: None,
        unit: info.unit.clone(),
        nominal: info.nominal,
        status: ParameterStatus::Known,
    }
}

/// Notes on the result: known and undetermined parameters, weak instruments, few equations, impossible signs.
fn remarks(model: &Model, found: &RegressionEstimate, parameters: &[FitParameter]) -> Vec<RecordingNote> {
    let solution = &found.solution;
    let mut notes = Vec::new();
    for p in parameters.iter().filter(|p| p.status == ParameterStatus::Known) {
        notes.push(RecordingNote::info(format!(
            "{} = {} contains numbers of the model file only. It is known and not identified; its force is subtracted \
             from the measured one.",
            p.name, p.expression
        )));
    }
    let unknown: Vec<&FitParameter> = found.unknown.iter().map(|k| &parameters[*k]).collect();
    let names: Vec<String> = unknown.iter().map(|p| p.expression.clone()).collect();
    if let Some(InstrumentStatistics { strength, .. }) = &found.instruments
        && *strength < WEAK_INSTRUMENT_CORRELATION
    {
        notes.push(RecordingNote::warning(format!(
            "The instruments are weak: their smallest correlation with the regressor is {}. Check that they have the same \
             motion as the recording and are synchronous with it.",
            number(*strength)
        )));
    }
    // Reweighting may alternate between two solutions.
    if found.weighting.as_ref().is_some_and(|weighting| !weighting.converged) {
        notes.push(RecordingNote::warning(message!(
            "The weights have not converged: residuals depend on the weights from one solution to the next; leave out \
             {} or {}.",
            Remedy::option(OptionName::Weights),
            Remedy::option(OptionName::Robust)
        )));
    }
    // Each undetermined direction gets one note, with the values that were chosen in it.
    for direction in &solution.undetermined {
        // The values along the direction are chosen nearest to the nominal ones.
        let kept: Vec<String> = direction
            .changes
            .iter()
            .map(|(i, _)| undetermined_text(unknown[*i]))
            .collect();
        let how = if kept.len() == 1 {
            "it stays at"
        } else {
            "of all values that fit equally well, those nearest to the nominal ones are used:"
        };
        notes.push(RecordingNote::warning(format!(
            "{}; {how} {}.",
            direction.describe(&names),
            kept.join(", ")
        )));
    }
    // Without degrees of freedom the residual is zero; with few, its estimate is poor.
    if solution.rows <= solution.rank {
        notes.push(RecordingNote::warning(format!(
            "There {} for as many unknown base parameters: the residuals have no degree of freedom, so standard \
             deviations and the error of the fit are meaningless; use a longer recording.",
            match solution.rows {
                1 => "is 1 equation".to_owned(),
                n => format!("are {n} equations"),
            }
        )));
    } else if found.uncertainty.few_samples {
        notes.push(RecordingNote::warning(format!(
            "There are only {} equations for {}: standard deviations assume independent residuals and are too small \
             if they are not, and the error of the fit is not reliable; use a longer recording (at least {FEWEST_ROWS} \
             equations for each parameter).",
            solution.rows,
            count(
                solution.values.len(),
                "unknown base parameter",
                "unknown base parameters"
            ),
        )));
    }
    // A sign counts as wrong only if it is two standard deviations beyond zero.
    for (k, p) in parameters.iter().enumerate() {
        // Undetermined parameters keep their nominal sign and are not tested.
        let slack = IMPOSSIBLE_SIGN_SIGMAS * p.std.unwrap_or(0.0);
        let (wrong, expected) = match model.sign_of_base_parameter(k) {
            Sign::Positive => (p.value < -slack, "positive"),
            Sign::Negative => (p.value > slack, "negative"),
            Sign::Any => continue,
        };
        if wrong && p.status == ParameterStatus::Identified {
            notes.push(RecordingNote::warning(format!(
                "{} = {} is estimated as {} {}, but must be {expected} to be physically possible: the model lacks an effect, or \
                 the recording excites it too little.",
                p.name,
                p.expression,
                number(p.value),
                p.unit
            )));
        }
    }
    notes
}

/// The value of an undetermined parameter, compared with its nominal one.
fn undetermined_text(p: &FitParameter) -> String {
    let value = number(p.value);
    match p.nominal {
        Some(nominal) if number(nominal) == value => {
            format!("{} = {value} {} (its nominal value)", p.name, p.unit)
        }
        Some(nominal) => format!("{} = {value} {} (nominal {})", p.name, p.unit, number(nominal)),
        None => format!(
            "{} = {value} {} (the file gives no nominal value; 0 is used)",
            p.name, p.unit
        ),
    }
}

/// Error figures with identified and with nominal values, over all samples and over the rows of the fit.
fn both_figures(
    model: &Model,
    data: &[RecordingSegment],
    values: &[f64],
    band_hz: Option<f64>,
) -> Outcome<(ErrorFigures, ErrorFigures)> {
    let figures_of = |values: &[f64]| {
        let forces = data
            .iter()
            .map(|one| along::forces(model, one, values))
            .collect::<Outcome<Vec<_>>>()?;
        let mut figures = compare::figures(model, data, &forces, band_hz)?;
        figures.rows = compare::figures_of_rows(model, data, &forces)?;
        Ok::<_, Error>(figures)
    };
    Ok((figures_of(values)?, figures_of(&model.values)?))
}

impl Identification {
    /// The values of all base parameters, in the order of the model and in their units.
    pub fn values(&self) -> Vec<f64> {
        self.fit.parameters.iter().map(|p| p.value).collect()
    }
}
