//! A diagnosis of a model: candidates from the effect library, their columns along recordings, and the search over them.
//!
//! `places` -> `candidates` (text of what `add` would add) -> `columns` (numbers along the recordings) -> `problem`.

mod candidates;
mod columns;
mod numbers;
mod places;
mod problem;

pub(crate) use problem::{Answer, Held, ROUNDING, find};
