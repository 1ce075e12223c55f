//! The library on recordings that are made for it, with what is in them known.

mod clocks;
mod draws;
mod events;
mod every_model;
mod forward;
mod hanging;
mod made;
mod mechanisms;
mod missing;
mod options;
mod permuted_entries;
mod redundant_drives;
mod run_plans;
mod runs;
mod runs_verdict;
mod servo;
mod servo_diagnosis;
mod servo_use;
mod spoilt;
mod stick;
mod together;
mod undriven;
mod variants;
