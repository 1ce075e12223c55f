//! Position errors of simulated motions, as JSON for scripts and as text for people.

use serde_json::{Map, Value, json};

use crate::forward::{ForwardComparison, HorizonError};
use crate::text::TerminalStyle;
use crate::text::table::{ColumnAlignment, count, significant, table};

impl ForwardComparison {
    /// The errors as one JSON object; angles are in degrees and lengths in mm.
    pub fn json(&self) -> Value {
        let horizon = |one: &HorizonError| {
            let coordinates: Map<String, Value> = (self.coordinates.iter().enumerate())
                .map(|(k, name)| {
                    let value = |all: &Option<Vec<f64>>| all.as_ref().map(|all| all[k] * self.factor(k));
                    let of = json!({"rms": value(&one.rms), "max": value(&one.largest), "unit": self.unit(k)});
                    (name.clone(), of)
                })
                .collect();
            json!({
                "seconds": one.seconds,
                "whole_run": one.is_whole_run,
                "simulations": one.windows,
                "ended_early": one.ended_early,
                "judged": one.is_judged,
                "coordinates": coordinates,
            })
        };
        json!({
            "input": self.input.name(),
            "horizons": self.horizons.iter().map(horizon).collect::<Vec<_>>(),
            "longest_horizon": self.longest_horizon,
        })
    }

    /// The errors as text, with the longest horizon over which they depend on the model.
    pub fn text(&self, style: TerminalStyle) -> String {
        let title = format!(
            "Position error when the model is simulated under the recorded {}",
            self.input.name()
        );
        let mut lines = vec![style.bold(&title)];
        let mut rows = Vec::new();
        for one in &self.horizons {
            let name = if one.is_whole_run {
                format!("whole run, {} s", significant(one.seconds, 3))
            } else {
                format!("{} s", significant(one.seconds, 3))
            };
            for (k, coordinate) in self.coordinates.iter().enumerate() {
                let value = |all: &Option<Vec<f64>>| match all {
                    Some(all) => significant(all[k] * self.factor(k), 3),
                    None => "-".to_owned(),
                };
                let first = |text: String| if k == 0 { text } else { String::new() };
                rows.push(vec![
                    first(name.clone()),
                    first(one.windows.to_string()),
                    coordinate.clone(),
                    value(&one.rms),
                    value(&one.largest),
                    self.unit(k).to_owned(),
                    first(if one.is_judged {
                        String::new()
                    } else {
                        "not judged".to_owned()
                    }),
                ]);
            }
        }
        let columns = [
            ("horizon", ColumnAlignment::Left),
            ("simulations", ColumnAlignment::Right),
            ("coordinate", ColumnAlignment::Left),
            ("rms", ColumnAlignment::Right),
            ("largest", ColumnAlignment::Right),
            ("unit", ColumnAlignment::Left),
            ("", ColumnAlignment::Left),
        ];
        lines.extend(table(2, &columns, &rows));
        lines.push("  Each simulation starts at a recorded state.".to_owned());
        if let Some(longest) = self.longest_horizon {
            lines.push(format!(
                "  A disturbance of the first state grows by a factor of 100 within {} s, whatever the model: longer horizons are not \
                 judged.",
                significant(longest, 2)
            ));
        }
        let early: usize = self.horizons.iter().map(|one| one.ended_early).sum();
        if early > 0 {
            lines.push(format!(
                "  {} ended early, since the motion left the reach of the mechanism; no error includes them.",
                count(early, "simulation", "simulations")
            ));
        }
        lines.join("\n")
    }

    /// Factor from SI units to the printed unit of a coordinate.
    fn factor(&self, k: usize) -> f64 {
        if self.is_angle[k] {
            180.0 / std::f64::consts::PI
        } else {
            1000.0
        }
    }

    /// The printed unit of a coordinate.
    fn unit(&self, k: usize) -> &'static str {
        if self.is_angle[k] { "deg" } else { "mm" }
    }
}
