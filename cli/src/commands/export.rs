//! `export`: a model as a robot description of other programs.

use std::path::Path;

use modelmill::Host;
use modelmill::export::Format;

use crate::args::ExportArgs;
use crate::failure::{Failure, Outcome};
use crate::output::Target;
use crate::{commands, terminal};

/// Writes the description and says what it does not hold.
pub(crate) fn run(host: &Host, args: &ExportArgs) -> Outcome {
    let ending = args.out.extension().and_then(|ending| ending.to_str());
    let format = args
        .format
        .or_else(|| Format::of_ending(&ending?.to_lowercase()));
    let Some(format) = format else {
        return Err(Failure::Input(format!(
            "{}: its ending says no format; end it in .urdf or .xml (MJCF), or give --format",
            args.out.display()
        )));
    };
    let model = commands::model(host, &args.model)?;
    let fits = args.parameters.iter().map(std::path::PathBuf::as_path);
    let target = Target::new(&args.out, model.files().chain(fits).collect::<Vec<&Path>>())?;
    let fit = args
        .parameters
        .as_ref()
        .map(|path| host.fit(path))
        .transpose()?;
    let file = (args.parameters.as_ref()).map_or(String::new(), |path| path.display().to_string());
    let exported = model.export(format, fit.as_ref().map(|fit| (fit, file.as_str())))?;
    target.write(&exported.text)?;
    for note in &exported.notes {
        terminal::remark(note);
    }
    terminal::note(&format!(
        "{} is written as {}",
        target.path().display(),
        format.name().to_uppercase()
    ));
    Ok(())
}
