//! `reduce`: reduces a full-body rig to a planar model and reports the size of every approximation.

use std::path::Path;

use modelmill::Host;

use crate::args::ReduceArgs;
use crate::failure::CommandOutcome;
use crate::output::OutputFile;
use crate::terminal;

/// Writes the model file and prints the report.
pub(crate) fn run(host: &Host, args: &ReduceArgs) -> CommandOutcome {
    let loaded = host.rig(&args.rig)?;
    let mut inputs: Vec<&Path> = loaded.sources.paths().collect();
    inputs.extend(args.plan.as_deref());
    let target = OutputFile::new(&args.out, inputs)?;
    let reduced = host.reduce(&args.rig, args.plan.as_deref())?;
    // The model is written before the report, so that it exists even if standard output is closed.
    target.write(&reduced.reduction.model)?;
    if args.json {
        return terminal::print_json(&reduced.json(&args.out.display().to_string()));
    }
    terminal::print(&reduced.text())?;
    terminal::note(&format!("{}: a model of {}", target.path().display(), reduced.rig));
    Ok(())
}
