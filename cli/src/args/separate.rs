//! Options of `excite` for a motion that distinguishes effects.

use std::path::PathBuf;

use clap::Args;
use modelmill::diagnose::NamedEffect;
use modelmill::excite::SeparationRequest;
use modelmill::options::parse_column;
use modelmill::recording::RecordingOptions;

/// The effects that the motion has to distinguish.
#[derive(Debug, Args)]
#[command(next_help_heading = "Distinguishing effects")]
pub(crate) struct SeparateArgs {
    /// Instead of exciting the base parameters, search for a motion in which this effect differs most from those of
    /// --from. Values of its parameters and constants in SI units follow the places: `coulomb_friction@motor:Fc=25.9`
    #[arg(long, value_name = "KIND@PLACE,...[:NAME=VALUE]", value_parser = NamedEffect::parse, requires = "from",
          conflicts_with = "criterion")]
    pub(crate) separate: Option<NamedEffect>,
    /// The effect it could be confused with; may be repeated. Constants without a value are estimated like parameters
    #[arg(long, value_name = "KIND@PLACE,...", value_parser = NamedEffect::parse, requires = "separate")]
    pub(crate) from: Vec<NamedEffect>,
    /// An effect that is present in both cases and that the model file lacks; may be repeated
    #[arg(long, value_name = "KIND@PLACE,...[:NAME=VALUE]", value_parser = NamedEffect::parse, requires = "separate")]
    pub(crate) beside: Vec<NamedEffect>,
    /// Standard deviation of the noise in the forces, in N or N m, with which the difference is compared
    #[arg(long, value_name = "SIZE", value_parser = parse_noise, requires = "separate", allow_negative_numbers = true)]
    pub(crate) noise: Option<f64>,
    /// Recordings of one motion to compare with; they also give the size of the effect and the noise if these are not
    /// specified
    #[arg(long, value_name = "RUN", num_args = 1.., requires = "separate")]
    pub(crate) data: Vec<PathBuf>,
    /// Column of the recordings for a name of the model, e.g. `--map theta1=pos_left`; may be repeated
    #[arg(long, value_name = "NAME=COLUMN", value_parser = parse_column, requires = "data")]
    pub(crate) map: Vec<(String, String)>,
}

impl SeparateArgs {
    /// The effects to distinguish, if `--separate` is given.
    pub(crate) fn separation_request(&self) -> Option<SeparationRequest> {
        // Without --separate the command excites the base parameters.
        Some(SeparationRequest {
            effect: self.separate.clone()?,
            from: self.from.clone(),
            common_effects: self.beside.clone(),
            noise: self.noise,
        })
    }

    /// How the recordings of `--data` are read.
    pub(crate) fn reading(&self) -> RecordingOptions {
        RecordingOptions {
            columns: self.map.clone(),
            ..RecordingOptions::default()
        }
    }
}

/// Reads a standard deviation above 0.
fn parse_noise(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("expected a standard deviation above 0 in N or N m, such as 1.5".to_owned()),
    }
}
