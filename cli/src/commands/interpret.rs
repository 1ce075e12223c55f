//! `interpret`: physical parameters from identified base parameters, the others held at their nominal values.

use modelmill::Host;

use crate::args::InterpretArgs;
use crate::failure::CommandOutcome;
use crate::flags::FlagSpelling;
use crate::{commands, terminal};

/// Solves, and prints the solutions or what is not determined.
pub(crate) fn run(host: &Host, args: &InterpretArgs) -> CommandOutcome {
    let model = commands::model(host, &args.model)?;
    let fit = host.fit(&args.fit)?;
    let found = model.interpret(&fit, &args.fit.display().to_string(), &args.unknown)?;
    if args.json {
        return terminal::print_json(&found.json());
    }
    terminal::print(&found.text(terminal::style(), &FlagSpelling))
}
