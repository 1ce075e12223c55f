//! Options of the estimator of `identify`: weights, robustness, constraints, instruments.

use clap::{Args, ValueEnum};
use modelmill::identify::{EquationWeights, EstimateRefinement, EstimatorOptions, HUBER_BOUND};

use super::preparation::parse_map;

/// How parameters are estimated from the rows of the regressor.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Estimation")]
pub(crate) struct EstimatorArgs {
    /// How equations are weighted
    #[arg(long, value_enum, default_value = "auto")]
    pub(crate) weights: WeightsArg,
    /// Huber's robust estimate: residuals beyond BOUND standard deviations (estimated from their median) get a lower
    /// weight
    #[arg(long, value_name = "BOUND", num_args = 0..=1, default_missing_value = "1.345",
        allow_negative_numbers = true, value_parser = parse_positive)]
    pub(crate) robust: Option<f64>,
    /// Nominal values as soft constraints, with this relative standard deviation of each product of parameters
    #[arg(long, value_name = "SIGMA", allow_negative_numbers = true, value_parser = parse_positive)]
    pub(crate) prior: Option<f64>,
    /// Allow only physically possible parameters (positive definite pseudo-inertias); what the recordings do not
    /// determine is as near to the nominal values as possible. Also returns every physical parameter
    #[arg(long, conflicts_with_all = ["prior", "essential"])]
    pub(crate) physical: bool,
    /// Remove base parameters that the recordings do not support, one by one, as long as the residual does not rise
    /// significantly (Wald test)
    #[arg(long, conflicts_with = "prior")]
    pub(crate) essential: bool,
    /// Instrumental variables, against the bias from noise that is fed back through the controller: recordings of the
    /// reference motion (one for each --data, with the same samples), or `period=SECONDS` to use the states one period
    /// later
    #[arg(long, value_name = "REF|period=SECONDS", num_args = 1..,
        conflicts_with_all = ["robust", "prior", "physical", "essential"])]
    pub(crate) instruments: Vec<String>,
    /// The same as --map for the recordings of --instruments; they may be those of --data with other columns
    #[arg(long, value_name = "NAME=COLUMN", value_parser = parse_map, requires = "instruments")]
    pub(crate) instrument_map: Vec<(String, String)>,
}

/// How equations are weighted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub(crate) enum WeightsArg {
    /// `channels` if the drives have different units or if cut-off and decimation are chosen automatically, else `none`
    #[default]
    Auto,
    /// Equal weights
    None,
    /// Equations of each drive divided by the standard deviation of its residuals, iterated
    Channels,
    /// Each equation divided by the standard deviation of its force, from the columns `DRIVE_var`
    Variance,
}

impl EstimatorArgs {
    /// The flags that differ from their defaults.
    pub(crate) fn given_flags(&self) -> Vec<&'static str> {
        let flags = [
            (self.weights != WeightsArg::Auto, "--weights"),
            (self.robust.is_some(), "--robust"),
            (self.prior.is_some(), "--prior"),
            (self.physical, "--physical"),
            (self.essential, "--essential"),
            (!self.instruments.is_empty(), "--instruments"),
        ];
        flags
            .iter()
            .filter(|(given, _)| *given)
            .map(|(_, flag)| *flag)
            .collect()
    }

    /// The same as options of the library.
    pub(crate) fn options(&self, standstill: Option<f64>) -> EstimatorOptions {
        EstimatorOptions {
            weights: match self.weights {
                WeightsArg::Auto => EquationWeights::Automatic,
                WeightsArg::None => EquationWeights::None,
                WeightsArg::Channels => EquationWeights::Channels,
                WeightsArg::Variance => EquationWeights::Variance,
            },
            robust: self.robust,
            // The command line excludes combinations of these three.
            refinement: match self.prior {
                Some(sigma) => EstimateRefinement::Prior(sigma),
                None if self.physical => EstimateRefinement::Physical,
                None if self.essential => EstimateRefinement::Essential,
                None => EstimateRefinement::None,
            },
            standstill: standstill.filter(|part| *part > 0.0),
        }
    }
}

/// Reads a finite number above 0.
fn parse_positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err(format!(
            "expected a positive number such as {HUBER_BOUND} or 0.2, not `{text}`"
        )),
    }
}
