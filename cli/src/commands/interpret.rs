//! `interpret`: solves identified base parameters for physical parameters; the others are fixed at their nominal
//! values.

use modelmill::Host;

use crate::args::InterpretArgs;
use crate::failure::CommandOutcome;
use crate::flags::FlagWording;
use crate::{commands, terminal};

/// Prints all real solutions, or which of the unknowns are not determined.
pub(crate) fn run(host: &Host, args: &InterpretArgs) -> CommandOutcome {
    let model = commands::model(host, &args.model)?;
    let fit = host.fit(&args.fit)?;
    let found = model.interpret(&fit, &args.fit.display().to_string(), &args.unknown)?;
    if args.json {
        return terminal::print_json(&found.json());
    }
    terminal::print(&found.text(terminal::style(), &FlagWording))
}
