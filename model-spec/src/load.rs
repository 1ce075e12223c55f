//! Reads a model file and those that it extends, and builds the mechanism that they describe.
//!
//! `read_chain` merges variants over their base, `read_libraries` adds kinds of effects, `build` makes the mechanism.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use modelmill_boundary::files::{DiskFiles, FileError, FileFault, FileSource, normalise_path};
use modelmill_boundary::text::{RemedyWording, RustWording};

use crate::build::build;
use crate::diagnostic::{self, Diagnostic, DiagnosticLog, SourceFile, SourceFiles, SourceSpan};
use crate::document::{self, TomlTable, TomlValue, find_key, quote};
use crate::kinds::{self, EffectKind};
use crate::mechanism::Mechanism;
use crate::merge::merge;
use crate::reading::{read_referenced, read_text};
use crate::schema::{EffectKindEntry, ModelEntry};

/// Most files in a chain of variants.
const LONGEST_CHAIN: usize = 8;

/// A model file that was read and has no errors.
#[derive(Clone, Debug)]
pub struct LoadedModel {
    /// What the file describes.
    pub mechanism: Mechanism,
    /// Findings that may not be intended, such as names that nothing uses.
    pub warnings: Vec<Diagnostic>,
    /// The files that were read.
    pub sources: SourceFiles,
    /// The kinds of effects that the file may use: the library's, then its own.
    pub kinds: Vec<EffectKind>,
    /// The place of each product of [`Mechanism::retain`].
    pub retain: Vec<SourceSpan>,
    /// The tables that the mechanism was built from, kept to add effects later.
    pub(crate) entries: Arc<FileEntries>,
}

/// The tables of a model file and of its libraries.
#[derive(Debug)]
pub(crate) struct FileEntries {
    /// The merged model file.
    pub(crate) model: ModelEntry,
    /// Kinds of effects of all libraries of the user, in the order in which they were read.
    pub(crate) libraries: Vec<EffectKindEntry>,
}

impl LoadedModel {
    /// The warnings as text with their source lines; empty if there are none.
    pub fn render(&self, color: bool) -> String {
        self.render_for(color, &RustWording)
    }

    /// [`LoadedModel::render`] with advice written for the reader's front end.
    pub fn render_for(&self, color: bool, wording: &dyn RemedyWording) -> String {
        if self.warnings.is_empty() {
            return String::new();
        }
        diagnostic::render(&self.warnings, &self.sources, color, wording)
    }
}

/// A model file with errors, and its findings.
#[derive(Clone, Debug)]
pub struct LoadFailure {
    /// All findings, errors and warnings, in the order of the file.
    pub diagnostics: Vec<Diagnostic>,
    /// The files that were read.
    pub sources: SourceFiles,
}

impl LoadFailure {
    /// The findings as text with their source lines and advice.
    pub fn render(&self, color: bool) -> String {
        self.render_for(color, &RustWording)
    }

    /// [`LoadFailure::render`] with advice written for the reader's front end.
    pub fn render_for(&self, color: bool, wording: &dyn RemedyWording) -> String {
        diagnostic::render(&self.diagnostics, &self.sources, color, wording)
    }
}

impl std::fmt::Display for LoadFailure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.render(false))
    }
}

impl std::error::Error for LoadFailure {}

/// Reads a model file from disk, and those that it extends.
///
/// Fails with every finding about the files, each with its place.
pub fn load_file(path: &Path) -> Result<LoadedModel, LoadFailure> {
    load_file_with(path, &[], &DiskFiles::default())
}

/// Reads a model file as [`load_file`] does, with further libraries of kinds of effects, and all files from `files`.
pub fn load_file_with(path: &Path, libraries: &[PathBuf], files: &dyn FileSource) -> Result<LoadedModel, LoadFailure> {
    let advice = "give the path of a model file, such as `model-spec/models/two_link.toml`";
    let text = read_text(files, path, advice)?;
    load_with(&path.to_string_lossy(), &text, libraries, files)
}

/// Reads a model from its text; files that it extends come from `files`.
///
/// Messages call the file `path_name`, and paths in `extends` are relative to its folder.
///
/// ```
/// let text = r#"
///     schema = 1
///     name = "pendulum"
///     gravity = [0, "-g", 0]
///     constants = { g = { value = 9.81, unit = "m/s^2" } }
///     coordinates = { angle = {} }
///     frame = [{ name = "arm", on = "base", modified_dh = { theta = "angle" } }]
///     part = [{ on = "arm", linear = { planar = "1" } }]
///     drive = [{ name = "motor", joint = "angle" }]
/// "#;
/// let files = modelmill_boundary::files::MemoryFiles::default();
/// let loaded = modelmill_spec::load("pendulum.toml", text, &files).unwrap();
/// let names: Vec<_> = loaded.mechanism.parameters.iter().map(|p| p.name.as_str()).collect();
/// assert_eq!(names, ["ZZ1", "MX1", "MY1", "M1"]);
///
/// let failure = modelmill_spec::load("p.toml", &text.replace("\"angle\" }", "\"angel\" }"), &files);
/// assert!(failure.unwrap_err().render(false).contains("did you mean `angle`?"));
/// ```
pub fn load(path_name: &str, text: &str, files: &dyn FileSource) -> Result<LoadedModel, LoadFailure> {
    load_with(path_name, text, &[], files)
}

/// Reads a model from its text as [`load`] does, with further libraries of kinds of effects. Their paths are used
/// unchanged.
pub fn load_with(
    path_name: &str,
    text: &str,
    libraries: &[PathBuf],
    files: &dyn FileSource,
) -> Result<LoadedModel, LoadFailure> {
    let mut log = DiagnosticLog::default();
    let mut sources = SourceFiles::default();
    let (table, named) = read_chain(path_name, text, files, &mut sources, &mut log);
    // Libraries of the caller come first, then those that the files name.
    let given = libraries.iter().map(|path| (path.clone(), None));
    let libraries: Vec<_> = given.chain(named).collect();
    let libraries = read_libraries(&libraries, files, &mut sources, &mut log);
    // The top-level table has no position of its own; missing keys are reported at the start of the file.
    let whole = SourceSpan {
        file: 0,
        start: 0,
        end: 0,
    };
    let model = ModelEntry::from_table(&table, whole, &mut log);
    if has_unread_section(&table, &model) {
        log.syntax_broken = true;
    }
    let (mechanism, kinds) = if log.syntax_broken {
        // Names that a broken line would define would all be reported as unknown.
        (None, Vec::new())
    } else {
        build(&model, &libraries, &mut log)
    };
    let mut diagnostics = log.finish();
    let Some(mechanism) = mechanism else {
        diagnostics.sort_by_key(|found| found.severity);
        return Err(LoadFailure { diagnostics, sources });
    };
    Ok(LoadedModel {
        mechanism,
        warnings: diagnostics,
        sources,
        kinds,
        retain: model
            .retain
            .iter()
            .flat_map(|list| &list.entries)
            .map(|formula| formula.ast.span)
            .collect(),
        entries: Arc::new(FileEntries { model, libraries }),
    })
}

/// Whether a section of quantities could not be read at all, so that uses of its names would be reported as unknown.
fn has_unread_section(table: &TomlTable, model: &ModelEntry) -> bool {
    let sections = [
        ("constants", model.constants.is_none()),
        ("parameters", model.parameters.is_none()),
        ("coordinates", model.coordinates.is_none()),
    ];
    let mut unread = sections.iter().filter(|(_, is_unread)| *is_unread);
    unread.any(|(key, _)| find_key(table, key).is_some())
}

/// The kinds of effects of the program's library, followed by those of further libraries.
///
/// Fails with every finding about the further libraries, each with its place.
pub fn kinds_with(libraries: &[PathBuf], files: &dyn FileSource) -> Result<Vec<EffectKind>, LoadFailure> {
    let mut log = DiagnosticLog::default();
    let mut sources = SourceFiles::default();
    let named: Vec<NamedPath> = libraries.iter().map(|path| (path.clone(), None)).collect();
    let own = read_libraries(&named, files, &mut sources, &mut log);
    for entry in &own {
        kinds::check_kind(entry, &mut log);
    }
    if log.n_errors() > 0 {
        return Err(LoadFailure {
            diagnostics: log.finish(),
            sources,
        });
    }
    let own = own.iter().map(|entry| kinds::describe(entry, true));
    Ok(kinds::library().into_iter().chain(own).collect())
}

/// Reads a file and those that it extends, and merges them: entries of a variant replace those of its base.
///
/// Returns the merged table and the libraries that any of the files name.
fn read_chain(
    path_name: &str,
    text: &str,
    files: &dyn FileSource,
    sources: &mut SourceFiles,
    log: &mut DiagnosticLog,
) -> (TomlTable, Vec<NamedPath>) {
    // Tables are collected from the variant down to the base.
    let mut tables = Vec::new();
    let mut libraries = Vec::new();
    let mut path = PathBuf::from(path_name);
    let mut text = text.to_owned();
    loop {
        let file = sources.files.len();
        let table = document::parse_toml(&text, file, log);
        sources.files.push(SourceFile {
            path: path.clone(),
            text,
        });
        libraries.extend(named_libraries(&table, &path));
        let next = extended_file(&table, &path, sources, files, log);
        tables.push(table);
        match next {
            Some((next_path, next_text)) => {
                path = next_path;
                text = next_text;
            }
            None => break,
        }
    }
    // The base is last; variants are merged over it in reverse order.
    let mut merged = tables.pop().unwrap_or_default();
    while let Some(variant) = tables.pop() {
        merged = merge(merged, variant, log);
    }
    (merged, libraries)
}

/// A path, and the place where a file names it; `None` for paths of the caller.
type NamedPath = (PathBuf, Option<SourceSpan>);

/// The libraries that a file names, relative to its own folder.
fn named_libraries(table: &TomlTable, path: &Path) -> Vec<NamedPath> {
    let Some((_, node)) = find_key(table, "library") else {
        return Vec::new();
    };
    let entries = match &node.value {
        TomlValue::Array(entries) => entries.as_slice(),
        _ => std::slice::from_ref(node),
    };
    // Entries that are not strings are reported by the reader of the merged file.
    let texts = entries.iter().filter_map(|entry| match &entry.value {
        TomlValue::Text { text, .. } => Some((text, entry.span)),
        _ => None,
    });
    let folder = path.parent().unwrap_or(Path::new(""));
    texts
        .map(|(text, span)| (normalise_path(&folder.join(text)), Some(span)))
        .collect()
}

/// Reads libraries of kinds of effects, each path once.
fn read_libraries(
    libraries: &[NamedPath],
    files: &dyn FileSource,
    sources: &mut SourceFiles,
    log: &mut DiagnosticLog,
) -> Vec<EffectKindEntry> {
    let mut kinds = Vec::new();
    for (i, (path, named)) in libraries.iter().enumerate() {
        let same = |(other, _): &NamedPath| normalise_path(other) == normalise_path(path);
        if libraries[..i].iter().any(same) {
            continue;
        }
        let file = sources.files.len();
        let path_name = quote(&path.to_string_lossy());
        match read_referenced(files, path, &["effect_kind", "schema"]) {
            Ok(text) => {
                let entries = kinds::own_library(&text, file, log);
                sources.files.push(SourceFile {
                    path: path.clone(),
                    text,
                });
                kinds.extend(entries);
            }
            // The error is marked where a file names the library; a path of the caller has no place.
            Err(error) => {
                let diagnostic = Diagnostic {
                    span: *named,
                    ..Diagnostic::error(
                        SourceSpan {
                            file: 0,
                            start: 0,
                            end: 0,
                        },
                        format!("cannot read `{path_name}`: {}", error.fault),
                    )
                };
                log.push(
                    diagnostic
                        .label("expected the path of a library of effects")
                        .help("a library is a TOML file of `[[effect_kind]]` tables; a path in a model file starts from the folder of that file"),
                );
                // The kinds that it would define are not reported as unknown.
                log.syntax_broken = true;
            }
        }
    }
    kinds
}

/// The path and text of the file that this one extends, if any; failures are reported.
fn extended_file(
    table: &TomlTable,
    path: &Path,
    sources: &SourceFiles,
    files: &dyn FileSource,
    log: &mut DiagnosticLog,
) -> Option<(PathBuf, String)> {
    let (_, node) = find_key(table, "extends")?;
    let TomlValue::Text { text: target, .. } = &node.value else {
        // The merge drops a base's own `extends`, so its type must be checked here.
        if !sources.files.is_empty() && sources.files.len() > 1 {
            log.push(Diagnostic::error(node.span, "`extends` is not a path").label("expected a path in quotes"));
        }
        return None;
    };
    let next = normalise_path(&path.parent().unwrap_or(Path::new("")).join(target));
    let mut refuse = |message: String, label: &str, help: &str| {
        log.push(Diagnostic::error(node.span, message).label(label).help(help));
        // Names that the missing file would define are not reported as unknown.
        log.syntax_broken = true;
    };
    // A file that is already in the chain would be read without end.
    if sources.files.iter().any(|file| normalise_path(&file.path) == next) {
        refuse(
            "these files extend one another in a circle".to_owned(),
            "this file is being read already",
            "a variant extends a file that does not depend on it",
        );
        return None;
    }
    if sources.files.len() >= LONGEST_CHAIN {
        refuse(
            "this chain of variants is too long".to_owned(),
            "one file too many",
            &format!("at most {LONGEST_CHAIN} files extend one another"),
        );
        return None;
    }
    match read_referenced(files, &next, &["schema"]) {
        Ok(text) => Some((next, text)),
        // `.` next to a file without a folder in its path gives an empty path.
        Err(FileError { fault, .. }) if fault == FileFault::Folder || next.as_os_str().is_empty() => {
            refuse(
                format!("`{}` is a folder", quote(target)),
                "expected the path of a model file, relative to this one",
                "name the file in it, such as `extends = \"arm.toml\"`",
            );
            None
        }
        Err(FileError { fault, .. }) => {
            refuse(
                format!("cannot read `{}`: {fault}", quote(&next.to_string_lossy())),
                "expected the path of a model file, relative to this one",
                "check the path; it starts from the folder of the file that names it",
            );
            None
        }
    }
}
