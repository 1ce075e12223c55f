//! Exact arithmetic that knows no mechanisms: rationals, prime fields and elimination in them, polynomials, their
//! Groebner bases and their real roots, and numbers of many digits where nothing exact is to be had.

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
