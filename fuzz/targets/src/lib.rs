//! Every reader of a file as a plain function of bytes, with limits on memory, work and time as assertions.
//!
//! A corpus ([`corpus`]) goes into [`mutation`], and its mutated bytes into a target ([`targets`]). A panic is a finding.
//! The functions need no fuzzer: the driver `modelmill-fuzz` calls them in a loop, and a test for a moment.

mod allocator;
mod budget;
pub mod corpus;
pub mod mutation;
mod readers;
pub mod targets;
