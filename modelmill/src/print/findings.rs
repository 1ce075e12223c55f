//! Findings of a diagnosis, as JSON for scripts and as text for people: verdict, errors after each step,
//! effects, disturbances, rejected candidates and next steps.

use crate::text::wrap::wrap_words;
use modelmill_identify::diagnose::{DiagnosisVerdict, LocatedEffect, SelectionStep};
use serde_json::{Map, Value, json};

use super::laws;
use crate::diagnose::{DiagnosisFindings, EffectEstimate, MissingEffect, UndecidedEffect, words};
use crate::faults::is_named_by_verdict;
use crate::print::{OptionName, Remedy, StepSpelling, notes};
use crate::text::TerminalStyle;
use crate::text::table::{ColumnAlignment, all_digits, number, percent, significant, table};

/// Rejected candidates that the text names at most.
const MOST_CANDIDATES: usize = 6;
/// Least share of the squared error that a rejected candidate must explain alone to be named. By judgement.
const NAMED_LEAST_SHARE: f64 = 0.01;

impl DiagnosisFindings {
    /// All findings as one JSON object; `spelling` writes commands or calls for its reader.
    ///
    /// - `verdict`, `noise_floor` (relative to the force, as all errors here)
    /// - `budget`: for each drive, the parts of its residual (`noise`, `in_time`, `model`) and the disturbances that were
    ///   `subtracted` from its force, relative to the rms force of the drive; `rms` is this force in `unit`. `not_repeating`
    ///   are `in_time` and `subtracted` together
    /// - `disturbances`: faults of the recordings, with estimates and times (`interval`, s)
    /// - `corrected`: faults of the recordings that were corrected hypothetically, with what to do about them (`todo`);
    ///   all other findings hold for the corrected recordings
    /// - `unresolved`: faults of the recordings that could not be corrected; nothing else is stated then
    /// - `steps`: errors after each added effect, on fitted (`fit`) and validation data (`check`)
    /// - `effects`: missing effects with estimates, probability, what supports them, alternatives, and the places whose
    ///   value the model uses there too (`shared_with`): the estimates are then the difference from that value
    /// - `geometry_alternatives`: errors of the geometry that explain as much as the effects found (`share`, 1 for as
    ///   much): each a constant, or a coordinate of a point that the file writes as zero
    /// - `possible`: the same for effects with a probability below 0.5
    /// - `candidates`: all effects that were tried, with the share of the squared error that each explains
    ///   alone and the reason of its rejection
    /// - `untold`: effects that the recordings can neither show nor exclude
    /// - `laws`: hypotheses for the residual
    /// - `parameters_off_nominal`: base parameters that differ from the file, in standard deviations (`sigmas`)
    /// - `unexplained`: drives with a repeatable residual that no effect explains
    /// - `follows_time`: drives with a residual that follows the time and not the state, and cannot be noise
    /// - `data`, `where`: notes on the recordings, and regions where the error is largest
    /// - `with_nominal_parameters`: the diagnosis with all parameters fixed
    pub fn json(&self, spelling: &dyn StepSpelling) -> Value {
        let diagnosis = &self.diagnosis;
        // Values are by drive, in the order of the model.
        let channels = self.channels();
        let model = &self.before.model;
        // Missing effects with the motion that would separate them from their alternatives. Kinds and places have
        // the names of the model file.
        let described = |effects: &[MissingEffect]| -> Vec<Value> {
            let described = effects.iter().map(|missing| {
                let separation = missing.separation.as_ref();
                json!({
                    "kind": missing.effect.kind,
                    "at": missing.effect.at,
                    "estimates": estimates(&missing.estimates),
                    "probability": missing.probability,
                    "support": missing.support,
                    "indistinguishable_from": missing.indistinguishable_from,
                    "shared_with": missing.shared_with,
                    "separate_by": missing.separating_experiment,
                    "separate_command": separation.and_then(|proposal| spelling.spell_separation(model, proposal)),
                })
            });
            described.collect()
        };
        // All candidates, including those that were found; they have no rejection reason. A script can sort them
        // by either share.
        let candidates: Vec<Value> = (diagnosis.candidates.iter())
            .map(|c| {
                json!({"kind": c.effect.kind, "at": c.effect.at, "explained": c.explained, "gain": c.gain, "refused": c.rejection_reason})
            })
            .collect();
        // Base parameters that differ from the file.
        let off: Vec<Value> = (self.off_nominal.iter())
            .map(|off| {
                let p = &off.parameter;
                json!({"name": p.name, "expression": p.expression, "nominal": off.nominal, "value": p.value, "sigmas": off.sigmas, "unit": p.unit})
            })
            .collect();
        // Parts of the residual are relative to the rms force of the drive.
        let budget: Map<String, Value> = (channels.iter().zip(&diagnosis.budgets).enumerate())
            .map(|(d, (channel, budget))| {
                // A drive without force has no relative parts.
                let part = |x: f64| {
                    if budget.force > 0.0 { x / budget.force } else { 0.0 }
                };
                let value = json!({
                    "noise": part(budget.noise),
                    "not_repeating": part(budget.non_repeatable()),
                    "in_time": part(budget.in_time),
                    "subtracted": part(budget.subtracted),
                    "model": part(budget.model),
                    "unit": model.force_unit(d),
                    "rms": budget.force,
                });
                (channel.clone(), value)
            })
            .collect();
        // Disturbances with estimates, recordings and times.
        let disturbances: Vec<Value> = (self.disturbances().iter())
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
                    "in_verdict": is_named_by_verdict(one),
                })
            })
            .collect();
        // Drives whose residual is repeatable, so that a model could explain it.
        let unexplained: Vec<Value> = (diagnosis.unexplained.iter())
            .map(|d| json!({"channel": channels[*d], "reproducible": diagnosis.repeatable_share[*d]}))
            .collect();
        // Keys are part of the interface; their meaning is listed above.
        json!({
            "model": model.name,
            "verdict": diagnosis.verdict,
            "noise_floor": diagnosis.noise_floor,
            "budget": budget,
            "disturbances": disturbances,
            "corrected": self.corrected.iter().map(|fault| fault.json(spelling)).collect::<Vec<_>>(),
            "unresolved": self.unresolved.iter().map(|fault| fault.json(spelling)).collect::<Vec<_>>(),
            "steps": steps(&diagnosis.steps),
            "effects": described(&self.missing),
            "geometry_alternatives": self.geometry_alternatives_json(),
            "possible": described(&self.possible),
            "candidates": candidates,
            "untold": self.undecided.iter().map(|one| {
                json!({"kind": one.effect.kind, "at": one.effect.at, "says": one.reason, "separate_by": one.separating_experiment})
            }).collect::<Vec<_>>(),
            "laws": laws::laws(&self.laws, model, spelling),
            "parameters_off_nominal": off,
            "unexplained": unexplained,
            "follows_time": self.time_residuals(),
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

    /// Residuals that follow the time and are no noise, as JSON.
    fn time_residuals(&self) -> Vec<Value> {
        let (diagnosis, channels) = (&self.diagnosis, self.channels());
        let model = &self.before.model;
        (diagnosis.time_residuals.iter())
            .map(|one| {
                json!({
                    "channel": channels[one.channel],
                    "character": one.character,
                    "rms": one.rms,
                    "noise": one.noise,
                    "unit": model.force_unit(one.channel),
                    "frequency": one.frequency,
                    "intervals": one.intervals.iter().map(|time| {
                        json!({"recording": time.recording, "interval": time.interval})
                    }).collect::<Vec<_>>(),
                    "says": words::time_residual(one, &channels[one.channel], model.force_unit(one.channel)),
                })
            })
            .collect()
    }

    /// The findings as lines of text, the verdict first.
    pub fn text(&self, style: TerminalStyle, spelling: &dyn StepSpelling) -> Vec<String> {
        let diagnosis = &self.diagnosis;
        let verdict = self.verdict_text();
        let mut lines: Vec<String> = (wrap_words(&verdict, 100).iter())
            .map(|line| style.bold(line))
            .collect();
        lines.push(String::new());
        lines.push(style.bold("Error after each added effect, relative to the force (nrms)"));
        // Errors after each step, on fitted and on validation data.
        let rows: Vec<Vec<String>> = (diagnosis.steps.iter())
            .map(|step| {
                vec![
                    words::step_text(step, diagnosis, self.channels()),
                    percent(Some(step.fit)),
                    percent(Some(step.check)),
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
        // The noise floor follows the table, as the lower bound of all errors.
        lines.push(format!("  {}", words::noise_floor_text(diagnosis)));
        self.missing_text(style, spelling, &mut lines);
        self.sums_text(&mut lines);
        self.geometry_alternatives_text(style, &mut lines);
        self.possible_text(style, &mut lines);
        self.disturbances_text(style, &mut lines);
        self.regions_text(style, &mut lines);
        lines.extend(laws::text(&self.laws, &self.before.model, style, spelling));
        self.refused_text(style, &mut lines);
        self.undecided_text(style, &mut lines);
        self.off_nominal_text(style, spelling, &mut lines);
        // Entries to add first, then advice for what a model file cannot contain. Steps are commands or calls,
        // depending on the reader.
        let at_fault = self.corrected.iter().chain(&self.unresolved);
        let mut next: Vec<String> = at_fault
            .map(|fault| format!("{}: {}.", fault.advice_heading(), fault.advice.spell(spelling)))
            .collect();
        // Steps that were done at once are no next steps.
        if !spelling.has_added_effects() {
            let entries = self.entries_to_add();
            let steps = entries.iter();
            next.extend(steps.map(|entry| spelling.spell_effect(&self.before.model, entry)));
            // A model is completed only once the faults are corrected.
            if entries.len() > 1 && self.corrected.is_empty() {
                next.push(format!("{}.", spelling.spell_completion()));
            }
        }
        next.extend(self.further_action().map(str::to_owned));
        if !next.is_empty() {
            lines.push(String::new());
            lines.push(style.bold("Next steps"));
            lines.extend(next.iter().map(|line| format!("  {line}")));
        }
        // Effects that were found may contradict the model file.
        if let Some(says) = self.after.refusal() {
            lines.push(format!(
                "  The model with the added effects cannot be built: {}",
                says.spell(spelling)
            ));
        }
        lines
    }

    /// Where the error, or what remains of it, is largest.
    fn regions_text(&self, style: TerminalStyle, lines: &mut Vec<String>) {
        let is_unexplained = self.diagnosis.verdict == DiagnosisVerdict::Unexplained;
        // Without a drive whose residual is repeatable, nothing was searched.
        if is_unexplained && self.regions.is_empty() {
            return;
        }
        lines.push(String::new());
        lines.push(style.bold(if is_unexplained {
            "Where the residual is largest"
        } else {
            "Where the error without added effects is largest"
        }));
        lines.extend(self.regions.iter().map(|region| format!("  {}.", region.says)));
        if self.regions.is_empty() {
            lines.push("  The error is clearly larger in no range of a coordinate, rate, load or time.".to_owned());
        }
    }

    /// Disturbances of the recordings, and the parts of the residual of each drive.
    fn disturbances_text(&self, style: TerminalStyle, lines: &mut Vec<String>) {
        let diagnosis = &self.diagnosis;
        let mut disturbances = self.disturbances();
        disturbances.retain(|one| !is_named_by_verdict(one));
        if !disturbances.is_empty() {
            lines.push(String::new());
            lines.push(style.bold("Disturbances in the recordings (not model errors)"));
            for says in words::disturbance_sentences(&disturbances) {
                let wrapped = wrap_words(&says, 98);
                lines.extend(wrapped.iter().map(|line| format!("  {line}")));
            }
        }
        if !diagnosis.time_residuals.is_empty() {
            lines.push(String::new());
            lines.push(style.bold("Residuals that vary with time and not with the state"));
            for one in &diagnosis.time_residuals {
                let unit = self.before.model.force_unit(one.channel);
                let says = words::time_residual(one, &self.channels()[one.channel], unit);
                let wrapped = wrap_words(&format!("{says}."), 98);
                lines.extend(wrapped.iter().map(|line| format!("  {line}")));
            }
        }
        lines.push(String::new());
        lines.push(style.bold("Remaining error of each drive, % of its force (rms)"));
        let part = |x: f64, force: f64| percent((force > 0.0).then(|| x / force));
        // Parts of the residual of each drive, relative to its force.
        let rows: Vec<Vec<String>> = (self.channels().iter().zip(&diagnosis.budgets))
            .map(|(channel, budget)| {
                // Noise, what varies with time, and what a model could explain; disturbances are no part of the residual.
                let of = |x: f64| part(x, budget.force);
                vec![
                    channel.clone(),
                    of(budget.noise),
                    of(budget.in_time),
                    of(budget.model),
                    of(budget.subtracted),
                ]
            })
            .collect();
        lines.extend(table(
            2,
            &[
                ("drive", ColumnAlignment::Left),
                ("noise or rounding", ColumnAlignment::Right),
                ("varies with time", ColumnAlignment::Right),
                ("repeatable, unexplained", ColumnAlignment::Right),
                ("disturbances (subtracted)", ColumnAlignment::Right),
            ],
            &rows,
        ));
    }

    /// Missing effects with their estimates, and effects that explain the recordings equally well. What a kind
    /// means and how to separate it are printed once, at its first place.
    fn missing_text(&self, style: TerminalStyle, spelling: &dyn StepSpelling, lines: &mut Vec<String>) {
        if self.missing.is_empty() {
            return;
        }
        lines.push(String::new());
        lines.push(style.bold("Missing effects"));
        // Each kind is explained at its first place only.
        let mut explained: Vec<&str> = Vec::new();
        // So is the experiment that distinguishes it from its alternatives.
        let mut distinguished: Vec<&str> = Vec::new();
        for found in &self.missing {
            let name = found.effect.kind.as_str();
            let is_first = !explained.contains(&name);
            explained.push(name);
            lines.push(format!(
                "  {}: {}",
                words::effect(&found.effect),
                values_text(&found.estimates)
            ));
            // Kinds of the libraries have a text of their own; others are explained here.
            // The text of the library comes first, since users can add kinds.
            let mut kinds = self.answer.candidates.kinds.iter();
            let kind = kinds.find(|kind| kind.name == found.effect.kind);
            let meaning = kind.map_or_else(|| words::meaning(&found.effect.kind), |kind| Some(kind.says.as_str()));
            if let Some(meaning) = meaning.filter(|_| is_first) {
                lines.push(style.dim(&format!("    {meaning}")));
            }
            if !found.shared_with.is_empty() {
                let says = words::shared_value(&found.effect, &found.shared_with);
                let wrapped = wrap_words(&says, 96);
                lines.extend(wrapped.iter().map(|line| format!("    {line}")));
            }
            // Alternatives follow with the motion that would distinguish them.
            if !found.indistinguishable_from.is_empty() {
                lines.push(format!(
                    "    With these recordings it is not distinguishable from {}.",
                    words::effects(&found.indistinguishable_from)
                ));
                if let Some(says) = &found.separating_experiment
                    && !distinguished.contains(&name)
                {
                    distinguished.push(name);
                    let wrapped = wrap_words(says, 96);
                    lines.extend(wrapped.iter().map(|line| style.dim(&format!("    {line}"))));
                }
                if let Some(proposal) = &found.separation
                    && let Some(command) = spelling.spell_separation(&self.before.model, proposal)
                {
                    lines.push("    To plan a motion that distinguishes them:".to_owned());
                    lines.push(format!("      {command}"));
                }
            }
        }
    }

    /// Values of the model file that are sums of the findings above them.
    fn sums_text(&self, lines: &mut Vec<String>) {
        for entry in self.summed_entries() {
            let values = entry.parameters.iter().filter_map(|p| {
                let nominal = p.nominal?;
                Some(format!("{} = {}", p.symbol, all_digits(nominal)))
            });
            let values: Vec<String> = values.collect();
            let says = format!(
                "At {}, {} was found more than once. The effects add up, and the model file gets their sum: {}.",
                entry.at.join(", "),
                words::kind(&entry.kind),
                values.join(", ")
            );
            lines.extend(wrap_words(&says, 96).iter().map(|line| format!("    {line}")));
        }
    }

    /// Effects that are less likely than not, with their values and probabilities.
    fn possible_text(&self, style: TerminalStyle, lines: &mut Vec<String>) {
        if self.possible.is_empty() {
            return;
        }
        lines.push(String::new());
        lines.push(style.bold("Possible effects (less likely than not)"));
        for found in &self.possible {
            lines.push(format!(
                "  {}: {}, probability {}",
                words::effect(&found.effect),
                values_text(&found.estimates),
                significant(found.probability, 2)
            ));
        }
        let advice = "The recordings do not show them clearly, so they are neither part of the verdict nor of the errors \
                      above. To decide, record a longer motion with more reversals and other speeds.";
        lines.extend(
            wrap_words(advice, 96)
                .iter()
                .map(|line| style.dim(&format!("    {line}"))),
        );
    }

    /// The rejected candidates that explain most of the error alone, with the reason.
    fn refused_text(&self, style: TerminalStyle, lines: &mut Vec<String>) {
        let has_findings = self.diagnosis.steps.len() > 1;
        // Candidates are sorted by what they explain alone, so the first are the closest rivals.
        let candidates = self.diagnosis.candidates.iter();
        let rows: Vec<Vec<String>> = candidates
            .filter_map(|c| {
                let why = c.rejection_reason?;
                (c.explained > NAMED_LEAST_SHARE).then(|| {
                    vec![
                        words::effect(&c.effect),
                        percent(Some(c.explained)),
                        words::refusal(why, has_findings).to_owned(),
                    ]
                })
            })
            .take(MOST_CANDIDATES)
            .collect();
        if rows.is_empty() {
            return;
        }
        lines.push(String::new());
        lines.push(style.bold("Rejected candidates"));
        lines.extend(table(
            2,
            &[
                ("candidate", ColumnAlignment::Left),
                ("alone it would explain", ColumnAlignment::Right),
                ("rejected because", ColumnAlignment::Left),
            ],
            &rows,
        ));
    }

    /// Effects that these recordings can neither show nor exclude, each with the experiment that would decide.
    fn undecided_text(&self, style: TerminalStyle, lines: &mut Vec<String>) {
        if self.undecided.is_empty() {
            return;
        }
        lines.push(String::new());
        lines.push(style.bold("Effects that these recordings can neither show nor exclude"));
        // Effects of one kind share their text, so it is printed once with all places.
        let mut groups: Vec<(&UndecidedEffect, Vec<&LocatedEffect>)> = Vec::new();
        for one in &self.undecided {
            let is_alike = |(first, _): &&mut (&UndecidedEffect, _)| {
                (&first.effect.kind, &first.reason) == (&one.effect.kind, &one.reason)
            };
            match groups.iter_mut().find(is_alike) {
                Some((_, effects)) => effects.push(&one.effect),
                None => groups.push((one, vec![&one.effect])),
            }
        }
        // One place has its own text; several places share one.
        for (first, effects) in groups {
            let (title, experiment) = match effects.as_slice() {
                [one] => (words::effect(one), first.separating_experiment.clone()),
                all => {
                    let kind = &first.effect.kind;
                    let places: Vec<String> = all.iter().map(|one| one.at.join(", ")).collect();
                    (
                        format!("{} ({})", words::kind(kind), places.join("; ")),
                        self.deciding_experiment(kind, "each of these places"),
                    )
                }
            };
            let reason = wrap_words(&format!("{title}: {}.", first.reason), 98);
            lines.extend(reason.iter().map(|line| format!("  {line}")));
            let wrapped = wrap_words(&experiment, 96);
            lines.extend(wrapped.iter().map(|line| style.dim(&format!("    {line}"))));
        }
    }

    /// Base parameters whose estimates differ from the nominal values of the file.
    fn off_nominal_text(&self, style: TerminalStyle, spelling: &dyn StepSpelling, lines: &mut Vec<String>) {
        if self.off_nominal.is_empty() {
            return;
        }
        // The difference is given in standard deviations, so that its size can be judged.
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
        lines.push(style.bold("Base parameters that differ from their nominal values"));
        lines.extend(table(
            2,
            &[
                ("", ColumnAlignment::Left),
                ("nominal", ColumnAlignment::Right),
                ("identified", ColumnAlignment::Right),
                ("difference / std", ColumnAlignment::Right),
                ("unit", ColumnAlignment::Left),
                ("expression", ColumnAlignment::Left),
            ],
            &rows,
        ));
        lines.push(
            "  Possible causes: a payload, a misplaced mass or a wrong length that the nominal values do not contain."
                .to_owned(),
        );
        // A second diagnosis with fixed parameters shows which further effects could explain the differences. It is no
        // second verdict, since the nominal values may be wrong.
        let Some(held) = &self.with_nominal else {
            return;
        };
        let is_new = |(effect, _): &&(LocatedEffect, Vec<EffectEstimate>)| {
            !self.missing.iter().any(|found| found.effect == *effect)
        };
        let further: Vec<String> = (held.missing.iter().filter(is_new))
            .map(|(effect, values)| format!("{}: {}", words::effect(effect), values_text(values)))
            .collect();
        if !further.is_empty() {
            let says =
                "If the nominal values are correct, these effects may explain a part of the differences instead:";
            lines.push(format!("  {says}"));
            lines.extend(further.iter().map(|says| format!("    {says}")));
        }
        let fix_parameters = Remedy::option(OptionName::Held).spell(spelling);
        lines.push(format!(
            "  To diagnose with all parameters fixed at their nominal values, use {fix_parameters}."
        ));
    }
}

/// Estimates with standard deviations and units, for a line of text.
pub(crate) fn values_text(estimates: &[EffectEstimate]) -> String {
    let values = estimates.iter().map(|e| {
        let std = e
            .std
            .map_or_else(String::new, |std| format!(" ± {}", significant(std, 2)));
        let unit = if e.unit == "1" { "" } else { &e.unit };
        let estimate = format!("{} = {}{std} {unit}", e.name, all_digits(e.value));
        estimate.trim_end().to_owned()
    });
    values.collect::<Vec<String>>().join(", ")
}

/// Estimates as JSON.
pub(super) fn estimates(all: &[EffectEstimate]) -> Vec<Value> {
    let one = |e: &EffectEstimate| json!({"name": e.name, "value": e.value, "std": e.std, "unit": e.unit});
    all.iter().map(one).collect()
}

/// The steps of the search as JSON.
fn steps(all: &[SelectionStep]) -> Vec<Value> {
    let one_step = |step: &SelectionStep| {
        json!({
            "added": step.added.first(),
            "also_added": step.added.get(1..).unwrap_or_default(),
            "dropped": step.dropped,
            "fit": step.fit,
            "check": step.check,
            "gain": step.evidence.map(|e| e.gain),
            "evidence": step.evidence,
        })
    };
    all.iter().map(one_step).collect()
}
