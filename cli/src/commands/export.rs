//! `export`: writes a model as a robot description (URDF, MJCF) for other programs.

use std::path::{Path, PathBuf};

use modelmill::Host;
use modelmill::export::{Format as DescriptionFormat, description};

use crate::args::ExportArgs;
use crate::failure::{CommandFailure, CommandOutcome};
use crate::output::OutputFile;
use crate::{commands, terminal};

/// Writes the description and prints notes on what the format cannot express.
pub(crate) fn run(host: &Host, args: &ExportArgs) -> CommandOutcome {
    // --format has priority over the ending of the file name.
    let ending = args.out.extension().and_then(|ending| ending.to_str());
    let format = args
        .format
        .or_else(|| DescriptionFormat::from_extension(&ending?.to_lowercase()));
    let Some(format) = format else {
        return Err(CommandFailure::Input(format!(
            "{}: the ending does not determine the format; end the name in .urdf or .xml (MJCF), or give --format",
            args.out.display()
        )));
    };
    // Inputs must not be written over.
    let loaded = commands::load(host, &args.model)?;
    let fits = args.parameters.iter().map(PathBuf::as_path);
    let inputs = loaded.sources.paths().chain(fits);
    let target = OutputFile::new(&args.out, inputs.collect::<Vec<&Path>>())?;
    let path = args.model.display().to_string();
    // A fit refers to the derived model; without one the loaded file is sufficient.
    let exported = match &args.parameters {
        None => description(&path, &loaded, format)?,
        Some(file) => {
            let fit = host.fit(file)?;
            let model = commands::derive_model(host, &path, loaded)?;
            model.export(format, Some((&fit, &file.display().to_string())))?
        }
    };
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
