//! `diagnose`: which effect the model lacks, and the evidence for it.

use modelmill::Host;
use modelmill::diagnose::DiagnosisOptions;

use crate::args::DiagnoseArgs;
use crate::commands;
use crate::failure::CommandOutcome;
use crate::flags::CommandLineSpelling;
use crate::terminal;

/// Prints the missing effects, or that none is missing, or that no known effect explains the error.
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
