//! Arguments of `verify`.

use std::path::PathBuf;

use clap::Args;

use crate::args::data::ParameterSource;
use crate::args::preparation::PreparationArgs;

/// Help after the options.
pub(super) const HELP: &str = "The states of a check are pass, fail and not evaluated. The exit status is 0 if the model passes, and 1 if a \
    check fails, if no drive was evaluated, or if a limit of the file was not evaluated. The cause of a failure comes from \
    the diagnosis of all recordings together.\n\n\
    A file of limits (TOML):\n\n  \
    [all_drives]                      # drives without a table of their own\n  \
    error_percent = 8.0               # rms error in % of the rms force\n\n  \
    [drives.spindle_left]\n  \
    error = 12.0                      # rms error, N or N m\n\n  \
    [parameters]                      # intervals of base parameters, by name or expression\n  \
    p1_min = [40.0, 48.0]\n\n  \
    [effects]\n  \
    most_probability = 0.5            # a new effect above it is a failure\n  \
    accepted = [\"coulomb_friction@spindle_left\"]\n\n\
    Examples (from the project's root):\n  \
    modelmill verify model-spec/models/spidermill.toml \\\n      \
    --data recordings/spidermill-mbs/plain-check.csv\n  \
    modelmill verify model-spec/models/spidermill.toml \\\n      \
    --data recordings/spidermill-mbs/plain-check.csv --limits verify.toml \\\n      \
    --junit verify.xml --json";

/// `verify`.
#[derive(Debug, Args)]
pub(crate) struct VerifyArgs {
    /// Model file (TOML)
    pub(crate) model: PathBuf,
    /// Recordings (CSV, Parquet, MATLAB, HDF5, MCAP, ROS bags); may be repeated; `a.csv+b.csv` joins files of one run on
    /// time
    #[arg(long, value_name = "RUN", required = true, num_args = 1..)]
    pub(crate) data: Vec<PathBuf>,
    /// Values of the base parameters: `nominal`, or a file that `identify` wrote
    #[arg(long, value_name = "nominal|FIT.json", default_value = "nominal", value_parser = ParameterSource::parse)]
    pub(crate) parameters: ParameterSource,
    /// File of limits (TOML); without it, default limits are used and printed
    #[arg(long, value_name = "LIMITS.toml")]
    pub(crate) limits: Option<PathBuf>,
    /// Write the checks as JUnit XML to this file, for services that run tests
    #[arg(long, value_name = "FILE.xml")]
    pub(crate) junit: Option<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) preparation: PreparationArgs,
}
