//! `import`: converts a robot description of other programs into a model file, as a starting point.

use std::path::{Path, PathBuf};

use modelmill::Host;
use modelmill::import::{ImportedRobot, Options};
use modelmill::text::table::count;

use crate::args::ImportArgs;
use crate::failure::{CommandFailure, CommandOutcome};
use crate::output::OutputFile;
use crate::terminal;

/// Largest robot description that is read, bytes.
const LARGEST_DESCRIPTION: u64 = 16 << 20;

/// Writes the model file. Notes on what was left out or rounded go to standard error.
pub(crate) fn run(host: &Host, args: &ImportArgs) -> CommandOutcome {
    let file = args.description.as_path();
    let closures = closures_of(file, args.closures.as_deref());
    // Neither the description nor the file of closures may be written over.
    let target = OutputFile::new(&args.out, [file].into_iter().chain(closures.as_deref()))?;
    let options = Options {
        floating: args.floating,
        round_angles: args.round_angles,
        known_bodies: args.known_bodies,
        closures: None,
        pose: &args.at,
        locked: &args.lock,
        kept: (!args.joints.is_empty()).then_some(args.joints.as_slice()),
        meshes: None,
    };
    let imported = import_description(host, file, closures.as_deref(), options)?;
    // A `robot.yaml` that was found automatically is mentioned, because it changes the result.
    if let (None, Some(path)) = (&args.closures, closures) {
        terminal::note(&format!(
            "loop closures and drives are read from {}, which is in the folder of the description",
            path.display()
        ));
    }
    target.write(&imported.model)?;
    terminal::note(&format!(
        "{}: {}, with {} of every body; check and correct it",
        target.path().display(),
        count(imported.joints.len(), "joint", "joints"),
        if args.known_bodies {
            "known masses and inertias"
        } else {
            "the ten linear parameters"
        },
    ));
    Ok(())
}

/// Whether a file name ends like those of robot descriptions.
pub(crate) fn is_description(file: &Path) -> bool {
    let endings = ["urdf", "xml", "mjcf", "sdf"];
    file.extension()
        .is_some_and(|ending| endings.iter().any(|known| ending == *known))
}

/// The file of loop closures: the one given, or a `robot.yaml` in the folder of a URDF.
pub(crate) fn closures_of(file: &Path, given: Option<&Path>) -> Option<PathBuf> {
    let beside = file.with_file_name("robot.yaml");
    let is_urdf = file.extension().is_some_and(|ending| ending == "urdf");
    match given {
        Some(given) => Some(given.to_owned()),
        None => (is_urdf && beside.is_file()).then_some(beside),
    }
}

/// Reads and converts a robot description; fails if a file cannot be read or is not a robot description.
pub(crate) fn import_description(
    host: &Host,
    file: &Path,
    closures: Option<&Path>,
    options: Options<'_>,
) -> CommandOutcome<ImportedRobot> {
    let text = read(host, file, "a robot description (URDF, MJCF or SDF, all XML)")?;
    // The file of closures is read as text; the library parses it together with the URDF.
    let closures = closures
        .map(|path| read(host, path, "a file of closures (YAML)"))
        .transpose()?;
    let options = Options {
        closures: closures.as_deref(),
        ..options
    };
    Ok(host.import(&file.display().to_string(), &text, &options)?)
}

/// The text of a file; `expected` states in the error which kind of file is needed.
fn read(host: &Host, path: &Path, expected: &str) -> Result<String, CommandFailure> {
    host.files().read_text(path, LARGEST_DESCRIPTION).map_err(|error| {
        CommandFailure::Input(format!(
            "{} cannot be read: {}; {expected} is expected",
            path.display(),
            error.fault
        ))
    })
}
