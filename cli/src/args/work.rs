//! The command line of `work`.

use std::path::PathBuf;

use clap::Args;

use crate::args::preparation::PreparationArgs;

/// What stands below the options.
pub(crate) const HELP: &str = "The page is served on the loopback address of this machine only, and answers only who has the \
    link. Only files of the model's folder and those given here are read. Nothing is written before you save; what \
    another program writes to the model file is followed, and where both changed it you choose. Ctrl+C ends it.\n\n\
    Examples (from the project's root):\n  \
    modelmill work model-spec/models/panda.toml\n  \
    modelmill work model-spec/models/spidermill.toml \\\n      \
    --data recordings/spidermill-mbs/with-rods-fit.csv \\\n      \
    --check recordings/spidermill-mbs/with-rods-check.csv\n  \
    modelmill work model-spec/models/spidermill.toml \\\n      \
    --beside model-spec/models/spidermill-paper.toml \\\n      \
    --data recordings/spidermill-mbs/with-rods-fit.csv";

/// `work`.
#[derive(Debug, Args)]
pub(crate) struct WorkArgs {
    /// Model file (TOML)
    pub(crate) model: PathBuf,
    /// Recordings to fit to and to compare with (CSV, Parquet, MATLAB, HDF5, MCAP, rosbag2); may be repeated
    #[arg(long, value_name = "RUN", num_args = 1..)]
    pub(crate) data: Vec<PathBuf>,
    /// Recordings that decide what is believed; without any, blocks of --data take turns
    #[arg(long, value_name = "RUN", num_args = 1.., requires = "data")]
    pub(crate) check: Vec<PathBuf>,
    /// A model file to hold the text beside, as it was before; also those of the model's folder can be chosen on the page
    #[arg(long, value_name = "MODEL")]
    pub(crate) beside: Option<PathBuf>,
    /// Port on the loopback address; 0 takes one that is free
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) port: u16,
    /// Print the link as one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) preparation: PreparationArgs,
}
