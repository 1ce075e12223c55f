//! `diagnose`: which effect is missing, and what speaks for it.

use modelmill::Host;
use modelmill::diagnose::Question;

use crate::args::DiagnoseArgs;
use crate::commands;
use crate::failure::Outcome;
use crate::flags::CommandLineSpelling;
use crate::terminal;

/// Prints what is missing, or that nothing is, or that nothing known explains it.
pub(crate) fn run(host: &Host, args: &DiagnoseArgs) -> Outcome {
    let flags = CommandLineSpelling::from_args(&args.ask);
    let question = Question {
        held: args.ask.held(),
        ..Question::default()
    };
    let findings = commands::diagnose(host, &args.ask, question)?;
    if args.json {
        return terminal::print_json(&findings.json(&flags));
    }
    terminal::print(&findings.text(terminal::style(), &flags).join("\n"))
}
