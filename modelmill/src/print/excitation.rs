//! An exciting trajectory, as JSON for scripts and as text for people: condition number, limits, coefficients.

use modelmill_identify::excite::ExcitationCriterion;
use serde_json::{Map, Value, json};

use crate::excite::HarmonicsResult;
use crate::excite::plant::used_fraction;
use crate::excite::{ExcitationResult, SeparationResult};
use crate::print::RemedyWording;
use crate::text::TerminalStyle;
use crate::text::table::{ColumnAlignment, count, number, significant, table};

impl ExcitationResult {
    /// Number of limits that the trajectory exceeds.
    fn violations(&self) -> usize {
        let margins = self.found.margins.iter();
        margins.filter(|margin| margin.excess > 0.0).count()
    }

    /// The trajectory and its quality as one JSON object.
    ///
    /// - `condition_number` of the regressor, `start` for the best random trajectory, `scaled_condition_number`
    ///   with columns of equal norm
    /// - `value` and `ends`: the criterion at the result, and at the end of each local search
    /// - `limits`: the fraction of each limit that is used (1 at the limit), and whether a bound proves
    ///   this for all times (otherwise it was checked at fine samples)
    /// - `period_range`: bounds of the period in s if it was a variable of the search, otherwise null
    /// - `compared_harmonics`: the result for each number of harmonics
    /// - `coefficients`: offset and Fourier coefficients of each coordinate (m or rad); `period` is in s
    pub fn json(&self) -> Value {
        let found = &self.found;
        let names = &self.coordinates;
        // The trajectory is `offset + sum of mu and nu terms` of each coordinate.
        let coefficients = names.iter().zip(&found.series).map(|(name, series)| {
            let one = json!({ "offset": series.offset, "mu": series.mu, "nu": series.nu });
            (name.clone(), one)
        });
        // A limit that is zero has no share that is used; JSON has null there.
        let limits = found.margins.iter().map(|margin| {
            json!({
                "name": margin.name,
                "excess": margin.excess,
                "used": Some(used_fraction(margin)).filter(|used| used.is_finite()),
                "proven": margin.proven,
            })
        });
        let criterion = |value: f64| self.criterion_value(value);
        json!({
            "model": self.model,
            "condition_number": found.condition_number,
            "start": found.start_condition_number,
            "random": found.feasible_starts,
            "scaled_condition_number": self.scaled,
            "criterion": match self.options.criterion {
                ExcitationCriterion::Condition => "condition",
                ExcitationCriterion::LogDet => "log_det",
                ExcitationCriterion::Separation => "separation",
            },
            "separation": self.separated.as_ref().map(SeparationResult::json),
            "value": criterion(found.value),
            "ends": found.end_values.iter().map(|end| criterion(*end)).collect::<Vec<_>>(),
            "evaluations": found.evaluations,
            "violations": self.violations(),
            "limits": limits.collect::<Vec<_>>(),
            "period": self.options.period,
            "period_range": self.period_range,
            "compared_harmonics": self.compared.iter().map(|one| json!({
                "harmonics": one.harmonics,
                "period": one.period,
                "value": criterion(one.value),
                "condition_number": one.condition_number,
            })).collect::<Vec<_>>(),
            "harmonics": self.options.harmonics,
            "seed": self.options.seed,
            "coefficients": Value::Object(coefficients.collect::<Map<_, _>>()),
        })
    }

    /// The trajectory as text: quality first, then the use of its limits.
    pub fn text(&self, style: TerminalStyle, wording: &dyn RemedyWording) -> String {
        let found = &self.found;
        // The head has what was asked for.
        let mut lines = vec![style.bold(&format!(
            "{}: {} of {}",
            self.model,
            count(self.options.harmonics, "harmonic", "harmonics"),
            self.period_text()
        ))];
        // The goal of the search decides which figures are printed.
        if let Some(separated) = &self.separated {
            lines.extend(separated.text(found.evaluations, found.feasible_starts, wording));
        } else {
            lines.extend(self.conditions());
        }
        lines.extend(self.harmonics());
        lines.push(String::new());
        lines.extend(self.limits());
        lines.join("\n")
    }

    /// The period; with its bounds if it was a variable of the search.
    fn period_text(&self) -> String {
        match self.period_range {
            None => format!("{} s", self.options.period),
            Some([low, high]) => format!(
                "{} s (the best period between {low} and {high} s)",
                significant(self.options.period, 4)
            ),
        }
    }

    /// The criterion as people read it: the search takes the logarithm of the condition number and of the separation.
    fn criterion_value(&self, value: f64) -> f64 {
        match self.options.criterion {
            ExcitationCriterion::Condition => value.exp(),
            ExcitationCriterion::LogDet => value,
            ExcitationCriterion::Separation => (-value).exp(),
        }
    }

    /// The result for each number of harmonics, if several were compared, with the criterion that decides.
    fn harmonics(&self) -> Vec<String> {
        if self.compared.len() < 2 {
            return Vec::new();
        }
        // The condition number stands in the table in any case.
        let criterion = match self.options.criterion {
            ExcitationCriterion::Condition => None,
            ExcitationCriterion::LogDet => Some("log det"),
            ExcitationCriterion::Separation => Some("separation"),
        };
        let row = |one: &HarmonicsResult| {
            let is_written = one.harmonics == self.options.harmonics;
            let mut row = vec![one.harmonics.to_string(), significant(one.period, 4)];
            row.extend(criterion.map(|_| significant(self.criterion_value(one.value), 4)));
            row.push(number(one.condition_number));
            row.push(if is_written { "written" } else { "" }.to_owned());
            row
        };
        let rows: Vec<Vec<String>> = self.compared.iter().map(row).collect();
        let mut columns = vec![
            ("harmonics", ColumnAlignment::Right),
            ("period, s", ColumnAlignment::Right),
        ];
        columns.extend(criterion.map(|name| (name, ColumnAlignment::Right)));
        columns.push(("condition number", ColumnAlignment::Right));
        columns.push(("", ColumnAlignment::Left));
        let mut lines = vec![String::new()];
        lines.extend(table(2, &columns, &rows));
        lines
    }

    /// How well the trajectory determines the base parameters.
    fn conditions(&self) -> Vec<String> {
        let found = &self.found;
        // The best random trajectory shows what the search gained.
        let mut lines = vec![format!(
            "  condition number {}; {} for the best of {} ({} times better)",
            number(found.condition_number),
            number(found.start_condition_number),
            count(
                found.feasible_starts,
                "random trajectory within the limits",
                "random trajectories within the limits"
            ),
            significant(found.start_condition_number / found.condition_number, 3),
        )];
        // Scaled columns make the number independent of units.
        if let Some(scaled) = self.scaled {
            lines.push(format!(
                "  {} after scaling the columns to equal norm; {} evaluated",
                number(scaled),
                count(found.evaluations, "trajectory", "trajectories")
            ));
        }
        lines
    }

    /// How close the trajectory comes to its limits.
    fn limits(&self) -> Vec<String> {
        let found = &self.found;
        // A limit is kept at all times if a bound proves it, otherwise at the samples of a fine grid.
        let rows: Vec<Vec<String>> = found
            .margins
            .iter()
            .map(|margin| {
                vec![
                    margin.name.clone(),
                    format!("{} %", significant(100.0 * used_fraction(margin), 4)),
                    if margin.excess > 0.0 {
                        "exceeded".to_owned()
                    } else {
                        String::new()
                    },
                    if margin.proven {
                        "at all times".to_owned()
                    } else {
                        "by fine sampling".to_owned()
                    },
                ]
            })
            .collect();
        table(
            2,
            &[
                ("limit", ColumnAlignment::Left),
                ("used", ColumnAlignment::Right),
                ("", ColumnAlignment::Left),
                ("checked", ColumnAlignment::Left),
            ],
            &rows,
        )
    }
}
