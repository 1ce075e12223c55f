//! `identify`: base parameters from recordings by least squares.

use std::path::Path;

use modelmill_identify::base_fit::fit_parameters;
use modelmill_identify::{Figures, FitFile, Note};
use serde_json::json;

use crate::along;
use crate::args::IdentifyArgs;
use crate::data::{self, Data};
use crate::failure::{Failure, Outcome};
use crate::model::{self, Model};
use crate::output::Target;
use crate::regression;
use crate::show;
use crate::table::{count, number};
use crate::terminal;

/// A fit with the figures that the nominal parameters have on the same recordings.
pub(crate) struct Result {
    /// The fit, as `--parameters` reads it.
    pub(crate) fit: FitFile,
    /// Figures with nominal parameters on the recordings of the fit.
    pub(crate) nominal_fit: Figures,
    /// The same on the recordings of the check.
    pub(crate) nominal_check: Option<Figures>,
}

/// Identifies, prints and perhaps writes the fit.
pub(crate) fn run(args: &IdentifyArgs) -> Outcome {
    let model = model::derive(&args.model)?;
    let inputs = model.files.iter().chain(&args.data).chain(&args.check);
    let target = args
        .out
        .as_ref()
        .map(|path| Target::new(path, inputs.map(AsRef::<Path>::as_ref)))
        .transpose()?;
    for path in args.check.iter().filter(|path| args.data.contains(path)) {
        terminal::warn(&format!(
            "{} is used for the fit and for the check, which proves nothing",
            path.display()
        ));
    }
    let data = data::read_all(&model, &args.data, &args.preparation)?;
    let check = data::read_all(&model, &args.check, &args.preparation)?;
    let result = identify(&model, &data, &check)?;
    for says in &result.fit.undetermined {
        terminal::warn(&format!("{says}; nominal values are kept for it"));
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
pub(crate) fn identify(model: &Model, data: &[Data], check: &[Data]) -> Outcome<Result> {
    let found = regression::identify(model, data)?;
    let solution = &found.solution;
    let infos = model.infos();
    let names: Vec<String> = infos.iter().map(|info| info.expression.clone()).collect();
    let (fit, nominal_fit) = both_figures(model, data, &solution.values)?;
    let (check, nominal_check) = if check.is_empty() {
        (None, None)
    } else {
        let (identified, nominal) = both_figures(model, check, &solution.values)?;
        (Some(identified), Some(nominal))
    };
    let finite = |value: f64| value.is_finite().then_some(value);
    let notes: Vec<Note> = data.iter().flat_map(Data::notes).cloned().collect();
    Ok(Result {
        fit: FitFile {
            model: model.name.clone(),
            samples: fit.samples,
            condition_number: finite(solution.condition_number),
            scaled_condition_number: finite(solution.scaled_condition_number),
            parameters: fit_parameters(&infos, solution, &found.deviations),
            undetermined: solution.says_undetermined(&names),
            fit,
            check,
            data: notes,
        },
        nominal_fit,
        nominal_check,
    })
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
        }
        Ok(value)
    }

    fn text(&self, model: &Model) -> String {
        let style = terminal::style();
        let fit = &self.fit;
        let mut lines = vec![style.bold(&format!(
            "{}: {} from {} samples",
            fit.model,
            count(fit.parameters.len(), "base parameter", "base parameters"),
            fit.samples
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
