//! Loops: the vector equation that closes each of them, written in the frame in which it is simplest.

use modelmill_spec::{FrameIdx, Mechanism};

use crate::DeriveError;
use crate::expr::{AtomAngleSum, ExprId, Graph, coordinates_of};
use crate::loops::coupling::CoupledCoordinate;
use crate::loops::relation::AngleRelation;
use crate::loops::segment::{
    PathSegment, PointPairPath, fixed_rotations, inverse_rotations, local_position, sum_segments,
};
use crate::loops::spatial;
use crate::tree::KinematicTree;

/// A loop cut open at two points that must coincide.
#[derive(Clone, Debug)]
pub(crate) struct LoopClosure {
    /// Name of the loop, or of the coordinate that a coupling determines.
    pub(crate) name: String,
    /// Difference of the two positions in m, in the plane of the loop (2) or in the frame of its root (3). Every entry
    /// is zero where the loop is closed. For a coupling: the coordinate minus its value.
    pub(crate) residual: Vec<ExprId>,
    /// Number of these that are independent of each other and of those of the loops before.
    pub(crate) n_independent: usize,
    /// The same as a chain of vectors that are rotated about one axis, if the loop is planar.
    pub(crate) chain: Option<Vec<PlanarLeg>>,
    /// Equations that are true where the loop closes, each without one or another of its coordinates. Empty if all
    /// loops are planar.
    pub(crate) equations: Vec<ExprId>,
    /// Relations that solve it directly; empty if there are none.
    pub(crate) relations: Vec<AngleRelation>,
    /// The coordinate that is determined by others, if this is a coupling and not a loop.
    pub(crate) follower: Option<CoupledCoordinate>,
    /// Indices of the coordinates on which it depends, in increasing order.
    pub(crate) coordinates: Vec<usize>,
}

impl LoopClosure {
    /// The coordinates that it determines without solving; empty where it has to be solved.
    pub(super) fn explicit_coordinates(&self) -> Vec<usize> {
        match &self.follower {
            Some(follower) => vec![follower.coordinate],
            None => self.relations.iter().map(|r| r.coordinate).collect(),
        }
    }
}

/// A vector of a planar chain, rotated by `angle + pi12 * pi/12`.
#[derive(Clone, Debug)]
pub(crate) struct PlanarLeg {
    /// Variable part of the angle, rad.
    pub(crate) angle: AtomAngleSum,
    /// Constant part of the angle, in multiples of pi/12.
    pub(crate) pi12: i32,
    /// Components before the rotation, m.
    pub(crate) vector: [ExprId; 2],
}

/// The closure of every loop of the mechanism, in the order of the file.
///
/// # Errors
/// A [`DeriveError`] of an expression of the file that cannot be written into the graph.
pub(crate) fn loop_closures(
    graph: &mut Graph,
    mechanism: &Mechanism,
    tree: &KinematicTree,
) -> Result<Vec<LoopClosure>, DeriveError> {
    // The links from the last common frame to each of the two points.
    let paths: Vec<[Vec<usize>; 2]> = mechanism
        .loops
        .iter()
        .map(|l| {
            let [a, b] = l.joins.map(|p| {
                let frame: FrameIdx = mechanism.points[p.0].frame;
                tree.path_to(tree.link_of(frame))
            });
            let common = a.iter().zip(&b).take_while(|(x, y)| x == y).count();
            [a[common..].to_vec(), b[common..].to_vec()]
        })
        .collect();
    let mut all = Vec::new();
    for (l, [pa, pb]) in mechanism.loops.iter().zip(&paths) {
        let [a, b] = l.joins.map(|p| &mechanism.points[p.0]);
        // Fixed rotations before the first revolute joint lead into the plane of the loop, if it has one.
        let into = fixed_rotations(tree, pa)
            .or_else(|| fixed_rotations(tree, pb))
            .unwrap_or_default();
        let between = PointPairPath {
            paths: [pa, pb],
            at: [local_position(graph, a)?, local_position(graph, b)?],
        };
        let path = between.segments(graph, tree, &inverse_rotations(&into));
        all.push((closure_of_path(graph, l.name.clone(), &path), between));
    }
    // Planar loops among spatial ones may have to be solved together with those, which needs their equations.
    let is_spatial = all.iter().any(|(closure, _)| closure.chain.is_none());
    Ok(all
        .into_iter()
        .map(|(mut closure, between)| {
            if is_spatial {
                closure.equations = spatial::equations(graph, tree, &between);
            }
            closure
        })
        .collect())
}

/// The closure of a path whose vectors sum up to zero: its residual, and its planar chain if all vectors are rotated
/// about the z axis only.
fn closure_of_path(graph: &mut Graph, name: String, path: &[PathSegment]) -> LoopClosure {
    let total = sum_segments(graph, path);
    let mut chain = Some(Vec::new());
    for stretch in path {
        // Fixed rotations at the inner end are applied to the vector. A planar loop then has one rotation left, about
        // z.
        let (mut turns, mut vector) = (stretch.turns.as_slice(), stretch.vector);
        while let [rest @ .., last] = turns
            && last.sum.is_empty()
        {
            vector = graph.rotate_out(last, &vector);
            turns = rest;
        }
        // Any other rotation makes the loop spatial.
        let turn = match turns {
            [] => None,
            [turn] if turn.axis == modelmill_spec::FrameAxis::Z => Some(turn),
            _ => {
                chain = None;
                break;
            }
        };
        let (angle, pi12) = turn.map_or((AtomAngleSum::NONE, 0), |t| (t.sum.clone(), t.pi12));
        // A vector along z, or of length zero, adds nothing in the plane.
        if let Some(legs) = &mut chain
            && vector[..2] != [Graph::ZERO; 2]
        {
            legs.push(PlanarLeg {
                angle,
                pi12,
                vector: [vector[0], vector[1]],
            });
        }
    }
    // A loop that leaves its plane is spatial.
    if total[2] != Graph::ZERO {
        chain = None;
    }
    let residual: Vec<ExprId> = total.into_iter().filter(|r| *r != Graph::ZERO).collect();
    let coordinates = coordinates_of(graph, &residual);
    LoopClosure {
        name,
        n_independent: residual.len(),
        residual,
        chain,
        equations: Vec::new(),
        relations: Vec::new(),
        follower: None,
        coordinates,
    }
}
