//! What a diagnosis found as JSON and for people.

use modelmill_identify::diagnose::{DiagnosisVerdict, SelectionStep};
use serde_json::{Map, Value, json};

use super::laws;
use crate::diagnose::{DiagnosisFindings, EffectEstimate, words};
use crate::print::{OptionName, Remedy, StepSpelling, notes};
use crate::text::TerminalStyle;
use crate::text::table::{ColumnAlignment, number, percent, significant, table};

/// Candidates that the text names.
const MOST_CANDIDATES: usize = 6;

impl DiagnosisFindings {
    /// All that was found as one JSON object; `spelling` says how its reader asks for what it advises.
    pub fn json(&self, spelling: &dyn StepSpelling) -> Value {
        let diagnosis = &self.diagnosis;
        let channels = self.channels();
        let model = &self.before.model;
        let effects: Vec<Value> = (self.missing.iter())
            .map(|missing| {
                let separation = missing.separation.as_ref();
                json!({
                    "kind": missing.effect.kind,
                    "at": missing.effect.at,
                    "estimates": estimates(&missing.estimates),
                    "probability": missing.probability,
                    "indistinguishable_from": missing.indistinguishable_from,
                    "separating_experiment": missing.separating_experiment,
                    "separate_command": separation.and_then(|asked| spelling.spell_separation(model, asked)),
                })
            })
            .collect();
        let candidates: Vec<Value> = (diagnosis.candidates.iter())
            .map(|c| {
                json!({"kind": c.effect.kind, "at": c.effect.at, "explained": c.explained, "gain": c.gain, "refused": c.rejection_reason})
            })
            .collect();
        let off: Vec<Value> = (self.off_nominal.iter())
            .map(|off| {
                let p = &off.parameter;
                json!({"name": p.name, "expression": p.expression, "nominal": off.nominal, "value": p.value, "sigmas": off.sigmas, "unit": p.unit})
            })
            .collect();
        let budget: Map<String, Value> = (channels.iter().zip(&diagnosis.budgets).enumerate())
            .map(|(d, (channel, budget))| {
                let part = |x: f64| {
                    if budget.force > 0.0 {
                        x / budget.force
                    } else {
                        0.0
                    }
                };
                let value = json!({
                    "noise": part(budget.noise),
                    "not_repeating": part(budget.non_repeatable),
                    "model": part(budget.model),
                    "unit": model.force_unit(d),
                    "rms": budget.force,
                });
                (channel.clone(), value)
            })
            .collect();
        let disturbances: Vec<Value> = (diagnosis.disturbances.iter())
            .map(|one| {
                json!({
                    "kind": one.kind,
                    "at": one.at,
                    "says": one.description,
                    "estimates": one.estimates.iter().map(|q| {
                        json!({"name": q.name, "value": q.value, "std": q.standard_deviation, "unit": q.unit})
                    }).collect::<Vec<_>>(),
                    "recordings": one.recordings,
                    "interval": one.interval,
                })
            })
            .collect();
        let unexplained: Vec<Value> = (diagnosis.unexplained.iter())
            .map(|d| json!({"channel": channels[*d], "reproducible": diagnosis.repeatable_share[*d]}))
            .collect();
        json!({
            "model": model.name,
            "verdict": diagnosis.verdict,
            "noise_floor": diagnosis.noise_floor,
            "budget": budget,
            "disturbances": disturbances,
            "steps": steps(&diagnosis.steps),
            "effects": effects,
            "candidates": candidates,
            "untold": self.undecided.iter().map(|one| {
                json!({"kind": one.effect.kind, "at": one.effect.at, "says": one.reason, "separate_by": one.separating_experiment})
            }).collect::<Vec<_>>(),
            "laws": laws::laws(&self.laws, model, spelling),
            "parameters_off_nominal": off,
            "unexplained": unexplained,
            "data": notes(&self.notes, spelling),
            "where": self.regions,
            "with_nominal_parameters": self.with_nominal.as_ref().map(|held| {
                json!({
                    "verdict": held.diagnosis.verdict,
                    "steps": steps(&held.diagnosis.steps),
                    "effects": held.missing.iter().map(|(effect, found)| {
                        json!({"kind": effect.kind, "at": effect.at, "estimates": estimates(found)})
                    }).collect::<Vec<_>>(),
                })
            }),
        })
    }

    /// The answer for people, line by line.
    pub fn text(&self, style: TerminalStyle, spelling: &dyn StepSpelling) -> Vec<String> {
        let diagnosis = &self.diagnosis;
        let channels = self.channels();
        let verdict = words::verdict(diagnosis, channels, self.validation);
        let mut lines: Vec<String> = (words::lines(&verdict, 100).iter())
            .map(|line| style.bold(line))
            .collect();
        lines.push(String::new());
        lines.push(style.bold("the ladder: relative error, step by step"));
        let rows: Vec<Vec<String>> = (diagnosis.steps.iter())
            .map(|rung| {
                vec![
                    words::rung(rung),
                    percent(Some(rung.fit)),
                    percent(Some(rung.check)),
                ]
            })
            .collect();
        lines.extend(table(
            2,
            &[
                ("step", ColumnAlignment::Left),
                ("fit", ColumnAlignment::Right),
                (self.validation.label(), ColumnAlignment::Right),
            ],
            &rows,
        ));
        lines.push(format!("  {}", words::noise_floor_text(diagnosis)));
        self.missing_text(style, spelling, &mut lines);
        self.disturbances_text(style, &mut lines);
        lines.push(String::new());
        lines.push(
            style.bold(if diagnosis.verdict == DiagnosisVerdict::Unexplained {
                "where what is left sits"
            } else {
                "where the error of the model as it is sits"
            }),
        );
        let places = &self.regions;
        lines.extend(places.iter().map(|region| format!("  {}.", region.says)));
        if places.is_empty() {
            lines.push("  No region of coordinates, rates, loads or time stands out.".to_owned());
        }
        lines.extend(laws::text(&self.laws, &self.before.model, style, spelling));
        self.refused_text(style, &mut lines);
        self.undecided_text(style, &mut lines);
        self.off_nominal_text(style, spelling, &mut lines);
        let mut next: Vec<String> = (self.entries_to_add().iter())
            .map(|entry| spelling.spell_effect(&self.before.model, entry))
            .collect();
        next.extend(self.further_action().map(str::to_owned));
        if !next.is_empty() {
            lines.push(String::new());
            lines.push(style.bold("how to go on"));
            lines.extend(next.iter().map(|line| format!("  {line}")));
        }
        if let Err(says) = &self.after
            && !says.is_empty()
        {
            lines.push(format!(
                "  The model with what was found cannot be made: {}",
                says.spell(spelling)
            ));
        }
        lines
    }

    /// What the recordings have besides, and where the error that is left comes from.
    fn disturbances_text(&self, style: TerminalStyle, lines: &mut Vec<String>) {
        let diagnosis = &self.diagnosis;
        if !diagnosis.disturbances.is_empty() {
            lines.push(String::new());
            lines.push(style.bold("what the recordings have besides, and the model does not lack"));
            for one in &diagnosis.disturbances {
                let says = format!("{}.", one.description.as_deref().unwrap_or_default());
                let told = words::lines(&says, 98);
                lines.extend(told.iter().map(|line| format!("  {line}")));
            }
        }
        lines.push(String::new());
        lines.push(style.bold("what is left of each drive, as a part of its force"));
        let part = |x: f64, force: f64| percent((force > 0.0).then(|| x / force));
        let rows: Vec<Vec<String>> = (self.channels().iter().zip(&diagnosis.budgets))
            .map(|(channel, budget)| {
                let of = |x: f64| part(x, budget.force);
                vec![
                    channel.clone(),
                    of(budget.noise),
                    of(budget.non_repeatable),
                    of(budget.model),
                ]
            })
            .collect();
        lines.extend(table(
            2,
            &[
                ("drive", ColumnAlignment::Left),
                ("noise", ColumnAlignment::Right),
                ("not repeating", ColumnAlignment::Right),
                ("model", ColumnAlignment::Right),
            ],
            &rows,
        ));
    }

    /// What was found, with values and doubles.
    fn missing_text(
        &self,
        style: TerminalStyle,
        spelling: &dyn StepSpelling,
        lines: &mut Vec<String>,
    ) {
        if self.missing.is_empty() {
            return;
        }
        lines.push(String::new());
        lines.push(style.bold("what is missing"));
        for found in &self.missing {
            let values: Vec<String> = (found.estimates.iter())
                .map(|e| {
                    let std = e
                        .std
                        .map_or_else(String::new, |std| format!(" ± {}", significant(std, 2)));
                    let unit = if e.unit == "1" { "" } else { &e.unit };
                    let said = format!("{} = {}{std} {unit}", e.name, number(e.value));
                    said.trim_end().to_owned().trim_end().to_owned()
                })
                .collect();
            lines.push(format!(
                "  {}: {}",
                words::effect(&found.effect),
                values.join(", ")
            ));
            let mut kinds = self.answer.candidates.kinds.iter();
            let kind = kinds.find(|kind| kind.name == found.effect.kind);
            let meaning = kind.map_or_else(
                || words::meaning(&found.effect.kind),
                |kind| Some(kind.says.as_str()),
            );
            if let Some(meaning) = meaning {
                lines.push(style.dim(&format!("    {meaning}")));
            }
            if !found.indistinguishable_from.is_empty() {
                lines.push(format!(
                    "    These recordings cannot tell it from {}.",
                    words::effects(&found.indistinguishable_from)
                ));
                if let Some(says) = &found.separating_experiment {
                    let wrapped = words::lines(says, 96);
                    lines.extend(wrapped.iter().map(|line| style.dim(&format!("    {line}"))));
                }
                if let Some(asked) = &found.separation
                    && let Some(command) = spelling.spell_separation(&self.before.model, asked)
                {
                    lines.push("    Motion that tells them apart is sought by".to_owned());
                    lines.push(format!("      {command}"));
                }
            }
        }
    }

    /// The best of what was refused, with the reason.
    fn refused_text(&self, style: TerminalStyle, lines: &mut Vec<String>) {
        let candidates = self.diagnosis.candidates.iter();
        let rows: Vec<Vec<String>> = candidates
            .filter_map(|c| {
                let why = c.rejection_reason.clone()?;
                (c.explained > 0.01).then(|| {
                    vec![
                        words::effect(&c.effect),
                        percent(Some(c.explained)),
                        if why == "sign" {
                            "beside what was found its sign makes no sense".to_owned()
                        } else {
                            why
                        },
                    ]
                })
            })
            .take(MOST_CANDIDATES)
            .collect();
        if rows.is_empty() {
            return;
        }
        lines.push(String::new());
        lines.push(style.bold("what was considered and refused"));
        lines.extend(table(
            2,
            &[
                ("candidate", ColumnAlignment::Left),
                ("explains alone", ColumnAlignment::Right),
                ("refused because", ColumnAlignment::Left),
            ],
            &rows,
        ));
    }

    /// What the recordings leave open, with the experiment that would tell.
    fn undecided_text(&self, style: TerminalStyle, lines: &mut Vec<String>) {
        if self.undecided.is_empty() {
            return;
        }
        lines.push(String::new());
        lines.push(style.bold("what these recordings cannot tell"));
        for one in &self.undecided {
            let says = words::lines(
                &format!("{}: {}.", words::effect(&one.effect), one.reason),
                98,
            );
            lines.extend(says.iter().map(|line| format!("  {line}")));
            let wrapped = words::lines(&one.separating_experiment, 96);
            lines.extend(wrapped.iter().map(|line| style.dim(&format!("    {line}"))));
        }
    }

    /// Parameters that differ from what the file says.
    fn off_nominal_text(
        &self,
        style: TerminalStyle,
        spelling: &dyn StepSpelling,
        lines: &mut Vec<String>,
    ) {
        if self.off_nominal.is_empty() {
            return;
        }
        let rows: Vec<Vec<String>> = (self.off_nominal.iter())
            .map(|off| {
                let p = &off.parameter;
                vec![
                    p.name.clone(),
                    number(off.nominal),
                    number(p.value),
                    significant(off.sigmas, 2),
                    p.unit.clone(),
                    p.expression.clone(),
                ]
            })
            .collect();
        lines.push(String::new());
        lines.push(style.bold("base parameters off their nominal values"));
        lines.extend(table(
            2,
            &[
                ("", ColumnAlignment::Left),
                ("nominal", ColumnAlignment::Right),
                ("identified", ColumnAlignment::Right),
                ("sigmas", ColumnAlignment::Right),
                ("unit", ColumnAlignment::Left),
                ("", ColumnAlignment::Left),
            ],
            &rows,
        ));
        lines.push(
            "  They make up for what the nominal values lack, such as a payload, a misplaced mass or a wrong length."
                .to_owned(),
        );
        let Some(held) = &self.with_nominal else {
            return;
        };
        let says = words::verdict(&held.diagnosis, self.channels(), self.validation);
        let says = format!("With all parameters held at their nominal values: {says}");
        lines.extend(
            words::lines(&says, 98)
                .iter()
                .map(|line| format!("  {line}")),
        );
        let fix_parameters = Remedy::option(OptionName::Held).spell(spelling);
        lines.push(format!("  ({fix_parameters} tells more.)"));
    }
}

/// Estimates as scripts read them.
pub(super) fn estimates(all: &[EffectEstimate]) -> Vec<Value> {
    let one = |e: &EffectEstimate| json!({"name": e.name, "value": e.value, "std": e.std, "unit": e.unit});
    all.iter().map(one).collect()
}

/// The ladder as scripts read it.
fn steps(ladder: &[SelectionStep]) -> Vec<Value> {
    let step = |rung: &SelectionStep| {
        json!({
            "added": rung.added.first(),
            "also_added": rung.added.get(1..).unwrap_or_default(),
            "dropped": rung.dropped,
            "fit": rung.fit,
            "check": rung.check,
            "gain": rung.evidence.map(|e| e.gain),
            "evidence": rung.evidence,
        })
    };
    ladder.iter().map(step).collect()
}
