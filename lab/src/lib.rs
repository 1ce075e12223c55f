//! Shared parts of the benchmarks of `diagnose`: one plant, one random generator, one harness.
//!
//! [`plant`] simulates the complete SpiderMill next to its reduced model. [`course`] draws a motion from a seed,
//! [`hidden`] and [`outside`] draw the effects that are hidden in its forces, [`record`] adds sensors. [`case`]
//! combines these, [`judge`] compares the program's answer with the truth, and [`table`] prints the scores. The
//! [`harness`] reads the options of a benchmark, runs the program on each case and collects the results. Nothing of
//! this is part of the program.

pub mod alternatives;
pub mod answer;
pub mod case;
pub mod coloured;
pub mod columns;
pub mod course;
pub mod disturbance;
pub mod harness;
pub mod hidden;
pub mod judge;
pub mod outside;
pub mod placed;
pub mod plant;
pub mod random;
pub mod record;
pub mod span;
pub mod table;
