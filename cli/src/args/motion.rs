//! Arguments of `simulate`, `excite` and `experiment`, which plan and simulate motions.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use modelmill::excite::TrajectoryLimit;
use modelmill::options::parse_column;

use crate::args::data::ParameterSource;
use crate::args::separate::SeparateArgs;

/// `simulate`.
#[derive(Debug, Args)]
pub(crate) struct SimulateArgs {
    /// Rig file (TOML), or a model file with --data or --command
    pub(crate) rig: PathBuf,
    /// Trajectory of the rig (CSV): time t and the coordinates, with or without derivatives
    #[arg(long, value_name = "TRAJ.csv", required_unless_present_any = ["data", "command"])]
    pub(crate) trajectory: Option<PathBuf>,
    /// Recording whose forces drive a model, from its first state; if it has none, those of the model's actuators
    #[arg(long, value_name = "RUN", conflicts_with_all = ["trajectory", "seed"])]
    pub(crate) data: Option<PathBuf>,
    /// Recording whose commands, or other signals of actuators, drive a model, from its first state; its forces are not
    /// used
    #[arg(long, value_name = "RUN", conflicts_with_all = ["trajectory", "seed", "data"])]
    pub(crate) command: Option<PathBuf>,
    /// Values of the base parameters of a model: `nominal`, or a file that `identify` wrote
    #[arg(long, value_name = "nominal|FIT.json", default_value = "nominal", value_parser = ParameterSource::parse)]
    pub(crate) parameters: ParameterSource,
    /// Write the recording to this file
    #[arg(long, value_name = "RUN.csv")]
    pub(crate) out: PathBuf,
    /// Seed of the noise; the rig's own if not given
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// Column of the trajectory or recording for a name of the rig or model, e.g. `--map theta1=pos_left`; may be repeated
    #[arg(long, value_name = "NAME=COLUMN", value_parser = parse_column)]
    pub(crate) map: Vec<(String, String)>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

/// What the search for an excitation minimises.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum CriterionArg {
    /// The condition number of the regressor in SI units, as in eq. (13) of the paper
    Condition,
    /// The negative logarithm of the determinant of W'W/N (D-optimality): the volume of the parameters' uncertainty
    LogDet,
}

/// `excite`.
#[derive(Debug, Args)]
pub(crate) struct ExciteArgs {
    /// Model file (TOML)
    pub(crate) model: PathBuf,
    /// Harmonics of the Fourier series of each active coordinate; with several numbers, such as `5,7,9`, each is
    /// searched and the best result is written
    #[arg(long, value_name = "N[,N...]", default_value = "7", value_delimiter = ',', value_parser = parse_harmonics)]
    pub(crate) harmonics: Vec<usize>,
    /// Period of the trajectory, s, or a range in which the best period is searched, such as `5:10`
    #[arg(long, value_name = "S|LOW:HIGH", default_value = "7.29", value_parser = PeriodArg::parse)]
    pub(crate) period: PeriodArg,
    /// Limits that add to those of the model file or replace them: a coordinate (`theta1=1.5:2.1`), its rate
    /// (`theta1_d=1.2`) or acceleration (`theta1_dd=4`), the force of a drive (`spindle_left=1500`), a point
    /// (`R3m.x=0.2:0.7`), or `singularity=0.3`; may be repeated
    #[arg(long, value_name = "NAME=RANGE", value_delimiter = ',', value_parser = TrajectoryLimit::parse, allow_hyphen_values = true)]
    pub(crate) limits: Vec<TrajectoryLimit>,
    /// Criterion that is minimised
    #[arg(long, value_enum, default_value = "condition")]
    pub(crate) criterion: CriterionArg,
    /// Values of the base parameters for the forces along the motion: `nominal`, or a file that `identify` wrote
    #[arg(long, value_name = "nominal|FIT.json", default_value = "nominal", value_parser = ParameterSource::parse)]
    pub(crate) parameters: ParameterSource,
    /// Random trajectories within the limits that are tried first
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = parse_count)]
    pub(crate) random: usize,
    /// How many of the best random trajectories the search starts from
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = parse_count)]
    pub(crate) starts: usize,
    /// Seed of the search; the same seed gives the same trajectory
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
    /// Samples per second in the file
    #[arg(long, value_name = "HZ", default_value_t = 500.0, value_parser = parse_rate)]
    pub(crate) rate: f64,
    /// Write one period of the trajectory to this file: `t`, coordinates, rates, accelerations
    #[arg(long, value_name = "TRAJ.csv")]
    pub(crate) out: PathBuf,
    /// Write its picture to this file; if not given, next to the trajectory with the ending .svg
    #[arg(long, value_name = "FILE.svg")]
    pub(crate) figure: Option<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) separate: SeparateArgs,
}

/// A period, or the range in which it is searched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum PeriodArg {
    /// A fixed period, s.
    Fixed(f64),
    /// Bounds of a period that is a variable of the search, s.
    Searched([f64; 2]),
}

impl PeriodArg {
    /// Reads a period in s, or a range of periods.
    fn parse(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            None => parse_period(text).map(Self::Fixed),
            Some((low, high)) => match [parse_period(low.trim())?, parse_period(high.trim())?] {
                [low, high] if low < high => Ok(Self::Searched([low, high])),
                _ => Err("the range of periods is empty; the shorter period comes first, as in 5:10".to_owned()),
            },
        }
    }
}

/// Reads a number of harmonics, 1 to 50.
fn parse_harmonics(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(value) if (1..=50).contains(&value) => Ok(value),
        _ => Err("expected an integer from 1 to 50".to_owned()),
    }
}

/// Reads a number of trajectories, 1 to 1000000.
pub(super) fn parse_count(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(value) if (1..=1_000_000).contains(&value) => Ok(value),
        _ => Err("expected an integer from 1 to 1000000".to_owned()),
    }
}

/// Reads a period in s, 0.001 to 10000.
fn parse_period(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (1e-3..=1e4).contains(&value) => Ok(value),
        _ => Err("expected a time in s between 0.001 and 10000, such as 7.29".to_owned()),
    }
}

/// Reads a sampling rate in samples per second, 1 to 100000.
pub(super) fn parse_rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (1.0..=1e5).contains(&value) => Ok(value),
        _ => Err("expected samples per second between 1 and 100000, such as 500".to_owned()),
    }
}
