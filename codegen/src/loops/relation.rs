//! Passive angles that are integer combinations of other angles.

use crate::expr::{Atom, AtomAngleSum, ExprId, Graph};

/// A passive angle, in rad, that equals `sum + pi12 * pi/12`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct AngleRelation {
    /// Index of the passive coordinate.
    pub(crate) coordinate: usize,
    /// Variable part of its value.
    pub(crate) sum: AtomAngleSum,
    /// Constant part of its value, in multiples of pi/12.
    pub(crate) pi12: i32,
}

impl AngleRelation {
    /// Its value as an expression, rad.
    pub(crate) fn value(&self, graph: &mut Graph) -> ExprId {
        graph.angle(&self.sum, self.pi12)
    }

    /// The relation as an equation: the coordinate minus its value.
    pub(super) fn residual(&self, graph: &mut Graph) -> ExprId {
        let (coordinate, value) = (graph.atom(Atom::Coordinate(self.coordinate)), self.value(graph));
        graph.sub(coordinate, value)
    }
}
