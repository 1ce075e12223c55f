//! `report`: what a model lacks, as one self-contained page.

use std::path::Path;

use crate::args::ReportArgs;
use crate::failure::{Failure, Outcome};
use crate::output;
use crate::report::{self, words};
use crate::terminal;

/// Name of the page in its folder.
pub(crate) const PAGE: &str = "report.html";

/// Diagnoses and writes the page.
pub(crate) fn run(args: &ReportArgs) -> Outcome {
    make_folder(&args.out)?;
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

/// Makes the folder that the page goes to.
pub(crate) fn make_folder(folder: &Path) -> Outcome {
    std::fs::create_dir_all(folder).map_err(|error| {
        Failure::Input(format!(
            "the folder {} cannot be made: {error}; give another one with --out",
            folder.display()
        ))
    })
}
