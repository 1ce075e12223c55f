//! The workbench: one model file in the browser, on the user's own machine, with its picture, equations, errors along recordings
//! and diagnosis beside the text.
//!
//! `options` is what is put on it, `draft` the text beside what the disk holds, `fence` what files may be read, `readings`
//! recordings as a model reads them, `watch` the progress of a diagnosis; `sitting` is the text with what was derived of it and
//! asked about it, `told` the answers as JSON; `server` lets the page ask, `page` is the page. All of it is the library's: this
//! crate derives, compares and diagnoses nothing by itself.

mod draft;
mod fence;
mod options;
mod page;
mod readings;
mod server;
mod sitting;
mod told;
mod watch;

use std::sync::Arc;

use modelmill::{Host, Outcome};

pub use options::{Commands, Options, Step};
use sitting::Sitting;

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
