//! Wording of the library's advice for the command line: options as flags, commands of the program, complete command
//! lines.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::path::PathBuf;

use modelmill::diagnose::{NamedEffect, SeparationProposal};
use modelmill::edit::NewEffect;
use modelmill::options::find_flag;
use modelmill::print::{CommandName, OptionName, OptionSetting, RemedyWording, StepWording};
use modelmill::recording::RecordingOptions;
use modelmill::text::table::significant;
use modelmill::{Host, Model};

use crate::args::DiagnosisArgs;

/// Writes command lines that read the same recordings as the current one, for texts that advise a next step.
pub(crate) struct CommandLineWording {
    /// Flags `--data` and `--check` of the current command.
    recordings: String,
    /// Flags `--data` and `--map` for `excite`. Empty if the recordings need options that `excite` does not have.
    compared: String,
    /// Whether the effects found were written into a model file.
    is_completed: bool,
}

impl CommandLineWording {
    /// Recordings for fit and validation, read with the options `reading`.
    pub(crate) fn new(fit: &[PathBuf], check: &[PathBuf], reading: &RecordingOptions) -> Self {
        let named = |option: &str, paths: &[PathBuf]| -> Vec<String> {
            let path = |p: &PathBuf| format!("{option} {}", quote_word(&p.display().to_string()));
            paths.iter().map(path).collect()
        };
        let mut all = named("--data", fit);
        let mut compared = String::new();
        let plain = RecordingOptions {
            columns: reading.columns.clone(),
            ..RecordingOptions::default()
        };
        // `excite` has `--map` but no other option for reading. Other options would give other states.
        if *reading == plain {
            for data in &all {
                let _ = write!(compared, " {data}");
            }
            for (ours, theirs) in &reading.columns {
                let _ = write!(compared, " --map {}", quote_word(&format!("{ours}={theirs}")));
            }
        }
        // Validation runs follow the fit runs on the command line, but `excite` does not take them.
        all.extend(named("--check", check));
        Self {
            recordings: all.join(" "),
            compared,
            is_completed: false,
        }
    }

    /// `modelmill identify ...` of a model file with the same recordings.
    pub(crate) fn identification_command(&self, path: &str) -> String {
        format!("modelmill identify {} {}", quote_word(path), self.recordings)
    }

    /// The same after the effects found were written into a model file, if they were.
    pub(crate) fn with_completion(self, is_completed: bool) -> Self {
        Self { is_completed, ..self }
    }

    /// The wording for the arguments of `diagnose` and `report`.
    pub(crate) fn from_args(args: &DiagnosisArgs) -> Self {
        Self::new(&args.data, &args.check, &args.preparation.reading())
    }
}

impl StepWording for CommandLineWording {
    /// `modelmill add ...`, with the libraries of the model.
    fn format_effect(&self, model: &Model, effect: &NewEffect) -> String {
        let mut add_command = add_command(&model.path, effect);
        add_command.push_str(&library_flags_of_model(model));
        add_command
    }

    /// The same with one more library, which defines the kind.
    fn format_effect_of_library(&self, model: &Model, effect: &NewEffect, library: &str) -> String {
        let effect = self.format_effect(model, effect);
        format!("{effect} --library {}", quote_word(library))
    }

    fn has_added_effects(&self) -> bool {
        self.is_completed
    }

    fn format_completion(&self) -> String {
        "`modelmill diagnose` with `--out completed.toml` adds all of them in one step".to_owned()
    }

    fn format_identification(&self, model: &Model) -> String {
        format!("{} --out fit.json", self.identification_command(&model.path))
    }

    /// `modelmill excite --separate ...` for a motion that distinguishes the effects.
    fn format_separation(&self, model: &Model, separation: &SeparationProposal) -> Option<String> {
        let mut command = format!(
            "modelmill excite {} --separate {}",
            quote_word(&model.path),
            quote_word(&effect_argument(&separation.effect))
        );
        // Rivals have no values: `excite` estimates them.
        for rival in &separation.rivals {
            let rival = NamedEffect {
                effect: rival.clone(),
                values: Vec::new(),
            };
            let _ = write!(command, " --from {}", quote_word(&effect_argument(&rival)));
        }
        for one in &separation.common_effects {
            let _ = write!(command, " --beside {}", quote_word(&effect_argument(one)));
        }
        if let Some(noise) = separation.noise {
            let _ = write!(command, " --noise {}", significant(noise, 3));
        }
        let _ = write!(
            command,
            "{}{} --out separate.csv",
            self.compared,
            library_flags_of_model(model)
        );
        Some(command)
    }
}

impl RemedyWording for CommandLineWording {
    fn format_options(&self, settings: &[OptionSetting]) -> String {
        FlagWording.format_options(settings)
    }

    fn format_command(&self, command: CommandName) -> String {
        FlagWording.format_command(command)
    }
}

/// Options as flags, and commands of the program.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FlagWording;

impl RemedyWording for FlagWording {
    /// Several flags become one piece of a command line in backticks.
    fn format_options(&self, settings: &[OptionSetting]) -> String {
        let one = |setting: &OptionSetting| match &setting.value {
            None => flag(setting.name),
            Some(value) => format!("{} {}", flag(setting.name), quote_value(value)),
        };
        let all: Vec<String> = settings.iter().map(one).collect();
        format!("`{}`", all.join(" "))
    }

    fn format_command(&self, command: CommandName) -> String {
        format!("`modelmill {}`", command.name())
    }
}

/// The flag of an option: that of its declaration, or its name with hyphens.
fn flag(option: OptionName) -> String {
    match option {
        OptionName::Loads => "--load".to_owned(),
        other => match find_flag(other.name()) {
            Some(flag) => format!("--{flag}"),
            None => format!("--{}", other.name().replace('_', "-")),
        },
    }
}

/// A value quoted for a shell: in double quotes as in the help, or in single quotes if a shell would expand its
/// characters.
fn quote_value(value: &str) -> Cow<'_, str> {
    if value.contains(['"', '$', '\\', '!', '\'']) {
        Cow::Owned(quote_word(value))
    } else if quote_word(value) != value || value.contains('/') || value.contains("=-") {
        Cow::Owned(format!("\"{value}\""))
    } else {
        Cow::Borrowed(value)
    }
}

/// The command that adds an effect to a model file.
fn add_command(model: &str, effect: &NewEffect) -> String {
    let mut command = format!(
        "modelmill add {} {} --at {}",
        quote_word(model),
        effect.kind,
        quote_word(&effect.at.join(","))
    );
    // Parameters without a nominal value and constants keep their defaults.
    let parameters = effect.parameters.iter();
    let values = parameters.filter_map(|p| Some((p.symbol.as_str(), p.nominal?)));
    let constants = effect.constants.iter().map(|(s, v)| (s.as_str(), *v));
    for (symbol, value) in values.chain(constants) {
        let _ = write!(command, " --set {symbol}={value}");
    }
    command.push_str(" --in-place");
    command
}

/// Flags for reading a model: `--library` and `--at-values`, each with a space before it.
fn library_flags_of_model(model: &Model) -> String {
    library_flags(model.host())
}

/// The same for a host.
pub(crate) fn library_flags(host: &Host) -> String {
    let option = |path: &PathBuf| format!(" --library {}", quote_word(&path.display().to_string()));
    let mut options: String = host.libraries().iter().map(option).collect();
    if host.has_numeric_constants() {
        options.push_str(" --at-values");
    }
    options
}

/// An effect as an argument of `excite`: `KIND@PLACE,PLACE:NAME=VALUE`.
fn effect_argument(named: &NamedEffect) -> String {
    let mut text = format!("{}@{}", named.effect.kind, named.effect.at.join(","));
    for (symbol, value) in &named.values {
        let _ = write!(text, ":{symbol}={value}");
    }
    text
}

/// A word quoted for a POSIX shell; plain words stay as they are.
pub(crate) fn quote_word(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./,=+:@".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;
    use modelmill::edit::NewParameter;
    use modelmill::print::Remedy;
    use modelmill_boundary::message;

    use super::*;
    use crate::args::CommandLine;

    #[test]
    fn options_become_flags() {
        let maps = ["q=q [deg]", "w=w/2"].map(|map| OptionSetting::new(OptionName::Columns, map));
        let says = message!(
            "map it: {}, or leave {} out; {} makes one",
            Remedy::options(maps),
            Remedy::option(OptionName::SkipBadSamples),
            Remedy::command(CommandName::Identify)
        );
        assert_eq!(
            says.format_for(&FlagWording),
            "map it: `--map \"q=q [deg]\" --map \"w=w/2\"`, or leave `--skip-bad-samples` out; `modelmill identify` makes one"
        );
    }

    /// What a recording calls its columns may be anything.
    #[test]
    fn a_shell_does_not_look_into_values() {
        for (value, expected) in [
            ("q=$(rm x)", "'q=$(rm x)'"),
            ("q=a;b", "\"q=a;b\""),
            ("q=x", "q=x"),
            ("q=-x", "\"q=-x\""),
        ] {
            assert_eq!(quote_value(value), expected);
        }
    }

    /// Every option and command that the library may advise is a flag or a command of the program.
    #[test]
    fn what_messages_advise_exists() {
        let commands: Vec<clap::Command> = CommandLine::command().get_subcommands().cloned().collect();
        let flags: Vec<String> = commands
            .iter()
            .flat_map(clap::Command::get_arguments)
            .filter_map(|a| Some(format!("--{}", a.get_long()?)))
            .collect();
        for option in OptionName::ALL {
            let flag = flag(*option);
            assert!(flags.contains(&flag), "{flag}");
        }
        for add_command in CommandName::ALL {
            let name = add_command.name();
            assert!(commands.iter().any(|c| c.get_name() == name), "{name}");
        }
    }

    #[test]
    fn commands_say_what_is_added() {
        let effect = NewEffect {
            kind: "spring".to_owned(),
            at: vec!["a".to_owned(), "b".to_owned()],
            parameters: vec![NewParameter {
                symbol: "k".to_owned(),
                nominal: Some(12.346),
                ..NewParameter::default()
            }],
            constants: vec![("q0".to_owned(), 0.5)],
            comment: None,
            ..NewEffect::default()
        };
        assert_eq!(
            add_command("my arm.toml", &effect),
            "modelmill add 'my arm.toml' spring --at a,b --set k=12.346 --set q0=0.5 --in-place"
        );
    }
}
