//! The workbench: one model file in the browser, on the user's own machine, with its picture, equations, errors along recordings
//! and diagnosis beside the text.
//!
//! `draft` is the text beside what the disk holds, `fence` what files may be read, `readings` recordings as a
//! model reads them, `sitting` the text with what was derived of
//! it and asked about it, `told` the answers as JSON, `watch` the progress of a diagnosis; `server` lets the page ask, `page` is
//! the page. All of it is the library's: this crate derives, compares and diagnoses nothing by itself.

mod draft;
mod fence;
mod page;
mod readings;
mod server;
mod sitting;
mod told;
mod watch;

use std::path::PathBuf;
use std::sync::Arc;

use modelmill::print::Spelling;
use modelmill::recording::Reading;
use modelmill::{Host, Outcome};

use sitting::Sitting;

/// What is put on the workbench.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The model file.
    pub model: PathBuf,
    /// Recordings to fit to and to compare with, each of one or several files that are joined on time.
    pub data: Vec<Vec<PathBuf>>,
    /// Recordings that a fit does not see.
    pub check: Vec<Vec<PathBuf>>,
    /// How recordings are read.
    pub reading: Reading,
    /// The port on the loopback address; 0 takes one that is free.
    pub port: u16,
}

/// What a reader is told that does the same without the workbench.
pub trait Commands: Spelling + Send + Sync {
    /// Does what a pane of the workbench does.
    fn same(&self, step: Step) -> String;
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

/// Serves the workbench on the loopback address until the program is stopped; `opened` gets the link as soon as it answers.
///
/// `host` gives libraries of effects and how models are derived; files come through a fence of the workbench's own.
/// Fails when the model file cannot be read, or the port is taken. A model file that has no meaning is no failure: it is what
/// the workbench is for.
pub fn serve(
    host: &Host,
    options: Options,
    commands: Arc<dyn Commands>,
    opened: impl FnOnce(&str),
) -> Outcome {
    let port = options.port;
    let sitting = Arc::new(Sitting::open(host, options, commands)?);
    server::serve(sitting, port, opened)
}
