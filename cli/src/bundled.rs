//! Models and recordings that are part of the program, so that the tour needs no files.

use std::io;
use std::path::Path;

use modelmill_spec::Loaded;

use crate::failure::{Failure, Outcome};
use crate::terminal;

/// Model files by name.
pub(crate) const MODELS: [(&str, &str); 2] = [
    (
        "spidermill.toml",
        include_str!("../../model-spec/models/spidermill.toml"),
    ),
    (
        "spidermill-paper.toml",
        include_str!("../../model-spec/models/spidermill-paper.toml"),
    ),
];

/// Rig files by name.
const RIGS: [(&str, &str); 2] = [
    (
        "spidermill-full.toml",
        include_str!("../../model-spec/rigs/spidermill-full.toml"),
    ),
    (
        "spidermill-with-rods.toml",
        include_str!("../../model-spec/rigs/spidermill-with-rods.toml"),
    ),
];

/// A recorded pair of runs of the whole robot: one to identify from, one to check on.
pub(crate) struct Runs {
    /// Name and text of the recording to identify from.
    pub(crate) fit: (&'static str, &'static str),
    /// Name and text of the recording to check on.
    pub(crate) check: (&'static str, &'static str),
}

/// The robot as the model describes it.
pub(crate) const PLAIN: Runs = Runs {
    fit: (
        "spidermill-mbs/plain-fit.csv",
        include_str!("../../recordings/spidermill-mbs/plain-fit.csv"),
    ),
    check: (
        "spidermill-mbs/plain-check.csv",
        include_str!("../../recordings/spidermill-mbs/plain-check.csv"),
    ),
};

/// The robot with something that the model does not know of.
pub(crate) const WITH_RODS: Runs = Runs {
    fit: (
        "spidermill-mbs/with-rods-fit.csv",
        include_str!("../../recordings/spidermill-mbs/with-rods-fit.csv"),
    ),
    check: (
        "spidermill-mbs/with-rods-check.csv",
        include_str!("../../recordings/spidermill-mbs/with-rods-check.csv"),
    ),
};

/// The text of a file that is part of the program.
fn text(files: &[(&str, &str)], wanted: &Path) -> io::Result<String> {
    files
        .iter()
        .find(|(name, _)| Path::new(name) == wanted)
        .map(|(_, text)| (*text).to_owned())
        .ok_or_else(|| io::Error::other("it is not part of the program"))
}

/// Reads a bundled model file.
pub(crate) fn model(name: &str) -> Outcome<Loaded> {
    let own = text(&MODELS, Path::new(name))
        .map_err(|error| Failure::Input(format!("{name}: {error}")))?;
    variant(name, &own)
}

/// Reads the text of a model file that may extend bundled ones.
pub(crate) fn variant(name: &str, own: &str) -> Outcome<Loaded> {
    modelmill_spec::load(name, own, &mut |path| text(&MODELS, path))
        .map_err(|failure| Failure::Rendered(failure.render(terminal::errors_in_colour())))
}

/// Reads a bundled rig file.
pub(crate) fn rig(name: &str) -> Outcome<modelmill_rig::Rig> {
    let own =
        text(&RIGS, Path::new(name)).map_err(|error| Failure::Input(format!("{name}: {error}")))?;
    modelmill_rig::load(name, &own, &mut |path| text(&RIGS, path))
        .map(|loaded| loaded.rig)
        .map_err(|failure| Failure::Rendered(failure.render(terminal::errors_in_colour())))
}
