//! `report`: writes a diagnosis as one self-contained page.

use modelmill::text::wrap::wrap_words;
use std::path::PathBuf;

use modelmill::Host;
use modelmill::diagnose::DiagnosisOptions;
use modelmill::report::page;

use crate::args::ReportArgs;
use crate::commands;
use crate::failure::CommandOutcome;
use crate::flags::CommandLineWording;
use crate::output::{self, OutputFile};
use crate::terminal;

/// Name of the page in its folder.
pub(crate) const PAGE: &str = "report.html";

/// Runs the diagnosis, writes the page and prints the verdict.
pub(crate) fn run(host: &Host, args: &ReportArgs) -> CommandOutcome {
    output::make_folder(&args.out)?;
    let path = args.out.join(PAGE);
    let ask = &args.diagnosis;
    // The page must not be written over an input.
    let inputs = [&ask.model].into_iter().chain(&ask.data).chain(&ask.check);
    let target = OutputFile::new(&path, inputs.map(PathBuf::as_path))?;
    let question = DiagnosisOptions {
        fixed: args.diagnosis.fixed_parameters(),
        repeat_with_nominal: false,
    };
    let findings = commands::diagnose(host, &args.diagnosis, question)?;
    target.write(&page(&findings, &CommandLineWording::from_args(&args.diagnosis))?)?;
    let says = findings.verdict_text();
    terminal::print(&format!(
        "{}\n\nThe page is {}.",
        wrap_words(&says, 100).join("\n"),
        path.display()
    ))
}
