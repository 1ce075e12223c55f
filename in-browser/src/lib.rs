//! The workbench as WebAssembly: a [`modelmill_workbench::RequestHandler`] behind four functions that a host calls by
//! name, and two that the host provides. On other targets, the functions that build the page around it.

#[cfg(target_family = "wasm")]
pub mod exports;
#[cfg(not(target_family = "wasm"))]
pub mod make;
