//! The workbench: one model file in the browser, on the user's own machine, with its picture, equations, errors along recordings
//! and diagnosis beside the text.
//!
//! `options` is what is put on it, `draft` the text beside what the disk holds, `readings` recordings as a model reads them,
//! `surroundings` what a sitting needs of where it takes place, `watch` the progress of a diagnosis; `sitting` is the text with
//! what was derived of it and asked about it, `variant` the model that it is held beside, `told` the answers as JSON, `answers` what a page may ask, `page` the page.
//!
//! It takes place on this machine, where `machine` has the disk behind a `fence` and a `server` lets the page ask; or on a
//! `desk` in memory (its files on a `shelf`), which WebAssembly carries into the page itself. All of the work is the library's:
//! this crate derives, compares and diagnoses nothing by itself.

mod answers;
mod desk;
mod draft;
mod options;
mod readings;
mod shelf;
mod sitting;
mod surroundings;
mod told;
mod variant;
mod watch;

#[cfg(not(target_family = "wasm"))]
mod fence;
#[cfg(not(target_family = "wasm"))]
mod machine;
#[cfg(not(target_family = "wasm"))]
mod page;
#[cfg(not(target_family = "wasm"))]
mod server;

pub use desk::RequestHandler;
pub use options::{ExcitationSettings, Options, WorkbenchCommands, WorkbenchStep};
#[cfg(not(target_family = "wasm"))]
pub use page::{PageBundle, standalone_page};

/// Serves the workbench on the loopback address until the program is stopped; `opened` gets the link as soon as it answers.
///
/// `host` gives libraries of effects and how models are derived; files come through a fence of the workbench's own.
/// Fails when the model file cannot be read, or the port is taken. A model file that has no meaning is no failure: it is what
/// the workbench is for.
#[cfg(not(target_family = "wasm"))]
pub fn serve(
    host: &modelmill::Host,
    options: Options,
    commands: std::sync::Arc<dyn WorkbenchCommands>,
    opened: impl FnOnce(&str),
) -> modelmill::Outcome {
    let port = options.port;
    let machine = std::sync::Arc::new(machine::LocalMachine::new(
        fence::FileAccessPolicy::for_session(host, &options),
    ));
    let sitting = sitting::WorkbenchSession::open(host, options, commands, machine.clone())?;
    server::serve(std::sync::Arc::new(sitting), machine, port, opened)
}
