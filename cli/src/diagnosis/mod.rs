//! A diagnosis of a model: candidates from the effect library, their columns along recordings, and the search over them.
//!
//! `places` -> `candidates` (text of what `add` would add) -> `columns` (numbers along the recordings) -> `problem`.
//! `chosen` does the same for effects that the user names.

mod candidates;
mod chosen;
mod columns;
mod numbers;
mod places;
mod problem;
mod tilt;

pub(crate) use candidates::sign;
pub(crate) use chosen::{Chosen, Constants, Named, base, choose};
pub(crate) use problem::{Answer, Held, ROUNDING, find};
