//! The workbench: one model file in the browser, on the user's own machine, with its picture, equations, errors along
//! recordings and diagnosis next to the text.
//!
//! `options` has the files and settings, `document` the edited document and the text on disk, `readings` the cache of
//! recordings, `surrounding_files` the environment of a session (files, clock, threads), `watch` the progress of a job.
//! `session` is the session: the text, the derived model, and the jobs. `variant` is the model that the text is
//! compared with, `view` the JSON views, `answers` the requests of a page, `page` the page.
//!
//! A session runs on this machine: `machine` gives access to the disk through the file access policy of `file_access`, and
//! `server` receives the requests of the page. Or it runs in memory: `request_handler` is the request handler and `memory_store` the
//! memory store, compiled to WebAssembly as part of the page. The library does the work: this crate does not derive,
//! compare or diagnose by itself.

mod answers;
mod document;
mod memory_store;
mod options;
mod readings;
mod request_handler;
mod session;
mod surrounding_files;
mod variant;
mod view;
mod watch;

#[cfg(not(target_family = "wasm"))]
mod connections;
#[cfg(not(target_family = "wasm"))]
mod file_access;
#[cfg(not(target_family = "wasm"))]
mod machine;
#[cfg(not(target_family = "wasm"))]
mod page;
#[cfg(not(target_family = "wasm"))]
mod server;

pub use options::{ExcitationSettings, Options, WorkbenchCommands, WorkbenchStep};
#[cfg(not(target_family = "wasm"))]
pub use page::{PageBundle, standalone_page};
pub use request_handler::RequestHandler;

/// Serves the workbench on the loopback address until the program is stopped; `opened` gets the link once the server
/// listens.
///
/// `host` gives libraries of effects and options for deriving models; files are read through the workbench's file
/// access policy. Fails if the model file cannot be read, or the port is in use. A model file with faults is no
/// failure: the page shows the faults.
#[cfg(not(target_family = "wasm"))]
pub fn serve(
    host: &modelmill::Host,
    options: Options,
    commands: std::sync::Arc<dyn WorkbenchCommands>,
    opened: impl FnOnce(&str),
) -> modelmill::Outcome {
    let port = options.port;
    let machine = std::sync::Arc::new(machine::LocalMachine::new(file_access::FileAccessPolicy::for_session(
        host, &options,
    )));
    let session = session::WorkbenchSession::open(host, options, commands, machine.clone())?;
    server::serve(std::sync::Arc::new(session), machine, port, opened)
}
