//! Printing of expressions: a notation-neutral [`PrintedFormula`] and its renderings as plain text, LaTeX and
//! presentation MathML.
//!
//! Everything that is shown to people goes through a [`PrintedFormula`]: expressions of the graph, exact expressions of
//! the model file, factors of eq. (6), operations of a program. The text is infix with `+ - * / ^ ( )`, rational
//! numbers and functions by name, so that a script can read it again.

mod formula;
mod from_exact;
mod from_graph;
mod latex;
mod mathml;
#[cfg(test)]
pub(crate) mod parse;
mod simplify;
mod symbol;
mod text;

#[cfg(test)]
pub(crate) mod tests;

pub use formula::{FormulaFunction, PrintedFormula};
pub use from_exact::{angle_formula, exact_formula, exact_formula_at, length_formula};
#[cfg(any(test, feature = "review"))]
pub(crate) use from_graph::angle_sum_formula;
pub use from_graph::{atom, formula, tree_size};
pub use symbol::FormulaSymbol;
