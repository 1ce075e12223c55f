//! Reads text files of any kind, with a limit on their size and with advice when reading fails.

use std::path::Path;

use modelmill_boundary::files::{FileError, FileFault, FileSource};
use toml::de::DeTable;

use crate::diagnostic::{Diagnostic, DiagnosticSeverity, SourceFile, SourceFiles, SourceSpan};
use crate::document::LARGEST_FILE;
use crate::load::LoadFailure;
use crate::toml_budget::find_toml_excess;

/// Reads the text of a file that a user names; `advice` is printed when the path leads to no file.
///
/// Fails when the file cannot be read, exceeds [`LARGEST_FILE`] bytes, or is not UTF-8.
pub fn read_text(files: &dyn FileSource, path: &Path, advice: &str) -> Result<String, LoadFailure> {
    let bytes = files.read(path, LARGEST_FILE as u64).map_err(|error| LoadFailure {
        diagnostics: vec![unreadable_file(&error, advice)],
        sources: SourceFiles::default(),
    })?;
    String::from_utf8(bytes).map_err(|error| invalid_utf8(path, error.as_bytes()))
}

/// Reads the text of a file that another file names. It must contain one of these keys outside of all tables.
///
/// Errors are one line and quote nothing of the text. A model file from someone else must not reveal the contents of
/// other files on the reader's disk.
pub fn read_referenced(files: &dyn FileSource, path: &Path, keys: &[&str]) -> Result<String, FileError> {
    let text = files.read_text(path, LARGEST_FILE as u64)?;
    // A file with syntax errors is accepted here; the reader of the file reports them.
    // One beyond the limits is not parsed, so that its keys are unknown.
    let is_readable = find_toml_excess(&text).is_none();
    let (table, _) = DeTable::parse_recoverable(if is_readable { &text } else { "" });
    if keys.iter().any(|key| table.get_ref().contains_key(*key)) {
        return Ok(text);
    }
    let fault = FileFault::OtherKind {
        lacks: keys.join("` or `"),
    };
    Err(FileError::new(path, fault))
}

/// The error of a file that cannot be read; it has no place because there is no text.
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
        is_impossible: false,
    }
}

/// The error of a file that is not UTF-8, marked at its first invalid byte.
fn invalid_utf8(path: &Path, bytes: &[u8]) -> LoadFailure {
    let start = match std::str::from_utf8(bytes) {
        Ok(text) => text.len(),
        Err(error) => error.valid_up_to(),
    };
    // The lossy text has a replacement character at the invalid byte, which the span covers.
    let text = String::from_utf8_lossy(bytes).into_owned();
    let end = (start + char::REPLACEMENT_CHARACTER.len_utf8()).min(text.len());
    let span = SourceSpan { file: 0, start, end };
    LoadFailure {
        diagnostics: vec![
            Diagnostic::error(span, "this file is not UTF-8 text")
                .label("the first invalid byte")
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
