//! `import`: a robot description of ROS as the start of a model file.

use modelmill::Host;
use modelmill::text::table::count;

use crate::args::ImportArgs;
use crate::failure::{Failure, Outcome};
use crate::output::Target;
use crate::terminal;

/// Writes the model file and says what was left out or rounded.
pub(crate) fn run(host: &Host, args: &ImportArgs) -> Outcome {
    let target = Target::new(&args.out, [args.urdf.as_path()])?;
    let bytes = std::fs::read(&args.urdf).map_err(|error| {
        Failure::Input(format!(
            "{} cannot be read: {error}; a URDF file is expected",
            args.urdf.display()
        ))
    })?;
    let text = String::from_utf8(bytes).map_err(|_| {
        Failure::Input(format!(
            "{} is no text; a URDF file (XML) is expected",
            args.urdf.display()
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
