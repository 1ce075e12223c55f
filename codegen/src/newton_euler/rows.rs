//! Generalised forces at joints, and the operations that both ways of carrying wrenches share.

use modelmill_spec::FreeBody;

use super::{RecursionStyle, SymbolicWrench};
use crate::expr::vector::SymbolicVector;
use crate::expr::{ExprId, Graph, Rational};
use crate::tree::{TreeLink, free};

/// Generalised forces of the coordinates, as lists of terms that are added at the end.
pub(super) struct ForceRows(Vec<Vec<(ExprId, Rational)>>);

impl ForceRows {
    /// Empty lists for all coordinates.
    pub(super) fn new(n_coordinates: usize) -> Self {
        Self(vec![Vec::new(); n_coordinates])
    }

    /// Adds a moment about a link's axis (N m) and a force along it (N) to the link's coordinates.
    pub(super) fn add_joint_force(&mut self, link: &TreeLink, moment: ExprId, force: ExprId) {
        // Coordinates that rotate the link take the moment, each with its integer factor.
        for (coordinate, n) in &link.turns {
            self.0[*coordinate].push((moment, Rational::integer(i64::from(*n))));
        }
        // Coordinates that displace it take the force, each with its rational factor.
        for (coordinate, k) in &link.slides {
            self.0[*coordinate].push((force, k.clone()));
        }
    }

    /// Adds the wrench on a free body, given in its axes and about its origin.
    pub(super) fn add_free_body_wrench(&mut self, graph: &mut Graph, body: &FreeBody, wrench: &SymbolicWrench) {
        // Force and moment are needed in the axes in which the body's rates are given.
        let force = free::from_body(graph, body, body.linear, &wrench.force);
        let moment = free::from_body(graph, body, body.angular, &wrench.moment);
        // Rows of the position for the force, and three rows of the quaternion for the moment.
        let [_, qx, qy, qz] = body.quaternion;
        let rows = body.position.into_iter().chain([qx, qy, qz]);
        for (i, component) in rows.zip(force.into_iter().chain(moment)) {
            self.0[i.0].push((component, Rational::ONE));
        }
    }

    /// The sums, one expression per coordinate.
    pub(super) fn sum_rows(self, graph: &mut Graph) -> Vec<ExprId> {
        self.0.into_iter().map(|terms| graph.sum(&terms)).collect()
    }
}

/// Adds a wrench to a sum that may not exist yet.
pub(super) fn add_wrench(graph: &mut Graph, total: &mut Option<SymbolicWrench>, wrench: SymbolicWrench) {
    *total = Some(match *total {
        None => wrench,
        Some(there) => SymbolicWrench {
            force: graph.add_vectors(&[there.force, wrench.force]),
            moment: graph.add_vectors(&[there.moment, wrench.moment]),
        },
    });
}

/// The moment of a wrench about the point that is reached before the offset along the link's axis.
pub(super) fn moment_before_axis_offset(
    graph: &mut Graph,
    style: RecursionStyle,
    link: &TreeLink,
    wrench: &SymbolicWrench,
) -> SymbolicVector {
    let (_, along) = style.split_position(link);
    // The offset is along z, so it changes the moments about x and y only.
    let [mx, my, mz] = wrench.moment;
    let (x, y) = (graph.mul(along, wrench.force[1]), graph.mul(along, wrench.force[0]));
    [graph.sub(mx, x), graph.add(my, y), mz]
}
