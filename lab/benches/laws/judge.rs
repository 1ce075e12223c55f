//! Marks of proposals: an answer and the true law go in; the rank of the right proposal comes out.
//!
//! A right proposal has the place and the variables of the law. Added to a library as printed and identified along
//! another motion without noise, it explains most of the residual that the law causes.

use std::collections::BTreeSet;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

use modelmill_lab::harness::{TestedProgram, write};
use serde_json::Value;

/// Least share of the squared residual that a right proposal explains.
const MOST: f64 = 0.9;
/// Largest number of proposals with right place and variables that are identified.
const TRIED: usize = 3;
/// Words in expressions that are not variables.
const WORDS: [&str; 13] = [
    "sin", "cos", "exp", "abs", "sign", "sqrt", "tanh", "pi", "dahl", "bouc_wen", "slip", "max", "e",
];

/// Mark of an answer.
#[derive(Clone, Debug)]
pub(crate) struct Marked {
    /// Rank of the right proposal: 0 for the first, then the near-ties; `None` if none is right.
    pub(crate) rank: Option<usize>,
    /// Number of near-ties.
    pub(crate) ties: usize,
    pub(crate) verdict: String,
    /// Proposed expressions with their places.
    pub(crate) says: String,
}

/// The true law.
pub(crate) struct Wanted<'a> {
    pub(crate) at: &'a str,
    pub(crate) words: &'a [String],
    pub(crate) remembers: bool,
}

/// Marks an answer to a case; `probe` is a recording without noise along another motion.
pub(crate) fn judge(
    program: &TestedProgram,
    model: &Path,
    folder: &Path,
    probe: &Path,
    answer: &Value,
    wanted: &Wanted<'_>,
) -> Result<Marked, String> {
    let laws = answer["laws"].as_array().ok_or("no `laws`")?;
    let mut says = String::new();
    let (mut rank, mut ties) = (None, 0);
    for law in laws {
        let others = law["ties"].as_array().ok_or("no `ties`")?;
        ties += others.len();
        let (expression, place) = (text(&law["expression"]), text(&law["at"][0]));
        says.extend([expression, " at ", place, "; "]);
        let mut tried = 0;
        for (k, one) in std::iter::once(law).chain(others).enumerate() {
            let has_place = text(&one["at"][0]) == wanted.at;
            if !has_place || variables(text(&one["expression"])) != *wanted.words || tried == TRIED {
                continue;
            }
            tried += 1;
            let is_right = if one["entry"].is_null() {
                wanted.remembers
            } else {
                let with_effects = with_effects(program, model, folder, answer, one);
                !wanted.remembers && goes(program, model, &with_effects, folder, probe, one)? > MOST
            };
            if is_right && rank.is_none_or(|rank| k < rank) {
                rank = Some(k);
            }
        }
    }
    Ok(Marked {
        rank,
        ties,
        verdict: text(&answer["verdict"]).to_owned(),
        says,
    })
}

fn text(value: &Value) -> &str {
    value.as_str().unwrap_or("")
}

/// Names of the variables in an expression, sorted: no functions, parameters or numbers.
fn variables(expression: &str) -> Vec<String> {
    let is_of_name = |c: char| c.is_alphanumeric() || c == '_' || c == '.';
    let words = expression.split(|c| !is_of_name(c));
    let is_parameter = |word: &str| {
        let letters = word.trim_end_matches(char::is_numeric);
        ["k", "ks", "kc"].contains(&letters)
    };
    let found: BTreeSet<String> = words
        .filter(|word| word.starts_with(char::is_alphabetic))
        .filter(|word| !WORDS.contains(word) && !is_parameter(word))
        .map(str::to_owned)
        .collect();
    found.into_iter().collect()
}

/// The model with the effects that the answer has in addition to a law, without those that `add` refuses.
fn with_effects(program: &TestedProgram, model: &Path, folder: &Path, answer: &Value, law: &Value) -> PathBuf {
    let mut file = model.to_owned();
    let same = |a: &Value, b: &Value| a["kind"] == b["kind"] && a["at"] == b["at"];
    let found = answer["effects"].as_array().into_iter().flatten();
    for (k, effect) in found.enumerate() {
        let mut needless = law["instead_of"].as_array().into_iter().flatten();
        if needless.any(|one| same(one, effect)) {
            continue;
        }
        let next = folder.join(format!("with-{k}.toml"));
        let at: Vec<&str> = effect["at"].as_array().into_iter().flatten().map(text).collect();
        let mut args: Vec<OsString> = vec!["add".into(), file.clone().into()];
        args.extend([text(&effect["kind"]).into(), "--at".into(), at.join(",").into()]);
        for value in effect["estimates"].as_array().into_iter().flatten() {
            let value = format!("{}={}", text(&value["name"]), value["value"]);
            args.extend(["--set".into(), value.into()]);
        }
        args.extend(["--out".into(), next.clone().into()]);
        if program.run(&args).is_ok() {
            file = next;
        }
    }
    file
}

/// Share of the squared residual along the probe that a law explains, with the effects of the answer in the model.
///
/// The entry of the law is added as printed.
fn goes(
    program: &TestedProgram,
    model: &Path,
    with_effects: &Path,
    folder: &Path,
    probe: &Path,
    law: &Value,
) -> Result<f64, String> {
    let library = folder.join("laws.toml");
    let with = folder.join("with-law.toml");
    write(&library, text(&law["entry"]))?;
    let places: Vec<&str> = law["places"].as_array().into_iter().flatten().map(text).collect();
    let places = places.join(",");
    let os = |text: &'static str| OsStr::new(text);
    let args = [
        os("add"),
        with_effects.as_os_str(),
        OsStr::new(text(&law["kind"])),
        os("--at"),
        OsStr::new(&places),
        os("--library"),
        library.as_os_str(),
        os("--out"),
        with.as_os_str(),
    ];
    program.run(&args).map_err(|fault| {
        format!(
            "`add` refuses the entry of {}: {}",
            text(&law["expression"]),
            fault.whole_complaint()
        )
    })?;
    let error = |model: &Path| -> Result<f64, String> {
        let args = [
            os("identify"),
            model.as_os_str(),
            os("--library"),
            library.as_os_str(),
            os("--data"),
            probe.as_os_str(),
            os("--json"),
        ];
        let fit = program.run_for_json(&args).map_err(|fault| fault.whole_complaint())?;
        fit["fit"]["nrms"].as_f64().ok_or_else(|| "no `nrms`".to_owned())
    };
    Ok(1.0 - (error(&with)? / error(model)?).powi(2))
}
