//! Arguments of what makes model files.

use std::path::PathBuf;

use clap::Args;

/// `reduce`.
#[derive(Debug, Args)]
pub(crate) struct ReduceArgs {
    /// Rig file (TOML)
    pub(crate) rig: PathBuf,
    /// Plan of the reduction (TOML); every body a part of its own if not given
    #[arg(long, value_name = "PLAN.toml")]
    pub(crate) plan: Option<PathBuf>,
    /// Write the model to this file
    #[arg(long, value_name = "MODEL.toml")]
    pub(crate) out: PathBuf,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

/// `import`.
#[derive(Debug, Args)]
pub(crate) struct ImportArgs {
    /// Robot description (URDF)
    pub(crate) urdf: PathBuf,
    /// Write the model to this file
    #[arg(long, value_name = "MODEL.toml")]
    pub(crate) out: PathBuf,
}
