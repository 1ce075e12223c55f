//! Arguments of `runs`.

use std::path::PathBuf;

use clap::Args;
use modelmill::runs::{KnownLoad, PerRunSelection, RunsOptions};

use crate::args::preparation::PreparationArgs;

/// Text of the help below the options.
pub(crate) const HELP: &str = "Every other run is compared with the first one. Runs may have different motions. \
    With four or more runs the command also reports when base parameters changed permanently. Runs that cannot be read are listed \
    and left out; the first run must be readable.\n\n\
    Examples:\n  \
    modelmill runs arm.toml --data monday.csv --data tuesday.csv\n  \
    modelmill runs arm.toml --data runs/ --out page\n  \
    modelmill runs arm.toml --data 'runs/2026-*.csv' --json\n  \
    modelmill runs model-spec/models/spidermill.toml \\\n      \
    --data recordings/spidermill-mbs/plain-fit.csv recordings/spidermill-mbs/with-rods-fit.csv \\\n      \
    --json\n\n\
    One fit of all runs, with shared base parameters; what --per-run names is estimated separately for each run:\n  \
    modelmill runs arm.toml --data a.csv b.csv c.csv --per-run payload@flange,friction --out fit.json\n  \
    modelmill runs arm.toml --data bare.csv loaded.csv --load loaded.csv=2.8@flange\n\n\
    --per-run accepts: payload@BODY, friction[@DRIVE], offset[@DRIVE], gain[@DRIVE], clock, zero[@COORDINATE], \
    or the name of a base parameter.";

/// `runs`.
#[derive(Debug, Args)]
pub(crate) struct RunsArgs {
    /// Model file (TOML)
    pub(crate) model: PathBuf,
    /// Recordings, folders of them (in the order of the names), or patterns with * and ? (CSV, Parquet, MATLAB, HDF5,
    /// MCAP, ROS bags), two or more; the first is the reference
    #[arg(long, value_name = "RUN", required = true, num_args = 1..)]
    pub(crate) data: Vec<PathBuf>,
    /// Fit all runs at once and estimate these separately for each run, separated by commas, e.g.
    /// `payload@flange,friction`
    #[arg(long, value_name = "WHAT", value_delimiter = ',', value_parser = PerRunSelection::parse)]
    per_run: Vec<PerRunSelection>,
    /// A run carried a load of known mass in kg, which determines the scales of all measured forces; may be repeated
    #[arg(long, value_name = "RUN=MASS@BODY", value_parser = KnownLoad::parse)]
    load: Vec<KnownLoad>,
    /// Write the page `runs.html` into this folder, or all results as JSON to this file if its name ends in `.json`
    #[arg(long, value_name = "DIR|FILE.json")]
    pub(crate) out: Option<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) preparation: PreparationArgs,
}

impl RunsArgs {
    /// Options for the joint fit of all runs.
    pub(crate) fn runs_options(&self) -> RunsOptions {
        RunsOptions {
            per_run: self.per_run.clone(),
            loads: self.load.clone(),
        }
    }
}
