//! `report`: what a model lacks, as one self-contained page.

use std::path::Path;

use crate::args::ReportArgs;
use crate::data;
use crate::diagnosis::Held;
use crate::failure::{Failure, Outcome};
use crate::model::{self, Model};
use crate::output;
use crate::report::{self, Question, words};
use crate::suspects;
use crate::terminal;

/// Name of the page in its folder.
pub(crate) const PAGE: &str = "report.html";

/// Diagnoses and writes the page.
pub(crate) fn run(args: &ReportArgs) -> Outcome {
    make_folder(&args.out)?;
    let loaded = model::load(&args.model)?;
    let model = model::derive_loaded(&args.model.display().to_string(), &loaded)?;
    let read = |model: &Model| -> Outcome<[Vec<data::Data>; 2]> {
        let mut fit = data::read_all(model, &args.data, &args.preparation)?;
        let mut check = data::read_all(model, &args.check, &args.preparation)?;
        data::note_twins(&mut fit, &mut check);
        Ok([fit, check])
    };
    let [mut fit, mut check] = read(&model)?;
    suspects::examine(&model, &mut fit);
    suspects::examine(&model, &mut check);
    let drives = model.drives();
    let study = report::study(Question {
        path: &args.model,
        loaded: &loaded,
        libraries: model::libraries(),
        model,
        fit,
        check,
        held: if args.held { Held::All } else { Held::Known },
        again: &read,
        recordings: recordings(args),
    })?;
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

/// The recordings as the command line has them.
fn recordings(args: &ReportArgs) -> String {
    let named = |option: &str, paths: &[std::path::PathBuf]| -> Vec<String> {
        let path = |p: &std::path::PathBuf| {
            format!(
                "{option} {}",
                report::added::quoted(&p.display().to_string())
            )
        };
        paths.iter().map(path).collect()
    };
    let mut all = named("--data", &args.data);
    all.extend(named("--check", &args.check));
    all.join(" ")
}
