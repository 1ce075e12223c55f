//! What a file is that was given in place of another one, so that a refusal can say so.

use std::path::Path;

use modelmill_boundary::files::{Files, Kind};

use crate::host::Host;

/// What kind of file of ours this is, in words with an article; `None` where it is none.
pub(crate) fn kind(host: &Host, path: &Path) -> Option<&'static str> {
    // Anything else may be a pipe, which cannot be read twice, or too large to be one of these.
    let files = host.files();
    if files.kind(path) != Kind::File {
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
            kind_for_models(path, files)
        }
    } else if starts_as_json() == Some(true) && host.fit(path).is_ok() {
        Some("a fit, as `identify` writes it")
    } else {
        None
    }
}

/// What kind of file a model can be made of this is.
#[cfg_attr(not(feature = "rig"), allow(unused_variables))]
fn kind_for_models(path: &Path, files: &dyn Files) -> Option<&'static str> {
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
