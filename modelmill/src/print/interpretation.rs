//! Physical parameters solved from base parameters, as JSON for scripts and as text for people.

use modelmill_boundary::message;
use modelmill_identify::interpret::{PhysicalInterpretation, PhysicalSolution};
use serde_json::{Map, Value, json};

use crate::interpret::InterpretationResult;
use crate::print::{OptionName, Remedy, RemedyWording};
use crate::text::TerminalStyle;
use crate::text::table::{ColumnAlignment, count, number, significant, table};

impl InterpretationResult {
    /// All solutions as one JSON object; values in SI units.
    ///
    /// - `identifiable`, `method`: whether and how the base parameters determine the unknowns
    /// - `solutions`: values with standard deviations, and whether each is plausible; `fit`: residuals of each solution
    /// - `determined`: unknowns with a unique value; `undetermined`: sentences about the others
    /// - `base_parameters`: those that were used as equations
    pub fn json(&self) -> Value {
        let parameters = &self.model.derivation.mechanism.parameters;
        let names = self.names();
        // A value is plausible if its sign is possible.
        let solution = |one: &PhysicalSolution| -> Value {
            let entries = names.iter().enumerate().map(|(i, name)| {
                let parameter = &parameters[self.unknown[i]];
                let value = json!({
                    "value": one.values[i],
                    "std": one.std.as_ref().map(|std| std[i]),
                    "unit": parameter.unit,
                    "nominal": parameter.nominal,
                    "plausible": self.sign_violation(i, one.values[i]).is_none(),
                });
                (name.clone(), value)
            });
            Value::Object(entries.collect::<Map<_, _>>())
        };
        // Residuals show which base parameters contradict the solution.
        let residuals = |one: &PhysicalSolution| -> Value {
            let entries = self.used.iter().zip(&one.residuals);
            let entries = entries.map(|(k, r)| (self.model.base[*k].name.clone(), json!(r)));
            json!({
                "chi_squared": one.chi_squared,
                "residuals": Value::Object(entries.collect::<Map<_, _>>()),
            })
        };
        // `none` means that the base parameters do not determine the unknowns.
        let method = match &self.found {
            PhysicalInterpretation::Exact { .. } => "exact",
            PhysicalInterpretation::LeastSquares { .. } => "least_squares",
            PhysicalInterpretation::Undetermined { .. } => "none",
        };
        // If not all unknowns are determined, some may still be.
        let determined: Vec<&String> = match &self.found {
            PhysicalInterpretation::Undetermined { determined, .. } => {
                let pairs = names.iter().zip(determined);
                pairs.filter(|(_, d)| **d).map(|(name, _)| name).collect()
            }
            _ => names.iter().collect(),
        };
        json!({
            "model": self.model.name,
            "identifiable": !matches!(self.found, PhysicalInterpretation::Undetermined { .. }),
            "method": method,
            "solutions": self.solutions().iter().map(solution).collect::<Vec<_>>(),
            "fit": self.solutions().iter().map(residuals).collect::<Vec<_>>(),
            "undetermined": self.undetermined_directions(),
            "determined": determined,
            "base_parameters": self.used.iter().map(|k| self.model.base[*k].name.clone()).collect::<Vec<_>>(),
        })
    }

    /// The solutions as text, each as a table, after a headline with the method.
    pub fn text(&self, style: TerminalStyle, wording: &dyn RemedyWording) -> String {
        let solutions = self.solutions();
        let unknowns = count(self.unknown.len(), "unknown parameter", "unknown parameters");
        let equations = count(self.used.len(), "base parameter", "base parameters");
        // The headline states the method, and for exact solutions that there are no others.
        let head = match &self.found {
            PhysicalInterpretation::Undetermined { .. } => {
                format!("{}: {equations} do not determine {unknowns}", self.model.name)
            }
            PhysicalInterpretation::Exact { .. } => format!(
                "{}: {} for {unknowns} from {equations}; there are no others",
                self.model.name,
                count(solutions.len(), "real solution", "real solutions"),
            ),
            PhysicalInterpretation::LeastSquares { is_linear: true, .. } => format!(
                "{}: {unknowns} from {equations} by weighted least squares",
                self.model.name
            ),
            PhysicalInterpretation::LeastSquares { starts, .. } => format!(
                "{}: {} of weighted least squares for {unknowns} from {equations}, searched from {}",
                self.model.name,
                count(solutions.len(), "minimum", "minima"),
                count(*starts, "starting point", "starting points"),
            ),
        };
        let mut lines = vec![style.bold(&head)];
        // Undetermined directions are listed before any solution.
        for says in self.undetermined_directions() {
            lines.push(format!("  {says}."));
        }
        // Each direction needs one more known parameter.
        if !self.directions().is_empty() {
            let how = message!(
                "  Fix one parameter of each line at its nominal value: leave it out of {}.",
                Remedy::option(OptionName::Unknown)
            );
            lines.push(how.format_for(wording));
        }
        // Exact equations may have complex solutions only.
        if let (PhysicalInterpretation::Exact { .. }, []) = (&self.found, solutions) {
            lines.push(
                "  No real values of these parameters give the base parameters. Fix other parameters at their nominal values."
                    .to_owned(),
            );
        }
        // Solutions are numbered if there are several.
        for (k, one) in solutions.iter().enumerate() {
            lines.push(String::new());
            if solutions.len() > 1 {
                lines.push(format!("  solution {}", k + 1));
            }
            lines.extend(self.table(one));
            if matches!(self.found, PhysicalInterpretation::LeastSquares { .. }) {
                lines.extend(self.residuals(one));
            }
        }
        lines.join("\n")
    }

    /// A solution as a table: nominal and solved values, standard deviations, and objections to values that are
    /// not plausible.
    fn table(&self, one: &PhysicalSolution) -> Vec<String> {
        let parameters = &self.model.derivation.mechanism.parameters;
        // The last column is empty unless a value is impossible.
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
                    self.sign_violation(i, one.values[i]).unwrap_or_default().to_owned(),
                ]
            })
            .collect();
        let columns = [
            ("parameter", ColumnAlignment::Left),
            ("nominal", ColumnAlignment::Right),
            ("solved", ColumnAlignment::Right),
            ("std", ColumnAlignment::Right),
            ("unit", ColumnAlignment::Left),
            ("", ColumnAlignment::Left),
        ];
        table(2, &columns, &rows)
    }

    /// Residuals of the base parameters for a solution by least squares, each in the unit of its base parameter.
    fn residuals(&self, one: &PhysicalSolution) -> Vec<String> {
        let rows: Vec<Vec<String>> = self
            .used
            .iter()
            .zip(&one.residuals)
            .map(|(k, residual)| {
                let base = &self.model.base[*k];
                vec![base.name.clone(), significant(*residual, 3), base.unit.clone()]
            })
            .collect();
        let columns = [
            ("base parameter", ColumnAlignment::Left),
            ("residual", ColumnAlignment::Right),
            ("unit", ColumnAlignment::Left),
        ];
        let mut lines = table(2, &columns, &rows);
        // The sum of squares in standard deviations judges the fit as a whole.
        if let Some(chi_squared) = one.chi_squared {
            lines.push(format!("  chi^2 {}", number(chi_squared)));
        }
        lines
    }
}
