//! What a file is that was given in place of another one, so that a refusal can say so.

use std::path::Path;

use modelmill_boundary::files::{FileSource, PathKind};

use crate::host::Host;

/// What kind of file of ours this is, in words with an article; `None` where it is none.
pub(crate) fn file_kind(host: &Host, path: &Path) -> Option<&'static str> {
    // Anything else may be a pipe, which cannot be read twice, or too large to be one of these.
    let files = host.files();
    if files.kind(path) != PathKind::File {
        return None;
    }
    let starts_as_json = || {
        let text = files.read_text(path, 1 << 24).ok()?;
        Some(text.trim_start().starts_with('{'))
    };
    if path.extension().is_some_and(|e| e == "toml") {
        if modelmill_spec::load_file_with(path, host.libraries(), files).is_ok() {
            Some("a model file")
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
