//! `tour`: the whole story on bundled recordings: derive, compare, see where it fails, learn what is missing, add it, watch
//! the error fall; then the same for the paper's own treatment. Everything it uses and makes goes into one folder, so that
//! each command can be repeated by hand.

mod story;

use std::path::{Path, PathBuf};

use modelmill::compare::ModelComparison;
use modelmill::diagnose::{DiagnosisFindings, DiagnosisOptions, FixedParameters, words};
use modelmill::print::{StepSpelling, edit};
use modelmill::recording::{PreparedRecording, RecordingOptions};
use modelmill::report::page;
use modelmill::{Host, Model, along, bundled};
use modelmill_recordings::{BundledRuns, PLAIN, WITH_RODS};

use crate::args::TourArgs;
use crate::failure::{CommandFailure, CommandOutcome};
use crate::flags::{CommandLineSpelling, quote_word};
use crate::output;
use crate::terminal;

use story::TourText;

/// The page of the robot with rods.
const RODS_PAGE: &str = "report.html";
/// The page of the paper's treatment.
const PAPER_PAGE: &str = "report-paper.html";
/// The model with what was found.
const EDITED: &str = "spidermill-completed.toml";

/// Tells the story and writes its files.
pub(crate) fn run(host: &Host, args: &TourArgs) -> CommandOutcome {
    let folder = args
        .out
        .clone()
        .unwrap_or_else(|| std::env::temp_dir().join("modelmill-tour"));
    output::make_folder(&folder)?;
    let place = TourFolder::unpack(&folder)?;
    let mut story = TourText::new(terminal::style());

    let model = place.model(host, "spidermill.toml")?;
    let runs = place.read(&model, &WITH_RODS)?;
    story.derive(&place.name("spidermill.toml"), &model);
    let seen = TourComparison::new(&model, &runs[1])?;
    story.compare(&place, &model, &seen);

    let flags = place.flags(&WITH_RODS);
    let rods = diagnose(&model, &runs, FixedParameters::Known)?;
    story.diagnose(&place, &rods);
    let edited = place.add(&rods, &flags)?;
    story.add(&place, edited.as_ref());
    story.ladder(&rods);
    place.write(RODS_PAGE, &page(&rods, &flags)?)?;

    let model = place.model(host, "spidermill-paper.toml")?;
    let runs = place.read(&model, &PLAIN)?;
    let paper = diagnose(&model, &runs, FixedParameters::All)?;
    story.paper(&place, &paper);
    place.write(PAPER_PAGE, &page(&paper, &place.flags(&PLAIN))?)?;

    story.pages(&place);
    terminal::print(story.text.trim_start())
}

fn diagnose(
    model: &Model,
    [fit, check]: &[PreparedRecording; 2],
    held: FixedParameters,
) -> CommandOutcome<DiagnosisFindings> {
    let question = DiagnosisOptions {
        fixed: held,
        repeat_with_nominal: false,
    };
    Ok(model.diagnose(&[fit], &[check], &question)?)
}

/// The folder of the tour.
struct TourFolder {
    folder: PathBuf,
}

impl TourFolder {
    /// Writes models and recordings of the program into a folder.
    fn unpack(folder: &Path) -> CommandOutcome<Self> {
        let place = Self {
            folder: folder.to_owned(),
        };
        for (name, text) in bundled::MODELS {
            place.write(name, text)?;
        }
        for runs in [&PLAIN, &WITH_RODS] {
            for (name, text) in [runs.fit, runs.check] {
                place.write(file_name(name), text)?;
            }
        }
        Ok(place)
    }

    fn write(&self, name: &str, text: &str) -> CommandOutcome {
        output::write(&self.folder.join(name), text)
    }

    /// A file of the folder as a command has it.
    fn name(&self, file: &str) -> String {
        quote_word(&self.folder.join(file).display().to_string())
    }

    /// Recordings as a command has them.
    fn recordings(&self, runs: &BundledRuns) -> String {
        format!(
            "--data {} --check {}",
            self.name(file_name(runs.fit.0)),
            self.name(file_name(runs.check.0))
        )
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.join(file_name(name))
    }

    fn model(&self, host: &Host, name: &str) -> CommandOutcome<Model> {
        Ok(host.model(self.path(name))?)
    }

    fn read(&self, model: &Model, runs: &BundledRuns) -> CommandOutcome<[PreparedRecording; 2]> {
        let read = |name: &str| model.recording(self.path(name), &RecordingOptions::default());
        Ok([read(runs.fit.0)?, read(runs.check.0)?])
    }

    /// How the command line asks for the same.
    fn flags(&self, runs: &BundledRuns) -> CommandLineSpelling {
        let [fit, check] = [runs.fit.0, runs.check.0].map(|name| self.path(name));
        CommandLineSpelling::new(&[fit], &[check], &RecordingOptions::default())
    }

    /// Writes the model with what was found beside the one it came from; the commands for it, and the difference.
    fn add(
        &self,
        findings: &DiagnosisFindings,
        flags: &CommandLineSpelling,
    ) -> CommandOutcome<Option<(Vec<String>, String)>> {
        let Some(edited) = &findings.edited else {
            return Ok(None);
        };
        self.write(EDITED, &edited.text)?;
        let model = &findings.before.model;
        let commands = findings.entries.iter();
        let commands = commands
            .map(|entry| flags.spell_effect(model, entry))
            .collect();
        let names = ["spidermill.toml", EDITED];
        let difference = edit::difference(model.text(), &edited.text, names);
        let coloured = edit::colour_diff(&difference, terminal::style());
        Ok(Some((commands, coloured)))
    }
}

/// The last part of a bundled recording's name.
fn file_name(name: &str) -> &str {
    name.rsplit('/').next().unwrap_or(name)
}

/// The model with nominal parameters held against a recording.
struct TourComparison {
    compared: ModelComparison,
    time: Vec<f64>,
    measured: Vec<Vec<f64>>,
    errors: Vec<Vec<f64>>,
}

impl TourComparison {
    fn new(model: &Model, recording: &PreparedRecording) -> CommandOutcome<Self> {
        let one = recording.segments.first().ok_or_else(|| {
            CommandFailure::Input("the bundled recording has no sample".to_owned())
        })?;
        let measured = along::measured_forces(one)?;
        let forces = along::filter_and_decimate(along::forces(model, one, &model.nominal)?, one)?;
        let errors = measured
            .iter()
            .zip(&forces)
            .map(|(y, m)| y.iter().zip(m).map(|(y, m)| y - m).collect())
            .collect();
        Ok(Self {
            compared: model.compare(&[recording], &model.nominal)?,
            time: one.time(),
            measured,
            errors,
        })
    }
}

/// The verdict of a diagnosis in words.
fn verdict(findings: &DiagnosisFindings) -> String {
    words::verdict(
        &findings.diagnosis,
        findings.channels(),
        findings.validation,
    )
}
