//! `experiment`: reproduces the paper's experiment on the bundled rig and writes one page.

use modelmill::Host;
use modelmill_paper_experiment::{ExperimentRequest, PaperExperiment};

use crate::args::ExperimentArgs;
use crate::failure::CommandOutcome;
use crate::output;
use crate::terminal;

/// Name of the page.
const PAGE: &str = "experiment.html";

/// Runs the experiment and writes the page.
pub(crate) fn run(host: &Host, args: &ExperimentArgs) -> CommandOutcome {
    output::make_folder(&args.out)?;
    // Excitation, simulation, identification and comparison run here; this takes most of the time.
    let experiment = PaperExperiment::new(
        host,
        &ExperimentRequest {
            random: args.random,
            starts: args.starts,
            seed: args.seed,
            rate: args.rate,
        },
    )?;
    let path = args.out.join(PAGE);
    output::write(&path, &experiment.page())?;
    if args.json {
        terminal::print_json(&experiment.json())?;
    } else {
        terminal::print(&experiment.text(terminal::style()))?;
    }
    terminal::note(&format!("the page is {}", path.display()));
    Ok(())
}
