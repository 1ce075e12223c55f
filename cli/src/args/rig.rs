//! Arguments of `reduce`, `import` and `export`: conversions from and to model files.

use std::path::PathBuf;

use clap::Args;
use modelmill::export::Format as DescriptionFormat;

use super::drawing::parse_value;

/// `reduce`.
#[derive(Debug, Args)]
pub(crate) struct ReduceArgs {
    /// Rig file (TOML), or a planar mechanism as URDF, MJCF or SDF
    pub(crate) rig: PathBuf,
    /// Plan of the reduction (TOML); without it every body becomes a separate part
    #[arg(long, value_name = "PLAN.toml")]
    pub(crate) plan: Option<PathBuf>,
    /// Measure which bodies move alike, which only translate and which values are equal, and write a plan for them to this
    /// file, to be edited
    #[arg(long, value_name = "PLAN.toml", conflicts_with = "plan")]
    pub(crate) propose: Option<PathBuf>,
    /// Accept joints that do not close exactly, with gaps up to this length in m, such as 0.002. The loop is then closed
    /// as well as possible, and the report says how much this changes the forces
    #[arg(long, value_name = "METRES", default_value_t = 0.0, hide_default_value = true, value_parser = parse_length)]
    pub(crate) tolerance: f64,
    /// Write the model to this file
    #[arg(long, value_name = "MODEL.toml", required_unless_present = "propose")]
    pub(crate) out: Option<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

/// `import`.
#[derive(Debug, Args)]
pub(crate) struct ImportArgs {
    /// Robot description (URDF, MJCF or SDF)
    pub(crate) description: PathBuf,
    /// The root of a URDF is not fixed to the ground (floating base), as for a walking robot
    #[arg(long)]
    pub(crate) floating: bool,
    /// Loop closures and drives of a URDF with loops, in the format of the collection example-parallel-robots. Default:
    /// a `robot.yaml` next to the URDF, if there is one
    #[arg(long, value_name = "ROBOT.yaml")]
    pub(crate) closures: Option<PathBuf>,
    /// Round angles within 1e-4 rad of a multiple of pi/12, such as 1.5708, to this multiple
    #[arg(long)]
    pub(crate) round_angles: bool,
    /// Masses and inertias of the description are known numbers. By default they are parameters with nominal values, which
    /// `identify` estimates
    #[arg(long)]
    pub(crate) known_bodies: bool,
    /// Joint values from which loops are closed, rad or m from the description's own zero. They select one of several
    /// assembly modes
    #[arg(long, value_name = "JOINT=VALUE,...", value_parser = parse_value, value_delimiter = ',', allow_hyphen_values = true)]
    pub(crate) at: Vec<(String, f64)>,
    /// Fix these joints at a value, rad or m from the description's own zero; their links become one body with those
    /// that carry them
    #[arg(long, value_name = "JOINT=VALUE,...", value_parser = parse_value, value_delimiter = ',', allow_hyphen_values = true)]
    pub(crate) lock: Vec<(String, f64)>,
    /// Only these joints, and those coupled with them, move; all others are fixed at the pose of the description
    #[arg(long, value_name = "JOINT,...", value_delimiter = ',')]
    pub(crate) joints: Vec<String>,
    /// Write the model to this file
    #[arg(long, value_name = "MODEL.toml")]
    pub(crate) out: PathBuf,
}

/// `export`.
#[derive(Debug, Args)]
pub(crate) struct ExportArgs {
    /// Model file (TOML)
    pub(crate) model: PathBuf,
    /// Use the values of a fit instead of the nominal ones: by `identify --physical`, or of a model with known bodies
    #[arg(long, value_name = "FIT.json")]
    pub(crate) parameters: Option<PathBuf>,
    /// Format; if not given, determined by the ending of --out (.urdf, .xml)
    #[arg(long, value_name = "urdf|mjcf", value_parser = parse_format)]
    pub(crate) format: Option<DescriptionFormat>,
    /// Write the description to this file
    #[arg(long, value_name = "FILE.urdf|FILE.xml")]
    pub(crate) out: PathBuf,
}

/// Reads the size of gaps in m.
fn parse_length(text: &str) -> Result<f64, String> {
    /// A larger gap is a wrong unit, m.
    const LARGEST_GAP: f64 = 0.1;
    let value: f64 = text
        .parse()
        .map_err(|_| "expected a length in m, such as 0.002".to_owned())?;
    if (0.0..=LARGEST_GAP).contains(&value) {
        Ok(value)
    } else {
        Err("expected a length from 0 to 0.1 m, such as 0.002 for 2 mm".to_owned())
    }
}

/// Reads the name of a format of robot descriptions.
fn parse_format(text: &str) -> Result<DescriptionFormat, String> {
    let named = |one: &DescriptionFormat| one.name() == text;
    let found = DescriptionFormat::ALL.into_iter().find(named);
    found.ok_or_else(|| "expected `urdf` or `mjcf`".to_owned())
}
