//! Paths along the tree as sums of vectors, each given in a frame that is reached by a chain of rotations.

use modelmill_spec::{FramePoint, Mechanism};

use crate::DeriveError;
use crate::expr::vector::{self, AxisRotation, SymbolicVector, push_rotation};
use crate::expr::{AtomAngleSum, ExprId, Graph};
use crate::tree::KinematicTree;
use crate::tree::expressions;

/// A part of a path: a vector given in a frame that is reached by the rotations `turns`.
#[derive(Clone)]
pub(crate) struct PathSegment {
    /// Rotations from the frame of the sum to that of the vector, outermost first.
    pub(crate) turns: Vec<AxisRotation>,
    /// Components in that frame, m.
    pub(crate) vector: SymbolicVector,
}

/// Position of a point in a frame further up the tree, as segments. `links` leads to the point, and `at` is its
/// position in the last link; the rotations `start` come before all others.
pub(crate) fn path_segments(
    tree: &KinematicTree,
    links: &[usize],
    start: &[AxisRotation],
    at: &SymbolicVector,
) -> Vec<PathSegment> {
    let mut turns = start.to_vec();
    let mut path = Vec::new();
    // Each link adds its origin in the frame of its parent, then its own rotations.
    for &i in links {
        let link = &tree.links[i];
        path.push(PathSegment {
            turns: turns.clone(),
            vector: link.position,
        });
        for turn in link.pre.iter().chain([&link.joint]) {
            push_rotation(&mut turns, turn);
        }
    }
    path.push(PathSegment { turns, vector: *at });
    // Zero vectors contribute nothing.
    path.retain(|segment| segment.vector != vector::ZERO);
    path
}

/// The fixed rotations from the root of a path to the axis of its first revolute joint; `None` if it has none.
pub(crate) fn fixed_rotations(tree: &KinematicTree, links: &[usize]) -> Option<Vec<AxisRotation>> {
    let mut turns = Vec::new();
    for &i in links {
        let link = &tree.links[i];
        // Rotations before a joint are fixed, and so is that of a joint that is not revolute.
        for turn in &link.pre {
            push_rotation(&mut turns, turn);
        }
        if !link.turns.is_empty() {
            return Some(turns);
        }
        push_rotation(&mut turns, &link.joint);
    }
    None
}

/// The sum of the vectors of a path, each rotated into the common frame, m.
pub(crate) fn sum_segments(graph: &mut Graph, path: &[PathSegment]) -> SymbolicVector {
    let vectors: Vec<SymbolicVector> = path
        .iter()
        .map(|segment| {
            let mut v = segment.vector;
            for turn in segment.turns.iter().rev() {
                v = graph.rotate_out(turn, &v);
            }
            v
        })
        .collect();
    graph.add_vectors(&vectors)
}

/// Position of a point in its own frame, as expressions, m.
pub(crate) fn local_position(graph: &mut Graph, point: &FramePoint) -> Result<SymbolicVector, DeriveError> {
    Ok([
        expressions::expression(graph, &point.at[0])?,
        expressions::expression(graph, &point.at[1])?,
        expressions::expression(graph, &point.at[2])?,
    ])
}

/// Position of a point in the base frame, m.
pub(crate) fn position_in_base(
    graph: &mut Graph,
    mechanism: &Mechanism,
    tree: &KinematicTree,
    point: usize,
) -> Result<SymbolicVector, DeriveError> {
    let point = &mechanism.points[point];
    let at = local_position(graph, point)?;
    let path = path_segments(tree, &tree.path_to(tree.link_of(point.frame)), &[], &at);
    Ok(sum_segments(graph, &path))
}

/// The paths to two points from their last common frame, and the points' positions in their own frames.
pub(crate) struct PointPairPath<'a> {
    /// Links from the common frame to each point.
    pub(crate) paths: [&'a [usize]; 2],
    /// Position of each point in its last link, m.
    pub(crate) at: [SymbolicVector; 2],
}

impl PointPairPath<'_> {
    /// Rotations from the common frame to each frame along the paths: none for the common frame itself, then those
    /// after each rotation on the way to either point.
    pub(crate) fn frames(&self, tree: &KinematicTree) -> Vec<Vec<AxisRotation>> {
        let mut frames = vec![Vec::new()];
        for path in self.paths {
            let mut turns = Vec::new();
            for &i in path {
                let link = &tree.links[i];
                for turn in link.pre.iter().chain([&link.joint]) {
                    push_rotation(&mut turns, turn);
                    frames.push(turns.clone());
                }
            }
        }
        frames
    }

    /// The vector from the second point to the first as segments, in the common frame rotated by `start`.
    pub(crate) fn segments(&self, graph: &mut Graph, tree: &KinematicTree, start: &[AxisRotation]) -> Vec<PathSegment> {
        // Both paths start in the common frame.
        let [first, second] = [0, 1].map(|i| path_segments(tree, self.paths[i], start, &self.at[i]));
        let mut path = first;
        // The second path is subtracted.
        for mut segment in second {
            segment.vector = segment.vector.map(|x| graph.neg(x));
            path.push(segment);
        }
        path
    }
}

/// The inverse of a product of rotations: each one by the negative angle, in reverse order.
pub(crate) fn inverse_rotations(turns: &[AxisRotation]) -> Vec<AxisRotation> {
    turns
        .iter()
        .rev()
        .map(|t| AxisRotation {
            axis: t.axis,
            sum: AtomAngleSum::NONE.plus(&t.sum, -1),
            pi12: -t.pi12,
        })
        .collect()
}

/// The square of the distance of two points, m^2, written in the frame between them in which it has the fewest nodes:
/// along a prismatic joint it is the square of one length.
pub(crate) fn distance_squared(
    graph: &mut Graph,
    mechanism: &Mechanism,
    tree: &KinematicTree,
    points: [usize; 2],
) -> Result<ExprId, DeriveError> {
    let points = points.map(|i| &mechanism.points[i]);
    let at = [local_position(graph, points[0])?, local_position(graph, points[1])?];
    // The part of the tree that both points share has no effect on the distance.
    let paths = points.map(|p| tree.path_to(tree.link_of(p.frame)));
    let common = (paths[0].iter().zip(&paths[1])).take_while(|(x, y)| x == y).count();
    let between = PointPairPath {
        paths: [&paths[0][common..], &paths[1][common..]],
        at,
    };
    // The frame whose expression has the fewest nodes is kept.
    let mut best: Option<(usize, ExprId)> = None;
    let mut try_frame = |graph: &mut Graph, turns: &[AxisRotation]| {
        // The vector between the points, in the frame that `turns` leads to.
        let path = between.segments(graph, tree, &inverse_rotations(turns));
        let along = sum_segments(graph, &path);
        let square = graph.dot(&along, &along);
        let size = graph.nodes_of(&[square]).count();
        if best.is_none_or(|(least, _)| size < least) {
            best = Some((size, square));
        }
    };
    for turns in between.frames(tree) {
        try_frame(graph, &turns);
    }
    let (_, square) = best.expect("the common frame was tried");
    Ok(square)
}
