//! Model files of modelmill: TOML goes in, a validated [`Mechanism`] or a list of diagnostics comes out.

mod exact;
mod mechanism;

pub use exact::*;
pub use mechanism::*;
