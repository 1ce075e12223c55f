//! `import`: a robot description of ROS as the start of a model file.

use crate::args::ImportArgs;
use crate::failure::{Failure, Outcome};
use crate::output::Target;
use crate::table::count;
use crate::terminal;

/// Writes the model file and says what was left out or rounded.
pub(crate) fn run(args: &ImportArgs) -> Outcome {
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
    let imported = modelmill_reduction::import_urdf(&text)
        .map_err(|error| Failure::Input(format!("{}: {error}", args.urdf.display())))?;
    for remark in &imported.remarks {
        terminal::warn(remark);
    }
    target.write(&imported.model)?;
    terminal::note(&format!(
        "{}: {}, with gravity along -z and the ten linear parameters of every body; read and mend it",
        target.path().display(),
        count(
            imported.model.matches("[[frame]]").count(),
            "joint",
            "joints"
        ),
    ));
    Ok(())
}
