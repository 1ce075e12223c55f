//! `diagnose`: which effect is missing, and what speaks for it.

use std::fmt::Write as _;

use modelmill_identify::diagnose::{Effect, FoundEffect, Rung, Verdict};
use modelmill_identify::{FitParameter, Region, Status};
use modelmill_spec::Mechanics;
use modelmill_spec::edit::NewEffect;
use serde_json::{Value, json};

use crate::args::{AskArgs, DiagnoseArgs};
use crate::data::Data;
use crate::diagnosis::{self, Answer, Held};
use crate::failure::Outcome;
use crate::model;
use crate::preparation::PreparationArgs;
use crate::report::added::{NamedEffect, quoted};
use crate::report::{self, Study, Version, added, words};
use crate::table::{Align, number, percent, significant, table};
use crate::terminal;

/// A base parameter is off its nominal value from this many of its deviations on, and from this share of it on.
const SIGMAS: f64 = 5.0;
const OFF: f64 = 0.01;
/// Candidates that the text names.
const NAMED: usize = 6;

/// Prints what is missing, or that nothing is, or that nothing known explains it.
pub(crate) fn run(args: &DiagnoseArgs) -> Outcome {
    let study = report::ask(&args.ask)?;
    // Base parameters that are off may hide what nominal values lack.
    let is_off = !args.ask.held && !off_nominal(last(&study)).is_empty();
    let held = is_off
        .then(|| with_nominal(&args.ask, &study))
        .transpose()?;
    if args.json {
        return terminal::print_json(&object(&study, held.as_ref(), &args.ask));
    }
    let lines = text(&study, held.as_ref(), &args.ask);
    terminal::print(&lines.join("\n"))
}

/// The same question with all parameters held at their nominal values.
fn with_nominal(args: &AskArgs, study: &Study) -> Outcome<Answer> {
    let loaded = model::load_quietly(&args.model)?;
    let version = &study.before;
    let of = |is_check: bool| -> Vec<Data> {
        let runs = version.data.iter().zip(&version.runs);
        let wanted = runs.filter(|(_, run)| run.is_check == is_check);
        wanted.map(|(data, _)| data.clone()).collect()
    };
    diagnosis::find(
        &args.model,
        &loaded,
        model::libraries(),
        &version.model,
        &of(false),
        &of(true),
        Held::All,
    )
}

/// The answer as scripts read it.
fn object(study: &Study, held: Option<&Answer>, args: &AskArgs) -> Value {
    let diagnosis = &study.answer.diagnosis;
    let channels = &study.answer.problem.layout.channels;
    let effects: Vec<Value> = (diagnosis.effects.iter())
        .map(|found| {
            let estimates: Vec<Value> = estimates(study, found)
                .into_iter()
                .map(|e| json!({"name": e.name, "value": e.value, "std": e.std, "unit": e.unit}))
                .collect();
            json!({
                "kind": found.effect.kind,
                "at": found.effect.at,
                "estimates": estimates,
                "indistinguishable_from": found.indistinguishable_from,
                "separate_by": separate_by(study, found),
                "separate_command": separate_command(study, found, args),
            })
        })
        .collect();
    let candidates: Vec<Value> = (diagnosis.candidates.iter())
        .map(|c| {
            json!({"kind": c.effect.kind, "at": c.effect.at, "explained": c.explained, "gain": c.gain, "refused": c.refused})
        })
        .collect();
    let off: Vec<Value> = (off_nominal(last(study)).into_iter())
        .map(|(p, nominal, sigmas)| {
            json!({"name": p.name, "expression": p.expression, "nominal": nominal, "value": p.value, "sigmas": sigmas, "unit": p.unit})
        })
        .collect();
    let unexplained: Vec<Value> = (diagnosis.unexplained.iter())
        .map(|d| json!({"channel": channels[*d], "reproducible": diagnosis.reproducible[*d]}))
        .collect();
    json!({
        "model": study.before.model.name,
        "verdict": diagnosis.verdict,
        "noise_floor": diagnosis.noise_floor,
        "steps": steps(&diagnosis.ladder),
        "effects": effects,
        "candidates": candidates,
        "parameters_off_nominal": off,
        "unexplained": unexplained,
        "data": study.notes(),
        "where": regions(study),
        "with_nominal_parameters": held.map(|answer| {
            json!({
                "verdict": answer.diagnosis.verdict,
                "steps": steps(&answer.diagnosis.ladder),
                "effects": answer.diagnosis.effects.iter().map(|found| {
                    let parameters = &answer.problem.candidates[found.candidate].parameters;
                    let values = parameters.iter().zip(&found.estimates);
                    let estimates: Vec<Value> = values
                        .map(|(p, value)| json!({"name": p.symbol, "value": value, "std": null, "unit": p.unit}))
                        .collect();
                    json!({"kind": found.effect.kind, "at": found.effect.at, "estimates": estimates})
                }).collect::<Vec<_>>(),
            })
        }),
    })
}

/// The ladder as scripts read it.
fn steps(ladder: &[Rung]) -> Vec<Value> {
    let step = |rung: &Rung| {
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

/// An estimate of a found effect.
struct Estimate {
    name: String,
    value: f64,
    std: Option<f64>,
    unit: String,
}

/// Unit of a constant of a found effect at its places.
fn unit_of_constant(study: &Study, found: &FoundEffect, name: &str) -> String {
    let candidates = &study.answer.candidates;
    let kind = (candidates.kinds.iter()).find(|kind| kind.name == found.effect.kind);
    let constant = kind.and_then(|kind| kind.constants.iter().find(|one| one.symbol == name));
    let mut spots = candidates.singles.iter().flat_map(|single| &single.spots);
    let spot = spots.find(|spot| found.effect.at.contains(&spot.name));
    let units = constant.zip(spot).and_then(|(constant, spot)| {
        let mut units = constant.units.iter();
        units.find(|(carries, _)| *carries == spot.carries)
    });
    units.map_or_else(String::new, |(_, unit)| unit.clone())
}

/// Estimates of an effect with their deviations, from identification with everything that was found; where the model with
/// the effects cannot say them apart, those of the search.
fn estimates(study: &Study, found: &FoundEffect) -> Vec<Estimate> {
    let parameters = &study.answer.problem.candidates[found.candidate].parameters;
    let of_search = parameters
        .iter()
        .zip(&found.estimates)
        .map(|(p, value)| Estimate {
            name: p.symbol.clone(),
            value: *value,
            std: None,
            unit: p.unit.clone(),
        });
    let mut all: Vec<Estimate> = of_search.collect();
    all.extend(found.constants.iter().map(|(name, value)| Estimate {
        name: name.clone(),
        value: *value,
        std: None,
        unit: unit_of_constant(study, found, name),
    }));
    let is_its =
        |entry: &&NewEffect| entry.kind == found.effect.kind && entry.at == found.effect.at;
    if let Some(entry) = study.entries.iter().find(is_its) {
        for estimate in &mut all {
            // What is held at zero, since its sign would make no sense, stays there.
            if estimate.value == 0.0 {
                continue;
            }
            if let Some(p) = identified(study, entry, &estimate.name) {
                estimate.value = p.value;
                estimate.std = p.std;
            } else if let Some((_, constant)) = estimate.name.clone().split_once('*') {
                // A product of a parameter and a constant is told as the constant.
                let known = entry
                    .constants
                    .iter()
                    .find(|(symbol, _)| symbol == constant);
                if let Some((_, value)) = known {
                    estimate.value = *value;
                    constant.clone_into(&mut estimate.name);
                }
            }
        }
    }
    all
}

/// The identified parameter of an added effect, if the model with the effects has it by itself.
fn identified<'a>(study: &'a Study, entry: &NewEffect, symbol: &str) -> Option<&'a FitParameter> {
    let after = study.after.as_ref().ok()?;
    let fit = &after.identified.as_ref()?.fit;
    let derivation = &after.model.derivation;
    let mechanism = &derivation.mechanism;
    let place = study.entries.iter().position(|one| one == entry)?;
    let first = mechanism.effects.len().checked_sub(study.entries.len())?;
    let effect = mechanism.effects.get(first + place)?;
    let term = (effect.kind == entry.kind)
        .then(|| effect.terms.iter().find(|term| term.symbol == symbol))??;
    let reduction = &derivation.reduction;
    let k = reduction
        .retained
        .iter()
        .position(|k| reduction.products[*k].0 == [(term.parameter.0, 1)])?;
    fit.parameters
        .get(k)
        .filter(|p| p.status == Status::Identified)
}

/// Which experiment tells an effect from its doubles, as the library says.
fn separate_by(study: &Study, found: &FoundEffect) -> Option<String> {
    if found.indistinguishable_from.is_empty() {
        return None;
    }
    let kinds = &study.answer.candidates.kinds;
    let kind = kinds.iter().find(|kind| kind.name == found.effect.kind)?;
    (!kind.doubles.is_empty()).then(|| kind.doubles.clone())
}

/// The command that computes such an experiment. What only moves forces in time has no force of its own to be made large.
fn separate_command(study: &Study, found: &FoundEffect, args: &AskArgs) -> Option<String> {
    let is_force = |effect: &&Effect| {
        let kinds = study.answer.candidates.kinds.iter();
        let mut kind = kinds.filter(|kind| kind.name == effect.kind);
        kind.all(|kind| kind.mechanics != Some(Mechanics::Delay))
    };
    let rivals = found.indistinguishable_from.iter().filter(is_force);
    let rivals: Vec<Effect> = rivals.cloned().collect();
    if rivals.is_empty() || !is_force(&&found.effect) {
        return None;
    }
    let values = estimates(study, found).into_iter();
    let values = values.filter(|e| !e.name.contains('*') && e.value.is_finite());
    let effect = (
        &found.effect,
        values.map(|e| (e.name, e.value)).collect::<Vec<_>>(),
    );
    let others = (study.answer.diagnosis.effects.iter())
        .filter(|other| other.effect != found.effect && is_force(&&other.effect));
    let beside: Vec<NamedEffect<'_>> = others
        .map(|other| (&other.effect, other.constants.clone()))
        .collect();
    let mut more = String::new();
    let noise = &study.answer.problem.noise;
    let squares: f64 = noise.iter().map(|n| n * n).sum();
    let noise = (squares / noise.len().max(1) as f64).sqrt();
    if noise > 0.0 && noise.is_finite() {
        let _ = write!(more, " --noise {}", significant(noise, 3));
    }
    // Recordings that need more than other names for their columns cannot be compared with there.
    let preparation = &args.preparation;
    let plain = PreparationArgs {
        map: preparation.map.clone(),
        ..PreparationArgs::none()
    };
    if *preparation == plain {
        for path in &args.data {
            let _ = write!(more, " --data {}", quoted(&path.display().to_string()));
        }
        for (ours, theirs) in &preparation.map {
            let _ = write!(more, " --map {}", quoted(&format!("{ours}={theirs}")));
        }
    }
    let model = args.model.display().to_string();
    Some(added::separating(&model, &effect, &rivals, &beside, &more))
}

/// The model with all that was found, or as it is.
fn last(study: &Study) -> &Version {
    study.after.as_ref().unwrap_or(&study.before)
}

/// Base parameters of the bodies that are not what the file says, with the nominal value and the distance in deviations.
fn off_nominal(version: &Version) -> Vec<(&FitParameter, f64, f64)> {
    let Some(identified) = &version.identified else {
        return Vec::new();
    };
    let parameters = identified.fit.parameters.iter().enumerate();
    let mut off: Vec<(&FitParameter, f64, f64)> = parameters
        .filter(|(k, p)| p.status == Status::Identified && !version.model.is_effect(*k))
        .filter_map(|(_, p)| {
            let (nominal, std) = (p.nominal?, p.std?);
            let sigmas = (p.value - nominal).abs() / std;
            let is_off =
                std > 0.0 && sigmas > SIGMAS && (p.value - nominal).abs() > OFF * nominal.abs();
            is_off.then_some((p, nominal, sigmas))
        })
        .collect();
    off.sort_by(|a, b| b.2.total_cmp(&a.2));
    off
}

/// Where the error sits that matters: what is left unexplained, or that of the model as it is.
fn regions(study: &Study) -> Vec<Region> {
    let diagnosis = &study.answer.diagnosis;
    if diagnosis.verdict != Verdict::Unexplained {
        return study.places.regions.clone();
    }
    let channels = &study.answer.problem.layout.channels;
    let left = study.left.as_ref().unwrap_or(&study.places);
    let mut regions = Vec::new();
    for d in &diagnosis.unexplained {
        let of_channel = left.regions.iter().filter(|r| r.channel == channels[*d]);
        let before = regions.len();
        regions.extend(of_channel.cloned());
        if regions.len() == before {
            regions.push(everywhere(study, *d));
        }
    }
    regions
}

/// A channel whose error sits nowhere in particular.
fn everywhere(study: &Study, channel: usize) -> Region {
    let name = study.answer.problem.layout.channels[channel].clone();
    let version = last(study);
    let judged = version.judged();
    let times = judged.iter().flat_map(|k| &version.runs[*k].time);
    let range = times.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], t| {
        [low.min(*t), high.max(*t)]
    });
    let again = 100.0 * study.answer.diagnosis.reproducible[channel];
    Region {
        says: format!(
            "what is left of {name} is spread over all of the time, and {again:.0} % of its square comes again with the state"
        ),
        channel: name,
        variable: modelmill_identify::TIME_COLUMN.to_owned(),
        range,
        share: 1.0,
        samples: 1.0,
    }
}

/// The answer for people.
fn text(study: &Study, held: Option<&Answer>, args: &AskArgs) -> Vec<String> {
    let model = &args.model.display().to_string();
    let style = terminal::style();
    let diagnosis = &study.answer.diagnosis;
    let channels = &study.answer.problem.layout.channels;
    let verdict = words::verdict(diagnosis, channels, study.judged);
    let mut lines: Vec<String> = (words::lines(&verdict, 100).iter())
        .map(|line| style.bold(line))
        .collect();
    lines.push(String::new());
    lines.push(style.bold("the ladder: relative error, step by step"));
    let rows: Vec<Vec<String>> = (diagnosis.ladder.iter())
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
            ("step", Align::Left),
            ("fit", Align::Right),
            (study.judged.short(), Align::Right),
        ],
        &rows,
    ));
    lines.push(format!("  {}", words::floor(diagnosis)));
    found(study, args, &mut lines);
    lines.push(String::new());
    lines.push(style.bold(if diagnosis.verdict == Verdict::Unexplained {
        "where what is left sits"
    } else {
        "where the error of the model as it is sits"
    }));
    let places = regions(study);
    lines.extend(places.iter().map(|region| format!("  {}.", region.says)));
    if places.is_empty() {
        lines.push("  No region of coordinates, rates, loads or time stands out.".to_owned());
    }
    refused(study, &mut lines);
    off(study, held, &mut lines);
    if !study.entries.is_empty() {
        lines.push(String::new());
        lines.push(style.bold("how to go on"));
        for entry in &study.entries {
            lines.push(format!("  {}", added::command(model, entry)));
        }
    }
    if let Err(says) = &study.after
        && !says.is_empty()
    {
        lines.push(format!(
            "  The model with what was found cannot be made: {says}"
        ));
    }
    lines
}

/// What was found, with values and doubles.
fn found(study: &Study, args: &AskArgs, lines: &mut Vec<String>) {
    let style = terminal::style();
    let diagnosis = &study.answer.diagnosis;
    if diagnosis.effects.is_empty() {
        return;
    }
    lines.push(String::new());
    lines.push(style.bold("what is missing"));
    for found in &diagnosis.effects {
        let values: Vec<String> = (estimates(study, found).iter())
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
        if let Some(kind) =
            (study.answer.candidates.kinds.iter()).find(|kind| kind.name == found.effect.kind)
        {
            lines.push(style.dim(&format!("    {}", kind.says)));
        }
        if !found.indistinguishable_from.is_empty() {
            lines.push(format!(
                "    These recordings cannot tell it from {}.",
                words::effects(&found.indistinguishable_from)
            ));
            if let Some(says) = separate_by(study, found) {
                let wrapped = words::lines(&says, 96);
                lines.extend(wrapped.iter().map(|line| style.dim(&format!("    {line}"))));
            }
            if let Some(command) = separate_command(study, found, args) {
                lines.push("    Motion that tells them apart is sought by".to_owned());
                lines.push(format!("      {command}"));
            }
        }
    }
}

/// The best of what was refused, with the reason.
fn refused(study: &Study, lines: &mut Vec<String>) {
    let candidates = study.answer.diagnosis.candidates.iter();
    let rows: Vec<Vec<String>> = candidates
        .filter_map(|c| {
            let why = c.refused.clone()?;
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
        .take(NAMED)
        .collect();
    if rows.is_empty() {
        return;
    }
    lines.push(String::new());
    lines.push(terminal::style().bold("what was considered and refused"));
    lines.extend(table(
        2,
        &[
            ("candidate", Align::Left),
            ("explains alone", Align::Right),
            ("refused because", Align::Left),
        ],
        &rows,
    ));
}

/// Parameters that differ from what the file says.
fn off(study: &Study, held: Option<&Answer>, lines: &mut Vec<String>) {
    let off = off_nominal(last(study));
    if off.is_empty() {
        return;
    }
    let rows: Vec<Vec<String>> = (off.iter())
        .map(|(p, nominal, sigmas)| {
            vec![
                p.name.clone(),
                number(*nominal),
                number(p.value),
                significant(*sigmas, 2),
                p.unit.clone(),
                p.expression.clone(),
            ]
        })
        .collect();
    lines.push(String::new());
    lines.push(terminal::style().bold("base parameters off their nominal values"));
    lines.extend(table(
        2,
        &[
            ("", Align::Left),
            ("nominal", Align::Right),
            ("identified", Align::Right),
            ("sigmas", Align::Right),
            ("unit", Align::Left),
            ("", Align::Left),
        ],
        &rows,
    ));
    lines.push(
        "  They make up for what the nominal values lack, such as a payload or a misplaced mass."
            .to_owned(),
    );
    let Some(answer) = held else { return };
    let channels = &answer.problem.layout.channels;
    let says = words::verdict(&answer.diagnosis, channels, study.judged);
    let says = format!("With all parameters held at their nominal values: {says}");
    lines.extend(
        words::lines(&says, 98)
            .iter()
            .map(|line| format!("  {line}")),
    );
    lines.push("  (--held tells more.)".to_owned());
}
