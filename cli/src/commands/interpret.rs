//! `interpret`: physical parameters from identified base parameters, the others held at their nominal values.

use modelmill_identify::interpret::{
    Interpretation, Physical, Polynomial, Problem, exact, interpret,
};
use modelmill_identify::{Direction, FitFile, Status};
use modelmill_spec::Sign;
use serde_json::{Map, Value, json};

use crate::args::{InterpretArgs, ParameterSource};
use crate::failure::{Failure, Outcome};
use crate::model::{self, Model};
use crate::progress::watched;
use crate::table::{Align, count, number, significant, table};
use crate::terminal;

/// Solves, and prints the solutions or what is not determined.
pub(crate) fn run(args: &InterpretArgs) -> Outcome {
    let model = model::derive(&args.model)?;
    let unknown = unknown(&model, &args.unknown)?;
    let values = model.values(&ParameterSource::Fit(args.fit.clone()))?;
    let fit = FitFile::read(&args.fit).map_err(Failure::input)?;
    let (problem, used) = problem(&model, &unknown, &values, &fit);
    let found = watched("solving for the unknown parameters", 0, |_| {
        interpret(&problem)
    })
    .map_err(|error| Failure::Input(format!("{}: {error}", model.path)))?;
    let answer = Answer {
        model: &model,
        unknown: &unknown,
        used: &used,
        found: &found,
    };
    for says in answer.remarks(&fit) {
        terminal::warn(&says);
    }
    if args.json {
        terminal::print_json(&answer.json())
    } else {
        terminal::print(&answer.text())
    }
}

/// Indices of the unknown parameters, in the order in which they are asked for.
pub(crate) fn unknown(model: &Model, names: &[String]) -> Outcome<Vec<usize>> {
    let parameters = &model.derivation.mechanism.parameters;
    let mut found = Vec::new();
    for name in names.iter().map(|name| name.trim()) {
        let Some(i) = parameters.iter().position(|p| p.name == name) else {
            let all: Vec<&str> = parameters.iter().map(|p| p.name.as_str()).collect();
            return Err(Failure::Input(format!(
                "--unknown {name}: {} declares no such parameter; its parameters are {}",
                model.path,
                all.join(", ")
            )));
        };
        if found.contains(&i) {
            return Err(Failure::Usage(format!(
                "--unknown names `{name}` twice; name each parameter once"
            )));
        }
        found.push(i);
    }
    Ok(found)
}

/// The equations in the unknowns alone, and which base parameters hold an unknown.
pub(crate) fn problem(
    model: &Model,
    unknown: &[usize],
    values: &[f64],
    fit: &FitFile,
) -> (Problem, Vec<usize>) {
    let mechanism = &model.derivation.mechanism;
    let constants: Vec<_> = mechanism.constants.iter().map(|c| exact(c.value)).collect();
    let nominal: Vec<_> = mechanism
        .parameters
        .iter()
        .map(|p| exact(p.nominal))
        .collect();
    let mut equations = Vec::new();
    for terms in model.derivation.base_polynomials(&constants) {
        let mut equation = Polynomial::new(unknown.len());
        for (product, mut factor) in terms {
            let mut powers = Vec::new();
            for (parameter, exponent) in &product.0 {
                match unknown.iter().position(|u| u == parameter) {
                    Some(i) => powers.push((i, *exponent)),
                    None => {
                        for _ in 0..*exponent {
                            factor *= &nominal[*parameter];
                        }
                    }
                }
            }
            equation.add_term(&powers, &factor);
        }
        equations.push(equation);
    }
    let used: Vec<usize> = (0..equations.len())
        .filter(|k| (0..unknown.len()).any(|i| equations[*k].mentions(i)))
        .collect();
    // Positions in the fit's own order.
    let at: Vec<usize> = used
        .iter()
        .filter_map(|k| {
            let name = &model.base[*k].name;
            fit.parameters.iter().position(|p| p.name == *name)
        })
        .collect();
    let problem = Problem {
        equations: used.iter().map(|k| equations[*k].clone()).collect(),
        values: used.iter().map(|k| values[*k]).collect(),
        covariance: fit.covariance_of(&at).map(|(covariance, _)| covariance),
        nominal: unknown
            .iter()
            .map(|u| mechanism.parameters[*u].nominal)
            .collect(),
    };
    (problem, used)
}

/// What is printed.
struct Answer<'a> {
    model: &'a Model,
    /// Indices of the unknown parameters.
    unknown: &'a [usize],
    /// Base parameters that hold unknowns.
    used: &'a [usize],
    found: &'a Interpretation,
}

impl Answer<'_> {
    fn names(&self) -> Vec<String> {
        let parameters = &self.model.derivation.mechanism.parameters;
        let names = self.unknown.iter();
        names.map(|u| parameters[*u].name.clone()).collect()
    }

    fn solutions(&self) -> &[Physical] {
        match self.found {
            Interpretation::Exact { solutions }
            | Interpretation::LeastSquares { solutions, .. } => solutions,
            Interpretation::Undetermined { .. } => &[],
        }
    }

    fn directions(&self) -> &[Direction] {
        match self.found {
            Interpretation::Undetermined { directions, .. } => directions,
            _ => &[],
        }
    }

    /// What is not determined, in words.
    fn undetermined(&self) -> Vec<String> {
        let names = self.names();
        let directions = self.directions().iter();
        directions
            .map(|direction| match direction.changes.as_slice() {
                [(i, _)] => format!("{} has no effect on the base parameters", names[*i]),
                _ => direction.says(&names).replace(
                    "changes nothing",
                    "changes no base parameter (near the nominal values)",
                ),
            })
            .collect()
    }

    /// Why a value cannot be, if it cannot.
    fn objection(&self, i: usize, value: f64) -> Option<&'static str> {
        match self.model.sign_of(self.unknown[i]) {
            Sign::Positive if value < 0.0 => Some("must not be negative"),
            Sign::Negative if value > 0.0 => Some("must not be positive"),
            _ => None,
        }
    }

    /// What the user should know beside the numbers.
    fn remarks(&self, fit: &FitFile) -> Vec<String> {
        let mut says = Vec::new();
        let used: Vec<_> = self
            .used
            .iter()
            .filter_map(|k| {
                let name = &self.model.base[*k].name;
                fit.parameters.iter().find(|p| p.name == *name)
            })
            .collect();
        let undetermined: Vec<&str> = used
            .iter()
            .filter(|p| p.status == Status::Undetermined)
            .map(|p| p.name.as_str())
            .collect();
        if !undetermined.is_empty() {
            says.push(format!(
                "the recordings of the fit do not determine {}: what is solved from them rests on nominal values",
                undetermined.join(", ")
            ));
        }
        if !self.solutions().is_empty() {
            if used.iter().any(|p| p.std.is_none()) {
                says.push("the fit gives no deviations, so the solutions have none".to_owned());
            } else if fit.covariance.is_none() && used.len() > 1 {
                says.push(
                    "the fit gives no covariance: the base parameters are taken as independent, which may make the \
                     deviations too large or too small"
                        .to_owned(),
                );
            }
        }
        if let (Interpretation::LeastSquares { .. }, Some(best)) =
            (self.found, self.solutions().first())
            && let Some(chi_squared) = best.chi_squared
        {
            let freedom = self.used.len() - self.unknown.len();
            if chi_squared > 9.0 * freedom as f64 {
                says.push(format!(
                    "the base parameters contradict the nominal values that are held: chi^2 is {} for {}; take more \
                     parameters as unknown",
                    number(chi_squared),
                    count(freedom, "degree of freedom", "degrees of freedom")
                ));
            }
        }
        says
    }

    fn json(&self) -> Value {
        let parameters = &self.model.derivation.mechanism.parameters;
        let names = self.names();
        let solution = |one: &Physical| -> Value {
            let entries = names.iter().enumerate().map(|(i, name)| {
                let parameter = &parameters[self.unknown[i]];
                let value = json!({
                    "value": one.values[i],
                    "std": one.std.as_ref().map(|std| std[i]),
                    "unit": parameter.unit,
                    "nominal": parameter.nominal,
                    "plausible": self.objection(i, one.values[i]).is_none(),
                });
                (name.clone(), value)
            });
            Value::Object(entries.collect::<Map<_, _>>())
        };
        let residuals = |one: &Physical| -> Value {
            let entries = self.used.iter().zip(&one.residuals);
            let entries = entries.map(|(k, r)| (self.model.base[*k].name.clone(), json!(r)));
            json!({
                "chi_squared": one.chi_squared,
                "residuals": Value::Object(entries.collect::<Map<_, _>>()),
            })
        };
        let method = match self.found {
            Interpretation::Exact { .. } => "exact",
            Interpretation::LeastSquares { .. } => "least_squares",
            Interpretation::Undetermined { .. } => "none",
        };
        let determined: Vec<&String> = match self.found {
            Interpretation::Undetermined { determined, .. } => {
                let pairs = names.iter().zip(determined);
                pairs.filter(|(_, d)| **d).map(|(name, _)| name).collect()
            }
            _ => names.iter().collect(),
        };
        json!({
            "model": self.model.name,
            "identifiable": !matches!(self.found, Interpretation::Undetermined { .. }),
            "method": method,
            "solutions": self.solutions().iter().map(solution).collect::<Vec<_>>(),
            "fit": self.solutions().iter().map(residuals).collect::<Vec<_>>(),
            "undetermined": self.undetermined(),
            "determined": determined,
            "base_parameters": self.used.iter().map(|k| self.model.base[*k].name.clone()).collect::<Vec<_>>(),
        })
    }

    fn text(&self) -> String {
        let style = terminal::style();
        let solutions = self.solutions();
        let unknowns = count(
            self.unknown.len(),
            "unknown parameter",
            "unknown parameters",
        );
        let equations = count(self.used.len(), "base parameter", "base parameters");
        let head = match self.found {
            Interpretation::Undetermined { .. } => format!(
                "{}: {equations} do not determine {unknowns}",
                self.model.name
            ),
            Interpretation::Exact { .. } => format!(
                "{}: {} for {unknowns} from {equations}, and no others",
                self.model.name,
                count(solutions.len(), "real solution", "real solutions"),
            ),
            Interpretation::LeastSquares {
                is_linear: true, ..
            } => format!(
                "{}: {unknowns} from {equations} by weighted least squares",
                self.model.name
            ),
            Interpretation::LeastSquares { starts, .. } => format!(
                "{}: {} of weighted least squares for {unknowns} from {equations}, looked for from {}",
                self.model.name,
                count(solutions.len(), "minimum", "minima"),
                count(*starts, "start", "starts"),
            ),
        };
        let mut lines = vec![style.bold(&head)];
        for says in self.undetermined() {
            lines.push(format!("  {says}."));
        }
        if !self.directions().is_empty() {
            lines.push(
                "  Hold one parameter of each line at its nominal value, that is, leave it out of --unknown."
                    .to_owned(),
            );
        }
        if let (Interpretation::Exact { .. }, []) = (self.found, solutions) {
            lines.push(
                "  No real values of these parameters give the base parameters; hold others at their nominal values."
                    .to_owned(),
            );
        }
        for (k, one) in solutions.iter().enumerate() {
            lines.push(String::new());
            if solutions.len() > 1 {
                lines.push(format!("  solution {}", k + 1));
            }
            lines.extend(self.table(one));
            if matches!(self.found, Interpretation::LeastSquares { .. }) {
                lines.extend(self.residuals(one));
            }
        }
        lines.join("\n")
    }

    fn table(&self, one: &Physical) -> Vec<String> {
        let parameters = &self.model.derivation.mechanism.parameters;
        let rows: Vec<Vec<String>> = (0..self.unknown.len())
            .map(|i| {
                let parameter = &parameters[self.unknown[i]];
                vec![
                    parameter.name.clone(),
                    number(parameter.nominal),
                    number(one.values[i]),
                    one.std
                        .as_ref()
                        .map_or_else(|| "-".to_owned(), |std| significant(std[i], 2)),
                    parameter.unit.clone(),
                    self.objection(i, one.values[i])
                        .unwrap_or_default()
                        .to_owned(),
                ]
            })
            .collect();
        let columns = [
            ("parameter", Align::Left),
            ("nominal", Align::Right),
            ("solved", Align::Right),
            ("std", Align::Right),
            ("unit", Align::Left),
            ("", Align::Left),
        ];
        table(2, &columns, &rows)
    }

    fn residuals(&self, one: &Physical) -> Vec<String> {
        let rows: Vec<Vec<String>> = self
            .used
            .iter()
            .zip(&one.residuals)
            .map(|(k, residual)| {
                let base = &self.model.base[*k];
                vec![
                    base.name.clone(),
                    significant(*residual, 3),
                    base.unit.clone(),
                ]
            })
            .collect();
        let columns = [
            ("base parameter", Align::Left),
            ("residual", Align::Right),
            ("unit", Align::Left),
        ];
        let mut lines = table(2, &columns, &rows);
        if let Some(chi_squared) = one.chi_squared {
            lines.push(format!("  chi^2 {}", number(chi_squared)));
        }
        lines
    }
}
