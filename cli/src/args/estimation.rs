//! Options of the estimator of `identify`: weights, robustness, constraints, instruments.

use clap::Args;
use modelmill::identify::EstimatorOptions;
use modelmill::options::parse_column;
use modelmill::recording::StandstillRule;

use crate::args::declared::DeclaredArgs;

/// How parameters are estimated from the rows of the regressor.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Estimation")]
pub(crate) struct EstimatorArgs {
    #[command(flatten)]
    declared: DeclaredArgs<EstimatorOptions>,
    /// Instrumental variables, against the bias from noise that is fed back through the controller: recordings of the
    /// reference motion (one for each --data, with the same samples), or `period=SECONDS` to use the states one period
    /// later
    #[arg(long, value_name = "REF|period=SECONDS", num_args = 1..,
        conflicts_with_all = ["robust", "prior", "physical", "essential"])]
    pub(crate) instruments: Vec<String>,
    /// The same as --map for the recordings of --instruments; they may be those of --data with other columns
    #[arg(long, value_name = "NAME=COLUMN", value_parser = parse_column, requires = "instruments")]
    pub(crate) instrument_map: Vec<(String, String)>,
}

impl EstimatorArgs {
    /// The flags that differ from their defaults.
    pub(crate) fn given_flags(&self) -> Vec<String> {
        let instruments = (!self.instruments.is_empty()).then(|| "--instruments".to_owned());
        self.declared.given_flags().chain(instruments).collect()
    }

    /// The same as options of the library.
    pub(crate) fn options(&self, standstill: StandstillRule) -> EstimatorOptions {
        EstimatorOptions {
            standstill: standstill.bound(),
            ..self.declared.options.clone()
        }
    }
}
