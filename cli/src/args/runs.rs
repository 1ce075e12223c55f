//! Arguments of `runs`.

use std::path::PathBuf;

use clap::Args;
use modelmill::runs::{KnownLoad, PerRunSelection, RunsOptions};

use crate::args::preparation::PreparationArgs;

/// What stands below the options.
pub(crate) const HELP: &str = "The first run is how things were; every other one is held against it. Runs may move differently. \
    From four runs on it says when base parameters changed and stayed changed. Runs that cannot be read are named, but the first.\n\n\
    Examples:\n  \
    modelmill runs arm.toml --data monday.csv --data tuesday.csv\n  \
    modelmill runs arm.toml --data runs/ --out page                  a folder, in the order of its names\n  \
    modelmill runs arm.toml --data 'runs/2026-*.csv' --json\n  \
    modelmill runs model-spec/models/spidermill.toml \\\n      \
    --data recordings/spidermill-mbs/plain-fit.csv recordings/spidermill-mbs/with-rods-fit.csv --json\n\n\
    One fit of all runs, in which base parameters are shared and what is named is each run's own:\n  \
    modelmill runs arm.toml --data a.csv b.csv c.csv --per-run payload@flange,friction --out fit.json\n  \
    modelmill runs arm.toml --data bare.csv loaded.csv --load loaded.csv=2.8@flange    scales of all forces by a known load\n\n\
    What may be each run's own: payload@BODY, friction[@DRIVE], offset[@DRIVE], gain[@DRIVE], clock, zero[@COORDINATE], \
    or a base parameter by its name.";

/// `runs`.
#[derive(Debug, Args)]
pub(crate) struct RunsArgs {
    /// Model file (TOML)
    pub(crate) model: PathBuf,
    /// Recordings, folders of them, or patterns with * and ? (CSV, Parquet, MATLAB, HDF5, MCAP, rosbag2), two or more; the first is
    /// the one that the others are held against
    #[arg(long, value_name = "RUN", required = true, num_args = 1..)]
    pub(crate) data: Vec<PathBuf>,
    /// Fit all runs at once, in which these are each run's own, separated by commas, e.g. `payload@flange,friction`
    #[arg(long, value_name = "WHAT", value_delimiter = ',', value_parser = PerRunSelection::parse)]
    per_run: Vec<PerRunSelection>,
    /// A run carried a load of known mass, in kg, from which the scales of all measured forces follow; may be repeated
    #[arg(long, value_name = "RUN=MASS@BODY", value_parser = KnownLoad::parse)]
    load: Vec<KnownLoad>,
    /// Write the page `runs.html` into this folder, or all that is found as JSON into this file where its name ends in `.json`
    #[arg(long, value_name = "DIR|FILE.json")]
    pub(crate) out: Option<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) preparation: PreparationArgs,
}

impl RunsArgs {
    /// What is asked beside what changed.
    pub(crate) fn runs_options(&self) -> RunsOptions {
        RunsOptions {
            per_run: self.per_run.clone(),
            loads: self.load.clone(),
        }
    }
}
