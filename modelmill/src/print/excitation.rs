//! An exciting trajectory, as JSON for scripts and as text for people: condition number, limits, coefficients.

use modelmill_identify::excite::Criterion;
use serde_json::{Map, Value, json};

use crate::excite::plant::used;
use crate::excite::{Excited, Separated};
use crate::print::RemedySpelling;
use crate::text::Style;
use crate::text::table::{Align, count, number, significant, table};

impl Excited {
    /// Number of limits that the trajectory exceeds.
    fn violations(&self) -> usize {
        let margins = self.found.margins.iter();
        margins.filter(|margin| margin.excess > 0.0).count()
    }

    /// The trajectory and its quality as one JSON object.
    ///
    /// - `condition_number` of the regressor, `start` for the best random trajectory, `scaled_condition_number` with columns of
    ///   equal norm
    /// - `value` and `ends`: the criterion at the result and at the end of each start
    /// - `limits`: the part of each limit that is used (1), and whether it is proven for all times
    /// - `coefficients`: offset and Fourier coefficients of each coordinate (m or rad); `period` is in s
    pub fn json(&self) -> Value {
        let found = &self.found;
        let names = &self.coordinates;
        let coefficients = names.iter().zip(&found.series).map(|(name, series)| {
            let one = json!({ "offset": series.offset, "mu": series.mu, "nu": series.nu });
            (name.clone(), one)
        });
        // A limit that is zero has no share that is used; JSON has null there.
        let limits = found.margins.iter().map(|margin| {
            json!({
                "name": margin.name,
                "excess": margin.excess,
                "used": Some(used(margin)).filter(|used| used.is_finite()),
                "proven": margin.proven,
            })
        });
        // The search takes the logarithm of the condition number; people do not.
        let criterion = |value: f64| match self.options.criterion {
            Criterion::Condition => value.exp(),
            Criterion::LogDet => value,
            Criterion::Separation => (-value).exp(),
        };
        json!({
            "model": self.model,
            "condition_number": found.condition_number,
            "start": found.start,
            "random": found.random,
            "scaled_condition_number": self.scaled,
            "criterion": match self.options.criterion {
                Criterion::Condition => "condition",
                Criterion::LogDet => "log_det",
                Criterion::Separation => "separation",
            },
            "separation": self.separated.as_ref().map(Separated::json),
            "value": criterion(found.value),
            "ends": found.ends.iter().map(|end| criterion(*end)).collect::<Vec<_>>(),
            "evaluations": found.evaluations,
            "violations": self.violations(),
            "limits": limits.collect::<Vec<_>>(),
            "period": self.options.period,
            "harmonics": self.options.harmonics,
            "seed": self.options.seed,
            "coefficients": Value::Object(coefficients.collect::<Map<_, _>>()),
        })
    }

    /// The same for people.
    pub fn text(&self, style: Style, spelling: &dyn RemedySpelling) -> String {
        let found = &self.found;
        let mut lines = vec![style.bold(&format!(
            "{}: {} of {} s",
            self.model,
            count(self.options.harmonics, "harmonic", "harmonics"),
            self.options.period
        ))];
        if let Some(separated) = &self.separated {
            lines.extend(separated.text(found.evaluations, found.random, spelling));
        } else {
            lines.extend(self.conditions());
        }
        lines.push(String::new());
        lines.extend(self.limits());
        lines.join("\n")
    }

    /// How well the trajectory determines the base parameters.
    fn conditions(&self) -> Vec<String> {
        let found = &self.found;
        let mut lines = vec![format!(
            "  condition number {}; {} for the best of {} ({} times better)",
            number(found.condition_number),
            number(found.start),
            count(
                found.random,
                "random trajectory within the limits",
                "random trajectories within the limits"
            ),
            significant(found.start / found.condition_number, 3),
        )];
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
        let rows: Vec<Vec<String>> = found
            .margins
            .iter()
            .map(|margin| {
                vec![
                    margin.name.clone(),
                    format!("{} %", significant(100.0 * used(margin), 4)),
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
                ("limit", Align::Left),
                ("used", Align::Right),
                ("", Align::Left),
                ("checked", Align::Left),
            ],
            &rows,
        )
    }
}
