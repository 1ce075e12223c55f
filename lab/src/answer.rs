//! The scored parts of the output of `modelmill diagnose --json`: JSON goes in, a typed answer comes out.

use serde_json::Value;

use crate::placed::PlacedEffect;

/// The scored parts of one answer.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ProgramAnswer {
    /// `adequate`, `missing_effect` or `unexplained`.
    pub verdict: String,
    /// Steps of the selection: the added effect, with the errors on fit and validation run.
    pub steps: Vec<ProgramStep>,
    /// Effects that the program proposes to add.
    pub effects: Vec<EffectClaim>,
    /// Kinds of the disturbances that it reports for the recordings.
    pub disturbances: Vec<String>,
    /// The drive of the first entry of `where`, which has the largest part of the error.
    pub channel: Option<String>,
}

/// One step of the selection.
#[derive(Clone, Debug, PartialEq)]
pub struct ProgramStep {
    /// The added effect; `None` in the first step.
    pub added: Option<PlacedEffect>,
    /// Error on the fit, relative to the force.
    pub fit: f64,
    /// Error on the validation run, relative to the force.
    pub check: f64,
}

/// An effect that the answer proposes.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectClaim {
    /// Kind and places.
    pub effect: PlacedEffect,
    /// Effects that the answer reports as indistinguishable from it.
    pub aliases: Vec<PlacedEffect>,
    /// Probability that the effect is present; `None` if the answer states none.
    pub probability: Option<f64>,
}

impl ProgramAnswer {
    /// Reads the JSON; fails if it differs from the format in `cli.md`.
    pub fn from_json(value: &Value) -> Result<Self, String> {
        let verdict = value["verdict"].as_str().ok_or("the answer has no `verdict`")?;
        if !["adequate", "missing_effect", "unexplained"].contains(&verdict) {
            return Err(format!("unknown verdict `{verdict}`"));
        }
        // Steps have an added effect, except for the first.
        let steps = list(value, "steps")?.iter().map(|step| {
            let added = &step["added"];
            Ok(ProgramStep {
                added: if added.is_null() { None } else { Some(placed(added)?) },
                fit: number(step, "fit")?,
                check: number(step, "check")?,
            })
        });
        let effects = list(value, "effects")?.iter().map(|effect| {
            // The key is optional and may be null.
            let aliases = match effect.get("indistinguishable_from") {
                None | Some(Value::Null) => Vec::new(),
                Some(_) => list(effect, "indistinguishable_from")?
                    .iter()
                    .map(placed)
                    .collect::<Result<_, _>>()?,
            };
            Ok(EffectClaim {
                effect: placed(effect)?,
                aliases,
                probability: effect["probability"].as_f64(),
            })
        });
        let disturbances = value["disturbances"].as_array().into_iter().flatten();
        Ok(Self {
            disturbances: disturbances
                .filter_map(|one| one["kind"].as_str().map(str::to_owned))
                .collect(),
            verdict: verdict.to_owned(),
            steps: steps.collect::<Result<_, String>>()?,
            effects: effects.collect::<Result<_, String>>()?,
            channel: value["where"][0]["channel"].as_str().map(str::to_owned),
        })
    }
}

/// The list of a key; fails if the value is not a list.
fn list<'a>(value: &'a Value, key: &str) -> Result<&'a Vec<Value>, String> {
    value[key].as_array().ok_or_else(|| format!("`{key}` is not a list"))
}

/// The number of a key of a step; fails if the value is not a number.
fn number(value: &Value, key: &str) -> Result<f64, String> {
    value[key]
        .as_f64()
        .ok_or_else(|| format!("`{key}` of a step is not a number"))
}

/// Kind and places of an effect; fails if one of them is missing.
fn placed(value: &Value) -> Result<PlacedEffect, String> {
    let kind = value["kind"].as_str().ok_or("an effect has no `kind`")?;
    let at = list(value, "at")?
        .iter()
        .map(|place| place.as_str().map(str::to_owned))
        .collect::<Option<Vec<String>>>()
        .ok_or("`at` is not a list of names")?;
    Ok(PlacedEffect {
        kind: kind.to_owned(),
        at,
    })
}
