//! Recordings from a pipe, such as `--data /dev/stdin` or `--data <(zcat run.csv.gz)`: what can be read only once is
//! kept in memory, for a recording is looked at more than once.

use std::path::Path;

use crate::error::{Error, Outcome};

/// The bytes of what is no ordinary file; `None` for files and folders, which can be opened again.
pub(crate) fn piped(path: &Path) -> Outcome<Option<Vec<u8>>> {
    match std::fs::metadata(path) {
        Ok(found) if !found.is_file() && !found.is_dir() => {
            let bytes = std::fs::read(path).map_err(|error| {
                Error::input(format!(
                    "{}: the recording cannot be read: {error}",
                    path.display()
                ))
            })?;
            Ok(Some(bytes))
        }
        // What is missing is reported by the reader of recordings.
        _ => Ok(None),
    }
}
