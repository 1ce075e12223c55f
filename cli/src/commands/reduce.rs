//! `reduce`: a full-body rig to a planar model, with the size of every approximation.

use std::fmt::Write as _;
use std::path::Path;

use modelmill_codegen::{Evaluator, States};
use modelmill_reduction::{Reduction, Report, sampled_forces};
use modelmill_rig::{Rig, State};
use serde_json::{Value, json};

use crate::args::ReduceArgs;
use crate::commands::simulate;
use crate::failure::{Failure, Outcome};
use crate::output::Target;
use crate::progress::watched;
use crate::terminal;

/// Poses at which the model is held against the rig, and how far from nominal, rad or m.
const POSES: (usize, f64) = (100, 0.2);

/// Writes the model file and prints the report.
pub(crate) fn run(args: &ReduceArgs) -> Outcome {
    let loaded = simulate::load(&args.rig)?;
    let rendered = |failure: modelmill_spec::Failure| {
        Failure::Rendered(failure.render(terminal::errors_in_colour()))
    };
    let plan = match &args.plan {
        Some(path) => modelmill_reduction::plan_file(path).map_err(rendered)?,
        None => modelmill_reduction::plan_for(&loaded.rig)
            .map_err(|says| Failure::Input(format!("{}: {says}", args.rig.display())))?,
    };
    let mut inputs: Vec<&Path> = loaded.sources.paths().collect();
    inputs.extend(args.plan.as_deref());
    let target = Target::new(&args.out, inputs)?;
    let rig = plan.rig(&loaded.rig);
    let reduction = watched(&format!("reducing {}", rig.name), 0, |_| {
        modelmill_reduction::reduce(rig, &plan)
    })
    .map_err(|failure| match args.plan {
        Some(_) => rendered(failure),
        None => Failure::Rendered(format!(
            "{}\nnote: no plan was given, so that every body became a part of its own; a plan (--plan) can make one \
             part of bodies that move alike, such as parallel cranks, whose joints are redundant",
            failure.render(terminal::errors_in_colour()).trim_end()
        )),
    })?;
    let forces = watched("holding the model against the rig", 0, |_| {
        compare(rig, &reduction)
    })?;
    target.write(&reduction.model)?;
    if args.json {
        return terminal::print_json(&json!({
            "rig": rig.name,
            "out": args.out.display().to_string(),
            "findings": findings(&reduction.report),
            "forces": forces.iter().map(|f| json!({ "drive": f.drive, "nrms": f.nrms })).collect::<Vec<_>>(),
            "poses": POSES.0,
        }));
    }
    let mut text = reduction.report.text();
    text.push_str("Price - forces of the model against those of the rig, relative\n");
    for one in &forces {
        let _ = writeln!(text, "  {:<16}{:.1e}", one.drive, one.nrms);
    }
    terminal::print(&text)?;
    terminal::note(&format!(
        "{}: a model of {}",
        target.path().display(),
        rig.name
    ));
    Ok(())
}

fn findings(report: &Report) -> Vec<Value> {
    let findings = report.findings.iter();
    findings
        .map(|finding| {
            let sizes: Vec<Value> = finding
                .sizes
                .iter()
                .map(|size| json!({ "of": size.of, "value": size.value, "unit": size.unit, "is_felt": size.is_felt() }))
                .collect();
            json!({ "step": finding.step, "about": finding.about, "says": finding.says, "sizes": sizes })
        })
        .collect()
}

/// How far the forces of a drive are from the rig's.
struct Compared {
    drive: String,
    nrms: f64,
}

/// The model's forces with its nominal values against the rig's own: two programs that share no mechanics.
fn compare(rig: &Rig, reduction: &Reduction) -> Outcome<Vec<Compared>> {
    let none = &mut |_: &Path| Err(std::io::Error::other("nothing is extended"));
    let loaded = modelmill_spec::load("the reduced model", &reduction.model, none)
        .map_err(|failure| Failure::Rendered(failure.render(terminal::errors_in_colour())))?;
    let derivation = modelmill_codegen::derive(&loaded.mechanism)
        .map_err(|error| Failure::Input(format!("the reduced model: {error}")))?;
    let mechanism = &derivation.mechanism;
    let sampled = sampled_forces(rig, POSES.0, POSES.1).map_err(Failure::input)?;
    // Coordinates and drives by name: their order in the model may be another.
    let active = mechanism
        .coordinates
        .iter()
        .filter(|coordinate| !coordinate.passive);
    let order: Vec<usize> = active
        .filter_map(|c| {
            rig.coordinates
                .iter()
                .position(|known| known.name == c.name)
        })
        .collect();
    let column = |of: fn(&State) -> &Vec<f64>| -> Vec<Vec<f64>> {
        order
            .iter()
            .map(|k| sampled.iter().map(|(state, _)| of(state)[*k]).collect())
            .collect()
    };
    let (q, qd, qdd) = (column(|s| &s.q), column(|s| &s.qd), column(|s| &s.qdd));
    let truth: Vec<Vec<f64>> = mechanism
        .drives
        .iter()
        .filter_map(|drive| rig.drives.iter().position(|known| known.name == drive.name))
        .map(|d| sampled.iter().map(|(_, forces)| forces[d]).collect())
        .collect();
    let states = States {
        q: slices(&q),
        qd: slices(&qd),
        qdd: slices(&qdd),
        load: slices(&truth),
    };
    let model = Evaluator::new(&derivation)
        .inverse_dynamics(&states, &derivation.nominal_base_values())
        .map_err(|fault| {
            Failure::Input(format!(
                "the reduced model does not follow the rig: {fault}"
            ))
        })?;
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>().sqrt();
    Ok(mechanism
        .drives
        .iter()
        .zip(model.iter().zip(&truth))
        .map(|(drive, (model, truth))| Compared {
            drive: drive.name.clone(),
            nrms: norm(&mut model.iter().zip(truth).map(|(x, y)| x - y))
                / norm(&mut truth.iter().copied()),
        })
        .collect())
}

fn slices(columns: &[Vec<f64>]) -> Vec<&[f64]> {
    columns.iter().map(Vec::as_slice).collect()
}
