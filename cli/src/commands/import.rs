//! `import`: a robot description of other programs as the start of a model file.

use std::path::Path;

use modelmill::Host;
use modelmill::import::Options;
use modelmill::text::table::count;

use crate::args::ImportArgs;
use crate::failure::{Failure, Outcome};
use crate::output::Target;
use crate::terminal;

/// No robot description is longer, bytes.
const LARGEST_DESCRIPTION: u64 = 16 << 20;

/// Writes the model file and says what was left out or rounded.
pub(crate) fn run(host: &Host, args: &ImportArgs) -> Outcome {
    let file = args.description.as_path();
    let beside = file.with_file_name("robot.yaml");
    let is_urdf = file.extension().is_some_and(|ending| ending == "urdf");
    let closures = match &args.closures {
        Some(given) => Some(given.as_path()),
        None => (is_urdf && beside.is_file()).then_some(beside.as_path()),
    };
    let target = Target::new(&args.out, [file].into_iter().chain(closures))?;
    let text = read(
        host,
        file,
        "a robot description (URDF, MJCF or SDF, all XML)",
    )?;
    let closing = closures
        .map(|path| read(host, path, "a file of closures (YAML)"))
        .transpose()?;
    if let (None, Some(path)) = (&args.closures, closures) {
        terminal::note(&format!(
            "closures and drives are those of {}, which lies beside the description",
            path.display()
        ));
    }
    let options = Options {
        floating: args.floating,
        round_angles: args.round_angles,
        closures: closing.as_deref(),
        pose: &args.at,
    };
    let imported = host.import(&file.display().to_string(), &text, &options)?;
    target.write(&imported.model)?;
    terminal::note(&format!(
        "{}: {}, with the ten linear parameters of every body; read and mend it",
        target.path().display(),
        count(imported.joints.len(), "joint", "joints"),
    ));
    Ok(())
}

fn read(host: &Host, path: &Path, expected: &str) -> Result<String, Failure> {
    host.files()
        .read_text(path, LARGEST_DESCRIPTION)
        .map_err(|error| {
            Failure::Input(format!(
                "{} cannot be read: {}; {expected} is expected",
                path.display(),
                error.fault
            ))
        })
}
