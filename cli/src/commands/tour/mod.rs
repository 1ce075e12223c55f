//! `tour`: all main steps on bundled recordings: derive, compare, find the missing effect, add it, identify again; then
//! a diagnosis of the model as published in the paper. Its models, recordings and pages are written into one folder, so
//! that each command can be repeated by hand.

mod story;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use modelmill::compare::ModelComparison;
use modelmill::diagnose::{DiagnosisFindings, DiagnosisOptions, FixedParameters};
use modelmill::files::{FileError, FileSource, MemoryFiles, OpenFile, PathKind};
use modelmill::print::{StepWording, edit};
use modelmill::recording::{PreparedRecording, RecordingOptions};
use modelmill::report::page;
use modelmill::{Host, Model, along};
use modelmill_recordings::{BundledRuns, MODELS, PLAIN, WITH_RODS};

use crate::args::TourArgs;
use crate::failure::{CommandFailure, CommandOutcome};
use crate::flags::{CommandLineWording, quote_word};
use crate::output::{self, OutputSet};
use crate::terminal;

use story::TourText;

/// The page of the robot with rods.
const RODS_PAGE: &str = "report.html";
/// The page of the paper's treatment.
const PAPER_PAGE: &str = "report-paper.html";
/// File of the model with the effects that were found.
const EDITED: &str = "spidermill-completed.toml";

/// Prints the tour and writes its files.
pub(crate) fn run(host: &Host, args: &TourArgs) -> CommandOutcome {
    let folder = args
        .out
        .clone()
        .unwrap_or_else(|| std::env::temp_dir().join("modelmill-tour"));
    output::make_folder(&folder)?;
    let mut place = TourFolder::new(&folder);
    let host = &host.clone().with_files(Arc::new(place.files.clone()));
    let mut story = TourText::new(terminal::style());

    // Steps 1 to 5: the recording has rods, the model does not.
    let model = place.model(host, "spidermill.toml")?;
    let runs = place.read(&model, &WITH_RODS)?;
    story.derive(&place.name("spidermill.toml"), &model);
    let seen = TourComparison::new(&model, &runs[1])?;
    story.compare(&place, &model, &seen);

    let flags = place.flags(&WITH_RODS);
    // Base parameters are estimated, as a user would do with an unknown machine.
    let rods = diagnose(&model, &runs, FixedParameters::Known)?;
    story.diagnose(&place, &seen, &rods);
    let edited = place.add(&rods, &flags);
    story.add(&place, edited.as_ref());
    story.steps(&rods);
    place.add_file(RODS_PAGE, page(&rods, &flags)?);

    // Step 6: the model as published, on a recording without rods.
    let model = place.model(host, "spidermill-paper.toml")?;
    let runs = place.read(&model, &PLAIN)?;
    // Base parameters are fixed: estimated ones would absorb most of the error.
    let paper = diagnose(&model, &runs, FixedParameters::All)?;
    story.paper(&place, &paper);
    let flags = place.flags(&PLAIN);
    place.add_file(PAPER_PAGE, page(&paper, &flags)?);

    story.pages(&place);
    // Files are written before the text, so that they exist even if standard output is closed.
    place.outputs.write()?;
    terminal::print(story.text.trim_start())
}

/// Diagnoses the first recording as fit and the second as validation run.
fn diagnose(
    model: &Model,
    [fit, check]: &[PreparedRecording; 2],
    fixed: FixedParameters,
) -> CommandOutcome<DiagnosisFindings> {
    let question = DiagnosisOptions {
        fixed,
        // The second diagnosis would double the time of the tour.
        repeat_with_nominal: false,
    };
    Ok(model.diagnose(&[fit], &[check], &question)?)
}

/// The folder of the tour, with its models and recordings. They are written together at the end of the tour, and read
/// from memory until then.
struct TourFolder {
    /// Its path.
    folder: PathBuf,
    /// The models and recordings, and the files of the disk.
    files: TourFiles,
    /// All files of the folder.
    outputs: OutputSet,
}

/// Files of the tour that are not written yet, in front of those of the disk, such as libraries of effects.
#[derive(Clone, Debug, Default)]
struct TourFiles(MemoryFiles);

impl TourFiles {
    /// Where a path is read from.
    fn source(&self, path: &Path) -> &dyn FileSource {
        match self.0.kind(path) {
            PathKind::File => &self.0,
            _ => output::disk(),
        }
    }
}

impl FileSource for TourFiles {
    fn read(&self, path: &Path, most: u64) -> Result<Vec<u8>, FileError> {
        self.source(path).read(path, most)
    }

    fn kind(&self, path: &Path) -> PathKind {
        self.source(path).kind(path)
    }

    fn open(&self, path: &Path, most: u64) -> Result<OpenFile, FileError> {
        self.source(path).open(path, most)
    }
}

impl TourFolder {
    /// The folder with the models and recordings of the program.
    fn new(folder: &Path) -> Self {
        let mut place = Self {
            folder: folder.to_owned(),
            files: TourFiles::default(),
            outputs: OutputSet::default(),
        };
        // All bundled models, because some of them include others.
        let models = MODELS.iter().map(|(name, text)| (*name, *text));
        let runs = [&PLAIN, &WITH_RODS].into_iter().flat_map(|runs| [runs.fit, runs.check]);
        for (name, text) in models.chain(runs) {
            place.files.0.insert(place.path(name), text);
            place.add_file(file_name(name), text);
        }
        place
    }

    /// Adds a file to the folder.
    fn add_file(&mut self, name: &str, text: impl Into<String>) {
        self.outputs.add_path(self.folder.join(name), text);
    }

    /// A file of the folder as an argument of a command, quoted.
    fn name(&self, file: &str) -> String {
        quote_word(&self.folder.join(file).display().to_string())
    }

    /// Recordings as flags of a command.
    fn recordings(&self, runs: &BundledRuns) -> String {
        format!(
            "--data {} --check {}",
            self.name(file_name(runs.fit.0)),
            self.name(file_name(runs.check.0))
        )
    }

    /// Path of a file of the folder.
    fn path(&self, name: &str) -> PathBuf {
        self.folder.join(file_name(name))
    }

    /// Reads and derives a model of the folder.
    fn model(&self, host: &Host, name: &str) -> CommandOutcome<Model> {
        Ok(host.model(self.path(name))?)
    }

    /// Reads the fit run and the validation run, in this order.
    fn read(&self, model: &Model, runs: &BundledRuns) -> CommandOutcome<[PreparedRecording; 2]> {
        let read = |name: &str| model.recording(self.path(name), &RecordingOptions::default());
        Ok([read(runs.fit.0)?, read(runs.check.0)?])
    }

    /// The wording of commands that use the same recordings.
    fn flags(&self, runs: &BundledRuns) -> CommandLineWording {
        let [fit, check] = [runs.fit.0, runs.check.0].map(|name| self.path(name));
        CommandLineWording::new(&[fit], &[check], &RecordingOptions::default())
    }

    /// Adds the model with the effects that were found. Returns the commands that do the same, and the difference of
    /// the files.
    fn add(&mut self, findings: &DiagnosisFindings, flags: &CommandLineWording) -> Option<(Vec<String>, String)> {
        let edited = findings.edited.as_ref()?;
        self.add_file(EDITED, edited.text.as_str());
        let model = &findings.before.model;
        // The bundled recordings show one effect, and the tour keeps the given model file.
        let target = format!(" --out {}", self.name(EDITED));
        let commands = findings.entries.iter();
        let commands = commands.map(|entry| flags.format_effect(model, entry).replace(" --in-place", &target));
        let commands = commands.collect();
        // File names of the difference, as `diff` prints them.
        let names = ["spidermill.toml", EDITED];
        let difference = edit::difference(model.text(), &edited.text, names);
        let coloured = edit::colour_diff(&difference, terminal::style());
        Some((commands, coloured))
    }
}

/// The last part of a bundled recording's name.
fn file_name(name: &str) -> &str {
    name.rsplit('/').next().unwrap_or(name)
}

/// The model with nominal parameters compared with a recording.
struct TourComparison {
    /// Error figures, and where the error is largest.
    compared: ModelComparison,
    /// Times of the samples, s.
    time: Vec<f64>,
    /// Measured forces, N, `[drive][sample]`.
    measured: Vec<Vec<f64>>,
    /// Measured minus calculated forces, N, `[drive][sample]`.
    errors: Vec<Vec<f64>>,
}

impl TourComparison {
    /// Computes forces and errors along the first segment. Fails if the recording has no samples.
    fn new(model: &Model, recording: &PreparedRecording) -> CommandOutcome<Self> {
        let one = recording
            .segments
            .first()
            .ok_or_else(|| CommandFailure::Input("the bundled recording has no samples".to_owned()))?;
        let measured = along::measured_forces(one)?;
        // Samples of forces and measurements must agree, so both are decimated alike.
        let forces = along::filter_and_decimate(along::forces(model, one, &model.values)?, one)?;
        let errors = measured
            .iter()
            .zip(&forces)
            .map(|(y, m)| y.iter().zip(m).map(|(y, m)| y - m).collect())
            .collect();
        Ok(Self {
            compared: model.compare(&[recording], &model.values)?,
            time: one.time(),
            measured,
            errors,
        })
    }
}

/// The verdict of a diagnosis in words.
fn verdict(findings: &DiagnosisFindings) -> String {
    findings.verdict_text()
}
