//! What is put on the workbench, and the words in which its steps are said.

use std::path::{Path, PathBuf};

use modelmill::excite::ExcitationRequest;
use modelmill::print::StepSpelling;
use modelmill::recording::RecordingOptions;
use serde::Deserialize;

/// What is put on the workbench.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The model file.
    pub model: PathBuf,
    /// Recordings to fit to and to compare with, each of one or several files that are joined on time.
    pub data: Vec<Vec<PathBuf>>,
    /// Recordings that a fit does not see.
    pub check: Vec<Vec<PathBuf>>,
    /// A model file beside the model, which may lie in another folder.
    pub beside: Option<PathBuf>,
    /// How recordings are read.
    pub reading: RecordingOptions,
    /// What revisions and versions are counted from, so that a page which opens one sitting after the other never takes one's
    /// answers for the other's.
    pub first: u64,
    /// The port on the loopback address; 0 takes one that is free.
    pub port: u16,
}

/// What a reader is told that does the same without the workbench.
pub trait WorkbenchCommands: StepSpelling + Send + Sync {
    /// Does what a pane of the workbench does; `None` where nothing else does.
    fn step_command(&self, step: WorkbenchStep) -> Option<String>;

    /// Holds the model of the workbench against another model file, as it was before.
    fn variant_command(&self, before: &Path) -> Option<String>;

    /// Plans the motion that was asked for; `None` where nothing else does.
    fn excite_command(&self, asked: &ExcitationSettings) -> Option<String>;
}

/// What is asked of an excitation; what is not named is as `excite` has it.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ExcitationSettings {
    /// Harmonics of each coordinate's series.
    pub harmonics: usize,
    /// Period, s.
    pub period: f64,
    /// Random trajectories that are tried first.
    pub random: usize,
    /// How many of them the search starts from.
    pub starts: usize,
    /// The same seed gives the same trajectory.
    pub seed: u64,
    /// Samples per second of the file, Hz.
    pub rate: f64,
    /// Limits beside those of the model file, or in their place, such as `theta1=1.5:2.1`.
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

/// What a pane of the workbench does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WorkbenchStep {
    /// Draws the mechanism.
    Picture,
    /// Derives the model and writes out its equations.
    Equations,
    /// Holds it against the recordings.
    Compare,
    /// Identifies its base parameters.
    Identify,
    /// Asks what it lacks.
    Diagnose,
}
