//! `compare`: errors of the model along recordings, and the regions of the motion where they are largest.

use modelmill::Host;

use crate::args::CompareArgs;
use crate::failure::CommandOutcome;
use crate::flags::FlagWording;
use crate::{commands, terminal};

/// Prints error figures and the regions where the error is largest.
pub(crate) fn run(host: &Host, args: &CompareArgs) -> CommandOutcome {
    let mut model = commands::model(host, &args.model)?;
    let given = args.parameters.load_values(host, &model)?;
    if args.parameters.file().is_some() {
        // The forces of a servo log follow from the gains of the fit.
        model = model.with_fit(&given);
    }
    let [data, _] = commands::recordings(&model, [&args.data, &[]], &args.preparation.reading())?;
    let data: Vec<_> = data.iter().collect();
    let compared = model.compare(&data, &given.values)?;
    let forward = (args.forward.then(|| model.compare_forward(&data, &given.values))).transpose()?;
    // The name states in the output which values were used.
    let name = args.parameters.name();
    if args.json {
        let mut object = compared.json(&name, &FlagWording)?;
        if let Some(forward) = &forward {
            object["forward"] = forward.json();
        }
        return terminal::print_json(&object);
    }
    terminal::print(&compared.text(&name, terminal::style(), &FlagWording))?;
    match &forward {
        Some(forward) => terminal::print(&format!("\n{}", forward.text(terminal::style()))),
        None => Ok(()),
    }
}
