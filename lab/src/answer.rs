//! What `modelmill diagnose --json` says, as far as it is scored.

use serde_json::Value;

use crate::placed::PlacedEffect;

/// An answer.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ProgramAnswer {
    /// `adequate`, `missing_effect` or `unexplained`.
    pub verdict: String,
    /// The ladder: what was added, error on the fit and on the check run.
    pub steps: Vec<ProgramStep>,
    /// What the program would add.
    pub effects: Vec<EffectClaim>,
    /// Kinds of what it says that recordings have besides.
    pub disturbances: Vec<String>,
    /// The drive in which it says most of the error sits.
    pub channel: Option<String>,
}

/// A step of the ladder.
#[derive(Clone, Debug, PartialEq)]
pub struct ProgramStep {
    /// Nothing on the first.
    pub added: Option<PlacedEffect>,
    /// Error on the fit.
    pub fit: f64,
    /// Error on the check run.
    pub check: f64,
}

/// An effect of the answer.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectClaim {
    /// Which and where.
    pub effect: PlacedEffect,
    /// What this recording cannot tell from it.
    pub aliases: Vec<PlacedEffect>,
    /// How likely it says the effect is; nothing where it does not say.
    pub probability: Option<f64>,
}

impl ProgramAnswer {
    /// Reads the JSON; fails where it departs from `cli.md`.
    pub fn from_json(value: &Value) -> Result<Self, String> {
        let verdict = value["verdict"].as_str().ok_or("no `verdict`")?;
        if !["adequate", "missing_effect", "unexplained"].contains(&verdict) {
            return Err(format!("unknown verdict `{verdict}`"));
        }
        let steps = list(value, "steps")?.iter().map(|step| {
            let added = &step["added"];
            Ok(ProgramStep {
                added: if added.is_null() { None } else { Some(placed(added)?) },
                fit: number(step, "fit")?,
                check: number(step, "check")?,
            })
        });
        let effects = list(value, "effects")?.iter().map(|effect| {
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

fn list<'a>(value: &'a Value, key: &str) -> Result<&'a Vec<Value>, String> {
    value[key].as_array().ok_or_else(|| format!("`{key}` is no list"))
}

fn number(value: &Value, key: &str) -> Result<f64, String> {
    value[key]
        .as_f64()
        .ok_or_else(|| format!("`{key}` of a step is no number"))
}

fn placed(value: &Value) -> Result<PlacedEffect, String> {
    let kind = value["kind"].as_str().ok_or("an effect without `kind`")?;
    let at = list(value, "at")?
        .iter()
        .map(|place| place.as_str().map(str::to_owned))
        .collect::<Option<Vec<String>>>()
        .ok_or("`at` is no list of names")?;
    Ok(PlacedEffect {
        kind: kind.to_owned(),
        at,
    })
}
