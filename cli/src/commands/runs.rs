//! `runs`: what changed between recordings of one machine.

use modelmill::Host;

use crate::args::RunsArgs;
use crate::failure::Outcome;
use crate::{commands, terminal};

/// Prints what changed against the first run.
pub(crate) fn run(host: &Host, args: &RunsArgs) -> Outcome {
    let model = commands::model(host, &args.model)?;
    let data = commands::recordings(&model, &args.data, &args.preparation.reading())?;
    let found = model.runs(&data.iter().collect::<Vec<_>>())?;
    if args.json {
        return terminal::print_json(&found.json());
    }
    terminal::print(&found.text(terminal::style()))
}
