//! What is put on the workbench, and the words in which its steps are said.

use std::path::{Path, PathBuf};

use modelmill::print::Spelling;
use modelmill::recording::Reading;

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
    pub reading: Reading,
    /// What revisions and versions are counted from, so that a page which opens one sitting after the other never takes one's
    /// answers for the other's.
    pub first: u64,
    /// The port on the loopback address; 0 takes one that is free.
    pub port: u16,
}

/// What a reader is told that does the same without the workbench.
pub trait Commands: Spelling + Send + Sync {
    /// Does what a pane of the workbench does; `None` where nothing else does.
    fn same(&self, step: Step) -> Option<String>;

    /// Holds the model of the workbench against another model file, as it was before.
    fn variant(&self, before: &Path) -> Option<String>;
}

/// What a pane of the workbench does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
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
