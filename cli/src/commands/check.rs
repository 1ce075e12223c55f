//! `check`: validates a model file, or a rig, and prints a summary of its contents.

use modelmill::model::ModelCheck;
use modelmill::{Error, Host, print};

use crate::args::CheckArgs;
use crate::failure::{CommandFailure, CommandOutcome};
use crate::flags::FlagWording;
use crate::{commands, terminal};

/// Validates and derives the model, and prints a summary.
pub(crate) fn run(host: &Host, args: &CheckArgs) -> CommandOutcome {
    if host.is_rig_file(&args.model) {
        return check_rig(host, args);
    }
    let model = print_fault(args, commands::model(host, &args.model))?;
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
        let mut object = checked.json(&FlagWording);
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
        None => terminal::print(&checked.text_with_next_step(terminal::style(), &FlagWording))?,
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

/// Closes the joints of a rig and prints its contents.
fn check_rig(host: &Host, args: &CheckArgs) -> CommandOutcome {
    if args.drawing.picture.is_some() {
        return Err(CommandFailure::Usage(
            "--picture draws a model, and this file is a rig; `modelmill reduce` makes a model from it".to_owned(),
        ));
    }
    let loaded = print_fault(args, commands::rig(host, &args.model))?;
    let checked = print_fault(args, host.check_rig(&loaded).map_err(CommandFailure::Library))?;
    if args.json {
        return terminal::print_json(&checked.json());
    }
    terminal::print(&checked.text())
}

/// Prints a fault as JSON if requested: editors read it from standard output, in addition to the text on standard error.
fn print_fault<T>(args: &CheckArgs, outcome: CommandOutcome<T>) -> CommandOutcome<T> {
    match outcome {
        Err(CommandFailure::Library(fault)) if args.json && !matches!(fault, Error::Cancelled) => {
            let object = match &fault {
                Error::Model(faults) => print::faults(faults, &FlagWording),
                fault => print::refusal(&fault.format_for(&FlagWording), &args.model.display().to_string()),
            };
            terminal::print_json(&object)?;
            Err(CommandFailure::Library(fault))
        }
        outcome => outcome,
    }
}
