//! Models and rigs of the paper's robot. They are part of the crate, so that it needs no files.

use std::path::Path;

use modelmill::files::{FileSource, MemoryFiles};
use modelmill::{Error, Host, Model, Outcome};
use modelmill_recordings::MODELS;
use modelmill_spec::bundled::RIGS;

/// Bundled files as a source of files.
fn files(bundled: &[(&str, &str)]) -> MemoryFiles {
    let all = bundled.iter();
    all.fold(MemoryFiles::default(), |files, (name, text)| {
        files.with_file(name, *text)
    })
}

/// The text of one bundled file.
fn text(bundled: &[(&str, &str)], wanted: &str) -> Outcome<String> {
    let found = files(bundled).read_text(Path::new(wanted), u64::MAX);
    found.map_err(Error::input)
}

/// Reads a bundled model file.
pub(crate) fn model(host: &Host, name: &str) -> Outcome<Model> {
    variant(host, name, name, &text(&MODELS, name)?)
}

/// Derives a model from the text of a file, called `file`, that may extend bundled ones. `name` is its name in
/// messages.
pub(crate) fn variant(host: &Host, name: &str, file: &str, own: &str) -> Outcome<Model> {
    let loaded = modelmill_spec::load(file, own, &files(&MODELS))?;
    host.derive(name, loaded)
}

/// Reads a rig file, called `file`, that may extend bundled ones.
pub(crate) fn rig_variant(file: &str, own: &str) -> Outcome<modelmill_rig::Rig> {
    Ok(modelmill_rig::load(file, own, &files(&RIGS))?.rig)
}

/// Reads a bundled rig file.
pub(crate) fn rig(name: &str) -> Outcome<modelmill_rig::Rig> {
    Ok(modelmill_rig::load(name, &text(&RIGS, name)?, &files(&RIGS))?.rig)
}
