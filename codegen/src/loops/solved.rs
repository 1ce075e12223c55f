//! The solution of a loop, independent of the method that finds it.

use super::relation::AngleRelation;
use crate::expr::{AtomAngleSum, ExprId, Graph};

/// Unknown coordinates of a loop as expressions of known ones.
#[derive(Clone, Debug)]
pub(crate) struct ClosureSolution {
    /// Cosine and sine of sums of angles, each of which contains unknown coordinates.
    pub(crate) angles: Vec<(AtomAngleSum, [ExprId; 2])>,
    /// Angles that are integer combinations of known ones.
    pub(crate) relations: Vec<AngleRelation>,
    /// Values of coordinates: of prismatic ones, and of coupled angles.
    pub(crate) values: Vec<(usize, ExprId)>,
    /// The square root that chooses between the two assembly modes, if there is one.
    pub(crate) root: Option<SignedRoot>,
}

/// A square root whose sign depends on the assembly mode.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SignedRoot {
    /// The argument of the root; it must not be negative for the loop to close.
    pub(crate) radicand: ExprId,
    /// An expression of the coordinates that equals the signed root.
    pub(crate) witness: ExprId,
    /// The root as a function without a root sign, if there is one: the two modes are then two separate motions.
    pub(crate) exact: Option<ExprId>,
}

/// Cosine and sine of `n` times an angle whose cosine and sine are given.
pub(crate) fn multiply_angle(graph: &mut Graph, mut power: [ExprId; 2], n: i64) -> [ExprId; 2] {
    // A negative multiple negates the sine.
    if n < 0 {
        power[1] = graph.neg(power[1]);
    }
    // Repeated squaring: the binary digits of n choose the factors.
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

/// The vector `[x, y]` rotated by the angle with cosine `c` and sine `s`.
pub(crate) fn rotate_vector(graph: &mut Graph, [c, s]: [ExprId; 2], [x, y]: [ExprId; 2]) -> [ExprId; 2] {
    let products = [(c, x), (s, y), (s, x), (c, y)].map(|(a, b)| graph.mul(a, b));
    [graph.sub(products[0], products[1]), graph.add(products[2], products[3])]
}
