//! `diagnose`: which effect is missing, and what speaks for it.

use modelmill::Host;
use modelmill::diagnose::DiagnosisOptions;

use crate::args::DiagnoseArgs;
use crate::commands;
use crate::failure::CommandOutcome;
use crate::flags::CommandLineSpelling;
use crate::terminal;

/// Prints what is missing, or that nothing is, or that nothing known explains it.
pub(crate) fn run(host: &Host, args: &DiagnoseArgs) -> CommandOutcome {
    let flags = CommandLineSpelling::from_args(&args.diagnosis);
    let question = DiagnosisOptions {
        fixed: args.diagnosis.fixed_parameters(),
        ..DiagnosisOptions::default()
    };
    let findings = commands::diagnose(host, &args.diagnosis, question)?;
    if args.json {
        return terminal::print_json(&findings.json(&flags));
    }
    terminal::print(&findings.text(terminal::style(), &flags).join("\n"))
}
