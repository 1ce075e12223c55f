//! Wording of the library's advice for Python: options as keywords, commands as methods.

use std::fmt::Write as _;

use modelmill::Model;
use modelmill::diagnose::{NamedEffect, SeparationProposal};
use modelmill::edit::NewEffect;
use modelmill::print::{CommandName, OptionName, OptionSetting, RemedyWording, StepWording};
use pyo3::prelude::*;

/// Writes advice as keywords and as calls of methods of a model `m`.
pub(crate) struct PythonWording;

impl RemedyWording for PythonWording {
    fn format_options(&self, settings: &[OptionSetting]) -> String {
        let all: Vec<String> = settings.iter().map(argument).collect();
        all.join(" ")
    }

    fn format_command(&self, command: CommandName) -> String {
        format!("`{}()`", method_of_command(command))
    }
}

impl StepWording for PythonWording {
    fn format_effect(&self, _: &Model, effect: &NewEffect) -> String {
        let mut call = format!("m.with_effect({:?}, {}", effect.kind, places(&effect.at));
        let parameters = effect.parameters.iter();
        let values = parameters.filter_map(|p| Some((p.symbol.as_str(), p.nominal?)));
        let constants = effect.constants.iter().map(|(s, v)| (s.as_str(), *v));
        for (symbol, value) in values.chain(constants) {
            let _ = write!(call, ", {symbol}={value}");
        }
        call + ")"
    }

    fn format_completion(&self) -> String {
        "`model` of this diagnosis has all of them; `model.save(\"completed.toml\")` writes its file".to_owned()
    }

    fn format_identification(&self, _: &Model) -> String {
        "m.identify(data)".to_owned()
    }

    fn format_separation(&self, _: &Model, separation: &SeparationProposal) -> Option<String> {
        let mut call = format!("m.excite(separate={:?}", effect_argument(&separation.effect));
        let rivals = separation.rivals.iter().map(|effect| {
            let effect = effect.clone();
            effect_argument(&NamedEffect {
                effect,
                values: Vec::new(),
            })
        });
        let list = |all: Vec<String>| format!("{all:?}");
        let _ = write!(call, ", apart_from={}", list(rivals.collect()));
        if !separation.common_effects.is_empty() {
            let beside = separation.common_effects.iter().map(effect_argument).collect();
            let _ = write!(call, ", beside={}", list(beside));
        }
        if let Some(noise) = separation.noise {
            let _ = write!(call, ", noise={noise:.3e}");
        }
        Some(call + ")")
    }
}

/// The places of an effect as an argument: a text for one, a list for several.
fn places(at: &[String]) -> String {
    match at {
        [one] => format!("{one:?}"),
        all => format!("{all:?}"),
    }
}

/// An effect as an argument of `excite`: `kind@place,place:name=value`.
fn effect_argument(effect: &NamedEffect) -> String {
    let mut text = format!("{}@{}", effect.effect.kind, effect.effect.at.join(","));
    for (name, value) in &effect.values {
        let _ = write!(text, ":{name}={value}");
    }
    text
}

/// The name of an option of the library in Python.
enum PythonName {
    /// A keyword of a function or method.
    Keyword(&'static str),
    /// A separate method, with the value as argument.
    Method(&'static str),
}

/// The keyword or method of an option.
fn option_name_in_python(option: OptionName) -> PythonName {
    match option {
        OptionName::From => PythonName::Keyword("apart_from"),
        OptionName::Out => PythonName::Method("save"),
        OptionName::Picture => PythonName::Method("picture"),
        other => PythonName::Keyword(other.name()),
    }
}

/// The method of a command.
fn method_of_command(command: CommandName) -> &'static str {
    match command {
        CommandName::Evaluate => "inverse_dynamics",
        other => other.name(),
    }
}

/// An option as an argument, or as a call.
fn argument(setting: &OptionSetting) -> String {
    let value = setting.value.as_deref();
    let keyword = match option_name_in_python(setting.name) {
        PythonName::Keyword(keyword) => keyword,
        PythonName::Method(method) => {
            let value = value.map(|value| format!("{value:?}"));
            return format!("`{method}({})`", value.unwrap_or_default());
        }
    };
    let Some(value) = value else {
        return format!("`{keyword}`");
    };
    let value = match setting.name {
        OptionName::Columns => match value.split_once('=') {
            Some((ours, theirs)) => format!("{{{ours:?}: {theirs:?}}}"),
            None => format!("{{{value:?}: ...}}"),
        },
        OptionName::Between => format!("({value})"),
        OptionName::Limits | OptionName::Loads | OptionName::Unknown => format!("[{value:?}]"),
        _ if value.parse::<f64>().is_ok() => value.to_owned(),
        _ => format!("{value:?}"),
    };
    format!("`{keyword}={value}`")
}

/// Keywords and methods that messages may advise, for a test that they exist.
#[pyfunction]
pub(crate) fn advised_names() -> (Vec<&'static str>, Vec<&'static str>) {
    let mut keywords = Vec::new();
    let mut methods: Vec<&str> = CommandName::ALL.iter().map(|c| method_of_command(*c)).collect();
    for option in OptionName::ALL {
        match option_name_in_python(*option) {
            PythonName::Keyword(keyword) => keywords.push(keyword),
            PythonName::Method(method) => methods.push(method),
        }
    }
    (keywords, methods)
}
