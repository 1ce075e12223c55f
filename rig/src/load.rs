//! Reads a rig file and those that it extends, and assembles the rig that they describe.

use std::path::{Path, PathBuf};

use modelmill_boundary::files::{DiskFiles, FileSource, normalise_path};
use modelmill_boundary::text::RemedyWording;
use modelmill_spec::{
    Diagnostic, DiagnosticSeverity, LoadFailure, SourceFile, SourceFiles, SourceSpan, find_toml_excess,
    read_referenced, read_text,
};

use crate::assemble::assemble;
use crate::file::RigEntry;
use crate::log::RigLog;
use crate::mass_properties::{read_mass_properties, refuse_lost_poses};
use crate::plausible::size_remark;
use crate::rig::Rig;

/// Longest chain of variants.
const LONGEST_CHAIN: usize = 8;

/// A rig file that was read without errors.
#[derive(Clone, Debug)]
pub struct LoadedRig {
    /// What the file describes.
    pub rig: Rig,
    /// The files that were read.
    pub sources: SourceFiles,
    /// Remarks about mass properties: conventions that were assumed, and values that are improbable.
    pub remarks: Vec<Diagnostic>,
}

impl LoadedRig {
    /// The remarks as text with their source lines and advice.
    pub fn render_remarks(&self, color: bool, wording: &dyn RemedyWording) -> String {
        let found = LoadFailure {
            diagnostics: self.remarks.clone(),
            sources: self.sources.clone(),
        };
        found.render_for(color, wording)
    }
}

/// Reads a rig file from disk, and those that it extends.
///
/// Fails with errors in the files, each with its place and a remedy.
pub fn load_file(path: &Path) -> Result<LoadedRig, LoadFailure> {
    load_file_with(path, &DiskFiles::default())
}

/// Reads a rig file as [`load_file`] does, with all files from `files`.
pub fn load_file_with(path: &Path, files: &dyn FileSource) -> Result<LoadedRig, LoadFailure> {
    let advice = "give the path of a rig file, such as `model-spec/rigs/spidermill-full.toml`";
    let text = read_text(files, path, advice)?;
    load(&path.to_string_lossy(), &text, files)
}

/// Reads a rig from its text; files that it extends come from `files`.
///
/// ```
/// let text = r#"
///     schema = 1
///     name = "pendulum"
///     gravity = [0, -9.81, 0]
///     body = [{ name = "arm", mass = 2, centre = [0.5, 0, 0], inertia = { zz = 0.1 } }]
///     joint = [{ name = "hinge", kind = "revolute", between = ["base", "arm"], at = [0, 0, 0] }]
///     coordinate = [{ name = "q", joint = "hinge" }]
///     drive = [{ name = "motor", joint = "hinge" }]
/// "#;
/// let files = modelmill_boundary::files::MemoryFiles::default();
/// let rig = modelmill_rig::load("pendulum.toml", text, &files)?.rig;
/// let mut tracker = modelmill_rig::RigTracker::new(&rig)?;
/// let state = modelmill_rig::RigState { q: vec![0.3], qd: vec![0.0], qdd: vec![0.0] };
/// let torque = modelmill_rig::forces(&rig, &tracker.follow(&state)?)?[0];
/// assert!((torque - 2.0 * 9.81 * 0.5 * 0.3_f64.cos()).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn load(path_name: &str, text: &str, files: &dyn FileSource) -> Result<LoadedRig, LoadFailure> {
    let mut sources = SourceFiles::default();
    let mut chain = Vec::new();
    let (mut log, mut remarks) = (RigLog::default(), Vec::new());
    let mut added = Vec::new();
    let mut next = Some((PathBuf::from(path_name), text.to_owned()));
    while let Some((path, text)) = next.take() {
        let file = sources.files.len();
        sources.files.push(SourceFile {
            path: path.clone(),
            text: text.clone(),
        });
        let mut entry: RigEntry = match parse(&text, file) {
            Ok(entry) => entry,
            Err(found) => return Err(failure(sources, *found)),
        };
        if let Some(extends) = &entry.extends {
            let span = Some(source_span(file, &extends.span()));
            let folder = path.parent().unwrap_or(Path::new(""));
            let other = normalise_path(&folder.join(extends.get_ref()));
            if chain.len() + 1 == LONGEST_CHAIN {
                let help = "check whether two files extend each other".into();
                let found = plain_error(span, "this chain of variants is too long");
                return Err(failure(
                    sources,
                    Diagnostic {
                        help: vec![help],
                        ..found
                    },
                ));
            }
            match read_referenced(files, &other, &["schema"]) {
                Ok(text) => next = Some((other, text)),
                Err(error) => {
                    let says = format!("cannot read `{}`: {}", other.display(), error.fault);
                    let found = plain_error(span, says);
                    let help = "the path is relative to the folder of this file".into();
                    return Err(failure(
                        sources,
                        Diagnostic {
                            help: vec![help],
                            ..found
                        },
                    ));
                }
            }
        }
        let folder = path.parent().unwrap_or(Path::new(""));
        // Before the bodies of this file are added: only those of a file that extends it can replace it.
        refuse_lost_poses(&added, &entry, &path, &mut log);
        added.extend(read_mass_properties(
            file,
            folder,
            &mut entry,
            files,
            &mut sources,
            &mut log,
            &mut remarks,
        ));
        chain.push((file, entry));
    }
    // Without their masses, bodies would have faults of their own.
    if !log.0.is_empty() {
        return Err(LoadFailure {
            diagnostics: log.0,
            sources,
        });
    }
    match assemble(chain) {
        Ok(rig) => {
            remarks.extend(size_remark(&rig));
            Ok(LoadedRig { rig, sources, remarks })
        }
        Err(diagnostics) => Err(LoadFailure { diagnostics, sources }),
    }
}

/// Reads the tables of a TOML file; `file` is its index among the sources.
///
/// Fails with the place of the first entry that does not have the expected form.
pub fn parse<T: serde::de::DeserializeOwned>(text: &str, file: usize) -> Result<T, Box<Diagnostic>> {
    if let Some(excess) = find_toml_excess(text) {
        let place = source_span(file, &(excess.at..excess.at));
        let found = plain_error(Some(place), excess.fault);
        return Err(Box::new(Diagnostic {
            label: excess.limit.to_owned(),
            ..found
        }));
    }
    toml::from_str(text).map_err(|error| {
        let place = error.span().map(|range| source_span(file, &range));
        let mut found = plain_error(place, error.message().lines().next().unwrap_or("this is not TOML"));
        let message = error.message();
        found.help.push(
            if message.contains("unknown field") {
                "take one of the keys listed, or delete this one"
            } else if message.contains("missing field") {
                "add the missing key to this table"
            } else if message.contains("invalid") && error.span().is_some() {
                "give a value of the kind that is expected: places are `[x, y, z]` in m, numbers are in SI units"
            } else {
                "see https://toml.io for the syntax of TOML, and model-spec/rigs for examples"
            }
            .into(),
        );
        Box::new(found)
    })
}

/// A failure with a single error.
fn failure(sources: SourceFiles, found: Diagnostic) -> LoadFailure {
    LoadFailure {
        diagnostics: vec![found],
        sources,
    }
}

/// A place in a file.
pub fn source_span(file: usize, range: &std::ops::Range<usize>) -> SourceSpan {
    SourceSpan {
        file,
        start: range.start,
        end: range.end,
    }
}

/// An error with a message only: no label and no help.
pub fn plain_error(span: Option<SourceSpan>, message: impl Into<String>) -> Diagnostic {
    Diagnostic {
        severity: DiagnosticSeverity::Error,
        message: message.into(),
        span,
        label: String::new(),
        related: None,
        help: Vec::new(),
        is_impossible: false,
    }
}
