//! The part of the command line of `excite` that asks for motion along which effects differ.

use std::path::PathBuf;

use clap::Args;
use modelmill::diagnose::{Effect, Named};
use modelmill::excite::Separate;
use modelmill::recording::Reading;

/// Which effects are to be told apart.
#[derive(Debug, Args)]
#[command(next_help_heading = "Telling effects apart")]
pub(crate) struct SeparateArgs {
    /// Instead of exciting the base parameters, make this effect differ most from those of --from. Values of its
    /// parameters and constants in SI units follow the places: `coulomb_friction@motor:Fc=25.9`
    #[arg(long, value_name = "KIND@PLACE,...[:NAME=VALUE]", value_parser = parse_named, requires = "from",
          conflicts_with = "criterion")]
    pub(crate) separate: Option<Named>,
    /// What it may be taken for; may be repeated. Constants without a value are fitted like parameters
    #[arg(long, value_name = "KIND@PLACE,...", value_parser = parse_named, requires = "separate")]
    pub(crate) from: Vec<Named>,
    /// An effect that is there in either case and that the model file lacks; may be repeated
    #[arg(long, value_name = "KIND@PLACE,...[:NAME=VALUE]", value_parser = parse_named, requires = "separate")]
    pub(crate) beside: Vec<Named>,
    /// Standard deviation of the noise in the forces, in N or N m, against which the difference is held
    #[arg(long, value_name = "SIZE", value_parser = parse_noise, requires = "separate", allow_negative_numbers = true)]
    pub(crate) noise: Option<f64>,
    /// Recordings to compare with, of one motion; they give the size of the effect and the noise too, where these are not
    /// given
    #[arg(long, value_name = "RUN", num_args = 1.., requires = "separate")]
    pub(crate) data: Vec<PathBuf>,
    /// The recordings call our column by another name, e.g. `--map theta1=pos_left`; may be repeated
    #[arg(long, value_name = "OURS=THEIRS", value_parser = super::preparation::parse_map, requires = "data")]
    pub(crate) map: Vec<(String, String)>,
}

impl SeparateArgs {
    /// What is to be told apart, if anything is.
    pub(crate) fn asked(&self) -> Option<Separate> {
        Some(Separate {
            effect: self.separate.clone()?,
            from: self.from.clone(),
            beside: self.beside.clone(),
            noise: self.noise,
        })
    }

    /// How the recordings are read.
    pub(crate) fn reading(&self) -> Reading {
        Reading {
            columns: self.map.clone(),
            ..Reading::default()
        }
    }
}

/// Reads `KIND@PLACE,PLACE:NAME=VALUE:NAME=VALUE`.
fn parse_named(text: &str) -> Result<Named, String> {
    let expected = || {
        "expected KIND@PLACE, such as coulomb_friction@motor, several places with commas, values behind colons: \
         coulomb_friction@motor:Fc=25.9"
            .to_owned()
    };
    let mut parts = text.split(':');
    let (kind, places) = parts
        .next()
        .and_then(|effect| effect.split_once('@'))
        .ok_or_else(expected)?;
    let at: Vec<String> = places
        .split(',')
        .map(|place| place.trim().to_owned())
        .collect();
    if kind.trim().is_empty() || at.iter().any(String::is_empty) {
        return Err(expected());
    }
    if let Some(twice) = (0..at.len()).find(|k| at[..*k].contains(&at[*k])) {
        return Err(format!("`{}` is named twice", at[twice]));
    }
    let mut values: Vec<(String, f64)> = Vec::new();
    for part in parts {
        let (symbol, value) = part.split_once('=').ok_or_else(expected)?;
        let symbol = symbol.trim();
        let value = match value.trim().parse::<f64>() {
            Ok(value) if value.is_finite() => value,
            _ => return Err(format!("`{}` is no finite number", value.trim())),
        };
        if values.iter().any(|(known, _)| known == symbol) {
            return Err(format!("`{symbol}` has two values"));
        }
        values.push((symbol.to_owned(), value));
    }
    Ok(Named {
        effect: Effect {
            kind: kind.trim().to_owned(),
            at,
        },
        values,
    })
}

fn parse_noise(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("expected a standard deviation above 0 in N or N m, such as 1.5".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn effects_are_read_and_nonsense_is_refused() {
        let read = parse_named("stribeck_friction@a,b:Fs=15:vs=-2e-2").unwrap();
        assert_eq!(read.effect.kind, "stribeck_friction");
        assert_eq!(read.effect.at, ["a", "b"]);
        let values = [("Fs".to_owned(), 15.0), ("vs".to_owned(), -0.02)];
        assert_eq!(read.values, values);
        for text in [
            "spring",
            "@a",
            "spring@",
            "spring@a,",
            "spring@a,a",
            "spring@a:k",
            "spring@a:k=x",
            "spring@a:k=nan",
            "spring@a:k=1:k=2",
        ] {
            assert!(parse_named(text).is_err(), "{text}");
        }
    }
}
