//! Options of the workbench: files and settings, and the commands that do the same without it.

use std::path::{Path, PathBuf};

use modelmill::excite::ExcitationRequest;
use modelmill::print::StepWording;
use modelmill::recording::RecordingOptions;
use serde::Deserialize;

/// The files of a session, and how they are read and served.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The model file.
    pub model: PathBuf,
    /// Recordings to fit and to compare with, each of one or several files that are joined on time.
    pub data: Vec<Vec<PathBuf>>,
    /// Recordings for validation, not used in a fit.
    pub check: Vec<Vec<PathBuf>>,
    /// A model file to compare with, which may be in another folder.
    pub beside: Option<PathBuf>,
    /// How recordings are read.
    pub reading: RecordingOptions,
    /// Value before the first revision and version. A page that opens several sessions in sequence thus never confuses
    /// their responses.
    pub first: u64,
    /// The port on the loopback address; 0 selects a free one.
    pub port: u16,
}

/// Commands that the page shows, which do the same as its panes without the workbench.
pub trait WorkbenchCommands: StepWording + Send + Sync {
    /// The command for a pane; `None` if there is no command line.
    fn step_command(&self, step: WorkbenchStep) -> Option<String>;

    /// The command that compares the model of the workbench with an earlier or other model file `before`; `None` if
    /// there is no command line.
    fn variant_command(&self, before: &Path) -> Option<String>;

    /// The command that plans the requested motion; `None` if there is no command line.
    fn excite_command(&self, asked: &ExcitationSettings) -> Option<String>;
}

/// Settings of a search for an excitation. Missing fields have the defaults of `excite`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ExcitationSettings {
    /// Harmonics of each coordinate's series.
    pub harmonics: usize,
    /// Period, s.
    pub period: f64,
    /// Number of random trajectories that are tried first.
    pub random: usize,
    /// Number of the best random trajectories from which the search starts.
    pub starts: usize,
    /// Seed of the random numbers; the same seed gives the same trajectory.
    pub seed: u64,
    /// Sampling rate of the file, Hz.
    pub rate: f64,
    /// Limits that add to those of the model file or replace them, such as `theta1=1.5:2.1`.
    pub limits: Vec<String>,
}

impl Default for ExcitationSettings {
    fn default() -> Self {
        let usual = ExcitationRequest::default();
        Self {
            harmonics: usual.options.harmonics,
            period: usual.options.period,
            random: usual.options.random,
            starts: usual.options.starts,
            seed: usual.options.seed,
            rate: usual.rate,
            limits: Vec::new(),
        }
    }
}

/// A step of the workbench, which one command does as well.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WorkbenchStep {
    /// Draws the mechanism.
    Picture,
    /// Derives the model and writes its equations.
    Equations,
    /// Compares it with the recordings.
    Compare,
    /// Identifies its base parameters.
    Identify,
    /// Searches for effects that it lacks.
    Diagnose,
}
