//! How files of text are read, whatever they describe: with a cap, and with what to do when it fails.

use std::path::Path;

use modelmill_boundary::files::{FileError, FileFault, FileSource};
use toml::de::DeTable;

use crate::diagnostic::{Diagnostic, DiagnosticSeverity, SourceFile, SourceFiles, SourceSpan};
use crate::document::LARGEST_FILE;
use crate::load::LoadFailure;

/// Reads the text of a file that a user names; `advice` is what to do when there is none.
///
/// Fails when it cannot be read, is too large to be meant, or is no text.
pub fn read_text(files: &dyn FileSource, path: &Path, advice: &str) -> Result<String, LoadFailure> {
    let bytes = files
        .read(path, LARGEST_FILE as u64)
        .map_err(|error| LoadFailure {
            diagnostics: vec![unreadable_file(&error, advice)],
            sources: SourceFiles::default(),
        })?;
    String::from_utf8(bytes).map_err(|error| invalid_utf8(path, error.as_bytes()))
}

/// Reads the text of a file that another one names, which must hold one of these keys outside of all tables.
///
/// Fails with what the file is not, in one line and without a word of its text: nobody who hands on a model file shall
/// learn in this way what else is on the reader's disk.
pub fn read_referenced(
    files: &dyn FileSource,
    path: &Path,
    keys: &[&str],
) -> Result<String, FileError> {
    let text = files.read_text(path, LARGEST_FILE as u64)?;
    let (table, _) = DeTable::parse_recoverable(&text);
    if keys.iter().any(|key| table.get_ref().contains_key(*key)) {
        return Ok(text);
    }
    let fault = FileFault::OtherKind {
        lacks: keys.join("` or `"),
    };
    Err(FileError::new(path, fault))
}

fn unreadable_file(error: &FileError, advice: &str) -> Diagnostic {
    let help = match &error.fault {
        FileFault::Missing | FileFault::Folder => advice,
        other => other.remedy(),
    };
    Diagnostic {
        severity: DiagnosticSeverity::Error,
        message: format!("cannot read `{}`: {}", error.path.display(), error.fault),
        span: None,
        label: String::new(),
        related: None,
        help: vec![help.into()],
    }
}

/// What is wrong with a file whose bytes are no text, with the place of the first of them.
fn invalid_utf8(path: &Path, bytes: &[u8]) -> LoadFailure {
    let start = match std::str::from_utf8(bytes) {
        Ok(text) => text.len(),
        Err(error) => error.valid_up_to(),
    };
    let text = String::from_utf8_lossy(bytes).into_owned();
    let end = (start + char::REPLACEMENT_CHARACTER.len_utf8()).min(text.len());
    let span = SourceSpan {
        file: 0,
        start,
        end,
    };
    LoadFailure {
        diagnostics: vec![
            Diagnostic::error(span, "this file is no text in UTF-8")
                .label("the first byte that is not")
                .help("save it as UTF-8; `modelmill` reads model files as text (TOML)"),
        ],
        sources: SourceFiles {
            files: vec![SourceFile {
                path: path.to_owned(),
                text,
            }],
        },
    }
}
