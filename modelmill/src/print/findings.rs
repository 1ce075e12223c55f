//! Findings of a diagnosis, as JSON for scripts and as text for people: verdict, errors after each step,
//! effects, disturbances, rejected candidates and next steps.

use crate::text::wrap::wrap_words;
use indexmap::IndexMap;
use modelmill_identify::diagnose::{DiagnosisVerdict, Disturbance, LocatedEffect, SelectionStep, TimeResidual};
use serde_json::Value;

use super::laws;
use crate::answers::{
    CandidateAnswer, DiagnosisAnswer, DisturbanceAnswer, DriveBudgetAnswer, DriveShareAnswer, EstimateAnswer,
    MissingEffectAnswer, NominalDiagnosisAnswer, NominalEffectAnswer, OffNominalAnswer, RecordedIntervalAnswer,
    SelectionStepAnswer, TimeResidualAnswer, UndecidedEffectAnswer, to_json,
};
use crate::diagnose::{
    DiagnosisFindings, EffectEstimate, ElasticAlternative, GeometryError, MissingEffect, UndecidedEffect,
    is_common_clock, words,
};
use crate::faults::is_named_by_verdict;
use crate::print::{OptionName, Remedy, StepWording, note_answers};
use crate::text::TerminalStyle;
use crate::text::table::{ColumnAlignment, all_digits, number, percent, significant, table};

/// Rejected candidates that the text names at most.
const MOST_CANDIDATES: usize = 6;
/// Least share of the squared error that a rejected candidate must explain alone to be named. By judgement.
const NAMED_LEAST_SHARE: f64 = 0.01;

impl DiagnosisFindings {
    /// All findings as one JSON object; `wording` writes commands or calls for its reader. Its fields are those of the schema
    /// `schema/diagnose.schema.json`.
    pub fn json(&self, wording: &dyn StepWording) -> Value {
        to_json(&self.answer(wording))
    }

    /// All findings as the answer of `diagnose`.
    fn answer(&self, wording: &dyn StepWording) -> DiagnosisAnswer {
        let diagnosis = &self.diagnosis;
        let (model, channels) = (&self.before.model, self.channels());
        let candidates = diagnosis.candidates.iter().map(|one| CandidateAnswer {
            kind: one.effect.kind.clone(),
            at: one.effect.at.clone(),
            explained: one.explained,
            gain: one.gain,
            refused: one.rejection_reason,
        });
        let off_nominal = self.off_nominal.iter().map(|off| OffNominalAnswer {
            name: off.parameter.name.clone(),
            expression: off.parameter.expression.clone(),
            nominal: off.nominal,
            value: off.parameter.value,
            sigmas: off.sigmas,
            unit: off.parameter.unit.clone(),
        });
        let unexplained = diagnosis.unexplained.iter().map(|d| DriveShareAnswer {
            channel: channels[*d].clone(),
            reproducible: diagnosis.repeatable_share[*d],
        });
        let undecided = self.undecided.iter().map(|one| UndecidedEffectAnswer {
            kind: one.effect.kind.clone(),
            at: one.effect.at.clone(),
            says: one.reason.clone(),
            separate_by: one.separating_experiment.clone(),
        });
        let with_nominal = self.with_nominal.as_ref().map(|held| NominalDiagnosisAnswer {
            verdict: held.diagnosis.verdict,
            steps: held.diagnosis.steps.iter().map(step_answer).collect(),
            effects: (held.missing.iter())
                .map(|(effect, found)| NominalEffectAnswer {
                    kind: effect.kind.clone(),
                    at: effect.at.clone(),
                    estimates: estimate_answers(found),
                })
                .collect(),
        });
        DiagnosisAnswer {
            model: model.name.clone(),
            verdict: diagnosis.verdict,
            noise_floor: diagnosis.noise_floor,
            budget: self.budget_answers(),
            disturbances: self
                .disturbances()
                .iter()
                .map(|one| self.disturbance_answer(one))
                .collect(),
            corrected: self.corrected.iter().map(|fault| fault.answer(wording)).collect(),
            unresolved: self.unresolved.iter().map(|fault| fault.answer(wording)).collect(),
            steps: diagnosis.steps.iter().map(step_answer).collect(),
            effects: self.effect_answers(&self.missing, wording),
            geometry_alternatives: self.geometry_answers(),
            possible: self.effect_answers(&self.possible, wording),
            candidates: candidates.collect(),
            untold: undecided.collect(),
            laws: laws::law_answers(&self.laws, model, wording),
            parameters_off_nominal: off_nominal.collect(),
            unexplained: unexplained.collect(),
            follows_time: self.time_residual_answers(),
            data: note_answers(&self.notes, wording),
            regions: self.regions.clone(),
            with_nominal_parameters: with_nominal,
        }
    }

    /// Missing effects with the motion that would separate them from their alternatives. Kinds and places have the names of
    /// the model file.
    fn effect_answers(&self, effects: &[MissingEffect], wording: &dyn StepWording) -> Vec<MissingEffectAnswer> {
        let model = &self.before.model;
        let answer = |missing: &MissingEffect| {
            let separation = missing.separation.as_ref();
            MissingEffectAnswer {
                kind: missing.effect.kind.clone(),
                at: missing.effect.at.clone(),
                estimates: estimate_answers(&missing.estimates),
                probability: missing.probability,
                support: missing.support,
                indistinguishable_from: missing.indistinguishable_from.clone(),
                shared_with: missing.shared_with.clone(),
                separate_by: missing.separating_experiment.clone(),
                separate_command: separation.and_then(|proposal| wording.format_separation(model, proposal)),
            }
        };
        effects.iter().map(answer).collect()
    }

    /// A disturbance with estimates, recordings and times, and errors of the geometry that explain as much.
    fn disturbance_answer(&self, one: &Disturbance) -> DisturbanceAnswer {
        let estimates = one.estimates.iter().map(|quantity| EstimateAnswer {
            name: quantity.name.clone(),
            value: quantity.value,
            std: quantity.standard_deviation,
            unit: quantity.unit.clone(),
        });
        // Alternatives of effects, where there are any, are listed for themselves.
        let is_alone = is_common_clock(one) && self.missing.is_empty();
        let alternatives = self.geometry_alternatives.iter().filter(|_| is_alone);
        let errors = alternatives.flat_map(|one| &one.errors).map(GeometryError::as_effect);
        let is_here = |other: &&ElasticAlternative| {
            one.kind == "encoder_eccentricity" && one.at.first() == Some(&other.coordinate)
        };
        let elastic = self.elastic_alternatives.iter().filter(is_here);
        let elastic = elastic.map(|other| other.compliance.clone());
        let contact = words::is_brief_force(one).then(|| LocatedEffect {
            kind: "contact_event".to_owned(),
            at: one.at.clone(),
        });
        DisturbanceAnswer {
            kind: one.kind.clone(),
            at: one.at.clone(),
            says: one.description.clone(),
            estimates: estimates.collect(),
            recordings: one.recordings.clone(),
            interval: one.interval,
            in_verdict: is_named_by_verdict(one),
            indistinguishable_from: errors.chain(elastic).chain(contact).collect(),
        }
    }

    /// Parts of the residual of each drive, relative to its rms force.
    fn budget_answers(&self) -> IndexMap<String, DriveBudgetAnswer> {
        let model = &self.before.model;
        let budgets = self.channels().iter().zip(&self.diagnosis.budgets).enumerate();
        let budgets = budgets.map(|(d, (channel, budget))| {
            // A drive without force has no relative parts.
            let part = |x: f64| if budget.force > 0.0 { x / budget.force } else { 0.0 };
            let answer = DriveBudgetAnswer {
                noise: part(budget.noise),
                not_repeating: part(budget.non_repeatable()),
                in_time: part(budget.in_time),
                subtracted: part(budget.subtracted),
                model: part(budget.model),
                unit: model.force_unit(d).to_owned(),
                rms: budget.force,
            };
            (channel.clone(), answer)
        });
        budgets.collect()
    }

    /// Residuals that follow the time and are no noise.
    fn time_residual_answers(&self) -> Vec<TimeResidualAnswer> {
        let (model, channels) = (&self.before.model, self.channels());
        let answer = |one: &TimeResidual| {
            let unit = model.force_unit(one.channel);
            let intervals = one.intervals.iter().map(|time| RecordedIntervalAnswer {
                recording: time.recording.clone(),
                interval: time.interval,
            });
            TimeResidualAnswer {
                channel: channels[one.channel].clone(),
                character: one.character.clone(),
                rms: one.rms,
                noise: one.noise,
                unit: unit.to_owned(),
                frequency: one.frequency,
                intervals: intervals.collect(),
                says: words::time_residual(one, &channels[one.channel], unit),
            }
        };
        self.diagnosis.time_residuals.iter().map(answer).collect()
    }

    /// The findings as lines of text, the verdict first.
    pub fn text(&self, style: TerminalStyle, wording: &dyn StepWording) -> Vec<String> {
        let diagnosis = &self.diagnosis;
        let verdict = self.verdict_text();
        let mut lines: Vec<String> = (wrap_words(&verdict, 100).iter())
            .map(|line| style.bold(line))
            .collect();
        lines.push(String::new());
        let base = if self.before.identified.is_some() {
            "estimated"
        } else {
            "fixed"
        };
        lines.push(style.bold(&format!(
            "Error after each step, relative to the force (nrms), with {base} base parameters"
        )));
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
        self.missing_text(style, wording, &mut lines);
        self.sums_text(&mut lines);
        self.geometry_alternatives_text(style, &mut lines);
        self.possible_text(style, &mut lines);
        self.disturbances_text(style, &mut lines);
        self.regions_text(style, &mut lines);
        lines.extend(laws::text(&self.laws, &self.before.model, style, wording));
        self.refused_text(style, &mut lines);
        self.undecided_text(style, &mut lines);
        self.off_nominal_text(style, wording, &mut lines);
        // Entries to add first, then advice for what a model file cannot contain. Steps are commands or calls,
        // depending on the reader.
        let at_fault = self.corrected.iter().chain(&self.unresolved);
        let mut next: Vec<String> = at_fault
            .map(|fault| format!("{}: {}.", fault.advice_heading(), fault.advice.format_for(wording)))
            .collect();
        // Steps that were done at once are no next steps.
        if !wording.has_added_effects() {
            let entries = self.entries_to_add();
            let steps = entries.iter();
            next.extend(steps.map(|entry| wording.format_effect(&self.before.model, entry)));
            // A model is completed only once the faults are corrected.
            if entries.len() > 1 && self.corrected.is_empty() {
                next.push(format!("{}.", wording.format_completion()));
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
                says.format_for(wording)
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
        let of = if self.missing.is_empty() {
            ""
        } else {
            " with the effects found"
        };
        lines.push(style.bold(&format!(
            "Remaining error of each drive{of}, split by origin (rms, relative to its rms force)"
        )));
        let has_removed = diagnosis.budgets.iter().any(|budget| budget.subtracted > 0.0);
        let part = |x: f64, force: f64| percent((force > 0.0).then(|| x / force));
        // Parts of the residual of each drive, relative to its force.
        let rows: Vec<Vec<String>> = (self.channels().iter().zip(&diagnosis.budgets))
            .map(|(channel, budget)| {
                // Noise, what varies with time, and what a model could explain; disturbances are no part of the residual.
                let of = |x: f64| part(x, budget.force);
                let mut row = vec![channel.clone(), of(budget.noise), of(budget.in_time), of(budget.model)];
                row.extend(has_removed.then(|| of(budget.subtracted)));
                row
            })
            .collect();
        let mut columns = vec![
            ("drive", ColumnAlignment::Left),
            ("noise or rounding", ColumnAlignment::Right),
            ("changes with time at equal motion", ColumnAlignment::Right),
            ("model error", ColumnAlignment::Right),
        ];
        columns.extend(has_removed.then_some(("removed before the fit (disturbances)", ColumnAlignment::Right)));
        lines.extend(table(2, &columns, &rows));
    }

    /// The meaning of a kind of effect in a sentence: that of its library, since users can add kinds, or else that of the
    /// kinds of the diagnosis.
    pub(crate) fn kind_meaning(&self, name: &str) -> Option<&str> {
        let mut kinds = self.answer.candidates.kinds.iter();
        let kind = kinds.find(|kind| kind.name == name);
        kind.map_or_else(|| words::meaning(name), |kind| Some(kind.says.as_str()))
    }

    /// Missing effects with their estimates, and effects that explain the recordings equally well. What a kind
    /// means and how to separate it are printed once, at its first place.
    fn missing_text(&self, style: TerminalStyle, wording: &dyn StepWording, lines: &mut Vec<String>) {
        if self.missing.is_empty() {
            return;
        }
        lines.push(String::new());
        lines.push(style.bold("Missing effects (estimate ± one standard deviation)"));
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
            if let Some(meaning) = self.kind_meaning(name).filter(|_| is_first) {
                let wrapped = wrap_words(meaning, 96);
                lines.extend(wrapped.iter().map(|line| style.dim(&format!("    {line}"))));
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
                    && let Some(command) = wording.format_separation(&self.before.model, proposal)
                {
                    let says = format!(
                        "To plan a motion that distinguishes {} from {}:",
                        words::effect(&proposal.effect.effect),
                        words::effects(&proposal.rivals)
                    );
                    lines.extend(wrap_words(&says, 96).iter().map(|line| format!("    {line}")));
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
        let all = || (self.diagnosis.candidates.iter()).filter_map(|one| Some((one, one.rejection_reason?)));
        let rejected = || {
            all()
                .filter(|(one, _)| one.explained > NAMED_LEAST_SHARE)
                .take(MOST_CANDIDATES)
        };
        let rows: Vec<Vec<String>> = rejected()
            .map(|(one, why)| {
                vec![
                    words::effect(&one.effect),
                    percent(Some(one.explained)),
                    words::refusal(why, has_findings).to_owned(),
                ]
            })
            .collect();
        if rows.is_empty() {
            return;
        }
        lines.push(String::new());
        lines.push(style.bold(&format!(
            "Rejected candidates: {}; those that explain most of the squared error alone",
            all().count()
        )));
        lines.extend(table(
            2,
            &[
                ("candidate", ColumnAlignment::Left),
                ("explained alone", ColumnAlignment::Right),
                ("rejected because", ColumnAlignment::Left),
            ],
            &rows,
        ));
        // Each kind is explained once, here or with the missing effects.
        let mut explained: Vec<&str> = self.missing.iter().map(|found| found.effect.kind.as_str()).collect();
        for (one, _) in rejected() {
            let name = one.effect.kind.as_str();
            let meaning = self.kind_meaning(name).filter(|_| !explained.contains(&name));
            if let Some(meaning) = meaning {
                explained.push(name);
                let says = format!("{}: {meaning}", words::kind(name));
                lines.extend(
                    wrap_words(&says, 96)
                        .iter()
                        .map(|line| style.dim(&format!("    {line}"))),
                );
            }
        }
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
    fn off_nominal_text(&self, style: TerminalStyle, wording: &dyn StepWording, lines: &mut Vec<String>) {
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
        let fix_parameters = Remedy::option(OptionName::Held).format_for(wording);
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

/// Estimates of an effect.
pub(super) fn estimate_answers(all: &[EffectEstimate]) -> Vec<EstimateAnswer> {
    let answer = |one: &EffectEstimate| EstimateAnswer {
        name: one.name.clone(),
        value: one.value,
        std: one.std,
        unit: one.unit.clone(),
    };
    all.iter().map(answer).collect()
}

/// A step of the search.
fn step_answer(step: &SelectionStep) -> SelectionStepAnswer {
    SelectionStepAnswer {
        added: step.added.first().cloned(),
        also_added: step.added.get(1..).unwrap_or_default().to_vec(),
        dropped: step.dropped.clone(),
        fit: step.fit,
        check: step.check,
        gain: step.evidence.map(|evidence| evidence.gain),
        evidence: step.evidence,
    }
}
