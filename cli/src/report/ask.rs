//! A study from the command line: model and recordings are read, examined, and diagnosed.

use std::path::PathBuf;

use crate::args::AskArgs;
use crate::data::{self, Data};
use crate::diagnosis::Held;
use crate::failure::Outcome;
use crate::model::{self, Model};
use crate::suspects;

use super::added::quoted;
use super::{Question, Study, study};

/// Diagnoses what the command line names.
pub(crate) fn ask(args: &AskArgs) -> Outcome<Study> {
    let loaded = model::load(&args.model)?;
    let model = model::derive_loaded(&args.model.display().to_string(), &loaded)?;
    let read = |model: &Model| -> Outcome<[Vec<Data>; 2]> {
        let mut fit = data::read_all(model, &args.data, &args.preparation)?;
        let mut check = data::read_all(model, &args.check, &args.preparation)?;
        data::note_twins(&mut fit, &mut check);
        Ok([fit, check])
    };
    let [mut fit, mut check] = read(&model)?;
    suspects::examine(&model, &mut fit);
    suspects::examine(&model, &mut check);
    study(Question {
        path: &args.model,
        loaded: &loaded,
        libraries: model::libraries(),
        model,
        fit,
        check,
        held: if args.held { Held::All } else { Held::Known },
        again: &read,
        recordings: recordings(args),
    })
}

/// The recordings as the command line has them.
fn recordings(args: &AskArgs) -> String {
    let named = |option: &str, paths: &[PathBuf]| -> Vec<String> {
        let path = |p: &PathBuf| format!("{option} {}", quoted(&p.display().to_string()));
        paths.iter().map(path).collect()
    };
    let mut all = named("--data", &args.data);
    all.extend(named("--check", &args.check));
    all.join(" ")
}
