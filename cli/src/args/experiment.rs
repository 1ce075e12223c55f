//! Arguments of `experiment`.

use std::path::PathBuf;

use clap::Args;

use super::motion::{parse_count, parse_rate};

/// `experiment`.
#[derive(Debug, Args)]
pub(crate) struct ExperimentArgs {
    /// Write the page `experiment.html` into this folder
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Random trajectories within the limits that the search for the excitation tries first
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = parse_count)]
    pub(crate) random: usize,
    /// How many of the best random trajectories the search starts from
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = parse_count)]
    pub(crate) starts: usize,
    /// Seed of the search and of the test trajectory
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
    /// Samples per second of the runs
    #[arg(long, value_name = "HZ", default_value_t = 200.0, value_parser = parse_rate)]
    pub(crate) rate: f64,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
}
