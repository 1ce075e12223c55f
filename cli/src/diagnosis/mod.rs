//! A diagnosis of a model: candidates from the effect library, their columns along recordings, and the search over them.
//!
//! `places` -> `candidates` (text of what `add` would add) -> `columns` (numbers along the recordings) -> `identify::diagnose`.

mod candidates;
mod columns;
mod places;

pub(crate) use columns::{Held, find};
