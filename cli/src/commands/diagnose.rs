//! `diagnose`: which effect is missing.

use modelmill_identify::diagnose::{Diagnosis, Problem};
use serde_json::json;

use crate::args::DiagnoseArgs;
use crate::data::{self, Data};
use crate::diagnosis::{self, Held};
use crate::failure::Outcome;
use crate::model;
use crate::suspects;
use crate::terminal;

/// Prints what is missing, or that nothing is, or that nothing known explains it.
pub(crate) fn run(args: &DiagnoseArgs) -> Outcome {
    let loaded = model::load(&args.model)?;
    let model = model::derive_loaded(&args.model.display().to_string(), &loaded)?;
    let mut fit = data::read_all(&model, &args.data, &args.preparation)?;
    let mut check = data::read_all(&model, &args.check, &args.preparation)?;
    data::note_twins(&mut fit, &mut check);
    suspects::examine(&model, &mut fit);
    suspects::examine(&model, &mut check);
    let held = if args.held { Held::All } else { Held::Known };
    let answer = diagnosis::find(
        &args.model,
        &loaded,
        model::libraries(),
        &model,
        &fit,
        &check,
        held,
    )?;
    let (problem, diagnosis) = (&answer.problem, &answer.diagnosis);
    if args.json {
        return terminal::print_json(&report(problem, diagnosis, &fit, &check));
    }
    let object = report(problem, diagnosis, &fit, &check);
    terminal::print(&[format!("{object:#}")].join("\n"))
}

fn report(
    problem: &Problem,
    diagnosis: &Diagnosis,
    fit: &[Data],
    check: &[Data],
) -> serde_json::Value {
    let steps: Vec<_> = diagnosis
        .ladder
        .iter()
        .map(|rung| {
            json!({
                "added": rung.added.first(),
                "also": rung.added.get(1..),
                "dropped": rung.dropped,
                "fit": rung.fit,
                "check": rung.check,
                "gain": rung.evidence.map(|e| e.gain),
                "evidence": rung.evidence,
            })
        })
        .collect();
    let effects: Vec<_> = diagnosis
        .effects
        .iter()
        .map(|found| {
            let parameters = &problem.candidates[found.candidate].parameters;
            let estimates: Vec<_> = parameters
                .iter()
                .zip(&found.estimates)
                .map(|(p, value)| json!({"name": p.symbol, "value": value, "unit": p.unit}))
                .collect();
            json!({
                "kind": found.effect.kind,
                "at": found.effect.at,
                "constants": found.constants,
                "estimates": estimates,
                "indistinguishable_from": found.indistinguishable_from,
            })
        })
        .collect();
    let candidates: Vec<_> = diagnosis
        .candidates
        .iter()
        .map(|c| {
            json!({"kind": c.effect.kind, "at": c.effect.at, "explained": c.explained, "gain": c.gain, "refused": c.refused})
        })
        .collect();
    let notes: Vec<_> = fit.iter().chain(check).flat_map(Data::notes).collect();
    json!({
        "verdict": diagnosis.verdict,
        "noise_floor": diagnosis.noise_floor,
        "steps": steps,
        "effects": effects,
        "candidates": candidates,
        "reproducible": diagnosis.reproducible,
        "data": notes,
    })
}
