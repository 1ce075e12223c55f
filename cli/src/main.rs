//! The program: arguments become options of the library, its answers become text, JSON and files. Exit status 0 done, 1
//! the input is at fault, 2 wrong usage, 3 the time limit was reached.

mod args;
mod commands;
mod failure;
mod flags;
mod output;
mod terminal;

use std::io::{ErrorKind, Write};
use std::process::ExitCode;
use std::sync::Arc;

use clap::Parser;
use modelmill::progress::ProgressListener;
use modelmill::{Error, Host};

use args::{CommandLine, ProgramCommand};
use failure::{CommandFailure, CommandOutcome};
use flags::FlagWording;
use terminal::progress::TerminalProgress;
use terminal::time_limit::TimeLimit;

/// Reads the command line, runs the command, and turns a failure into a message and an exit status.
fn main() -> ExitCode {
    let cli = match CommandLine::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            return print_help_or_usage(&error);
        }
    };
    #[cfg(feature = "workbench")]
    if let Some(failure) = find_time_limit_fault(&cli) {
        return report_failure(&failure);
    }
    let mut progress: Arc<dyn ProgressListener> = Arc::new(TerminalProgress::new());
    if let Some(limit) = cli.time_limit {
        progress = Arc::new(TimeLimit::start(limit, progress));
    }
    // All files of the library are read through the disk of this run, which remembers them.
    let host = Host::new()
        .with_files(Arc::new(output::disk().clone()))
        .with_libraries(cli.library)
        .with_numeric_constants(cli.at_values)
        .with_progress(progress);
    match run(&host, &cli.command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => report_failure(&failure),
    }
}

/// The fault of a time limit for the workbench, which runs until it is stopped.
#[cfg(feature = "workbench")]
fn find_time_limit_fault(cli: &CommandLine) -> Option<CommandFailure> {
    let is_limited = cli.time_limit.is_some() && matches!(cli.command, ProgramCommand::Work(_));
    let says = "--time-limit: the workbench runs until it is stopped; leave out the option";
    is_limited.then(|| CommandFailure::Usage(says.to_owned()))
}

/// Prints why a command ended early, and returns its exit status.
fn report_failure(failure: &CommandFailure) -> ExitCode {
    match failure {
        // Faults of a model file are shown with the lines of the file; other errors are one message.
        CommandFailure::Library(Error::Model(faults)) => {
            // Each fault has its line, what was expected, and a remedy.
            let in_colour = terminal::is_stderr_coloured();
            terminal::print_to_stderr(faults.render_for(in_colour, &FlagWording).trim_end());
        }
        CommandFailure::Library(error) => terminal::error(&error.format_for(&FlagWording)),
        CommandFailure::Input(says) | CommandFailure::Usage(says) => terminal::error(says),
        CommandFailure::NotVerified
        | CommandFailure::ImpossibleValues
        | CommandFailure::Unusable
        | CommandFailure::BrokenPipe => {}
    }
    ExitCode::from(failure.status())
}

/// Prints help, version or a wrong usage. Help and version have status 0, unless they cannot be written. A closed
/// standard output is not reported.
fn print_help_or_usage(message: &clap::Error) -> ExitCode {
    let status = u8::try_from(message.exit_code()).unwrap_or(2);
    match message.print().and_then(|()| std::io::stdout().flush()) {
        Err(error) if status == 0 && error.kind() != ErrorKind::BrokenPipe => {
            terminal::error(&format!("standard output cannot be written: {error}"));
            ExitCode::FAILURE
        }
        _ => ExitCode::from(status),
    }
}

/// Runs one command.
fn run(host: &Host, command: &ProgramCommand) -> CommandOutcome {
    match command {
        ProgramCommand::Check(args) => commands::check::run(host, args),
        ProgramCommand::Diff(args) => commands::diff::run(host, args),
        ProgramCommand::Effects(args) => commands::effects::run(host, args),
        ProgramCommand::Adopt(args) => commands::adopt::run(host, args),
        ProgramCommand::Add(args) => commands::add::run(host, args),
        ProgramCommand::Equations(args) => commands::equations::run(host, args),
        ProgramCommand::Atlas(args) => commands::atlas::run(host, args),
        ProgramCommand::Generate(args) => commands::generate::run(host, args),
        ProgramCommand::Evaluate(args) => commands::evaluate::run(host, args),
        ProgramCommand::Identify(args) => commands::identify::run(host, args),
        ProgramCommand::Compare(args) => commands::compare::run(host, args),
        ProgramCommand::Diagnose(args) => commands::diagnose::run(host, args),
        ProgramCommand::Verify(args) => commands::verify::run(host, args),
        ProgramCommand::Recordings(args) => commands::recordings::run(host, args),
        ProgramCommand::Report(args) => commands::report::run(host, args),
        ProgramCommand::Simulate(args) => commands::simulate::run(host, args),
        ProgramCommand::Reduce(args) => commands::reduce::run(host, args),
        ProgramCommand::Import(args) => commands::import::run(host, args),
        ProgramCommand::Export(args) => commands::export::run(host, args),
        ProgramCommand::Runs(args) => commands::runs::run(host, args),
        ProgramCommand::Interpret(args) => commands::interpret::run(host, args),
        ProgramCommand::Excite(args) => commands::excite::run(host, args),
        #[cfg(feature = "experiment")]
        ProgramCommand::Experiment(args) => commands::experiment::run(host, args),
        ProgramCommand::Doctor(args) => commands::doctor::run(args),
        ProgramCommand::Manual(args) => commands::manual::run(args),
        ProgramCommand::Completions(args) => commands::completions::run(args),
        #[cfg(feature = "workbench")]
        ProgramCommand::Work(args) => commands::work::run(host, args),
        ProgramCommand::Tour(args) => commands::tour::run(host, args),
    }
}
