//! The program: arguments become options of the library, its answers become text, JSON and files. Exit status 0 done, 1 the
//! input is at fault, 2 wrong usage.

mod args;
mod commands;
mod failure;
mod flags;
mod output;
mod terminal;

use std::process::ExitCode;
use std::sync::Arc;

use clap::Parser;
use modelmill::{Error, Host};

use args::{Cli, Command};
use failure::{Failure, Outcome};
use terminal::progress::Terminal;

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
    let host = Host::new()
        .with_files(Arc::new(output::disk().clone()))
        .with_libraries(cli.library)
        .at_values(cli.at_values)
        .with_progress(Arc::new(Terminal::new()));
    match run(&host, &cli.command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            match &failure {
                Failure::Library(Error::Model(faults)) => {
                    terminal::say(faults.render(terminal::errors_in_colour()).trim_end());
                }
                Failure::Library(error) => terminal::error(&error.to_string()),
                Failure::Input(says) | Failure::Usage(says) => terminal::error(says),
                Failure::BrokenPipe => {}
            }
            ExitCode::from(failure.status())
        }
    }
}

fn run(host: &Host, command: &Command) -> Outcome {
    match command {
        Command::Check(args) => commands::check::run(host, args),
        Command::Diff(args) => commands::diff::run(host, args),
        Command::Effects(args) => commands::effects::run(host, args),
        Command::Adopt(args) => commands::adopt::run(host, args),
        Command::Add(args) => commands::add::run(host, args),
        Command::Equations(args) => commands::equations::run(host, args),
        Command::Atlas(args) => commands::atlas::run(host, args),
        Command::Generate(args) => commands::generate::run(host, args),
        Command::Evaluate(args) => commands::evaluate::run(host, args),
        Command::Identify(args) => commands::identify::run(host, args),
        Command::Compare(args) => commands::compare::run(host, args),
        Command::Diagnose(args) => commands::diagnose::run(host, args),
        Command::Recordings(args) => commands::recordings::run(host, args),
        Command::Report(args) => commands::report::run(host, args),
        Command::Simulate(args) => commands::simulate::run(host, args),
        Command::Reduce(args) => commands::reduce::run(host, args),
        Command::Import(args) => commands::import::run(host, args),
        Command::Export(args) => commands::export::run(host, args),
        Command::Runs(args) => commands::runs::run(host, args),
        Command::Interpret(args) => commands::interpret::run(host, args),
        Command::Excite(args) => commands::excite::run(host, args),
        #[cfg(feature = "experiment")]
        Command::Experiment(args) => commands::experiment::run(host, args),
        Command::Completions(args) => commands::completions::run(args),
        Command::Work(args) => commands::work::run(host, args),
        Command::Tour(args) => commands::tour::run(host, args),
    }
}
