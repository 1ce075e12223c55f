//! `report`: what a model lacks, as one self-contained page.

use crate::args::ReportArgs;
use crate::failure::Outcome;
use crate::output;
use crate::report::{self, words};
use crate::terminal;

/// Name of the page in its folder.
pub(crate) const PAGE: &str = "report.html";

/// Diagnoses and writes the page.
pub(crate) fn run(args: &ReportArgs) -> Outcome {
    output::make_folder(&args.out)?;
    let study = report::ask(&args.ask)?;
    let drives = study.before.model.drives();
    let path = args.out.join(PAGE);
    output::write(&path, &report::render(&study))?;
    let says = words::verdict(&study.answer.diagnosis, &drives, study.judged);
    terminal::print(&format!(
        "{}\n\nThe page is {}.",
        words::lines(&says, 100).join("\n"),
        path.display()
    ))
}
