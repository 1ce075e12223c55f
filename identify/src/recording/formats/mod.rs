//! The formats of recordings, each a reader of its own that hands samples to the intake.

pub(crate) mod csv;
pub(crate) mod matlab;
pub(crate) mod parquet;
