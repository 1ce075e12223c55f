//! The parts of benchmarks do what they say.

mod hidden_cases;
mod hidden_effects;
