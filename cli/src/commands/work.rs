//! `work`: the workbench in the browser.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::time::Duration;

use modelmill::diagnose::SeparationProposal;
use modelmill::edit::NewEffect;
use modelmill::files::PathKind;
use modelmill::print::{CommandName, OptionSetting, RemedyWording, StepWording};
use modelmill::{Host, Model};
use modelmill_workbench::{ExcitationSettings, Options, WorkbenchCommands, WorkbenchStep, serve};
use serde_json::json;

use crate::args::work::WorkArgs;
use crate::commands;
use crate::failure::{CommandFailure, CommandOutcome};
use crate::flags::{CommandLineWording, library_flags, quote_word};
use crate::terminal;

/// Time before the program states that the derivation goes on.
const PATIENCE: Duration = Duration::from_millis(1500);

/// Serves the page until the program is stopped.
pub(crate) fn run(host: &Host, args: &WorkArgs) -> CommandOutcome {
    if !args.model.is_file() {
        // The error of this call has the reason and lists model files nearby.
        commands::load_quietly(host, &args.model)?;
    }
    if let Some(beside) = &args.beside {
        commands::load_quietly(host, beside)?;
    }
    // Each run is a list of files to join on time; all must exist before the server starts.
    let files = |paths: &[PathBuf]| -> CommandOutcome<Vec<Vec<PathBuf>>> {
        let runs = paths.iter().map(|path| commands::files_of(path));
        let is_there = |file: &PathBuf| {
            // Recordings are read again after each edit, so pipes and devices cannot be used.
            let says = match host.files().kind(file) {
                PathKind::File | PathKind::Folder => return Ok(()),
                PathKind::Missing => "there is no such file; the path of a recording is expected",
                PathKind::Stream | PathKind::Device => {
                    "this is not a file on a disk; recordings are read again after each edit, so write it to a file first"
                }
            };
            Err(CommandFailure::Input(format!("{}: {says}", file.display())))
        };
        runs.map(|files| files.iter().try_for_each(is_there).map(|()| files))
            .collect()
    };
    let options = Options {
        model: args.model.clone(),
        data: files(&args.data)?,
        check: files(&args.check)?,
        beside: args.beside.clone(),
        reading: args.preparation.reading(),
        port: args.port,
        first: 0,
    };
    let advice = WorkbenchAdvice::new(host, args);
    let opening = announce_long_derivation(&args.model);
    serve(host, options, Arc::new(advice), |link| {
        drop(opening);
        // If standard output is closed, the server continues: a browser that has the link can still use it.
        let _ = if args.json {
            terminal::print_json(&json!({ "url": link }))
        } else {
            terminal::print(&format!("The workbench is open:\n  {link}\nPress Ctrl+C to stop it."))
        };
    })?;
    Ok(())
}

/// Prints a line if the workbench does not open within [`PATIENCE`], because a large model takes minutes to derive.
/// The caller drops the result once it is open.
fn announce_long_derivation(model: &Path) -> Sender<()> {
    let (opening, waiting) = channel::<()>();
    let says = format!(
        "Deriving the equations of {}. A model with closed loops in space can take minutes. The link is printed when \
         they are ready.",
        model.display()
    );
    std::thread::spawn(move || {
        if waiting.recv_timeout(PATIENCE) == Err(RecvTimeoutError::Timeout) {
            terminal::print_to_stderr(&says);
        }
    });
    opening
}

/// Writes the steps of the workbench as command lines. All fields are quoted for a shell; flags begin with a space.
struct WorkbenchAdvice {
    /// Wording of the advice of a diagnosis.
    flags: CommandLineWording,
    /// Path of the model file.
    model: String,
    /// Flags `--data`.
    data: String,
    /// Flags `--check`.
    check: String,
    /// Recordings of `--data` and `--check`, all as `--data`.
    all: String,
    /// Flags for reading and preparing recordings.
    reading: String,
    /// Flags for reading models.
    libraries: String,
}

impl WorkbenchAdvice {
    /// Takes the flags from the arguments of `work`, so that each command reads the same recordings in the same way.
    fn new(host: &Host, args: &WorkArgs) -> Self {
        let named = |option: &str, paths: &[PathBuf]| -> String {
            let path = |path: &PathBuf| format!(" --{option} {}", quoted_path(path));
            paths.iter().map(path).collect()
        };
        Self {
            flags: CommandLineWording::new(&args.data, &args.check, &args.preparation.reading()),
            model: quoted_path(&args.model),
            data: named("data", &args.data),
            check: named("check", &args.check),
            all: named("data", &[&*args.data, &*args.check].concat()),
            reading: args.preparation.to_flags(),
            libraries: library_flags(host),
        }
    }
}

/// A path, quoted for a shell.
fn quoted_path(path: &Path) -> String {
    quote_word(&path.display().to_string())
}

impl WorkbenchCommands for WorkbenchAdvice {
    /// The command of a pane, on the recordings of the workbench.
    fn step_command(&self, step: WorkbenchStep) -> Option<String> {
        let Self {
            model,
            data,
            check,
            reading,
            libraries,
            ..
        } = self;
        Some(match step {
            WorkbenchStep::Picture => {
                format!("modelmill check {model} --picture picture.svg{libraries}")
            }
            WorkbenchStep::Equations => {
                format!("modelmill equations {model} --format html --out equations.html{libraries}")
            }
            WorkbenchStep::Compare => {
                format!("modelmill compare {model}{data}{reading}{libraries}")
            }
            WorkbenchStep::Identify => {
                format!("modelmill identify {model}{data}{check}{reading}{libraries}")
            }
            WorkbenchStep::Diagnose => {
                format!("modelmill diagnose {model}{data}{check}{reading}{libraries}")
            }
        })
    }

    /// `modelmill diff`; all recordings are given as --data, because both models only follow their motion.
    fn variant_command(&self, before: &Path) -> Option<String> {
        let Self {
            model,
            all,
            reading,
            libraries,
            ..
        } = self;
        let before = quoted_path(before);
        Some(format!("modelmill diff {before} {model}{all}{reading}{libraries}"))
    }

    /// `modelmill excite` with the settings of the page.
    fn excite_command(&self, asked: &ExcitationSettings) -> Option<String> {
        let usual = ExcitationSettings::default();
        let mut words = format!("modelmill excite {}", self.model);
        // Name, value, and default of each setting.
        let options = [
            ("harmonics", asked.harmonics.to_string(), usual.harmonics.to_string()),
            ("period", asked.period.to_string(), usual.period.to_string()),
            ("random", asked.random.to_string(), usual.random.to_string()),
            ("starts", asked.starts.to_string(), usual.starts.to_string()),
            ("seed", asked.seed.to_string(), usual.seed.to_string()),
            ("rate", asked.rate.to_string(), usual.rate.to_string()),
        ];
        // Only settings that differ from their defaults become flags.
        for (name, value, usual) in options {
            if value != usual {
                let _ = write!(words, " --{name} {value}");
            }
        }
        if !asked.limits.is_empty() {
            let _ = write!(words, " --limits {}", quote_word(&asked.limits.join(",")));
        }
        let _ = write!(words, " --out {TRAJECTORY}{}", self.libraries);
        Some(words)
    }
}

/// File of the trajectory in the commands that the page shows.
const TRAJECTORY: &str = "excitation.csv";

impl RemedyWording for WorkbenchAdvice {
    fn format_options(&self, settings: &[OptionSetting]) -> String {
        self.flags.format_options(settings)
    }

    fn format_command(&self, command: CommandName) -> String {
        self.flags.format_command(command)
    }
}

impl StepWording for WorkbenchAdvice {
    fn format_effect(&self, model: &Model, effect: &NewEffect) -> String {
        self.flags.format_effect(model, effect)
    }

    fn format_effect_of_library(&self, model: &Model, effect: &NewEffect, library: &str) -> String {
        self.flags.format_effect_of_library(model, effect, library)
    }

    fn format_completion(&self) -> String {
        self.flags.format_completion()
    }

    fn format_identification(&self, model: &Model) -> String {
        self.flags.format_identification(model)
    }

    fn format_separation(&self, model: &Model, separation: &SeparationProposal) -> Option<String> {
        self.flags.format_separation(model, separation)
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::args::{CommandLine, PeriodArg, ProgramCommand};

    /// Commands that the page shows are valid, and read the same recordings in the same way.
    #[test]
    fn commands_of_the_page_are_understood() {
        let line = "modelmill work arm.toml --data a.csv b.csv --check c.csv --map 'q=x [deg]' --trim 5 --smoothing fourier \
                    --between -1,3 --leave-out-events --library my.toml";
        let words = |line: &str| -> Vec<String> {
            let mut words = vec![String::new()];
            let mut is_quoted = false;
            for c in line.chars() {
                match c {
                    '\'' => is_quoted = !is_quoted,
                    ' ' if !is_quoted => words.push(String::new()),
                    c => words.last_mut().unwrap().push(c),
                }
            }
            words.retain(|word| !word.is_empty());
            words
        };
        let cli = CommandLine::try_parse_from(words(line)).unwrap();
        let host = Host::new().with_libraries(cli.library);
        let ProgramCommand::Work(args) = &cli.command else {
            panic!("another command");
        };
        let advice = WorkbenchAdvice::new(&host, args);
        let asked = ExcitationSettings {
            harmonics: 3,
            period: 2.5,
            limits: vec!["q=-1:2".to_owned(), "q_d=3".to_owned()],
            ..ExcitationSettings::default()
        };
        let command = advice.excite_command(&asked).unwrap();
        let excite = CommandLine::try_parse_from(words(&command)).unwrap();
        let ProgramCommand::Excite(excite) = &excite.command else {
            panic!("another command");
        };
        let told = (
            excite.harmonics.clone(),
            excite.period,
            excite.limits.len(),
            excite.starts,
        );
        assert_eq!(told, (vec![3], PeriodArg::Fixed(2.5), 2, asked.starts), "{command}");
        for step in [
            WorkbenchStep::Picture,
            WorkbenchStep::Equations,
            WorkbenchStep::Compare,
            WorkbenchStep::Identify,
            WorkbenchStep::Diagnose,
        ] {
            let command = advice.step_command(step).unwrap();
            let cli = CommandLine::try_parse_from(words(&command));
            let cli = cli.unwrap_or_else(|error| panic!("{command}: {error}"));
            assert_eq!(cli.library, [PathBuf::from("my.toml")]);
            let (data, preparation) = match &cli.command {
                ProgramCommand::Compare(other) => (&other.data, &other.preparation),
                ProgramCommand::Identify(other) => (&other.data, &other.preparation),
                ProgramCommand::Diagnose(other) => (&other.diagnosis.data, &other.diagnosis.preparation),
                _ => continue,
            };
            assert_eq!((data, preparation), (&args.data, &args.preparation));
        }
        let command = advice.variant_command(Path::new("before this.toml")).unwrap();
        let cli = CommandLine::try_parse_from(words(&command));
        let cli = cli.unwrap_or_else(|error| panic!("{command}: {error}"));
        let ProgramCommand::Diff(other) = &cli.command else {
            panic!("{command}");
        };
        assert_eq!(
            [&other.before, &other.after],
            [&PathBuf::from("before this.toml"), &args.model]
        );
        assert_eq!(other.data, [&*args.data, &*args.check].concat());
        assert_eq!(other.preparation, args.preparation);
    }
}
