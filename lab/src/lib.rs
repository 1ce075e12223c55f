//! What all benchmarks of `diagnose` have in common: one plant, one stream of random numbers, one harness.
//!
//! [`plant`] is the SpiderMill's rig beside its reduced model, [`course`] a motion that is drawn from a seed, [`hidden`] and
//! [`outside`] what is hidden in its forces, [`record`] what sensors make of them. [`case`] draws all of that, [`judge`] marks
//! what the program answers, and [`table`] prints marks. A benchmark of `benches` takes from these what it needs; the
//! [`harness`] reads its options, works its cases off and asks the program. Nothing of this is part of the program.

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
