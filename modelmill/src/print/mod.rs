//! Printers of results: JSON objects for scripts, text for people. Each prints a value of the library; none looks anything up.

mod changes;
mod comparison;
mod contents;
pub mod edit;
pub mod effects;
mod estimation;
mod excitation;
mod findings;
mod identification;
mod interpretation;
pub(crate) mod laws;
mod next_step;
#[cfg(feature = "import")]
mod reduction;
mod runs;
mod spelling;
mod summary;
pub mod tables;
mod variants;

pub use spelling::{Advised, Spelling, Words, spelled};
pub use summary::{faults, refusal, warnings};
