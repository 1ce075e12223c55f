//! The program: arguments go in, tables, figures and files come out; exit status 0 done, 1 the
//! input is at fault, 2 wrong usage.

mod along;
mod args;
mod bundled;
mod columns;
mod commands;
mod consistent;
mod data;
mod diagnosis;
mod effect_args;
mod entries;
mod estimation;
mod estimators;
mod failure;
mod instruments;
mod limits;
mod model;
mod nominal_forces;
mod output;
mod piped;
mod plant;
mod plot;
mod preparation;
mod progress;
mod regression;
mod report;
mod sampled_rank;
mod separate_args;
mod separating;
mod show;
mod standstill;
mod suspects;
mod svg;
mod table;
mod terminal;
mod variances;

use std::process::ExitCode;

use clap::Parser;

use args::{Cli, Command};
use failure::{Failure, Outcome};

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            // Help is no error; a reader that goes away is none either.
            let status = u8::try_from(error.exit_code()).unwrap_or(2);
            let _ = error.print();
            return ExitCode::from(status);
        }
    };
    model::use_libraries(&cli.library);
    match run(&cli.command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            match &failure {
                Failure::Input(says) | Failure::Usage(says) => terminal::error(says),
                Failure::Rendered(text) => terminal::say(text.trim_end()),
                Failure::BrokenPipe => {}
            }
            ExitCode::from(failure.status())
        }
    }
}

fn run(command: &Command) -> Outcome {
    match command {
        Command::Check(args) => commands::check::run(args),
        Command::Diff(args) => commands::diff::run(args),
        Command::Effects(args) => commands::effects::run(args),
        Command::Add(args) => commands::add::run(args),
        Command::Equations(args) => commands::equations::run(args),
        Command::Generate(args) => commands::generate::run(args),
        Command::Evaluate(args) => commands::evaluate::run(args),
        Command::Identify(args) => commands::identify::run(args),
        Command::Compare(args) => commands::compare::run(args),
        Command::Diagnose(args) => commands::diagnose::run(args),
        Command::Report(args) => commands::report::run(args),
        Command::Simulate(args) => commands::simulate::run(args),
        Command::Reduce(args) => commands::reduce::run(args),
        Command::Import(args) => commands::import::run(args),
        Command::Interpret(args) => commands::interpret::run(args),
        Command::Excite(args) => commands::excite::run(args),
        Command::Experiment(args) => commands::experiment::run(args),
        Command::Completions(args) => commands::completions::run(args),
        Command::Tour(args) => commands::tour::run(args),
    }
}
