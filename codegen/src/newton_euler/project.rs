//! Forces of all joints above a link, computed in the link's own frame: `z_i . (M + (o - c_i) x F)` with the axis of
//! joint i and a point on it (virtual power). Axes through one point share the moment about it. Axes and points are
//! shared by all wrenches that are projected in the same frame.

use rustc_hash::FxHashMap;

use super::rows::{ForceRows, moment_before_axis_offset};
use super::{RecursionStyle, SymbolicWrench, rotate_into_inner};
use crate::expr::vector::{self, SymbolicVector};
use crate::expr::{ExprId, Graph};
use crate::tree::KinematicTree;

/// Axes and lever arms that were written for one tree and one style. Without it, each of them would be written anew
/// from link to link for every wrench: work that grows with the third power of a tree's depth.
#[derive(Clone, Debug, Default)]
pub(crate) struct JointAxisCache {
    /// Direction of the axis of a joint in the frame of a link: by joint and link.
    directions: FxHashMap<(usize, usize), SymbolicVector>,
    /// The vectors of [`lever_arm`] before the last offset and rotation: by joint, place on its axis, and link.
    arms: FxHashMap<(usize, ExprId, usize), SymbolicVector>,
}

/// Adds the forces of a wrench on link `at` to all joints above it. `cache` belongs to this tree and style.
pub(super) fn project_on_joints(
    graph: &mut Graph,
    tree: &KinematicTree,
    style: RecursionStyle,
    at: usize,
    wrench: &SymbolicWrench,
    cache: &mut JointAxisCache,
    rows: &mut ForceRows,
) {
    let path = tree.path_to(Some(at));
    let Some((_, above)) = path.split_last() else {
        return;
    };
    // The moment about the point before the offset along the axis, for which axes and arms are computed.
    let moment = moment_before_axis_offset(graph, style, &tree.links[at], wrench);
    let points = axis_points(graph, tree, &path);
    // From the nearest axes to the base, in groups of axes that meet in one point.
    let mut rest = above;
    while let Some(last) = rest.last() {
        // Joints whose axes share the point of the nearest one.
        let n = rest
            .iter()
            .rev()
            .take_while(|i| points[**i].group == points[*last].group)
            .count();
        let (further, group) = rest.split_at(rest.len() - n);
        rest = further;
        // A pure moment needs no point.
        let arm = if wrench.has_force() {
            lever_arm(graph, tree, style, cache, *last, points[*last].along, &path)
        } else {
            vector::ZERO
        };
        // Axes in the frame of the link.
        let axes: Vec<SymbolicVector> = group
            .iter()
            .map(|i| axis_direction(graph, tree, style, cache, *i, at))
            .collect();
        // Several axes share the moment about their common point. A single axis needs only one component of it.
        let shared = (group.len() > 1).then(|| {
            let lever = graph.cross(&arm, &wrench.force);
            graph.add_vectors(&[moment, lever])
        });
        for (i, axis) in group.iter().zip(&axes) {
            let link = &tree.links[*i];
            let about = match shared {
                Some(moment) => graph.dot(axis, &moment),
                None => {
                    // Virtual power: velocity of the point of action and angular velocity for a unit rate of the joint.
                    let speed = graph.cross(axis, &arm);
                    let turned = graph.dot(axis, &moment);
                    let moved = graph.dot(&speed, &wrench.force);
                    graph.add(turned, moved)
                }
            };
            // The force along the axis, for joints that translate.
            let along = if link.slides.is_empty() {
                Graph::ZERO
            } else {
                graph.dot(axis, &wrench.force)
            };
            rows.add_joint_force(link, about, along);
        }
    }
}

/// A point on a joint's axis, through which other axes may pass.
#[derive(Clone, Copy)]
struct AxisPoint {
    /// Axes with the same number go through the same point.
    group: usize,
    /// Its position along the axis, from the link's origin, m.
    along: ExprId,
}

/// A point for every joint on a path, by link. Neighbouring axes that meet share a point.
fn axis_points(graph: &mut Graph, tree: &KinematicTree, path: &[usize]) -> Vec<AxisPoint> {
    // Each axis begins with a point of its own, the origin of its link.
    let mut points = vec![
        AxisPoint {
            group: 0,
            along: Graph::ZERO
        };
        tree.links.len()
    ];
    // Whether the point of the group may still be moved along its only axis: a second axis fixes it.
    let mut is_free = true;
    for (k, i) in path.iter().enumerate() {
        points[*i].group = k;
        let link = &tree.links[*i];
        let above = k.checked_sub(1).map(|k| path[k]);
        let meets = above.and_then(|above| {
            let (axis, positive) = link.axis?;
            // The axes meet if the position between them lies in the plane of both, and at the point of the group.
            // The position without its component along the joint's axis.
            let mut left = link.position;
            let own = std::mem::replace(&mut left[axis], Graph::ZERO);
            let [x, y, z] = left;
            let fits = is_free || points[above].along == z;
            // A point must stay on both axes, but a prismatic joint would move it.
            let slides = !link.slides.is_empty() || !tree.links[above].slides.is_empty();
            let meets = axis != 2 && x == Graph::ZERO && y == Graph::ZERO && fits && !slides;
            meets.then(|| (above, z, if positive { graph.neg(own) } else { own }))
        });
        match meets {
            Some((above, at, along)) => {
                points[above].along = at;
                points[*i] = AxisPoint {
                    group: points[above].group,
                    along,
                };
                is_free = false;
            }
            None => is_free = true,
        }
    }
    points
}

/// Direction of a joint's axis in the frame of a link below it, as a unit vector.
fn axis_direction(
    graph: &mut Graph,
    tree: &KinematicTree,
    style: RecursionStyle,
    cache: &mut JointAxisCache,
    joint: usize,
    at: usize,
) -> SymbolicVector {
    let z = [Graph::ZERO, Graph::ZERO, Graph::ONE];
    if joint == at {
        return z;
    }
    let first = style.first_rotated_link(tree, at);
    // Parallel axes are the same in the frames of all of them.
    if style.first_rotated_link(tree, joint) == first {
        return z;
    }
    let Some(parent) = tree.links[first].parent else {
        return z;
    };
    if let Some(written) = cache.directions.get(&(joint, at)) {
        return *written;
    }
    // The direction in the parent's frame, rotated to this link.
    let above = axis_direction(graph, tree, style, cache, joint, parent);
    let fixed = rotate_into_inner(graph, &tree.links[first].pre, &above);
    let direction = graph.rotate_in(style.joint_rotation(&tree.links[at]), &fixed);
    cache.directions.insert((joint, at), direction);
    direction
}

/// Vector from a point on the axis of `joint`, given by its position along it, to the point of the last link of `path`
/// that is reached before the offset along that link's own axis. In that link's frame, m.
fn lever_arm(
    graph: &mut Graph,
    tree: &KinematicTree,
    style: RecursionStyle,
    cache: &mut JointAxisCache,
    joint: usize,
    along: ExprId,
    path: &[usize],
) -> SymbolicVector {
    let start = path.iter().position(|i| *i == joint).unwrap_or(0);
    // The nearest link to the end of the path up to which the vector is known.
    let known = (start + 1..path.len())
        .rev()
        .find_map(|k| Some((k, *cache.arms.get(&(joint, along, path[k]))?)));
    // On the fixed side of the first of parallel joints; the rotation is applied only where these end.
    let (known, mut v) = known.unwrap_or((start, [Graph::ZERO, Graph::ZERO, graph.neg(along)]));
    for k in known + 1..path.len() {
        let (above, i) = (path[k - 1], path[k]);
        // The offset along the axis of the link above; that of the last link is not included.
        if k > start + 1 {
            let (_, own) = style.split_position(&tree.links[above]);
            v[2] = graph.add(v[2], own);
        }
        let link = &tree.links[i];
        let (across, _) = style.split_position(link);
        let turn = style.joint_rotation(&tree.links[above]).clone();
        // At the end of parallel joints the vector is rotated and the position added in the parent's frame.
        if style.first_rotated_link(tree, i) == i {
            v = graph.rotate_in(&turn, &v);
            v = graph.add_vectors(&[v, across]);
            v = rotate_into_inner(graph, &link.pre, &v);
        // Between parallel joints only the position is rotated.
        } else {
            let across = graph.rotate_out(&turn, &across);
            v = graph.add_vectors(&[v, across]);
        }
        cache.arms.insert((joint, along, i), v);
    }
    let last = path.last().copied().unwrap_or(joint);
    graph.rotate_in(style.joint_rotation(&tree.links[last]), &v)
}
