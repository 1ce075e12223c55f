//! `interpret`: physical parameters from identified base parameters, with all other parameters fixed at their nominal
//! values. As in Table 1 of the paper, all real solutions are given.

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};
use modelmill_identify::interpret::{
    InterpretationProblem, PhysicalInterpretation, PhysicalSolution, Polynomial, exact_decimal, interpret,
};
use modelmill_identify::{FitFile, NullDirection, ParameterStatus, RecordingNote};
use modelmill_spec::Sign;

use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::text::table::{count, number};

/// Solved physical parameters.
pub struct InterpretationResult {
    /// The model.
    pub model: Model,
    /// Indices of the unknown parameters among those of the mechanism.
    pub unknown: Vec<usize>,
    /// Indices of the base parameters that contain unknowns.
    pub used: Vec<usize>,
    /// All real solutions, or the directions that are not determined.
    pub found: PhysicalInterpretation,
    /// Notes on the fit and the solutions.
    pub notes: Vec<RecordingNote>,
}

impl Model {
    /// Solves identified base parameters for physical ones, with the others fixed at their nominal values: all real
    /// solutions, as in Table 1 of the paper. `file` is only used in messages,
    /// as the name of the fit.
    ///
    /// Fails when a name is not a parameter of the model, when the fit belongs to another model, or when the
    /// equations are too many for an exact solution.
    pub fn interpret(&self, fit: &FitFile, file: &str, unknown: &[String]) -> Outcome<InterpretationResult> {
        // The equations contain only base parameters in which an unknown occurs.
        let unknown = self::unknown_indices(self, unknown)?;
        let values = self.values_of(fit, file)?;
        let (system, used) = system(self, &unknown, &values.values, fit);
        let found = self
            .host()
            .run_job("solving for the unknown parameters", 0, |_| interpret(&system))?
            .map_err(|error| Error::input(format!("{}: {error}", self.path)))?;
        let mut interpreted = InterpretationResult {
            model: self.clone(),
            unknown,
            used,
            found,
            notes: values.notes,
        };
        let remarks = interpreted.remarks(fit).into_iter().map(RecordingNote::warning);
        interpreted.notes.extend(remarks);
        // The listener receives the notes as soon as they are known.
        for note in &interpreted.notes {
            self.host().note(note);
        }
        Ok(interpreted)
    }
}

/// Indices of the unknown parameters, in the requested order.
///
/// Fails when a name is not a parameter of the model or is given twice.
pub fn unknown_indices(model: &Model, names: &[String]) -> Outcome<Vec<usize>> {
    let parameters = &model.derivation.mechanism.parameters;
    let mut found = Vec::new();
    for name in names.iter().map(|name| name.trim()) {
        // The error lists all names of the model.
        let Some(i) = parameters.iter().position(|p| p.name == name) else {
            let all: Vec<&str> = parameters.iter().map(|p| p.name.as_str()).collect();
            return Err(Error::input(message!(
                "{}: {} declares no such parameter; its parameters are {}",
                Remedy::option(OptionName::Unknown).with_value(name),
                model.path,
                all.join(", ")
            )));
        };
        if found.contains(&i) {
            return Err(Error::options(message!(
                "{} names `{name}` twice; name each parameter once",
                Remedy::option(OptionName::Unknown)
            )));
        }
        found.push(i);
    }
    Ok(found)
}

/// The polynomial equations in the unknowns alone, and the indices of the base parameters that contain an unknown.
/// `values` are the identified base parameters, in the order of the model.
pub fn system(model: &Model, unknown: &[usize], values: &[f64], fit: &FitFile) -> (InterpretationProblem, Vec<usize>) {
    let mechanism = &model.derivation.mechanism;
    // Constants and nominal values enter as exact decimals, so that the solver works in exact
    // arithmetic.
    let constants: Vec<_> = mechanism.constants.iter().map(|c| exact_decimal(c.value)).collect();
    let nominal: Vec<_> = mechanism.parameters.iter().map(|p| exact_decimal(p.nominal)).collect();
    let mut equations = Vec::new();
    for terms in model.derivation.base_polynomials(&constants) {
        let mut equation = Polynomial::new(unknown.len());
        // Fixed parameters are multiplied into the factor; unknown ones remain as powers.
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
    // Base parameters without an unknown add no equation.
    let used: Vec<usize> = (0..equations.len())
        .filter(|k| (0..unknown.len()).any(|i| equations[*k].has_unknown(i)))
        .collect();
    // The covariance is read from the fit, whose order of parameters may differ.
    let at: Vec<usize> = used
        .iter()
        .filter_map(|k| {
            let name = &model.base[*k].name;
            fit.parameters.iter().position(|p| p.name == *name)
        })
        .collect();
    let system = InterpretationProblem {
        equations: used.iter().map(|k| equations[*k].clone()).collect(),
        values: used.iter().map(|k| values[*k]).collect(),
        covariance: fit.covariance_of(&at).map(|(covariance, _)| covariance),
        nominal: unknown.iter().map(|u| mechanism.parameters[*u].nominal).collect(),
    };
    (system, used)
}

impl InterpretationResult {
    /// Names of the unknown parameters.
    pub fn names(&self) -> Vec<String> {
        let parameters = &self.model.derivation.mechanism.parameters;
        let names = self.unknown.iter();
        names.map(|u| parameters[*u].name.clone()).collect()
    }

    /// All real solutions; empty if some direction is not determined.
    pub fn solutions(&self) -> &[PhysicalSolution] {
        match &self.found {
            PhysicalInterpretation::Exact { solutions } | PhysicalInterpretation::LeastSquares { solutions, .. } => {
                solutions
            }
            PhysicalInterpretation::Undetermined { .. } => &[],
        }
    }

    /// Directions in which the unknown parameters may change without a change of the base parameters.
    pub fn directions(&self) -> &[NullDirection] {
        match &self.found {
            PhysicalInterpretation::Undetermined { directions, .. } => directions,
            _ => &[],
        }
    }

    /// The undetermined directions, one phrase each.
    pub(crate) fn undetermined_directions(&self) -> Vec<String> {
        let names = self.names();
        let directions = self.directions().iter();
        directions
            .map(|direction| match direction.changes.as_slice() {
                // A single parameter without effect gets a shorter phrase than a combination.
                [(i, _)] => format!("{} has no effect on the base parameters", names[*i]),
                _ => direction
                    .describe(&names)
                    .replace("changes nothing", "changes no base parameter (near the nominal values)"),
            })
            .collect()
    }

    /// The reason why a value has the wrong sign; `None` if its sign is possible. `i` counts the unknown parameters.
    pub(crate) fn sign_violation(&self, i: usize, value: f64) -> Option<&'static str> {
        match self.model.sign_of_parameter(self.unknown[i]) {
            Sign::Positive if value < 0.0 => Some("must not be negative"),
            Sign::Negative if value > 0.0 => Some("must not be positive"),
            _ => None,
        }
    }

    /// Notes on how far the numbers can be trusted: undetermined base parameters, missing standard deviations,
    /// contradictions.
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
        // A base parameter that the fit did not determine has its nominal value.
        let undetermined: Vec<&str> = used
            .iter()
            .filter(|p| p.status == ParameterStatus::Undetermined)
            .map(|p| p.name.as_str())
            .collect();
        if !undetermined.is_empty() {
            says.push(format!(
                "the recordings of the fit do not determine {}: solutions from them depend on nominal values",
                undetermined.join(", ")
            ));
        }
        // Standard deviations of the solutions need those of the base parameters, and their
        // covariance.
        if !self.solutions().is_empty() {
            if used.iter().any(|p| p.std.is_none()) {
                says.push("the fit gives no standard deviations, so the solutions have none".to_owned());
            } else if fit.covariance.is_none() && used.len() > 1 {
                says.push(
                    "the fit gives no covariance: the base parameters are taken as independent, which may make the \
                     standard deviations too large or too small"
                        .to_owned(),
                );
            }
        }
        // With more equations than unknowns, chi^2 tests whether the fixed nominal values are
        // consistent.
        if let (PhysicalInterpretation::LeastSquares { .. }, Some(best)) = (&self.found, self.solutions().first())
            && let Some(chi_squared) = best.chi_squared
        {
            let freedom = self.used.len() - self.unknown.len();
            if chi_squared > 9.0 * freedom as f64 {
                says.push(format!(
                    "the base parameters contradict the nominal values that are fixed: chi^2 is {} for {}; take more \
                     parameters as unknown",
                    number(chi_squared),
                    count(freedom, "degree of freedom", "degrees of freedom")
                ));
            }
        }
        says
    }
}
