//! `check`: validates a model file and says what is in it.

use modelmill::{Error, Host, print};

use crate::args::CheckArgs;
use crate::failure::{Failure, Outcome};
use crate::{commands, terminal};

/// Validates and derives the model, and prints a summary.
pub(crate) fn run(host: &Host, args: &CheckArgs) -> Outcome {
    let model = match commands::model(host, &args.model) {
        Err(Failure::Library(Error::Model(faults))) if args.json => {
            // What is wrong goes to standard output as well, for editors.
            terminal::print_json(&print::faults(&faults))?;
            return Err(Failure::Library(Error::Model(faults)));
        }
        model => model?,
    };
    let checked = model.check()?;
    if args.json {
        return terminal::print_json(&checked.json());
    }
    terminal::print(&checked.text(terminal::style()))
}
