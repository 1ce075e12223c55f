//! `excite`: the periodic trajectory that tells the base parameters apart best, eq. (14), (15) and (17), or that tells an
//! effect from what it may be taken for.

use std::path::PathBuf;

use modelmill::Host;
use modelmill::excite::{Criterion, Options, Request};
use modelmill::text::table::count;

use crate::args::{CriterionArg, ExciteArgs};
use crate::failure::{Failure, Outcome};
use crate::flags::FlagSpelling;
use crate::output::Target;
use crate::{commands, terminal};

/// Searches, and writes the trajectory and its picture.
pub(crate) fn run(host: &Host, args: &ExciteArgs) -> Outcome {
    let model = args
        .parameters
        .in_model(host, commands::model(host, &args.model)?)?;
    let target = Target::new(&args.out, model.files())?;
    let figure = Target::new(&figure_path(args), model.files())?;
    if figure.path() == target.path() {
        return Err(Failure::Usage(
            "--out and --figure name the same file; the trajectory is CSV, the picture SVG"
                .to_owned(),
        ));
    }
    let data = commands::recordings(&model, &args.separate.data, &args.separate.reading())?;
    let found = model.excite(&args.request(), &data.iter().collect::<Vec<_>>())?;
    target.write(&found.csv())?;
    figure.write(&found.picture)?;
    if args.json {
        terminal::print_json(&found.json())?;
    } else {
        terminal::print(&found.text(terminal::style(), &FlagSpelling))?;
    }
    terminal::note(&format!(
        "{}: one period, {}; {} shows it",
        target.path().display(),
        count(found.time.len(), "sample", "samples"),
        figure.path().display()
    ));
    Ok(())
}

/// Where the picture goes: beside the trajectory if nothing is said.
fn figure_path(args: &ExciteArgs) -> PathBuf {
    args.figure
        .clone()
        .unwrap_or_else(|| args.out.with_extension("svg"))
}

impl ExciteArgs {
    fn request(&self) -> Request {
        Request {
            options: Options {
                harmonics: self.harmonics,
                period: self.period,
                criterion: match self.criterion {
                    CriterionArg::Condition => Criterion::Condition,
                    CriterionArg::LogDet => Criterion::LogDet,
                },
                random: self.random,
                starts: self.starts,
                seed: self.seed,
                ..Options::default()
            },
            rate: self.rate,
            limits: self.limits.clone(),
            separate: self.separate.asked(),
        }
    }
}
