//! Rigs against formulas by hand, another program's numbers, and themselves.

mod common;
mod effects;
mod faulty;
mod hand;
mod mass_properties;
mod plant;
mod sensors;
mod spidermill;
