//! `check`: validates a model file and prints a summary of its contents.

use modelmill::model::ModelCheck;
use modelmill::{Error, Host, print};

use crate::args::CheckArgs;
use crate::failure::{CommandFailure, CommandOutcome};
use crate::flags::FlagSpelling;
use crate::{commands, terminal};

/// Validates and derives the model, and prints a summary.
pub(crate) fn run(host: &Host, args: &CheckArgs) -> CommandOutcome {
    let model = match commands::model(host, &args.model) {
        Err(CommandFailure::Library(fault)) if args.json && !matches!(fault, Error::Cancelled) => {
            // Editors read faults as JSON from standard output, in addition to the text on standard error.
            let told = match &fault {
                Error::Model(faults) => print::faults(faults, &FlagSpelling),
                fault => print::refusal(&fault.spell(&FlagSpelling), &args.model.display().to_string()),
            };
            terminal::print_json(&told)?;
            return Err(CommandFailure::Library(fault));
        }
        model => model?,
    };
    let picture = args.drawing.target(model.files())?;
    let checked = model.check()?;
    let servo = if model.actuators().is_empty() {
        None
    } else {
        Some(model.servo_model()?)
    };
    if let Some(target) = &picture {
        args.drawing.draw(target, &model, None)?;
    }
    if args.json {
        let mut object = checked.json(&FlagSpelling);
        if let Some(servo) = &servo {
            object["servo"] = servo.json();
        }
        terminal::print_json(&object)?;
        return require_possible_values(&checked);
    }
    // The scale of a servo's gains is the next question of its user.
    match servo {
        Some(servo) => {
            terminal::print(&checked.text(terminal::style()))?;
            terminal::print(&servo.text(terminal::style()))?;
        }
        None => terminal::print(&checked.text_with_next_step(terminal::style(), &FlagSpelling))?,
    }
    require_possible_values(&checked)
}

/// Fails for a model with values that no machine can have; the output states them already.
fn require_possible_values(checked: &ModelCheck) -> CommandOutcome {
    if checked.impossible_values().is_empty() {
        Ok(())
    } else {
        Err(CommandFailure::ImpossibleValues)
    }
}
