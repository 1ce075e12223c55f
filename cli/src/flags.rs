//! How the command line asks for what the library advises.

use std::fmt::Write as _;
use std::path::PathBuf;

use modelmill::Model;
use modelmill::diagnose::{Named, Separation};
use modelmill::edit::NewEffect;
use modelmill::print::Spelling;
use modelmill::recording::Reading;
use modelmill::text::table::significant;

use crate::args::AskArgs;

/// Significant digits of values on the command line.
const DIGITS: usize = 5;

/// The command line that asked, for texts that advise another one.
pub(crate) struct Flags {
    /// The recordings, as the command line has them.
    recordings: String,
    /// The recordings of the fit with other names for their columns, where they need nothing else; what `excite` compares with.
    compared: String,
}

impl Flags {
    /// Recordings for fit and check, read as `reading` says.
    pub(crate) fn new(fit: &[PathBuf], check: &[PathBuf], reading: &Reading) -> Self {
        let named = |option: &str, paths: &[PathBuf]| -> Vec<String> {
            let path = |p: &PathBuf| format!("{option} {}", quoted(&p.display().to_string()));
            paths.iter().map(path).collect()
        };
        let mut all = named("--data", fit);
        let mut compared = String::new();
        let plain = Reading {
            columns: reading.columns.clone(),
            ..Reading::default()
        };
        if *reading == plain {
            for data in &all {
                let _ = write!(compared, " {data}");
            }
            for (ours, theirs) in &reading.columns {
                let _ = write!(compared, " --map {}", quoted(&format!("{ours}={theirs}")));
            }
        }
        all.extend(named("--check", check));
        Self {
            recordings: all.join(" "),
            compared,
        }
    }

    /// What a command asked.
    pub(crate) fn of(args: &AskArgs) -> Self {
        Self::new(&args.data, &args.check, &args.preparation.reading())
    }
}

impl Spelling for Flags {
    fn add(&self, model: &Model, effect: &NewEffect) -> String {
        let mut command = command(&model.path, effect);
        command.push_str(&with_libraries(model));
        command
    }

    fn identify(&self, model: &Model) -> String {
        format!(
            "modelmill identify {} {} --out fit.json",
            quoted(&model.path),
            self.recordings
        )
    }

    fn separate(&self, model: &Model, separation: &Separation) -> Option<String> {
        let mut command = format!(
            "modelmill excite {} --separate {}",
            quoted(&model.path),
            quoted(&named(&separation.effect))
        );
        for rival in &separation.rivals {
            let rival = Named {
                effect: rival.clone(),
                values: Vec::new(),
            };
            let _ = write!(command, " --from {}", quoted(&named(&rival)));
        }
        for one in &separation.beside {
            let _ = write!(command, " --beside {}", quoted(&named(one)));
        }
        if let Some(noise) = separation.noise {
            let _ = write!(command, " --noise {}", significant(noise, 3));
        }
        let _ = write!(
            command,
            "{}{} --out separate.csv",
            self.compared,
            with_libraries(model)
        );
        Some(command)
    }

    fn held(&self) -> String {
        "--held".to_owned()
    }
}

/// The command that adds an effect to a model file.
fn command(model: &str, effect: &NewEffect) -> String {
    let mut command = format!(
        "modelmill add {} {} --at {}",
        quoted(model),
        effect.kind,
        quoted(&effect.at.join(","))
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

/// Libraries of kinds of one's own, as the command line has them.
fn with_libraries(model: &Model) -> String {
    let option = |path: &PathBuf| format!(" --library {}", quoted(&path.display().to_string()));
    model.host().libraries().iter().map(option).collect()
}

/// `KIND@PLACE,PLACE:NAME=VALUE`.
fn named(named: &Named) -> String {
    let mut text = format!("{}@{}", named.effect.kind, named.effect.at.join(","));
    for (symbol, value) in &named.values {
        let _ = write!(text, ":{symbol}={}", rounded(*value));
    }
    text
}

fn rounded(value: f64) -> f64 {
    let text = format!("{value:.*e}", DIGITS - 1);
    text.parse().unwrap_or(value)
}

/// A word as a shell takes it.
pub(crate) fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./,=+:@".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use modelmill::edit::NewParameter;

    use super::*;

    #[test]
    fn commands_say_what_is_added() {
        let effect = NewEffect {
            kind: "spring".to_owned(),
            at: vec!["a".to_owned(), "b".to_owned()],
            parameters: vec![NewParameter {
                symbol: "k".to_owned(),
                nominal: Some(rounded(12.345_678)),
                ..NewParameter::default()
            }],
            constants: vec![("q0".to_owned(), 0.5)],
            comment: None,
        };
        assert_eq!(
            command("my arm.toml", &effect),
            "modelmill add 'my arm.toml' spring --at a,b --set k=12.346 --set q0=0.5 --in-place"
        );
    }
}
