//! All loops of a mechanism, and which coordinates they settle.
//!
//! Decision: a loop in space is cut where two points coincide. A spherical joint there needs no coordinates, a
//! universal joint is two revolute ones, and a platform is a free body whose pose is independent or passive like
//! any other coordinate. Drives on passive coordinates act through their Jacobian. So no joint of a loop is a
//! special case.

use modelmill_spec::Mechanism;

use super::closure::{Closure, closures};
use super::coupling;
use super::independent::{independent, sufficient};
use super::parallelogram;
use crate::DeriveError;
use crate::expr::{ExprId, Graph};
use crate::tree::Tree;

/// The loops of a mechanism with the coordinates that move it and those that follow.
#[derive(Clone, Debug)]
pub(crate) struct Loops {
    pub(crate) active: Vec<usize>,
    pub(crate) passive: Vec<usize>,
    pub(crate) closures: Vec<Closure>,
    /// Residuals that are independent, as many as there are passive coordinates.
    pub(crate) residual: Vec<ExprId>,
    /// Angles whose turns others make fractions of, and into how many parts the field divides them.
    pub(crate) divided: Vec<(usize, i64)>,
}

impl Loops {
    pub(crate) fn new(
        graph: &mut Graph,
        mechanism: &Mechanism,
        tree: &Tree,
    ) -> Result<Self, DeriveError> {
        let (passive, active): (Vec<usize>, Vec<usize>) =
            (0..mechanism.coordinates.len()).partition(|i| mechanism.coordinates[*i].passive);
        let mut closures = closures(graph, mechanism, tree)?;
        let couplings = coupling::couplings(graph, mechanism)?;
        closures.extend(couplings.closures);
        parallelogram::find(graph, mechanism, &mut closures, &couplings.divided);
        let residual: Vec<ExprId> = closures
            .iter()
            .flat_map(|c| c.residual.iter().copied())
            .collect();
        let mut residual = independent(graph, &residual)?;
        if residual.len() > passive.len()
            && let Some(enough) = sufficient(graph, mechanism, &residual, passive.len())
        {
            residual = enough;
        }
        let mut left = residual.clone();
        for closure in &mut closures {
            let before = left.len();
            left.retain(|r| !closure.residual.contains(r));
            closure.n_independent = before - left.len();
        }
        if residual.len() != passive.len() {
            return Err(DeriveError::LoopCount {
                equations: residual.len(),
                passive: passive.len(),
            });
        }
        Ok(Self {
            active,
            passive,
            closures,
            residual,
            divided: couplings.divided,
        })
    }

    /// How many gaps close the loops, couplings aside: eqs. (L1) to (Ln) of the page.
    pub(crate) fn n_gaps(&self, mechanism: &Mechanism) -> usize {
        let of_loops = self.closures.iter().take(mechanism.loops.len());
        of_loops.map(|c| c.residual.len()).sum()
    }
}
