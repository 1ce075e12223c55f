//! `evaluate`: the model's forces along a recording, of the drives or in the joints.

use std::path::Path;

use modelmill::Host;
use modelmill::text::table::count;

use crate::args::{EvaluateArgs, ParameterSource};
use crate::failure::{CommandFailure, CommandOutcome};
use crate::output::OutputFile;
use crate::{commands, terminal};

/// Writes `t` and one column per drive, or per component of a reaction.
pub(crate) fn run(host: &Host, args: &EvaluateArgs) -> CommandOutcome {
    // A fit cannot give reactions, so this combination of options is refused before anything is read.
    if args.reactions && args.parameters != ParameterSource::Nominal {
        return Err(CommandFailure::Usage(
            "--reactions needs all parameters of the model file: a fit has base parameters only, and reactions also depend on \
             parameters without effect on the drives. Write identified masses and inertias into the model file (`interpret`, \
             `identify --physical`)"
                .to_owned(),
        ));
    }
    let model = commands::model(host, &args.model)?;
    // The target must not be one of the files that this command reads.
    let mut inputs: Vec<&Path> = model.files().collect();
    inputs.push(&args.data);
    inputs.extend(args.parameters.file().map(AsRef::<Path>::as_ref));
    let target = args
        .out
        .as_ref()
        .map(|path| OutputFile::new(path, inputs))
        .transpose()?;
    let values = args.parameters.values(host, &model)?;
    let reading = args.preparation.reading();
    let found = if args.reactions {
        model.evaluate_reactions(&args.data, &reading)?
    } else {
        model.evaluate(&args.data, &reading, &values)?
    };
    if !found.left_out.is_empty() {
        terminal::note(&format!(
            "left out, since the equations of motion do not determine them (statically indeterminate reactions): {}",
            found.left_out.join(", ")
        ));
    }
    match target {
        Some(target) => {
            target.write(&found.csv())?;
            // The note lists the columns that were written.
            let names: Vec<&str> = found.columns.iter().map(|(name, _)| name.as_str()).collect();
            terminal::note(&format!(
                "{}: {} of {}",
                target.path().display(),
                count(found.time.len(), "sample", "samples"),
                names.join(", ")
            ));
            Ok(())
        }
        None => terminal::print(&found.csv()),
    }
}
