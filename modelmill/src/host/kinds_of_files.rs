//! Recognises files of the project that were given in place of another kind, so that the error can name what they are.

use std::path::Path;

use modelmill_boundary::files::{FileSource, PathKind};

use crate::host::Host;

/// A model file, as a phrase.
pub(super) const MODEL_FILE: &str = "a model file";

/// The kind of a file of the project, as a phrase with an article; `None` if it is no file of the project.
pub(crate) fn file_kind(host: &Host, path: &Path) -> Option<&'static str> {
    // Other files are not opened: a pipe cannot be read twice.
    let files = host.files();
    if files.kind(path) != PathKind::File {
        return None;
    }
    // A fit is JSON; the size limit excludes recordings that happen to start like it.
    let starts_as_json = || {
        let text = files.read_text(path, 1 << 24).ok()?;
        Some(text.trim_start().starts_with('{'))
    };
    // Model, rig and plan share the extension; the first one that loads decides.
    if path.extension().is_some_and(|e| e == "toml") {
        if modelmill_spec::load_file_with(path, host.libraries(), files).is_ok() {
            Some(MODEL_FILE)
        } else {
            kind_of_model_source(path, files)
        }
    } else if starts_as_json() == Some(true) && host.fit(path).is_ok() {
        Some("a fit, as `identify` writes it")
    } else {
        None
    }
}

/// The kind of a file from which `reduce` makes a model: a rig, or a plan.
#[cfg_attr(not(feature = "rig"), allow(unused_variables))]
fn kind_of_model_source(path: &Path, files: &dyn FileSource) -> Option<&'static str> {
    #[cfg(feature = "rig")]
    if modelmill_rig::load_file_with(path, files).is_ok() {
        return Some("a rig file, which describes the whole machine");
    }
    #[cfg(feature = "import")]
    if modelmill_reduction::plan_file_with(path, files).is_ok() {
        return Some("a plan of a reduction");
    }
    None
}
