//! How a notebook asks for what the library advises.

use std::borrow::Cow;
use std::fmt::Write as _;

use modelmill::Model;
use modelmill::diagnose::{Named, Separation};
use modelmill::edit::NewEffect;
use modelmill::print::{self, Advised, Spelling};
use serde_json::Value;

/// Calls of methods of a model `m`.
pub(crate) struct NotebookAdvice;

impl Spelling for NotebookAdvice {
    fn add(&self, _: &Model, effect: &NewEffect) -> String {
        let mut call = format!("m.with_effect({:?}, {}", effect.kind, places(&effect.at));
        let parameters = effect.parameters.iter();
        let values = parameters.filter_map(|p| Some((p.symbol.as_str(), p.nominal?)));
        let constants = effect.constants.iter().map(|(s, v)| (s.as_str(), *v));
        for (symbol, value) in values.chain(constants) {
            let _ = write!(call, ", {symbol}={value}");
        }
        call + ")"
    }

    fn identify(&self, _: &Model) -> String {
        "m.identify(data)".to_owned()
    }

    fn separate(&self, _: &Model, separation: &Separation) -> Option<String> {
        let mut call = format!("m.excite(separate={:?}", effect_argument(&separation.effect));
        let rivals = separation.rivals.iter().map(|effect| {
            let effect = effect.clone();
            effect_argument(&Named {
                effect,
                values: Vec::new(),
            })
        });
        let list = |all: Vec<String>| format!("{all:?}");
        let _ = write!(call, ", apart_from={}", list(rivals.collect()));
        if !separation.beside.is_empty() {
            let beside = separation.beside.iter().map(effect_argument).collect();
            let _ = write!(call, ", beside={}", list(beside));
        }
        if let Some(noise) = separation.noise {
            let _ = write!(call, ", noise={noise:.3e}");
        }
        Some(call + ")")
    }

    fn held(&self) -> String {
        "held=True".to_owned()
    }

    fn text<'a>(&self, text: &'a str) -> Cow<'a, str> {
        format_advice(text)
    }
}

fn places(at: &[String]) -> String {
    match at {
        [one] => format!("{one:?}"),
        all => format!("{all:?}"),
    }
}

/// An effect as `excite` takes it: `kind@place,place:name=value`.
fn effect_argument(effect: &Named) -> String {
    let mut text = format!("{}@{}", effect.effect.kind, effect.effect.at.join(","));
    for (name, value) in &effect.values {
        let _ = write!(text, ":{name}={value}");
    }
    text
}

/// A text of the library with its options as keywords and its verbs as methods.
pub(crate) fn format_advice(text: &str) -> Cow<'_, str> {
    print::spelled(text, |advised| match advised {
        Advised::Option("columns", Some(value)) => match value.split_once('=') {
            Some((ours, theirs)) => format!("`columns={{{ours:?}: {theirs:?}}}`"),
            None => format!("`columns={{{value:?}: ...}}`"),
        },
        Advised::Option("out", Some(path)) => format!("`save({path:?})`"),
        Advised::Option(name, Some(value)) if value.parse::<f64>().is_ok() => {
            format!("`{name}={value}`")
        }
        Advised::Option(name, Some(value)) => format!("`{name}={value:?}`"),
        Advised::Option(name, None) => format!("`{name}`"),
        Advised::Verb("add") => "`with_effect()`".to_owned(),
        Advised::Verb(name) => format!("`{name}()`"),
    })
}

/// The same in all texts of an object.
pub(crate) fn format_advice_in_json(value: &Value) -> Value {
    match value {
        Value::String(text) => Value::String(format_advice(text).into_owned()),
        Value::Array(all) => all.iter().map(format_advice_in_json).collect(),
        Value::Object(all) => {
            let all = all
                .iter()
                .map(|(key, value)| (key.clone(), format_advice_in_json(value)));
            Value::Object(all.collect())
        }
        other => other.clone(),
    }
}
