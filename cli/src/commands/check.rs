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
        Err(Failure::Library(Error::Derivation { model, error })) if args.json => {
            let fault = Error::Derivation { model, error };
            let path = args.model.display().to_string();
            terminal::print_json(&print::refusal(&fault.to_string(), &path))?;
            return Err(Failure::Library(fault));
        }
        model => model?,
    };
    let checked = model.check()?;
    if args.json {
        return terminal::print_json(&checked.json());
    }
    terminal::print(&checked.text(terminal::style()))
}
