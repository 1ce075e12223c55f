//! Options that say how parameters are estimated.

use clap::{Args, ValueEnum};
use modelmill::identify::{EquationWeights, EstimateRefinement, EstimatorOptions, HUBER_BOUND};

use super::preparation::parse_map;

/// How parameters are estimated from the rows.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Estimating")]
pub(crate) struct EstimatorArgs {
    /// What each equation counts: `channels` divides each drive's by the standard deviation of its residuals (iterated),
    /// `variance` each sample's by that of the recording's columns `DRIVE_var`
    #[arg(long, value_enum, default_value = "auto")]
    pub(crate) weights: WeightsArg,
    /// Huber's robust estimate: residuals beyond BOUND standard deviations (taken from their median) count less
    #[arg(long, value_name = "BOUND", num_args = 0..=1, default_missing_value = "1.345",
        allow_negative_numbers = true, value_parser = parse_positive)]
    pub(crate) robust: Option<f64>,
    /// Nominal values as soft constraints, with this relative standard deviation of each product of parameters
    #[arg(long, value_name = "SIGMA", allow_negative_numbers = true, value_parser = parse_positive)]
    pub(crate) prior: Option<f64>,
    /// Only parameters that bodies can have (positive definite pseudo-inertias), nearest to the nominal ones; also returns
    /// every physical parameter
    #[arg(long, conflicts_with_all = ["prior", "essential"])]
    pub(crate) physical: bool,
    /// Leave out base parameters that the recordings do not support, one by one, while none of them is missed
    #[arg(long, conflicts_with = "prior")]
    pub(crate) essential: bool,
    /// Instrumental variables against noise that runs through the controller: recordings of the motion that was asked for
    /// (one for each --data, in step with it), or `period=SECONDS` to take the states one period later
    #[arg(long, value_name = "REF|period=SECONDS", num_args = 1..,
        conflicts_with_all = ["robust", "prior", "physical", "essential"])]
    pub(crate) instruments: Vec<String>,
    /// The same as --map for the recordings of --instruments; they may be those of --data with other columns
    #[arg(long, value_name = "OURS=THEIRS", value_parser = parse_map, requires = "instruments")]
    pub(crate) instrument_map: Vec<(String, String)>,
}

/// What each equation counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub(crate) enum WeightsArg {
    /// By the residuals of each drive where drives have different units, and where cut-off and decimation are chosen
    #[default]
    Auto,
    /// All the same
    None,
    /// By the residuals of each drive
    Channels,
    /// By the recording's columns
    Variance,
}

/// What is left out of a fit.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Leaving out equations")]
pub(crate) struct StandstillArgs {
    /// Leave an equation out of the fit while its drive is slower than this part of its fastest, for at rest the
    /// friction takes any value; 0.01 is usual
    #[arg(long, value_name = "PART", value_parser = parse_fraction)]
    pub(crate) standstill: Option<f64>,
}

impl EstimatorArgs {
    /// As the library wants it.
    pub(crate) fn options(&self, standstill: &StandstillArgs) -> EstimatorOptions {
        EstimatorOptions {
            weights: match self.weights {
                WeightsArg::Auto => EquationWeights::Automatic,
                WeightsArg::None => EquationWeights::None,
                WeightsArg::Channels => EquationWeights::Channels,
                WeightsArg::Variance => EquationWeights::Variance,
            },
            robust: self.robust,
            refinement: match self.prior {
                Some(sigma) => EstimateRefinement::Prior(sigma),
                None if self.physical => EstimateRefinement::Physical,
                None if self.essential => EstimateRefinement::Essential,
                None => EstimateRefinement::None,
            },
            standstill: standstill.standstill,
        }
    }
}

fn parse_fraction(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(part) if part > 0.0 && part < 1.0 => Ok(part),
        _ => Err("expected a number between 0 and 1, such as 0.01".to_owned()),
    }
}

fn parse_positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err(format!(
            "expected a positive number such as {HUBER_BOUND} or 0.2, not `{text}`"
        )),
    }
}
