//! What solving a loop yields, whichever way it is solved.

use super::relation::AngleRelation;
use crate::expr::{AtomAngleSum, ExprId, Graph};

/// Unknown coordinates of a loop as expressions of known ones.
#[derive(Clone, Debug)]
pub(crate) struct ClosureSolution {
    /// Cosine and sine of sums of angles, each of which holds unknown coordinates.
    pub(crate) angles: Vec<(AtomAngleSum, [ExprId; 2])>,
    /// Angles that are integer combinations of known ones.
    pub(crate) relations: Vec<AngleRelation>,
    /// Values of coordinates: of prismatic ones, and of angles that follow others.
    pub(crate) values: Vec<(usize, ExprId)>,
    /// The square root that chooses between the two assembly modes: its sign is `branch`'s.
    pub(crate) root: Option<SignedRoot>,
}

/// A square root whose sign depends on the assembly mode.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SignedRoot {
    /// What must not be negative for the loop to close.
    pub(crate) radicand: ExprId,
    /// An expression of the coordinates that equals the signed root.
    pub(crate) witness: ExprId,
    /// The function that the root is, if it needs no root sign: the two modes are then two motions, each by itself.
    pub(crate) exact: Option<ExprId>,
}

/// Cosine and sine of so many times an angle.
pub(crate) fn multiply_angle(graph: &mut Graph, mut power: [ExprId; 2], n: i64) -> [ExprId; 2] {
    if n < 0 {
        power[1] = graph.neg(power[1]);
    }
    let mut total = [Graph::ONE, Graph::ZERO];
    let mut left = n.unsigned_abs();
    while left > 0 {
        if left % 2 == 1 {
            total = rotate_vector(graph, power, total);
        }
        left /= 2;
        if left > 0 {
            power = rotate_vector(graph, power, power);
        }
    }
    total
}

/// The vector turned by the angle of the given cosine and sine.
pub(crate) fn rotate_vector(
    graph: &mut Graph,
    [c, s]: [ExprId; 2],
    [x, y]: [ExprId; 2],
) -> [ExprId; 2] {
    let products = [(c, x), (s, y), (s, x), (c, y)].map(|(a, b)| graph.mul(a, b));
    [
        graph.sub(products[0], products[1]),
        graph.add(products[2], products[3]),
    ]
}
