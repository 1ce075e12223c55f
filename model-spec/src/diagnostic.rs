//! Diagnostics: what is wrong with a model file, where, what was expected and what to do about it.
//!
//! Findings go in, text as rustc prints it comes out.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;

use annotate_snippets::renderer::DecorStyle;
use annotate_snippets::{AnnotationKind, Group, Level, Origin, Renderer, Snippet};
use modelmill_boundary::text::{Message, RemedyWording};

/// How many diagnostics are kept. A file with more usually has one common cause.
const MOST_DIAGNOSTICS: usize = 100;
/// Longest line in bytes that is printed; longer ones are only named by line and column.
const LONGEST_PRINTED_LINE: usize = 400;

/// A segment of bytes in one of the files read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SourceSpan {
    /// Index into [`SourceFiles::files`].
    pub file: usize,
    /// First byte.
    pub start: usize,
    /// One past the last byte.
    pub end: usize,
}

/// How serious a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum DiagnosticSeverity {
    /// The model cannot be built until this is corrected.
    Error,
    /// The model can be built, though perhaps not as intended.
    Warning,
}

/// One finding about a model file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// Error or warning.
    pub severity: DiagnosticSeverity,
    /// What is wrong, in one line.
    pub message: String,
    /// Where; absent if a file could not be read at all.
    pub span: Option<SourceSpan>,
    /// What was expected there; may be empty.
    pub label: String,
    /// Another place that explains the finding, such as a first definition.
    pub related: Option<(SourceSpan, String)>,
    /// What to do, one sentence each.
    pub help: Vec<Message>,
    /// True for a warning of values that no machine can have, such as a negative mass. Equations are still right, but
    /// the values of the file are not.
    pub is_impossible: bool,
}

impl Diagnostic {
    /// An error at a place.
    pub(crate) fn error(span: SourceSpan, message: impl Into<String>) -> Self {
        Self {
            severity: DiagnosticSeverity::Error,
            message: message.into(),
            span: Some(span),
            label: String::new(),
            related: None,
            help: Vec::new(),
            is_impossible: false,
        }
    }

    /// A warning at a place.
    pub(crate) fn warning(span: SourceSpan, message: impl Into<String>) -> Self {
        Self {
            severity: DiagnosticSeverity::Warning,
            ..Self::error(span, message)
        }
    }

    /// Marks a warning of values that no machine can have, if `is_impossible`.
    #[must_use]
    pub(crate) fn impossible_if(self, is_impossible: bool) -> Self {
        Self { is_impossible, ..self }
    }

    /// Sets the text at the marked place: what was expected there.
    #[must_use]
    pub(crate) fn label(mut self, label: impl Into<String>) -> Self {
        self.label = label.into();
        self
    }

    /// Adds a second place with its own text, such as a first definition.
    #[must_use]
    pub(crate) fn related(mut self, span: SourceSpan, label: impl Into<String>) -> Self {
        self.related = Some((span, label.into()));
        self
    }

    /// Points to where a variant removes what is missing; otherwise gives other advice.
    #[must_use]
    pub(crate) fn with_removal_or(self, removal: Option<SourceSpan>, advice: impl FnOnce() -> String) -> Self {
        match removal {
            Some(span) => self
                .related(span, "the variant removes it here")
                .help("remove what uses it as well, or keep it"),
            None => self.help(advice()),
        }
    }

    /// Adds one sentence of advice.
    #[must_use]
    pub(crate) fn help(mut self, help: impl Into<Message>) -> Self {
        self.help.push(help.into());
        self
    }

    /// Adds advice if there is any.
    #[must_use]
    pub(crate) fn help_if(mut self, help: Option<String>) -> Self {
        self.help.extend(help.map(Message::from));
        self
    }
}

/// One file that was read.
#[derive(Clone, Debug)]
pub struct SourceFile {
    /// The path as the user gave it, or as `extends` leads to it.
    pub path: PathBuf,
    /// Its text.
    pub text: String,
}

/// The files that a model was read from, the model's own first.
#[derive(Clone, Debug, Default)]
pub struct SourceFiles {
    /// The files in the order in which they were read.
    pub files: Vec<SourceFile>,
}

impl SourceFiles {
    /// The paths of all files, for `cargo:rerun-if-changed`.
    pub fn paths(&self) -> impl Iterator<Item = &std::path::Path> {
        self.files.iter().map(|file| file.path.as_path())
    }

    /// Line and column of a place, both counted from one, the column in characters.
    pub fn line_and_column(&self, span: SourceSpan) -> (usize, usize) {
        let Some(file) = self.files.get(span.file) else {
            return (1, 1);
        };
        let before = &file.text[..floor_boundary(&file.text, span.start)];
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().unwrap_or("").chars().count() + 1;
        (line, column)
    }
}

/// Collects findings while a file is read.
#[derive(Debug, Default)]
pub(crate) struct DiagnosticLog {
    /// The findings that are kept, without duplicates; at most [`MOST_DIAGNOSTICS`].
    diagnostics: Vec<Diagnostic>,
    /// Number of errors that were pushed, including those that are not kept.
    n_errors: usize,
    /// Number of findings beyond the limit.
    n_left_off: usize,
    /// Set while the text itself is broken: missing entries are then not reported.
    pub(crate) syntax_broken: bool,
    /// Where variants remove entries, by section and name; a use of a removed entry is reported with this place.
    pub(crate) removed: BTreeMap<(String, String), SourceSpan>,
}

impl DiagnosticLog {
    /// Adds a finding, unless it is a duplicate or a consequence of another one.
    pub(crate) fn push(&mut self, diagnostic: Diagnostic) {
        if diagnostic.severity == DiagnosticSeverity::Error {
            self.n_errors += 1;
        }
        if self.diagnostics.contains(&diagnostic) || self.is_consequence(&diagnostic) {
            return;
        }
        if self.diagnostics.len() < MOST_DIAGNOSTICS {
            self.diagnostics.push(diagnostic);
        } else {
            self.n_left_off += 1;
        }
    }

    /// Whether broken text was already reported at the place of this finding.
    fn is_consequence(&self, diagnostic: &Diagnostic) -> bool {
        let start = |one: &Diagnostic| one.span.map(|span| (span.file, span.start));
        let is_there = |one: &Diagnostic| start(one) == start(diagnostic);
        self.syntax_broken && diagnostic.span.is_some() && self.diagnostics.iter().any(is_there)
    }

    /// True once there are so many findings that it is not worth working out good advice for more.
    pub(crate) fn is_full(&self) -> bool {
        self.diagnostics.len() >= MOST_DIAGNOSTICS
    }

    /// Where a variant removes an entry from one of these sections.
    pub(crate) fn removal(&self, sections: &[&str], name: &str) -> Option<SourceSpan> {
        sections.iter().find_map(|section| {
            let key = ((*section).to_owned(), name.to_owned());
            self.removed.get(&key).copied()
        })
    }

    /// Number of errors so far.
    pub(crate) fn n_errors(&self) -> usize {
        self.n_errors
    }

    /// All findings in the order of their places.
    pub(crate) fn finish(mut self) -> Vec<Diagnostic> {
        // A stable sort keeps the order of findings at the same place; those without a place come first.
        self.diagnostics
            .sort_by_key(|found| found.span.map(|span| (span.file, span.start)));
        if self.n_left_off > 0 {
            self.diagnostics.push(Diagnostic {
                severity: if self.n_errors > 0 {
                    DiagnosticSeverity::Error
                } else {
                    DiagnosticSeverity::Warning
                },
                message: format!(
                    "{} not shown; correct the first ones and check again",
                    match self.n_left_off {
                        1 => "1 more finding is".to_owned(),
                        n => format!("{n} more findings are"),
                    }
                ),
                span: None,
                label: String::new(),
                related: None,
                help: Vec::new(),
                is_impossible: false,
            });
        }
        self.diagnostics
    }
}

/// Renders findings one below the other, with the source lines and advice written for the reader's front end.
pub(crate) fn render(
    diagnostics: &[Diagnostic],
    sources: &SourceFiles,
    color: bool,
    wording: &dyn RemedyWording,
) -> String {
    let renderer = if color { Renderer::styled() } else { Renderer::plain() }.decor_style(DecorStyle::Ascii);
    let mut text = String::new();
    for diagnostic in diagnostics {
        text.push_str(&render_one(diagnostic, sources, &renderer, wording));
        text.push_str("\n\n");
    }
    text.truncate(text.trim_end().len());
    text.push('\n');
    // File names and source lines come from users and may contain control sequences of terminals.
    modelmill_boundary::text::terminal(&text, color).into_owned()
}

/// Renders one finding: title, marked source lines, and its advice.
fn render_one(
    diagnostic: &Diagnostic,
    sources: &SourceFiles,
    renderer: &Renderer,
    wording: &dyn RemedyWording,
) -> String {
    let help = diagnostic.help.iter();
    let help: Vec<String> = help.map(|help| help.format_for(wording)).collect();
    let level = match diagnostic.severity {
        DiagnosticSeverity::Error => Level::ERROR,
        DiagnosticSeverity::Warning => Level::WARNING,
    };
    let mut group = Group::with_title(level.primary_title(diagnostic.message.as_str()));
    if let Some(span) = diagnostic.span {
        let label = Some(diagnostic.label.as_str()).filter(|label| !label.is_empty());
        // A second place in the same file goes into the same snippet, otherwise into a snippet of its own.
        match diagnostic.related.as_ref() {
            Some((other, text)) if other.file == span.file => {
                group = annotate_lines(group, sources, &[(span, label, true), (*other, Some(text), false)]);
            }
            Some((other, text)) => {
                group = annotate_lines(group, sources, &[(span, label, true)]);
                group = annotate_lines(group, sources, &[(*other, Some(text), false)]);
            }
            None => group = annotate_lines(group, sources, &[(span, label, true)]),
        }
    }
    if diagnostic.span.is_none() {
        // Without a snippet the renderer would begin the help by an empty margin.
        let mut text = renderer.render(&[group]);
        for help in &help {
            let _ = write!(text, "\n  = help: {help}");
        }
        return text;
    }
    for help in &help {
        group = group.element(Level::HELP.message(help.as_str()));
    }
    renderer.render(&[group])
}

///
/// Adds the marked lines of one file to a group; long lines are named, not shown.
fn annotate_lines<'a>(
    group: Group<'a>,
    sources: &'a SourceFiles,
    marks: &[(SourceSpan, Option<&'a str>, bool)],
) -> Group<'a> {
    let Some(file) = marks.first().and_then(|mark| sources.files.get(mark.0.file)) else {
        return group;
    };
    // The window covers all complete lines from the first mark to the last.
    let text = file.text.as_str();
    let path = file.path.to_string_lossy().replace('\\', "/");
    let first = marks.iter().map(|mark| mark.0.start).min().unwrap_or(0);
    let last = marks.iter().map(|mark| mark.0.end).max().unwrap_or(0);
    let start = line_start(text, first);
    let end = line_end(text, last);
    let window = &text[start..end];
    if window.lines().any(|line| line.len() > LONGEST_PRINTED_LINE) || window.len() > 200 * LONGEST_PRINTED_LINE {
        let (line, column) = sources.line_and_column(marks[0].0);
        let mut group = group.element(Origin::path(path).line(line).char_column(column));
        if let Some(label) = marks[0].1 {
            group = group.element(Level::NOTE.message(label));
        }
        return group;
    }
    // Line numbers count from one; positions of marks are relative to the window.
    let line = text[..start].matches('\n').count() + 1;
    let mut snippet = Snippet::source(window).line_start(line).path(path);
    for &(span, label, primary) in marks {
        let kind = if primary {
            AnnotationKind::Primary
        } else {
            AnnotationKind::Context
        };
        let from = floor_boundary(text, span.start).clamp(start, end);
        let to = ceil_boundary(text, span.end).clamp(from, end);
        snippet = snippet.annotation(kind.span(from - start..to - start).label(label));
    }
    group.element(snippet)
}

/// Byte at which the line that contains `at` starts.
fn line_start(text: &str, at: usize) -> usize {
    text[..floor_boundary(text, at)]
        .rfind('\n')
        .map_or(0, |found| found + 1)
}

/// Byte at which the line that contains `at` ends, without its line feed.
fn line_end(text: &str, at: usize) -> usize {
    let at = ceil_boundary(text, at);
    text[at..].find('\n').map_or(text.len(), |found| at + found)
}

/// The last character boundary at or before `at`, so that slicing cannot panic.
fn floor_boundary(text: &str, at: usize) -> usize {
    let mut at = at.min(text.len());
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    at
}

/// The first character boundary at or after `at`.
fn ceil_boundary(text: &str, at: usize) -> usize {
    let mut at = at.min(text.len());
    while !text.is_char_boundary(at) {
        at += 1;
    }
    at
}
