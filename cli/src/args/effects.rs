//! Arguments of `effects` and `add`.

use std::path::PathBuf;

use clap::Args;
use modelmill::add::{EffectSetting, SettingValue};

/// `effects`.
#[derive(Debug, Args)]
pub(crate) struct EffectsArgs {
    /// Explain this kind of effect; without it all kinds are listed
    pub(crate) kind: Option<String>,
    /// Include the kinds that this model file (TOML) defines
    #[arg(long, value_name = "MODEL")]
    pub(crate) model: Option<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

/// `add`.
#[derive(Debug, Args)]
pub(crate) struct AddArgs {
    /// Model file (TOML)
    pub(crate) model: PathBuf,
    /// Kind of the effect; `modelmill effects` lists them
    pub(crate) kind: String,
    /// Where the effect acts: drives, coordinates, points, a part, `base` or `force`, depending on the kind; several
    /// places share its parameters
    #[arg(
        long,
        value_name = "PLACE,...",
        required_unless_present = "at_each",
        value_delimiter = ','
    )]
    pub(crate) at: Vec<String>,
    /// Places with parameters of their own, instead of --at; `drives` stands for all drives
    #[arg(long, value_name = "PLACE,...", value_delimiter = ',', conflicts_with = "at")]
    pub(crate) at_each: Vec<String>,
    /// Name of the new entry, by which a variant can replace it. Default: kind and places
    #[arg(long, value_name = "NAME")]
    pub(crate) name: Option<String>,
    /// Parameters of the kind that the effect does not have, such as the damping `Fv` of a coil spring
    #[arg(long, value_name = "SYMBOL,...", value_delimiter = ',')]
    pub(crate) without: Vec<String>,
    /// Nominal value of a parameter (`Fc=25.9`) or its name (`Fc.name=Fc_left`), or the value of a constant
    /// (`vs=0.02`), in SI units; may be repeated
    #[arg(long, value_name = "NAME=VALUE", value_parser = parse_setting, allow_hyphen_values = true)]
    pub(crate) set: Vec<EffectSetting>,
    /// Comment to write above the effect
    #[arg(long, value_name = "TEXT")]
    pub(crate) comment: Option<String>,
    /// Write the result into the model file itself
    #[arg(long, conflicts_with = "out")]
    pub(crate) in_place: bool,
    /// Write the result to this file
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

/// Reads `NAME=VALUE` or `NAME.name=NAME`.
fn parse_setting(text: &str) -> Result<EffectSetting, String> {
    let (left, right) = text
        .split_once('=')
        .ok_or("expected NAME=VALUE, such as Fc=25.9 or Fc.name=Fc_left")?;
    let (left, right) = (left.trim(), right.trim());
    if let Some(symbol) = left.strip_suffix(".name") {
        return Ok(EffectSetting {
            symbol: symbol.to_owned(),
            value: SettingValue::Name(right.to_owned()),
        });
    }
    match right.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(EffectSetting {
            symbol: left.to_owned(),
            value: SettingValue::Value(value),
        }),
        _ => Err(format!(
            "`{right}` is not a finite number; to name a parameter write {left}.name={right}"
        )),
    }
}
