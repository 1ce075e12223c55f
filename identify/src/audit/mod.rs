//! What looks wrong with a recording: columns, signals and periods go in, suspicions and notes come out.

pub(crate) mod columns;
mod periods;
mod signals;
pub mod suspects;
