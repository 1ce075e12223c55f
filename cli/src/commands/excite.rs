//! `excite`: searches for the periodic trajectory that determines the base parameters best, eq. (14), (15) and (17), or
//! that distinguishes an effect from its alternatives.

use std::path::PathBuf;

use modelmill::Host;
use modelmill::excite::{ExcitationCriterion, ExcitationRequest, Options};
use modelmill::text::table::count;

use crate::args::{CriterionArg, ExciteArgs, PeriodArg};
use crate::failure::{CommandFailure, CommandOutcome};
use crate::flags::FlagWording;
use crate::output::{OutputFile, OutputSet};
use crate::{commands, terminal};

/// Searches for the trajectory, and writes it (CSV) and its picture (SVG).
pub(crate) fn run(host: &Host, args: &ExciteArgs) -> CommandOutcome {
    let model = args.parameters.apply_to(host, commands::model(host, &args.model)?)?;
    let target = OutputFile::new(&args.out, model.files())?;
    let figure = OutputFile::new(&figure_path(args), model.files())?;
    if figure.path() == target.path() {
        return Err(CommandFailure::Usage(
            "--out and --figure name the same file; the trajectory is CSV, the picture SVG".to_owned(),
        ));
    }
    // Recordings are needed only for --separate, to estimate effect and noise.
    let [data, _] = commands::recordings(&model, [&args.separate.data, &[]], &args.separate.reading())?;
    let found = model.excite(&args.request(), &data.iter().collect::<Vec<_>>())?;
    // Files are written before the text, so that they exist even if standard output is closed.
    let mut outputs = OutputSet::default();
    outputs.add(&target, found.csv());
    outputs.add(&figure, found.picture.as_str());
    outputs.write()?;
    if args.json {
        terminal::print_json(&found.json())?;
    } else {
        terminal::print(&found.text(terminal::style(), &FlagWording))?;
    }
    terminal::note(&format!(
        "{}: one period, {}; {} shows it",
        target.path().display(),
        count(found.time.len(), "sample", "samples"),
        figure.path().display()
    ));
    Ok(())
}

/// Path of the picture: `--figure`, or the path of the trajectory with the ending `.svg`.
fn figure_path(args: &ExciteArgs) -> PathBuf {
    args.figure.clone().unwrap_or_else(|| args.out.with_extension("svg"))
}

impl ExciteArgs {
    /// The same as a request of the library.
    fn request(&self) -> ExcitationRequest {
        let (period, period_range) = match self.period {
            PeriodArg::Fixed(period) => (period, None),
            PeriodArg::Searched(range) => (range[1], Some(range)),
        };
        // Clap has at least the default number; a number that is repeated is searched once.
        let (first, others) = self.harmonics.split_first().unwrap_or((&7, &[]));
        let mut other_harmonics: Vec<usize> = Vec::new();
        for harmonics in others {
            if harmonics != first && !other_harmonics.contains(harmonics) {
                other_harmonics.push(*harmonics);
            }
        }
        ExcitationRequest {
            options: Options {
                harmonics: *first,
                period,
                period_range,
                criterion: match self.criterion {
                    CriterionArg::Condition => ExcitationCriterion::Condition,
                    CriterionArg::LogDet => ExcitationCriterion::LogDet,
                },
                random: self.random,
                starts: self.starts,
                seed: self.seed,
                ..Options::default()
            },
            other_harmonics,
            rate: self.rate,
            limits: self.limits.clone(),
            separate: self.separate.separation_request(),
        }
    }
}
