//! `reduce`: reduces a full-body rig to a planar model and reports the size of every approximation.

use std::path::Path;

use modelmill::Host;
use modelmill::reduce::RigReductionOptions;

use crate::args::ReduceArgs;
use crate::failure::{CommandFailure, CommandOutcome};
use crate::output::{OutputFile, OutputSet};
use crate::{commands, terminal};

/// Writes the model file and prints the report; or proposes a plan.
pub(crate) fn run(host: &Host, args: &ReduceArgs) -> CommandOutcome {
    let loaded = host.rig_or_description(&args.rig)?;
    let options = RigReductionOptions {
        plan: args.plan.as_deref(),
        gap_tolerance: args.tolerance,
    };
    commands::print_remarks(&loaded);
    let mut inputs: Vec<&Path> = loaded.sources.paths().collect();
    inputs.extend(args.plan.as_deref());
    let target = args
        .out
        .as_deref()
        .map(|out| OutputFile::new(out, inputs.iter().copied()))
        .transpose()?;
    if let Some(propose) = &args.propose {
        let plan = OutputFile::for_flag("--propose", propose, inputs)?;
        if let Some(target) = &target {
            OutputFile::refuse_equal([("--propose", &plan), ("--out", target)])?;
        }
        return write_proposal(host, args, &options, &plan, target.as_ref());
    }
    let Some(target) = target else {
        return Err(CommandFailure::Usage("--out or --propose is needed".to_owned()));
    };
    let reduced = host.reduce(&args.rig, &options)?;
    // The model is written before the report, so that it exists even if standard output is closed.
    target.write(&reduced.reduction.model)?;
    if args.json {
        return terminal::print_json(&reduced.json(&target.path().display().to_string()));
    }
    terminal::print(&reduced.text())?;
    terminal::note(&format!("{}: a model of {}", target.path().display(), reduced.rig));
    Ok(())
}

/// Writes a proposed plan, and its model if requested.
fn write_proposal(
    host: &Host,
    args: &ReduceArgs,
    options: &RigReductionOptions<'_>,
    plan: &OutputFile,
    target: Option<&OutputFile>,
) -> CommandOutcome {
    let proposed = host.propose_plan(&args.rig, options)?;
    // A plan beside the model of another one would mislead, so both are replaced or none.
    let mut outputs = OutputSet::default();
    outputs.add(plan, proposed.plan.as_str());
    if let Some(target) = target {
        outputs.add(target, proposed.reduced.reduction.model.as_str());
    }
    outputs.write()?;
    let name = |file: &OutputFile| file.path().display().to_string();
    if args.json {
        return terminal::print_json(&proposed.json(&name(plan), target.map(name).as_deref()));
    }
    terminal::print(&proposed.text())?;
    let rig = &proposed.reduced.rig;
    terminal::note(&format!(
        "{}: a plan for {rig}; edit it, then use it with --plan",
        name(plan)
    ));
    if let Some(target) = target {
        terminal::note(&format!("{}: a model of {rig}", name(target)));
    }
    Ok(())
}
