//! The backward recursion: wrenches are carried down to the base, and their moment or force is added at each joint.

use super::project::{JointAxisCache, project_on_joints};
use super::rows::{ForceRows, add_wrench, moment_before_axis_offset};
use super::{JointSide, RecursionStyle, SymbolicWrench, rotate_into_outer};
use crate::expr::vector::SymbolicVector;
use crate::expr::{ExprId, Graph, Rational};
use crate::tree::{KinematicTree, TreeLink};

/// A wrench on a link, transformed to the origin and axes of its parent.
pub(super) fn to_parent(
    graph: &mut Graph,
    style: RecursionStyle,
    link: &TreeLink,
    side: JointSide,
    wrench: &SymbolicWrench,
) -> SymbolicWrench {
    let mut moment = moment_before_axis_offset(graph, style, link, wrench);
    let mut force = wrench.force;
    // On the moving side the wrench is in the axes after the joint's rotation.
    if side == JointSide::Moving {
        force = graph.rotate_out(&link.joint, &force);
        moment = graph.rotate_out(&link.joint, &moment);
    }
    let force = rotate_into_outer(graph, &link.pre, &force);
    let turned = rotate_into_outer(graph, &link.pre, &moment);
    // The force also has a moment about the parent's origin.
    let (across, _) = style.split_position(link);
    let lever = graph.cross(&across, &force);
    let moment = graph.add_vectors(&[turned, lever]);
    SymbolicWrench { force, moment }
}

/// Generalised force of every coordinate for the sum of the given wrenches: `n_coordinates` expressions, N or N m.
pub(crate) fn backward_recursion(
    graph: &mut Graph,
    tree: &KinematicTree,
    style: RecursionStyle,
    n_coordinates: usize,
    wrenches: impl IntoIterator<Item = (usize, JointSide, SymbolicWrench)>,
) -> Vec<ExprId> {
    // Sum of the wrenches on each side of each joint.
    let n = tree.links.len();
    let mut total: [Vec<Option<SymbolicWrench>>; 2] = [vec![None; n], vec![None; n]];
    for (link, side, wrench) in wrenches {
        add_wrench(graph, &mut total[side as usize][link], wrench);
    }
    let mut rows = ForceRows::new(n_coordinates);
    // Children come after their parents, so all wrenches of a link are summed before it is left.
    for i in (0..n).rev() {
        let link = &tree.links[i];
        for side in [JointSide::Moving, JointSide::Fixed] {
            let Some(wrench) = total[side as usize][i] else {
                continue;
            };
            // All six components of the wrench act on a free body, which has no joint.
            if let Some(body) = &link.free {
                rows.add_free_body_wrench(graph, body, &wrench);
                continue;
            }
            // A joint takes the components about and along its z axis.
            rows.add_joint_force(link, wrench.moment[2], wrench.force[2]);
            if let Some(parent) = link.parent {
                let wrench = to_parent(graph, style, link, side, &wrench);
                add_wrench(graph, &mut total[JointSide::Moving as usize][parent], wrench);
            }
        }
    }
    rows.sum_rows(graph)
}

/// Depth down to which wrenches are carried from link to link; from there they are projected on all axes above.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct CarryDepths {
    /// For wrenches that are a moment alone.
    pub(crate) moments: usize,
    /// For all other wrenches.
    pub(crate) forces: usize,
}

/// Generalised forces of wrenches that are carried separately, without being summed. `cache` belongs to this tree and
/// style.
pub(crate) fn carry_wrench(
    graph: &mut Graph,
    tree: &KinematicTree,
    style: RecursionStyle,
    cache: &mut JointAxisCache,
    n_coordinates: usize,
    depths: CarryDepths,
    wrenches: impl IntoIterator<Item = (usize, JointSide, SymbolicWrench)>,
) -> Vec<ExprId> {
    let mut rows = ForceRows::new(n_coordinates);
    // Each wrench has its own way down.
    for (start, side, wrench) in wrenches {
        let depth = if wrench.has_force() {
            depths.forces
        } else {
            depths.moments
        };
        let mut at = Some((start, side, wrench));
        while let Some((i, side, wrench)) = at {
            let link = &tree.links[i];
            // A free body at the base takes all six components.
            if let Some(body) = &link.free {
                rows.add_free_body_wrench(graph, body, &wrench);
                break;
            }
            // Joints from the base to this one.
            let path = tree.path_to(Some(i));
            // All of a wrench is needed at a free body at the base, and the joints on the way cost little more.
            let hangs_free = tree.links[path[0]].free.is_some();
            // Near the base a projection on the remaining axes is cheaper than further transformations.
            if side == JointSide::Moving && path.len() <= depth && !hangs_free {
                rows.add_joint_force(link, wrench.moment[2], wrench.force[2]);
                project_on_joints(graph, tree, style, i, &wrench, cache, &mut rows);
                break;
            }
            // Otherwise the wrench is carried to the parent of this joint, or of the first of parallel joints.
            let (first, wrench) = if style.across_parallel_axes {
                cross_parallel_joints(graph, tree, style, i, side, wrench, &mut rows)
            } else {
                rows.add_joint_force(link, wrench.moment[2], wrench.force[2]);
                (i, to_parent(graph, style, link, side, &wrench))
            };
            at = tree.links[first].parent.map(|p| (p, JointSide::Moving, wrench));
        }
    }
    rows.sum_rows(graph)
}

/// Adds the generalised forces of the parallel joints from `start` up to the first. Returns that first link, and the
/// wrench transformed to its parent. A wrench on the fixed side, that of the first joint, must be a moment alone.
fn cross_parallel_joints(
    graph: &mut Graph,
    tree: &KinematicTree,
    style: RecursionStyle,
    start: usize,
    side: JointSide,
    wrench: SymbolicWrench,
    rows: &mut ForceRows,
) -> (usize, SymbolicWrench) {
    let first = style.first_rotated_link(tree, start);
    // Moment about z: from joint to joint, because only one component is needed at each.
    let (mut force, mut about_z) = (wrench.force, wrench.moment[2]);
    let mut arms: Vec<SymbolicVector> = Vec::new();
    let mut i = start;
    let mut here = side;
    loop {
        let joint = &tree.links[i];
        rows.add_joint_force(joint, about_z, wrench.force[2]);
        if i == first {
            break;
        }
        // The force in the axes of the parent.
        if here == JointSide::Moving {
            force = graph.rotate_out(&joint.joint, &force);
        }
        here = JointSide::Moving;
        force = rotate_into_outer(graph, &joint.pre, &force);
        // The moment about z of the force at the parent's origin.
        let [px, py, _] = joint.position;
        let (x, y) = (graph.mul(px, force[1]), graph.mul(py, force[0]));
        about_z = graph.linear_combination([(about_z, Rational::ONE), (x, Rational::ONE), (y, Rational::MINUS_ONE)]);
        let parent = joint.parent.expect("a link below the first parallel one has a parent");
        // Arms from the first joint, in its axes.
        arms.push(graph.rotate_out(&tree.links[parent].absolute, &joint.position));
        i = parent;
    }
    // Moments about x and y: once, for all of these joints.
    let [force, turned] = match side {
        JointSide::Moving => {
            let absolute = &tree.links[start].absolute;
            [wrench.force, wrench.moment].map(|v| graph.rotate_out(absolute, &v))
        }
        JointSide::Fixed => [wrench.force, wrench.moment],
    };
    let arm = graph.add_vectors(&arms);
    let lever = graph.cross(&arm, &force);
    // The third component is the one from the loop.
    let moment = [graph.add(turned[0], lever[0]), graph.add(turned[1], lever[1]), about_z];
    let wrench = SymbolicWrench { force, moment };
    (
        first,
        to_parent(graph, style, &tree.links[first], JointSide::Fixed, &wrench),
    )
}
