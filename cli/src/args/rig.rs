//! Arguments of what makes model files.

use std::path::PathBuf;

use clap::Args;
use modelmill::export::Format as DescriptionFormat;

use super::drawing::parse_value;

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
    /// Robot description (URDF, MJCF or SDF)
    pub(crate) description: PathBuf,
    /// The root of a URDF hangs on nothing, as that of a walking robot
    #[arg(long)]
    pub(crate) floating: bool,
    /// Closures and drives of a URDF with loops, as the collection example-parallel-robots has them; a `robot.yaml` beside the
    /// URDF if not given
    #[arg(long, value_name = "ROBOT.yaml")]
    pub(crate) closures: Option<PathBuf>,
    /// Take angles within 1e-4 rad of multiples of pi/12, such as 1.5708, for these
    #[arg(long)]
    pub(crate) round_angles: bool,
    /// Values of joints from which loops are closed, rad or m in the description's own zero: which of its assemblies is meant
    #[arg(long, value_name = "JOINT=VALUE,...", value_parser = parse_value, value_delimiter = ',', allow_hyphen_values = true)]
    pub(crate) at: Vec<(String, f64)>,
    /// Write the model to this file
    #[arg(long, value_name = "MODEL.toml")]
    pub(crate) out: PathBuf,
}

/// `export`.
#[derive(Debug, Args)]
pub(crate) struct ExportArgs {
    /// Model file (TOML)
    pub(crate) model: PathBuf,
    /// Values of a fit by `identify --physical` in the place of the nominal ones
    #[arg(long, value_name = "FIT.json")]
    pub(crate) parameters: Option<PathBuf>,
    /// Format; by the ending of --out if not given (.urdf, .xml)
    #[arg(long, value_name = "urdf|mjcf", value_parser = parse_format)]
    pub(crate) format: Option<DescriptionFormat>,
    /// Write the description to this file
    #[arg(long, value_name = "FILE.urdf|FILE.xml")]
    pub(crate) out: PathBuf,
}

fn parse_format(text: &str) -> Result<DescriptionFormat, String> {
    let named = |one: &DescriptionFormat| one.name() == text;
    let found = DescriptionFormat::ALL.into_iter().find(named);
    found.ok_or_else(|| "expected `urdf` or `mjcf`".to_owned())
}
