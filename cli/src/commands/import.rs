//! `import`: a robot description of ROS as the start of a model file.

use modelmill::Host;
use modelmill::text::table::count;

use crate::args::ImportArgs;
use crate::failure::{Failure, Outcome};
use crate::output::Target;
use crate::terminal;

/// No robot description is longer, bytes.
const LARGEST_URDF: u64 = 16 << 20;

/// Writes the model file and says what was left out or rounded.
pub(crate) fn run(host: &Host, args: &ImportArgs) -> Outcome {
    let target = Target::new(&args.out, [args.urdf.as_path()])?;
    let read = host.files().read_text(&args.urdf, LARGEST_URDF);
    let text = read.map_err(|error| {
        Failure::Input(format!(
            "{} cannot be read: {}; a URDF file (XML) is expected",
            args.urdf.display(),
            error.fault
        ))
    })?;
    let imported = host.import(&args.urdf.display().to_string(), &text)?;
    target.write(&imported.model)?;
    terminal::note(&format!(
        "{}: {}, with gravity along -z and the ten linear parameters of every body; read and mend it",
        target.path().display(),
        count(imported.joints, "joint", "joints"),
    ));
    Ok(())
}
