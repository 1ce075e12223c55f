//! Tests of the parts that the benchmarks share.

mod hidden_cases;
mod hidden_effects;
