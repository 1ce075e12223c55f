//! Output of models with actuators: what can be known from their signals, and estimates from servo logs.

use serde_json::{Value, json};

use crate::print::{RemedyWording, notes};
use crate::servo::{ServoDelay, ServoEstimator, ServoIdentification, ServoModel, ServoRowError, ServoStatus};
use crate::text::TerminalStyle;
use crate::text::table::{ColumnAlignment, count, number, percent, significant, table};

impl ServoModel {
    /// Actuators, base parameters with gains, and what only ratios can be known of, as one JSON object.
    pub fn json(&self) -> Value {
        let base = &self.equations.base;
        let actuators = self.actuators().iter().map(|actuator| {
            json!({
                "drive": self.drive_name(actuator),
                "kind": actuator.kind.name(),
                "signal": actuator.signal,
                "force": actuator.kind.formula(),
                "delay": actuator.delay,
            })
        });
        let ratios = self.scale.freedoms.iter().map(|freedom| {
            json!({
                "parameters": freedom.base.iter().map(|k| &base[*k].expression).collect::<Vec<_>>(),
                "relative_to": base[freedom.reference].expression,
                "open": freedom.open,
                "fixed_by": freedom.fixed_by,
            })
        });
        let parameters = base.iter().enumerate().map(|(k, one)| {
            json!({
                "name": one.name,
                "expression": one.expression,
                "unit": one.unit,
                "known": self.equations.is_known(k),
                "only_ratio": self.scale.is_open(k),
            })
        });
        json!({
            "actuators": actuators.collect::<Vec<_>>(),
            "base": parameters.collect::<Vec<_>>(),
            "only_ratios": ratios.collect::<Vec<_>>(),
        })
    }

    /// The same as text: actuators, base parameters, and what fixes the scale.
    pub fn text(&self, style: TerminalStyle) -> String {
        let model = &self.equations;
        let mut lines = vec![style.bold("Actuators, in place of measured forces")];
        // A kind with several signals has one entry for each.
        for same in self.actuators().chunk_by(|a, b| (a.drive, a.kind) == (b.drive, b.kind)) {
            let signals: Vec<&str> = same.iter().map(|actuator| actuator.signal.as_str()).collect();
            lines.push(format!(
                "  {}: {} by the column{} {}; force = {}",
                self.drive_name(&same[0]),
                same[0].kind.name(),
                if signals.len() > 1 { "s" } else { "" },
                signals.join(" and "),
                same[0].kind.formula()
            ));
        }
        lines.push("  Base parameters that commands or currents can determine:".to_owned());
        for (k, base) in model.base.iter().enumerate() {
            let remark = if model.is_known(k) {
                " (known)"
            } else if self.scale.is_open(k) {
                " (only as a ratio)"
            } else {
                ""
            };
            lines.push(format!("    {} = {}{remark}", base.name, base.expression));
        }
        lines.extend(self.scale_lines().into_iter().map(|line| format!("  {line}")));
        lines.join("\n")
    }

    /// What fixes the scale of the equations, one sentence for each group of parameters.
    fn scale_lines(&self) -> Vec<String> {
        if self.scale.freedoms.is_empty() {
            return vec!["Numbers of the model file fix the scale: all values can be known.".to_owned()];
        }
        let base = &self.equations.base;
        let group = |freedom: &crate::servo::ScaleFreedom| {
            let names: Vec<&str> = freedom.base.iter().map(|k| base[*k].expression.as_str()).collect();
            let fix = match (freedom.open, freedom.fixed_by.as_slice()) {
                (1, []) => "give a gain as a number, or record a force".to_owned(),
                (1, [one]) => format!("a number for {one} in the model file fixes the scale"),
                (1, all) => format!(
                    "a number for one of {} in the model file fixes the scale",
                    all.join(", ")
                ),
                (n, all) => format!("{n} numbers in the model file are needed, of {}", all.join(", ")),
            };
            format!("Only ratios of {} can be known: {fix}.", names.join(", "))
        };
        self.scale.freedoms.iter().map(group).collect()
    }
}

impl ServoIdentification {
    /// The result as one JSON object, with the keys of an identification from forces where they have the same meaning.
    pub fn json(&self, wording: &dyn RemedyWording) -> Value {
        let parameters = self.parameters.iter().map(|p| {
            json!({
                "name": p.name,
                "expression": p.expression,
                "value": p.value,
                "std": p.std,
                "unit": p.unit,
                "status": status(p.status),
                "relative_to": p.relative_to,
            })
        });
        let delays = self.delays.iter().map(|delay| {
            json!({
                "drive": delay.drive,
                "value": delay.value,
                "std": delay.std,
                "interval": delay.interval,
                "known": delay.interval.is_none(),
                "determined": !delay.is_open,
            })
        });
        let check = (!self.check.is_empty()).then(|| errors(&self.check));
        json!({
            "model": self.model,
            "samples": self.samples,
            "source": "signals",
            "scaled_condition_number": self.scaled_condition_number,
            "parameters": parameters.collect::<Vec<_>>(),
            "delays": delays.collect::<Vec<_>>(),
            "estimator": match &self.estimator {
                ServoEstimator::Instruments { strength } => json!({ "kind": "instruments", "strength": strength }),
                ServoEstimator::LeastSquares { reason } => json!({ "kind": "least_squares", "reason": reason }),
            },
            "fit": errors(&self.fit),
            "check": check,
            "only_ratios": self.scale.freedoms.iter().map(|freedom| json!({
                "parameters": freedom.base.iter().map(|k| &self.parameters[*k].expression).collect::<Vec<_>>(),
                "relative_to": self.parameters[freedom.reference].expression,
                "open": freedom.open,
                "fixed_by": freedom.fixed_by,
            })).collect::<Vec<_>>(),
            "model_fit": self.model_fit,
            "data": notes(&self.notes, wording),
        })
    }

    /// The result as text.
    pub fn text(&self, style: TerminalStyle) -> String {
        let mut lines = vec![style.bold(&format!(
            "{}: {} from {} of signals, without forces",
            self.model,
            count(self.parameters.len(), "base parameter", "base parameters"),
            count(self.samples, "sample", "samples")
        ))];
        lines.extend(
            self.parameters
                .iter()
                .map(|p| format!("  {} = {}", p.name, p.expression)),
        );
        lines.push(String::new());
        lines.extend(self.parameter_table());
        lines.push(
            "  The standard deviations (std) contain noise and the uncertainty of delays, not errors of the model."
                .to_owned(),
        );
        lines.push(String::new());
        let mut delays: Vec<String> = self
            .delays
            .iter()
            .map(|delay| format!("  {}", delay_line(delay)))
            .collect();
        // Signals of one actuator have the same known delay.
        delays.dedup();
        lines.extend(delays);
        lines.push(format!(
            "  {}",
            match &self.estimator {
                ServoEstimator::Instruments { strength } => format!(
                    "estimated by instrumental variables from the commands, smallest correlation {}",
                    significant(*strength, 3)
                ),
                ServoEstimator::LeastSquares { .. } => "estimated by least squares".to_owned(),
            }
        ));
        if let Some(condition) = self.scaled_condition_number {
            lines.push(format!(
                "  condition number {} after scaling the columns to equal norm; below 100 is good",
                significant(condition, 3)
            ));
        }
        lines.push(String::new());
        lines.push(style.bold("Error of the balance of forces"));
        lines.extend(self.error_table());
        lines.join("\n")
    }

    /// Values with standard deviations.
    fn parameter_table(&self) -> Vec<String> {
        let rows: Vec<Vec<String>> = self
            .parameters
            .iter()
            .map(|p| {
                vec![
                    p.name.clone(),
                    number(p.value),
                    p.std.map_or_else(String::new, |std| significant(std, 2)),
                    p.std
                        .filter(|_| p.value != 0.0)
                        .map_or_else(String::new, |std| percent(Some((std / p.value).abs()))),
                    match (p.status, &p.relative_to) {
                        (ServoStatus::Ratio, Some(reference)) => format!("times {reference}"),
                        (ServoStatus::Identified, _) => String::new(),
                        (other, _) => status(other).to_owned(),
                    },
                    p.unit.clone(),
                ]
            })
            .collect();
        table(
            2,
            &[
                ("parameter", ColumnAlignment::Left),
                ("value", ColumnAlignment::Right),
                ("std", ColumnAlignment::Right),
                ("relative std", ColumnAlignment::Right),
                ("meaning", ColumnAlignment::Left),
                ("unit", ColumnAlignment::Left),
            ],
            &rows,
        )
    }

    /// Errors by drive.
    fn error_table(&self) -> Vec<String> {
        let named = [("fit", &self.fit), ("validation", &self.check)];
        let rows: Vec<Vec<String>> = named
            .iter()
            .flat_map(|(name, all)| {
                all.iter().map(|row| {
                    vec![
                        (*name).to_owned(),
                        row.drive.clone(),
                        number(row.error),
                        number(row.force),
                        row.unit.clone(),
                        percent(relative(row)),
                    ]
                })
            })
            .collect();
        table(
            2,
            &[
                ("", ColumnAlignment::Left),
                ("drive", ColumnAlignment::Left),
                ("rms error", ColumnAlignment::Right),
                ("rms force", ColumnAlignment::Right),
                ("unit", ColumnAlignment::Left),
                ("error", ColumnAlignment::Right),
            ],
            &rows,
        )
    }
}

/// The error of a drive relative to its force.
fn relative(row: &ServoRowError) -> Option<f64> {
    (row.force > 0.0).then(|| row.error / row.force)
}

/// Errors of all drives as JSON; `nrms` is relative to the force, over all drives.
fn errors(rows: &[ServoRowError]) -> Value {
    let sum = |of: &dyn Fn(&ServoRowError) -> f64| rows.iter().map(|row| of(row).powi(2)).sum::<f64>().sqrt();
    let force = sum(&|row| row.force);
    let channels = rows.iter().map(|row| {
        let value = json!({ "nrms": relative(row), "rms": row.error, "rms_force": row.force, "unit": row.unit });
        (row.drive.clone(), value)
    });
    json!({
        "nrms": (force > 0.0).then(|| sum(&|row| row.error) / force),
        "channels": channels.collect::<serde_json::Map<String, Value>>(),
    })
}

/// The word for the meaning of a value.
fn status(status: ServoStatus) -> &'static str {
    match status {
        ServoStatus::Identified => "identified",
        ServoStatus::Ratio => "ratio",
        ServoStatus::Reference => "reference",
        ServoStatus::Known => "known",
        ServoStatus::Undetermined => "not determined",
    }
}

/// The delay of an actuator as a phrase.
fn delay_line(delay: &ServoDelay) -> String {
    let ms = |seconds: f64| significant(1e3 * seconds, 3);
    match delay.interval {
        None => format!("delay of {}: {} ms (known)", delay.drive, ms(delay.value)),
        Some([low, high]) => format!(
            "delay of {}: {} ms, 95 % interval {} to {} ms",
            delay.drive,
            ms(delay.value),
            ms(low),
            ms(high)
        ),
    }
}
