//! Models and rigs of the paper's robot, which are part of the crate so that it needs no files.

use std::io;
use std::path::Path;

use modelmill::{Error, Host, Model, Outcome};

/// Model files by name.
const MODELS: [(&str, &str); 2] = [
    (
        "spidermill.toml",
        include_str!("../../../model-spec/models/spidermill.toml"),
    ),
    (
        "spidermill-paper.toml",
        include_str!("../../../model-spec/models/spidermill-paper.toml"),
    ),
];

/// Rig files by name.
const RIGS: [(&str, &str); 2] = [
    (
        "spidermill-full.toml",
        include_str!("../../../model-spec/rigs/spidermill-full.toml"),
    ),
    (
        "spidermill-with-rods.toml",
        include_str!("../../../model-spec/rigs/spidermill-with-rods.toml"),
    ),
];

/// The text of a file that is part of the program.
fn text(files: &[(&str, &str)], wanted: &Path) -> io::Result<String> {
    files
        .iter()
        .find(|(name, _)| Path::new(name) == wanted)
        .map(|(_, text)| (*text).to_owned())
        .ok_or_else(|| io::Error::other("it is not part of the program"))
}

/// Reads a bundled model file.
pub(crate) fn model(host: &Host, name: &str) -> Outcome<Model> {
    let own =
        text(&MODELS, Path::new(name)).map_err(|error| Error::input(format!("{name}: {error}")))?;
    variant(host, name, name, &own)
}

/// Reads the text of a model file, called `file`, that may extend bundled ones; `name` is what the model is called.
pub(crate) fn variant(host: &Host, name: &str, file: &str, own: &str) -> Outcome<Model> {
    let loaded = modelmill_spec::load(file, own, &mut |path| text(&MODELS, path))?;
    host.derive(name, loaded)
}

/// Reads a bundled rig file.
pub(crate) fn rig(name: &str) -> Outcome<modelmill_rig::Rig> {
    let own =
        text(&RIGS, Path::new(name)).map_err(|error| Error::input(format!("{name}: {error}")))?;
    Ok(modelmill_rig::load(name, &own, &mut |path| text(&RIGS, path))?.rig)
}
