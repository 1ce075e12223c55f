//! Passive angles that are integer combinations of other angles.

use crate::expr::{Atom, AtomAngleSum, ExprId, Graph};

/// A passive angle that equals `sum + pi12 * pi/12`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct AngleRelation {
    pub(crate) coordinate: usize,
    pub(crate) sum: AtomAngleSum,
    pub(crate) pi12: i32,
}

impl AngleRelation {
    /// The angle that it gives, as a number.
    pub(crate) fn value(&self, graph: &mut Graph) -> ExprId {
        graph.angle(&self.sum, self.pi12)
    }

    /// The relation as an equation.
    pub(super) fn residual(&self, graph: &mut Graph) -> ExprId {
        let (coordinate, value) = (
            graph.atom(Atom::Coordinate(self.coordinate)),
            self.value(graph),
        );
        graph.sub(coordinate, value)
    }
}
