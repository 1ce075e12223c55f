//! Exact arithmetic without any knowledge of mechanisms: rationals, prime fields and elimination in them, polynomials,
//! their Groebner bases and real roots. Where no exact result exists, there are floating-point numbers of many digits.

pub mod digits;
pub mod eliminate;
pub mod field;
pub mod groebner;
pub mod lift;
pub mod polynomial;
mod rational;
pub mod real_roots;
pub mod univariate;

pub use rational::Rational;
