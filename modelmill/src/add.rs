//! `add`: a [`Model`] with effects added, derived again. Its file keeps comments and layout; the edit of the text is
//! that of [`crate::edit`], which works without a derived model.

use modelmill_spec::EffectKind;
use modelmill_spec::edit::{NewEffect, NewParameter};

use crate::diagnose::added_effects;
use crate::error::{Error, Outcome};
use crate::model::Model;

/// A setting of an effect.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectSetting {
    /// Symbol of a parameter or a constant of the kind.
    pub symbol: String,
    /// The value or name that it gets.
    pub value: SettingValue,
}

/// The setting of a symbol.
#[derive(Clone, Debug, PartialEq)]
pub enum SettingValue {
    /// The value of a constant, or the nominal value of a parameter, in the unit of the kind.
    Value(f64),
    /// The name of the parameter in the model file.
    Name(String),
}

impl Model {
    /// The model with effects added to its file; [`Model::text`] of the result is the edited file. All else is kept
    /// byte for byte. No file is written.
    ///
    /// Fails when the edited file is invalid: an unknown kind or place, a missing value, or an effect given twice.
    pub fn with_added_effects(&self, effects: &[NewEffect]) -> Outcome<Model> {
        let added = added_effects::add_entries(self, effects)?;
        Ok(self.host().derive(&self.path, added.loaded)?.with_values_of(self))
    }
}

/// An effect of a kind at given places, with settings of its parameters and constants. `kinds` are the kinds that the
/// model may use; an unknown kind is reported when the effect is added.
///
/// Fails when the kind has no such symbol, or a name is given for a constant.
///
/// ```
/// use modelmill::Model;
/// use modelmill::add::{EffectSetting, SettingValue, new_effect};
///
/// let arm = Model::open("../model-spec/models/two_link.toml")?;
/// let fc = EffectSetting { symbol: "Fc".to_owned(), value: SettingValue::Value(2.0) };
/// let places = ["joint1".to_owned()];
/// let friction = new_effect(&arm.loaded.kinds, "coulomb_friction", &places, &[fc])?;
/// let with_friction = arm.with_added_effects(&[friction])?;
/// assert_eq!(with_friction.base.len(), arm.base.len() + 1);
/// # Ok::<(), modelmill::Error>(())
/// ```
pub fn new_effect(kinds: &[EffectKind], kind: &str, at: &[String], settings: &[EffectSetting]) -> Outcome<NewEffect> {
    let mut effect = NewEffect {
        kind: kind.to_owned(),
        at: at.iter().map(|name| name.trim().to_owned()).collect(),
        ..NewEffect::default()
    };
    let Some(kind) = kinds.iter().find(|one| one.name == kind) else {
        return Ok(effect);
    };
    let parameters: Vec<&str> = kind.parameters.iter().map(|p| p.symbol.as_str()).collect();
    let constants: Vec<&str> = kind.constants.iter().map(|c| c.symbol.as_str()).collect();
    // Settings of one parameter are collected in one entry; the last value of a symbol counts.
    for setting in settings {
        let symbol = setting.symbol.as_str();
        if parameters.contains(&symbol) {
            let known = effect.parameters.iter().position(|p| p.symbol == symbol);
            let at = known.unwrap_or_else(|| {
                effect.parameters.push(NewParameter {
                    symbol: symbol.to_owned(),
                    ..NewParameter::default()
                });
                effect.parameters.len() - 1
            });
            let parameter = &mut effect.parameters[at];
            match &setting.value {
                SettingValue::Value(value) => parameter.nominal = Some(*value),
                SettingValue::Name(name) => parameter.name = Some(name.clone()),
            }
            continue;
        }
        // What is no parameter must be a constant, and constants have values only.
        match (&setting.value, constants.contains(&symbol)) {
            (SettingValue::Value(value), true) => {
                effect.constants.retain(|(known, _)| known != symbol);
                effect.constants.push((symbol.to_owned(), *value));
            }
            (SettingValue::Name(_), true) => {
                return Err(Error::input(format!(
                    "{symbol}.name: `{symbol}` is a constant of `{}`, and constants have a value but no name",
                    kind.name
                )));
            }
            (_, false) => {
                let known: Vec<&str> = parameters.iter().chain(&constants).copied().collect();
                return Err(Error::input(format!(
                    "{symbol}: `{}` has no `{symbol}`; it has {}",
                    kind.name,
                    known.join(", ")
                )));
            }
        }
    }
    Ok(effect)
}
