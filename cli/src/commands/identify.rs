//! `identify`: base parameters from recordings by least squares.

use std::path::{Path, PathBuf};

use modelmill_identify::estimate::FEWEST_ROWS;
use modelmill_identify::{
    Figures, FitFile, FitParameter, Note, ParameterInfo, Repeats, Severity, Status, fit_parameters,
};
use modelmill_spec::Sign;
use serde_json::json;

use crate::along;
use crate::args::IdentifyArgs;
use crate::data::{self, Data};
use crate::estimation;
use crate::estimators::EstimatorArgs;
use crate::failure::{Failure, Outcome};
use crate::instruments;
use crate::model::{self, Model};
use crate::output::Target;
use crate::regression::{self, Identified, More};
use crate::show;
use crate::standstill;
use crate::suspects;
use crate::table::{count, number};
use crate::terminal;

/// Instruments whose smallest canonical correlation with the regressor is below this deserve a warning.
const WEAK_INSTRUMENTS: f64 = 0.2;

/// A fit with the figures that the nominal parameters have on the same recordings.
pub(crate) struct Result {
    /// The fit, as `--parameters` reads it.
    pub(crate) fit: FitFile,
    /// Figures with nominal parameters on the recordings of the fit.
    pub(crate) nominal_fit: Figures,
    /// The same on the recordings of the check.
    pub(crate) nominal_check: Option<Figures>,
    /// How the parameters were estimated, and what that says.
    estimator: serde_json::Value,
    /// The same for people.
    estimator_text: Vec<String>,
    /// What the user should know about the result; the fit holds it too.
    pub(crate) notes: Vec<Note>,
    /// Periods and noise floors of periodic recordings, by their names.
    pub(crate) repeats: Vec<(String, Repeats)>,
}

/// Identifies, prints and perhaps writes the fit.
pub(crate) fn run(args: &IdentifyArgs) -> Outcome {
    let model = model::derive(&args.model)?;
    let files = args.estimators.instruments.iter().map(PathBuf::from);
    let instruments: Vec<PathBuf> = files.filter(|file| file.exists()).collect();
    let inputs = model
        .files
        .iter()
        .chain(&args.data)
        .chain(&args.check)
        .chain(&instruments);
    let target = args
        .out
        .as_ref()
        .map(|path| Target::new(path, inputs.map(AsRef::<Path>::as_ref)))
        .transpose()?;
    let mut data = data::read_all(&model, &args.data, &args.preparation)?;
    let mut check = data::read_all(&model, &args.check, &args.preparation)?;
    data::note_twins(&mut data, &mut check);
    suspects::examine(&model, &mut data);
    suspects::examine(&model, &mut check);
    standstill::leave_out(&model, &mut data, &args.standstill)?;
    let instruments = instruments::read(&model, &data, &args.estimators, &args.preparation)?;
    let result = identify(&model, &data, &instruments, &check, &args.estimators)?;
    for note in &result.notes {
        match note.severity {
            Severity::Warning => terminal::warn(&note.says),
            Severity::Info => terminal::note(&note.says),
        }
    }
    let object = result.json()?;
    if let Some(target) = &target {
        target.write(&format!("{object:#}\n"))?;
    }
    if args.json {
        return terminal::print_json(&object);
    }
    terminal::print(&result.text(&model))?;
    if let Some(target) = &target {
        terminal::note(&format!(
            "the fit is in {0}; use it with --parameters {0}",
            target.path().display()
        ));
    }
    Ok(())
}

/// Identifies a model from some recordings and holds it against others.
pub(crate) fn identify(
    model: &Model,
    data: &[Data],
    instruments: &[Data],
    check: &[Data],
    args: &EstimatorArgs,
) -> Outcome<Result> {
    let found = regression::identify(model, data, instruments, args)?;
    let solution = &found.solution;
    let infos = model.infos();
    let unknown: Vec<ParameterInfo> = found.unknown.iter().map(|k| infos[*k].clone()).collect();
    let mut parameters = fit_parameters(&unknown, solution, &found.deviations);
    if let More::Essential(dropped, _) = &found.more {
        for one in dropped {
            parameters[one.parameter].status = Status::NotEssential;
        }
    }
    for (k, info) in infos.iter().enumerate() {
        if model.is_known(k) {
            parameters.insert(k, known(info, model.nominal[k]));
        }
    }
    let notes = remarks(model, &found, &parameters);
    let values: Vec<f64> = parameters.iter().map(|p| p.value).collect();
    let names: Vec<String> = unknown.into_iter().map(|info| info.expression).collect();
    let (fit, nominal_fit) = both_figures(model, data, &values)?;
    let recordings = data.iter().chain(check);
    let repeats = recordings
        .clone()
        .filter_map(|one| Some((one.run.file.clone(), one.run.repeats.clone()?)))
        .collect();
    let (check, nominal_check) = if check.is_empty() {
        (None, None)
    } else {
        let (identified, nominal) = both_figures(model, check, &values)?;
        (Some(identified), Some(nominal))
    };
    let finite = |value: f64| value.is_finite().then_some(value);
    let mut all_notes: Vec<Note> = recordings.flat_map(Data::notes).cloned().collect();
    all_notes.extend(notes.iter().cloned());
    let constants = &model.derivation.mechanism.constants;
    Ok(Result {
        fit: FitFile {
            model: model.name.clone(),
            samples: fit.samples,
            condition_number: finite(solution.condition_number),
            scaled_condition_number: finite(solution.scaled_condition_number),
            covariance: covariance(&found, parameters.len()),
            parameters,
            constants: constants
                .iter()
                .map(|c| (c.name.clone(), c.value))
                .collect(),
            undetermined: solution.says_undetermined(&names),
            fit,
            check,
            data: all_notes,
        },
        nominal_fit,
        nominal_check,
        estimator: estimation::json(model, &found, args),
        estimator_text: estimation::text(model, &found, &infos),
        notes,
        repeats,
    })
}

/// The covariance of all base parameters, of which the known ones have none.
fn covariance(found: &Identified, n: usize) -> Option<Vec<Vec<f64>>> {
    let mut rows = vec![vec![0.0; n]; n];
    for (a, i) in found.unknown.iter().enumerate() {
        for (b, j) in found.unknown.iter().enumerate() {
            rows[*i][*j] = found.deviations.covariance[(a, b)];
        }
    }
    let is_known = found.deviations.std.iter().all(|s| s.is_finite())
        && rows.iter().flatten().all(|c| c.is_finite());
    is_known.then_some(rows)
}

/// A parameter that is a number of the model file.
fn known(info: &ParameterInfo, value: f64) -> FitParameter {
    FitParameter {
        name: info.name.clone(),
        expression: info.expression.clone(),
        value,
        std: None,
        classical_std: None,
        effective_samples: None,
        unit: info.unit.clone(),
        nominal: info.nominal,
        status: Status::Known,
    }
}

/// What is not as one would wish: known parameters, undetermined ones, no deviations, impossible values.
fn remarks(model: &Model, found: &Identified, parameters: &[FitParameter]) -> Vec<Note> {
    let solution = &found.solution;
    let mut notes = Vec::new();
    for p in parameters.iter().filter(|p| p.status == Status::Known) {
        notes.push(Note::info(format!(
            "{} = {} holds numbers of the model file only: it is known, its force is taken off the measured one, and it is \
             not identified.",
            p.name, p.expression
        )));
    }
    let unknown: Vec<&FitParameter> = found.unknown.iter().map(|k| &parameters[*k]).collect();
    let names: Vec<String> = unknown.iter().map(|p| p.expression.clone()).collect();
    if let More::Instruments(strength, _) = &found.more
        && *strength < WEAK_INSTRUMENTS
    {
        notes.push(Note::warning(format!(
            "The instruments say little: their smallest correlation with the regressor is {}. Are they of the same motion, \
             and in step with the recording?",
            number(*strength)
        )));
    }
    if found
        .weighting
        .as_ref()
        .is_some_and(|weighting| !weighting.settled)
    {
        notes.push(Note::warning(
            "The weights have not settled: residuals depend on the weights from one solution to the next; leave out --weights \
             or --robust.",
        ));
    }
    for direction in &solution.undetermined {
        let kept: Vec<String> = direction
            .changes
            .iter()
            .map(|(i, _)| kept(unknown[*i]))
            .collect();
        let how = if kept.len() == 1 {
            "it stays at"
        } else {
            "of all values that fit equally well those nearest to the nominal ones are taken:"
        };
        notes.push(Note::warning(format!(
            "{}; {how} {}.",
            direction.says(&names),
            kept.join(", ")
        )));
    }
    if solution.rows <= solution.rank {
        notes.push(Note::warning(format!(
            "There {} for as many unknown base parameters: no degree of freedom is left for the residuals, so neither \
             standard deviations nor the error of the fit say anything; use a longer recording.",
            match solution.rows {
                1 => "is 1 equation".to_owned(),
                n => format!("are {n} equations"),
            }
        )));
    } else if found.deviations.few_samples {
        notes.push(Note::warning(format!(
            "There are only {} equations for {}: standard deviations take the residuals for independent and are too small \
             if they are not, and the error of the fit says little; use a longer recording (at least {FEWEST_ROWS} \
             equations for each parameter).",
            solution.rows,
            count(
                solution.values.len(),
                "unknown base parameter",
                "unknown base parameters"
            ),
        )));
    }
    for (k, p) in parameters.iter().enumerate() {
        let slack = 2.0 * p.std.unwrap_or(0.0);
        let (wrong, expected) = match model.sign(k) {
            Sign::Positive => (p.value < -slack, "positive"),
            Sign::Negative => (p.value > slack, "negative"),
            Sign::Any => continue,
        };
        if wrong && p.status == Status::Identified {
            notes.push(Note::warning(format!(
                "{} = {} comes out as {} {}, but must be {expected} to make physical sense: the model lacks something, or \
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

/// The value of an undetermined parameter beside its nominal one.
fn kept(p: &FitParameter) -> String {
    let value = number(p.value);
    match p.nominal {
        Some(nominal) if number(nominal) == value => {
            format!("{} = {value} {} (its nominal value)", p.name, p.unit)
        }
        Some(nominal) => format!(
            "{} = {value} {} (nominal {})",
            p.name,
            p.unit,
            number(nominal)
        ),
        None => format!(
            "{} = {value} {} (the file gives no nominal value, 0 stands for it)",
            p.name, p.unit
        ),
    }
}

/// Figures with identified and with nominal values.
fn both_figures(model: &Model, data: &[Data], values: &[f64]) -> Outcome<(Figures, Figures)> {
    let measured = data
        .iter()
        .map(along::measured)
        .collect::<Outcome<Vec<_>>>()?;
    let figures_of = |values: &[f64]| {
        let forces = data
            .iter()
            .map(|one| along::forces(model, one, values))
            .collect::<Outcome<Vec<_>>>()?;
        let pairs = measured
            .iter()
            .map(Vec::as_slice)
            .zip(forces.iter().map(Vec::as_slice));
        along::figures(&model.drives(), pairs)
    };
    Ok((figures_of(values)?, figures_of(&model.nominal)?))
}

impl Result {
    /// The identified values.
    pub(crate) fn values(&self) -> Vec<f64> {
        self.fit.parameters.iter().map(|p| p.value).collect()
    }

    /// What `identify --json` prints and `--parameters` reads.
    pub(crate) fn json(&self) -> Outcome<serde_json::Value> {
        let mut value = serde_json::to_value(&self.fit).map_err(Failure::input)?;
        if let Some(object) = value.as_object_mut() {
            object.insert(
                "nominal".to_owned(),
                json!({ "fit": self.nominal_fit, "check": self.nominal_check }),
            );
            object.insert("estimator".to_owned(), self.estimator.clone());
            if !self.repeats.is_empty() {
                let repeats = self
                    .repeats
                    .iter()
                    .map(|(file, repeats)| (file.clone(), json!(repeats)));
                let repeats: serde_json::Map<String, serde_json::Value> = repeats.collect();
                object.insert("repeats".to_owned(), json!(repeats));
            }
        }
        Ok(value)
    }

    fn text(&self, model: &Model) -> String {
        let style = terminal::style();
        let fit = &self.fit;
        let identified = fit.parameters.iter().filter(|p| p.status != Status::Known);
        let identified = identified.count();
        let mut lines = vec![style.bold(&format!(
            "{}: {} from {}",
            fit.model,
            count(identified, "base parameter", "base parameters"),
            count(fit.samples, "sample", "samples")
        ))];
        lines.extend(show::expressions(2, model));
        lines.push(String::new());
        lines.extend(show::parameters(&fit.parameters));
        lines.push(String::new());
        lines.push(format!(
            "  condition number {}, {} with columns of equal norm",
            fit.condition_number
                .map_or_else(|| "infinite".to_owned(), number),
            fit.scaled_condition_number
                .map_or_else(|| "infinite".to_owned(), number),
        ));
        lines.extend(self.estimator_text.iter().map(|line| format!("  {line}")));
        lines.push(String::new());
        lines.push(style.bold("error"));
        let has_nominal = (0..model.base.len()).any(|k| model.has_nominal(k));
        let mut figures = Vec::new();
        if has_nominal {
            figures.push(("fit, nominal", &self.nominal_fit));
        }
        figures.push(("fit, identified", &fit.fit));
        if let (Some(check), Some(nominal)) = (&fit.check, &self.nominal_check) {
            if has_nominal {
                figures.push(("check, nominal", nominal));
            }
            figures.push(("check, identified", check));
        }
        lines.extend(show::figures(&figures));
        lines.join("\n")
    }
}
