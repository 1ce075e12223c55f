//! What `modelmill diagnose --json` says, as far as it is scored.

use serde_json::Value;

use super::placed::Placed;

/// An answer.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Answer {
    /// `adequate`, `missing_effect` or `unexplained`.
    pub(crate) verdict: String,
    /// The ladder: what was added, error on the fit and on the check run.
    pub(crate) steps: Vec<Step>,
    /// What the program would add.
    pub(crate) effects: Vec<Claim>,
    /// Kinds of what it says that recordings have besides.
    pub(crate) disturbances: Vec<String>,
    /// The drive in which it says most of the error sits.
    pub(crate) channel: Option<String>,
}

/// A step of the ladder.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Step {
    /// Nothing on the first.
    pub(crate) added: Option<Placed>,
    /// Error on the fit.
    pub(crate) fit: f64,
    /// Error on the check run.
    pub(crate) check: f64,
}

/// An effect of the answer.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Claim {
    /// Which and where.
    pub(crate) effect: Placed,
    /// What this recording cannot tell from it.
    pub(crate) aliases: Vec<Placed>,
    /// How likely it says the effect is; nothing where it does not say.
    pub(crate) probability: Option<f64>,
}

impl Answer {
    /// Reads the JSON; fails where it departs from `cli.md`.
    pub(crate) fn read(text: &str) -> Result<Self, String> {
        let value: Value = serde_json::from_str(text).map_err(|error| format!("JSON: {error}"))?;
        let verdict = value["verdict"].as_str().ok_or("no `verdict`")?;
        if !["adequate", "missing_effect", "unexplained"].contains(&verdict) {
            return Err(format!("unknown verdict `{verdict}`"));
        }
        let steps = list(&value, "steps")?.iter().map(|step| {
            let added = &step["added"];
            Ok(Step {
                added: if added.is_null() {
                    None
                } else {
                    Some(placed(added)?)
                },
                fit: number(step, "fit")?,
                check: number(step, "check")?,
            })
        });
        let effects = list(&value, "effects")?.iter().map(|effect| {
            let aliases = match effect.get("indistinguishable_from") {
                None | Some(Value::Null) => Vec::new(),
                Some(_) => list(effect, "indistinguishable_from")?
                    .iter()
                    .map(placed)
                    .collect::<Result<_, _>>()?,
            };
            Ok(Claim {
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
    value[key]
        .as_array()
        .ok_or_else(|| format!("`{key}` is no list"))
}

fn number(value: &Value, key: &str) -> Result<f64, String> {
    value[key]
        .as_f64()
        .ok_or_else(|| format!("`{key}` of a step is no number"))
}

fn placed(value: &Value) -> Result<Placed, String> {
    let kind = value["kind"].as_str().ok_or("an effect without `kind`")?;
    let at = list(value, "at")?
        .iter()
        .map(|place| place.as_str().map(str::to_owned))
        .collect::<Option<Vec<String>>>()
        .ok_or("`at` is no list of names")?;
    Ok(Placed {
        kind: kind.to_owned(),
        at,
    })
}
