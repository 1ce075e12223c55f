//! The backward recursion: wrenches go down to the base, and leave their moment or force at each joint.

use super::project::project;
use super::rows::{ForceRows, back_along_axis, join};
use super::{Side, Style, Wrench, turn_out_all};
use crate::expr::vector::Vector;
use crate::expr::{ExprId, Graph, Rational};
use crate::tree::{Link, Tree};

/// A wrench on a link, taken to its parent.
pub(super) fn to_parent(
    graph: &mut Graph,
    style: Style,
    link: &Link,
    side: Side,
    wrench: &Wrench,
) -> Wrench {
    let mut moment = back_along_axis(graph, style, link, wrench);
    let mut force = wrench.force;
    if side == Side::Moving {
        force = graph.turn_out(&link.joint, &force);
        moment = graph.turn_out(&link.joint, &moment);
    }
    let force = turn_out_all(graph, &link.pre, &force);
    let turned = turn_out_all(graph, &link.pre, &moment);
    let (across, _) = style.split_position(link);
    let lever = graph.cross(&across, &force);
    let moment = graph.add_vectors(&[turned, lever]);
    Wrench { force, moment }
}

/// Generalised force of every coordinate for the sum of the given wrenches, `n_coordinates` expressions.
pub(crate) fn backward(
    graph: &mut Graph,
    tree: &Tree,
    style: Style,
    n_coordinates: usize,
    wrenches: impl IntoIterator<Item = (usize, Side, Wrench)>,
) -> Vec<ExprId> {
    let n = tree.links.len();
    let mut total: [Vec<Option<Wrench>>; 2] = [vec![None; n], vec![None; n]];
    for (link, side, wrench) in wrenches {
        join(graph, &mut total[side as usize][link], wrench);
    }
    let mut rows = ForceRows::new(n_coordinates);
    for i in (0..n).rev() {
        let link = &tree.links[i];
        for side in [Side::Moving, Side::Fixed] {
            let Some(wrench) = total[side as usize][i] else {
                continue;
            };
            if let Some(body) = &link.free {
                rows.leave_free(graph, body, &wrench);
                continue;
            }
            rows.leave(link, wrench.moment[2], wrench.force[2]);
            if let Some(parent) = link.parent {
                let wrench = to_parent(graph, style, link, side, &wrench);
                join(graph, &mut total[Side::Moving as usize][parent], wrench);
            }
        }
    }
    rows.sums(graph)
}

/// Up to which depth wrenches are carried from link to link; from there they are projected on all axes above.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Depths {
    /// Of wrenches that are a moment alone.
    pub(crate) moments: usize,
    /// Of all others.
    pub(crate) forces: usize,
}

/// Generalised forces of one wrench by itself.
pub(crate) fn carry(
    graph: &mut Graph,
    tree: &Tree,
    style: Style,
    n_coordinates: usize,
    depths: Depths,
    wrenches: impl IntoIterator<Item = (usize, Side, Wrench)>,
) -> Vec<ExprId> {
    let mut rows = ForceRows::new(n_coordinates);
    for (start, side, wrench) in wrenches {
        let depth = if wrench.has_force() {
            depths.forces
        } else {
            depths.moments
        };
        let mut at = Some((start, side, wrench));
        while let Some((i, side, wrench)) = at {
            let link = &tree.links[i];
            if let Some(body) = &link.free {
                rows.leave_free(graph, body, &wrench);
                break;
            }
            let path = tree.path(Some(i));
            // All of a wrench goes down to a free body, and what it leaves on the way costs little.
            let hangs_free = tree.links[path[0]].free.is_some();
            if side == Side::Moving && path.len() <= depth && !hangs_free {
                rows.leave(link, wrench.moment[2], wrench.force[2]);
                project(graph, tree, style, i, &wrench, &mut rows);
                break;
            }
            let (first, wrench) = if style.across_parallel_axes {
                across(graph, tree, style, i, side, wrench, &mut rows)
            } else {
                rows.leave(link, wrench.moment[2], wrench.force[2]);
                (i, to_parent(graph, style, link, side, &wrench))
            };
            at = tree.links[first].parent.map(|p| (p, Side::Moving, wrench));
        }
    }
    rows.sums(graph)
}

/// Leaves the generalised forces of the parallel joints from `start` up to the first; returns that first link with the
/// wrench taken to its parent. What stands on the fixed side, that of the first joint, is a moment alone.
fn across(
    graph: &mut Graph,
    tree: &Tree,
    style: Style,
    start: usize,
    side: Side,
    wrench: Wrench,
    rows: &mut ForceRows,
) -> (usize, Wrench) {
    let first = style.first(tree, start);
    // About z: from joint to joint, since only one component of the force is needed there.
    let (mut force, mut about_z) = (wrench.force, wrench.moment[2]);
    let mut arms: Vec<Vector> = Vec::new();
    let mut i = start;
    let mut here = side;
    loop {
        let joint = &tree.links[i];
        rows.leave(joint, about_z, wrench.force[2]);
        if i == first {
            break;
        }
        if here == Side::Moving {
            force = graph.turn_out(&joint.joint, &force);
        }
        here = Side::Moving;
        force = turn_out_all(graph, &joint.pre, &force);
        let [px, py, _] = joint.position;
        let (x, y) = (graph.mul(px, force[1]), graph.mul(py, force[0]));
        about_z = graph.combine([
            (about_z, Rational::ONE),
            (x, Rational::ONE),
            (y, Rational::MINUS_ONE),
        ]);
        let parent = joint
            .parent
            .expect("a link below the first parallel one has a parent");
        arms.push(graph.turn_out(&tree.links[parent].absolute, &joint.position));
        i = parent;
    }
    // About x and y: at once.
    let [force, turned] = match side {
        Side::Moving => {
            let absolute = &tree.links[start].absolute;
            [wrench.force, wrench.moment].map(|v| graph.turn_out(absolute, &v))
        }
        Side::Fixed => [wrench.force, wrench.moment],
    };
    let arm = graph.add_vectors(&arms);
    let lever = graph.cross(&arm, &force);
    let moment = [
        graph.add(turned[0], lever[0]),
        graph.add(turned[1], lever[1]),
        about_z,
    ];
    let wrench = Wrench { force, moment };
    (
        first,
        to_parent(graph, style, &tree.links[first], Side::Fixed, &wrench),
    )
}
