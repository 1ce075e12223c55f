//! Arguments of `work`.

use std::path::PathBuf;

use clap::Args;

use crate::args::preparation::PreparationArgs;

/// Text of the help below the options.
pub(crate) const HELP: &str = "The page is served on the loopback address of this machine only, and only to browsers that have the \
    link. Only files of the model's folder and those given here are read. Nothing is written before you save. Changes that \
    another program makes to the model file are loaded; if both changed it, you choose. Ctrl+C ends the program.\n\n\
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
    /// Recordings to fit and to compare with (CSV, Parquet, MATLAB, HDF5, MCAP, ROS bags); may be repeated
    #[arg(long, value_name = "RUN", num_args = 1..)]
    pub(crate) data: Vec<PathBuf>,
    /// Recordings for validation: an effect is accepted only if it lowers the error there. Without any, --data is split
    /// into blocks (cross-validation)
    #[arg(long, value_name = "RUN", num_args = 1.., requires = "data")]
    pub(crate) check: Vec<PathBuf>,
    /// A model file to compare with, for example an earlier version; those of the model's folder can also be chosen on
    /// the page
    #[arg(long, value_name = "MODEL")]
    pub(crate) beside: Option<PathBuf>,
    /// Port on the loopback address; 0 selects a free one
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) port: u16,
    /// Print the link as one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) preparation: PreparationArgs,
}
