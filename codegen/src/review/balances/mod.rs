//! Balances of forces and of moments of one body that is cut free: Newton's and Euler's equations of the body with the
//! reactions at its cuts, eq. (2) and (3) of the paper.
//!
//! A [`Derivation`] and the name of a part or frame go in, a page or [`BodyBalances`] comes out. `geometry` selects the
//! body and expresses its vectors in one set of axes, `masses` and `connections` collect the terms of the equations,
//! `equations` writes them, and `picture` draws the body with its forces.
//!
//! Decision: the terms are those of `on_request::reactions`, joint by joint, so that printed symbols are the components
//! that a program for reactions computes. They are collected again for one body, because reactions are sums over
//! everything beyond a joint, in which the forces of one body cannot be seen.

mod connections;
mod equations;
mod geometry;
mod masses;
mod page;
mod picture;
mod vectors;

use std::fmt;

#[cfg(any(test, feature = "json"))]
use serde::Serialize;

use super::PageFormat;
use super::{render_html, render_latex, render_markdown, render_text};
use crate::{Derivation, DeriveError};
use equations::BalanceEquations;
use geometry::BodyGeometry;

/// Why there are no balances of a part.
#[derive(Clone, Debug, PartialEq)]
pub enum CutFreeError {
    /// No part and no frame has this name.
    UnknownPart {
        /// The requested name.
        name: String,
        /// Names of all parts that can be cut free.
        parts: Vec<String>,
    },
    /// The part is fixed to the base.
    FixedToBase {
        /// The requested name.
        name: String,
        /// Names of all parts that can be cut free.
        parts: Vec<String>,
    },
    /// An expression of the model has no symbolic form.
    Derivation(DeriveError),
}

impl From<DeriveError> for CutFreeError {
    fn from(error: DeriveError) -> Self {
        Self::Derivation(error)
    }
}

impl fmt::Display for CutFreeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnknownPart { name, parts } => {
                write!(f, "no part and no frame is named {name:?}; {}", remedy(parts))
            }
            Self::FixedToBase { name, parts } => write!(
                f,
                "{name:?} is fixed to the base and does not move, so it has no balances of its own; {}",
                remedy(parts)
            ),
            Self::Derivation(error) => error.fmt(f),
        }
    }
}

/// What to do if a part cannot be cut free.
fn remedy(parts: &[String]) -> String {
    if parts.is_empty() {
        return "the model has no moving part".to_owned();
    }
    format!("choose one of {}", parts.join(", "))
}

/// The balances of a body as texts.
#[derive(Clone, Debug)]
#[cfg_attr(any(test, feature = "json"), derive(Serialize))]
pub struct BodyBalances {
    /// Name of the model.
    pub model: String,
    /// The part or frame that was requested.
    pub part: String,
    /// Frames of the body: those that are fixed to each other.
    pub frames: Vec<String>,
    /// The axes of all components: `base`, or the joint whose frame moves with the body.
    pub axes: String,
    /// Whether all motion is in one plane, so that three equations describe the body and not six.
    pub is_planar: bool,
    /// Names of the vectors, with their meaning.
    pub vectors: Vec<BalanceVector>,
    /// Components of known vectors as functions of coordinates, rates and accelerations, in the order of computation.
    pub definitions: Vec<BalanceEquation>,
    /// The balance of forces with vectors.
    pub forces: BalanceEquation,
    /// The balance of moments about the origin of the body with vectors.
    pub moments: BalanceEquation,
    /// The same by components.
    pub components: Vec<BalanceEquation>,
}

/// A vector of the balances.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(any(test, feature = "json"), derive(Serialize))]
pub struct BalanceVector {
    /// Its symbol; components have the name of the axis behind it.
    pub symbol: String,
    /// What it is.
    pub meaning: String,
    /// Its unit.
    pub unit: String,
    /// Its components along x, y and z: formulas, or names of unknowns and of definitions. Components that the balances
    /// do not contain are 0. Empty for quantities without components.
    pub components: Vec<String>,
    /// The joint or loop that transmits it, for reactions; the drive, for its force.
    pub transmitted_by: Option<String>,
}

/// One equation as infix text.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(any(test, feature = "json"), derive(Serialize))]
pub struct BalanceEquation {
    /// Number on the page.
    pub tag: String,
    /// The left side: inertia in a balance, a symbol in a definition.
    pub left: String,
    /// The right side: forces or moments on the body in a balance.
    pub right: String,
}

/// Derives the balances of the body that carries a part or frame.
///
/// # Errors
/// A [`CutFreeError`] if there is no such body, or if its vectors cannot be written as expressions.
pub fn body_balances(derivation: &Derivation, part: &str) -> Result<BodyBalances, CutFreeError> {
    let geometry = BodyGeometry::new(derivation, part)?;
    let equations = BalanceEquations::new(derivation, geometry)?;
    Ok(equations.texts(derivation))
}

/// The page of the balances of a body in one notation.
///
/// # Errors
/// As [`body_balances`].
pub fn balance_page(derivation: &Derivation, part: &str, format: PageFormat) -> Result<String, CutFreeError> {
    let geometry = BodyGeometry::new(derivation, part)?;
    let mut equations = BalanceEquations::new(derivation, geometry)?;
    let picture = equations.picture(derivation);
    let document = page::compose(derivation, &equations);
    Ok(match format {
        PageFormat::Text => render_text::render(&document),
        PageFormat::Markdown => render_markdown::render(&document),
        PageFormat::Latex => render_latex::render(&document),
        PageFormat::Html => render_html::render(&document, &picture),
        #[cfg(any(test, feature = "json"))]
        PageFormat::Json => equations.texts(derivation).json(),
    })
}

#[cfg(any(test, feature = "json"))]
impl BodyBalances {
    /// As JSON, indented, with a line end.
    pub fn json(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).expect("strings only");
        text.push('\n');
        text
    }
}
