//! All loops of a mechanism, and the coordinates that they determine.
//!
//! Decision: a loop in space is cut where two points coincide. A spherical joint there needs no coordinates, a
//! universal joint is two revolute ones, and a platform is a free body whose pose is independent or passive like
//! any other coordinate. Drives on passive coordinates act through their Jacobian. So no joint of a loop is a
//! special case.

use modelmill_spec::Mechanism;

use super::closure::{LoopClosure, loop_closures};
use super::coupling;
use super::independent::{independent_residuals, sufficient_residuals};
use super::parallelogram;
use crate::DeriveError;
use crate::expr::{ExprId, Graph};
use crate::tree::KinematicTree;

/// The loops of a mechanism with its active and passive coordinates.
#[derive(Clone, Debug)]
pub(crate) struct KinematicLoops {
    /// Indices of the active coordinates, which move the mechanism.
    pub(crate) active: Vec<usize>,
    /// Indices of the passive coordinates, which the loops determine.
    pub(crate) passive: Vec<usize>,
    /// All loops, then all couplings.
    pub(crate) closures: Vec<LoopClosure>,
    /// Independent residuals, as many as there are passive coordinates.
    pub(crate) residual: Vec<ExprId>,
    /// Residuals that are zero wherever the selected ones are, in the assembly of the nominal pose; elsewhere they may not be.
    pub(crate) dependent_residual: Vec<ExprId>,
    /// The largest value of a residual at closed poses near the nominal one, relative to the size of the loops.
    pub(crate) contradiction: f64,
    /// Angles of which others are fractions, with the number of parts into which the field divides them.
    pub(crate) divided: Vec<(usize, i64)>,
}

impl KinematicLoops {
    /// Derives all closures, finds relations between angles, and selects independent equations.
    ///
    /// # Errors
    /// [`DeriveError::LoopCount`] if the independent equations are not as many as the passive coordinates.
    pub(crate) fn new(graph: &mut Graph, mechanism: &Mechanism, tree: &KinematicTree) -> Result<Self, DeriveError> {
        let (passive, active): (Vec<usize>, Vec<usize>) =
            (0..mechanism.coordinates.len()).partition(|i| mechanism.coordinates[*i].passive);
        let mut closures = loop_closures(graph, mechanism, tree)?;
        let couplings = coupling::couplings(graph, mechanism)?;
        closures.extend(couplings.closures);
        parallelogram::find_relations(graph, mechanism, &mut closures, &couplings.divided);
        let residual: Vec<ExprId> = closures.iter().flat_map(|c| c.residual.iter().copied()).collect();
        // Dependent equations are dropped: first linear dependences, then others that show in numbers.
        let mut residual = independent_residuals(graph, &residual)?;
        let (mut dependent_residual, mut contradiction) = (Vec::new(), 0.0);
        if residual.len() > passive.len()
            && let Some(enough) = sufficient_residuals(graph, mechanism, &residual, passive.len())
        {
            residual = enough.selected;
            dependent_residual = enough.dependent;
            contradiction = enough.contradiction;
        }
        // Each closure counts the selected equations that no closure before it has.
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
            dependent_residual,
            contradiction,
            divided: couplings.divided,
        })
    }

    /// Number of residuals of the loops without couplings: eqs. (L1) to (Ln) of the page.
    pub(crate) fn n_gap_equations(&self, mechanism: &Mechanism) -> usize {
        let of_loops = self.closures.iter().take(mechanism.loops.len());
        of_loops.map(|c| c.residual.len()).sum()
    }
}
