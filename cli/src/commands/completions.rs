//! `completions`: a completion script for a shell.

use clap::CommandFactory;

use crate::args::{CommandLine, CompletionsArgs};
use crate::failure::CommandOutcome;
use crate::terminal;

/// Prints the script.
pub(crate) fn run(args: &CompletionsArgs) -> CommandOutcome {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut CommandLine::command(), "modelmill", &mut script);
    terminal::print(&String::from_utf8_lossy(&script))
}
