//! How the command line asks for what the library advises.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::path::PathBuf;

use modelmill::diagnose::{NamedEffect, SeparationProposal};
use modelmill::edit::NewEffect;
use modelmill::print::AdviceFormatter;
use modelmill::recording::RecordingOptions;
use modelmill::text::table::significant;
use modelmill::{Host, Model};
use modelmill_boundary::text::{self, AdviceItem};
use serde_json::Value;

use crate::args::DiagnosisArgs;

/// Significant digits of values on the command line.
const DIGITS: usize = 5;

/// The command line that asked, for texts that advise another one.
pub(crate) struct CommandLineAdvice {
    /// The recordings, as the command line has them.
    recordings: String,
    /// The recordings of the fit with other names for their columns, where they need nothing else; what `excite` compares with.
    compared: String,
}

impl CommandLineAdvice {
    /// Recordings for fit and check, read as `reading` says.
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
        if *reading == plain {
            for data in &all {
                let _ = write!(compared, " {data}");
            }
            for (ours, theirs) in &reading.columns {
                let _ = write!(compared, " --map {}", quote_word(&format!("{ours}={theirs}")));
            }
        }
        all.extend(named("--check", check));
        Self {
            recordings: all.join(" "),
            compared,
        }
    }

    /// What a command asked.
    pub(crate) fn from_args(args: &DiagnosisArgs) -> Self {
        Self::new(&args.data, &args.check, &args.preparation.reading())
    }
}

impl AdviceFormatter for CommandLineAdvice {
    fn add_effect(&self, model: &Model, effect: &NewEffect) -> String {
        let mut command = add_command(&model.path, effect);
        command.push_str(&library_flags_of_model(model));
        command
    }

    fn add_effect_from_library(&self, model: &Model, effect: &NewEffect, library: &str) -> String {
        format!("{} --library {}", self.add_effect(model, effect), quote_word(library))
    }

    fn identify(&self, model: &Model) -> String {
        format!(
            "modelmill identify {} {} --out fit.json",
            quote_word(&model.path),
            self.recordings
        )
    }

    fn separate_effects(&self, model: &Model, separation: &SeparationProposal) -> Option<String> {
        let mut command = format!(
            "modelmill excite {} --separate {}",
            quote_word(&model.path),
            quote_word(&effect_argument(&separation.effect))
        );
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

    fn fix_parameters(&self) -> String {
        "--held".to_owned()
    }

    fn format_text<'a>(&self, text: &'a str) -> Cow<'a, str> {
        format_advice(text)
    }
}

/// Fields of the library's options whose flags are called otherwise.
const FLAGS: [(&str, &str); 5] = [
    ("band_hz", "band"),
    ("columns", "map"),
    ("cutoff_hz", "cutoff"),
    ("loads", "load"),
    ("source", "derivatives"),
];

/// A text of the library with its options as flags and its verbs as commands.
pub(crate) fn format_advice(text: &str) -> Cow<'_, str> {
    let spelled = text::format_advice(text, |advised| match advised {
        AdviceItem::Option(name, None) => format!("`{}`", flag(name)),
        AdviceItem::Option(name, Some(value)) => format!("`{} {}`", flag(name), quote_value(value)),
        AdviceItem::Verb(name) => format!("`modelmill {name}`"),
    });
    // Flags side by side are one piece of a command line.
    match spelled {
        Cow::Owned(text) => Cow::Owned(text.replace("` `--", " --")),
        Cow::Borrowed(text) => Cow::Borrowed(text),
    }
}

/// A value as a shell takes it, in the quotes that the help shows unless a shell would look into them.
fn quote_value(value: &str) -> Cow<'_, str> {
    if value.contains(['"', '$', '\\', '!', '\'']) {
        Cow::Owned(quote_word(value))
    } else if quote_word(value) != value || value.contains('/') || value.contains("=-") {
        Cow::Owned(format!("\"{value}\""))
    } else {
        Cow::Borrowed(value)
    }
}

fn flag(field: &str) -> String {
    let other = FLAGS.iter().find(|(ours, _)| *ours == field);
    other.map_or_else(
        || format!("--{}", field.replace('_', "-")),
        |(_, flag)| format!("--{flag}"),
    )
}

/// A JSON value with all its texts spelled as [`spelled`] does.
pub(crate) fn format_advice_in_json(value: &Value) -> Value {
    match value {
        Value::String(text) => Value::String(format_advice(text).into_owned()),
        Value::Array(values) => values.iter().map(format_advice_in_json).collect(),
        Value::Object(members) => {
            let members = members.iter();
            members
                .map(|(name, value)| (name.clone(), format_advice_in_json(value)))
                .collect()
        }
        Value::Null | Value::Bool(_) | Value::Number(_) => value.clone(),
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
    let parameters = effect.parameters.iter();
    let values = parameters.filter_map(|p| Some((p.symbol.as_str(), p.nominal?)));
    let constants = effect.constants.iter().map(|(s, v)| (s.as_str(), *v));
    for (symbol, value) in values.chain(constants) {
        let _ = write!(command, " --set {symbol}={value}");
    }
    command.push_str(" --in-place");
    command
}

/// How models are read, as the command line has it: libraries of kinds of one's own, and whether constants stand as numbers.
fn library_flags_of_model(model: &Model) -> String {
    library_flags(model.host())
}

/// The same of a host.
pub(crate) fn library_flags(host: &Host) -> String {
    let option = |path: &PathBuf| format!(" --library {}", quote_word(&path.display().to_string()));
    let mut options: String = host.libraries().iter().map(option).collect();
    if host.is_at_values() {
        options.push_str(" --at-values");
    }
    options
}

/// `KIND@PLACE,PLACE:NAME=VALUE`.
fn effect_argument(named: &NamedEffect) -> String {
    let mut text = format!("{}@{}", named.effect.kind, named.effect.at.join(","));
    for (symbol, value) in &named.values {
        let _ = write!(text, ":{symbol}={}", round_significant(*value));
    }
    text
}

fn round_significant(value: f64) -> f64 {
    let text = format!("{value:.*e}", DIGITS - 1);
    text.parse().unwrap_or(value)
}

/// A word as a shell takes it.
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
    use std::path::Path;

    use clap::CommandFactory;
    use modelmill::edit::NewParameter;

    use super::*;
    use crate::args::CommandLine;

    #[test]
    fn options_of_texts_become_flags() {
        let says = "map it: option `columns` = `q=q [deg]` option `columns` = `w=w/2`, or leave option `skip_bad_samples` \
                    out; verb `identify` makes one";
        assert_eq!(
            format_advice(says),
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

    /// Every option and verb that a text of the library names is a flag or a command of the program.
    #[test]
    fn what_texts_advise_exists() {
        let commands: Vec<clap::Command> = CommandLine::command().get_subcommands().cloned().collect();
        let flags: Vec<String> = commands
            .iter()
            .flat_map(clap::Command::get_arguments)
            .filter_map(|a| Some(format!("--{}", a.get_long()?)))
            .collect();
        let mut count = 0;
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        for package in ["model-spec", "identify", "reduction", "modelmill"] {
            for (file, text) in sources(&root.join(package).join("src")) {
                text::format_advice(&text, |advised| {
                    count += 1;
                    match advised {
                        AdviceItem::Option(name, _) => {
                            let flag = flag(name);
                            assert!(flags.contains(&flag), "{}: {flag}", file.display());
                        }
                        AdviceItem::Verb(verb) => {
                            let is_verb = commands.iter().any(|c| c.get_name() == verb);
                            assert!(is_verb, "{}: {verb}", file.display());
                        }
                    }
                    String::new()
                });
                for line in text.lines().map(str::trim_start) {
                    let names_a_flag = flags.iter().any(|flag| {
                        let mut places = line.match_indices(flag.as_str());
                        places.any(|(at, _)| !line[..at].ends_with('-'))
                    });
                    let is_text = !line.starts_with("//");
                    assert!(!(is_text && names_a_flag), "{}: {line}", file.display());
                }
            }
        }
        assert!(count > 40, "{count}");
    }

    fn sources(folder: &Path) -> Vec<(PathBuf, String)> {
        let mut found = Vec::new();
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                found.extend(sources(&path));
            } else if path.extension().is_some_and(|e| e == "rs") {
                let text = std::fs::read_to_string(&path).unwrap();
                found.push((path, text));
            }
        }
        found
    }

    #[test]
    fn commands_say_what_is_added() {
        let effect = NewEffect {
            kind: "spring".to_owned(),
            at: vec!["a".to_owned(), "b".to_owned()],
            parameters: vec![NewParameter {
                symbol: "k".to_owned(),
                nominal: Some(round_significant(12.345_678)),
                ..NewParameter::default()
            }],
            constants: vec![("q0".to_owned(), 0.5)],
            comment: None,
        };
        assert_eq!(
            add_command("my arm.toml", &effect),
            "modelmill add 'my arm.toml' spring --at a,b --set k=12.346 --set q0=0.5 --in-place"
        );
    }
}
