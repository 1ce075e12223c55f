//! The workbench as WebAssembly: a [`modelmill_workbench::RequestHandler`] behind four functions that a host calls by name, and two that
//! it lends. Everywhere else, what makes the page around it.

#[cfg(target_family = "wasm")]
pub mod exports;
#[cfg(not(target_family = "wasm"))]
pub mod make;
