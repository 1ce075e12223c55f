//! Loads on the tree other than its bodies: forces at the cuts of loops, along linear drives, and of effects with
//! mechanics.

use std::collections::{BTreeMap, BTreeSet};

use modelmill_spec::{DriveKind, FrameAxis, Mechanism, PointIdx};

use super::force_through_point;
use crate::DeriveError;
use crate::expr::vector::{self, AxisRotation, SymbolicVector, push_rotation};
use crate::expr::{Atom, ExprId, Graph};
use crate::loops::segment::{PointPairPath, fixed_rotations, inverse_rotations, local_position, sum_segments};
use crate::newton_euler::{JointLoad, SymbolicWrench, rotate_into_inner};
use crate::regressor::UnreducedEquations;
use crate::regressor::mechanics::point_forces;
use crate::tree::KinematicTree;
use crate::tree::expressions::ParameterMonomial;

/// A loop cut open: force and moment from its second side on its first side are unknowns.
pub(super) struct CutLoop {
    /// Name of the loop.
    pub(super) name: String,
    /// Gap of the loop, in m, along three axes that are fixed on the common link.
    pub(super) gap: SymbolicVector,
    /// Unknown force along these axes, N.
    pub(super) force: [Atom; 3],
    /// Unknown moment about two of the axes that a pin could transmit, N m; none for spatial loops, which are cut at a
    /// ball joint.
    pub(super) moment: Option<[Atom; 2]>,
    /// Index of the link in the axes of whose joint the force is reported.
    pub(super) shown_in: usize,
    /// The last link that both sides have in common; none if that is the base.
    common: Option<usize>,
    /// Rotations from the three axes to the link of each side, and the position of its point.
    sides: [CutSide; 2],
    /// Rotations from the three axes to those in which the force is reported.
    shown: Vec<AxisRotation>,
}

/// One side of a cut.
struct CutSide {
    /// The link with the point; none if the point is on the base.
    link: Option<usize>,
    /// Rotations from the axes of the cut to this link.
    turns: Vec<AxisRotation>,
    /// Position of the point in the frame of the link, m.
    at: SymbolicVector,
}

/// Paths to two points from their last common link.
struct CutPaths {
    /// Links of each path, outwards.
    links: [Vec<usize>; 2],
    /// The common link; none if it is the base.
    common: Option<usize>,
    /// The link with each point; none if it is on the base.
    of_points: [Option<usize>; 2],
    /// Position of each point in the frame of its link, m.
    at: [SymbolicVector; 2],
}

/// The paths to two points; errors are those of the points' coordinates.
fn paths_from_common_link(
    graph: &mut Graph,
    mechanism: &Mechanism,
    tree: &KinematicTree,
    points: [PointIdx; 2],
) -> Result<CutPaths, DeriveError> {
    let points = points.map(|p| &mechanism.points[p.0]);
    let of_points = points.map(|p| tree.link_of(p.frame));
    let [a, b] = of_points.map(|link| tree.path_to(link));
    // Links that both paths have in common.
    let shared = a.iter().zip(&b).take_while(|(x, y)| x == y).count();
    Ok(CutPaths {
        common: shared.checked_sub(1).map(|last| a[last]),
        links: [a[shared..].to_vec(), b[shared..].to_vec()],
        of_points,
        at: [local_position(graph, points[0])?, local_position(graph, points[1])?],
    })
}

/// Rotations along a path of links after the rotations of `start`.
fn rotations_along(tree: &KinematicTree, start: &[AxisRotation], links: &[usize]) -> Vec<AxisRotation> {
    let mut turns = Vec::new();
    let of_links = links.iter().map(|i| &tree.links[*i]);
    let along = of_links.flat_map(|link| link.pre.iter().chain([&link.joint]));
    for turn in start.iter().chain(along) {
        push_rotation(&mut turns, turn);
    }
    turns
}

/// Whether rotations, apart from constant ones at their inner end, are a single one about z.
fn is_rotation_about_z(turns: &[AxisRotation]) -> bool {
    let fixed = turns.iter().rev().take_while(|turn| turn.sum.is_empty());
    match &turns[..turns.len() - fixed.count()] {
        [] => true,
        [turn] => turn.axis == FrameAxis::Z,
        _ => false,
    }
}

/// Unknown `k` of cut `l`. Reactions have no base parameters, so the atoms of these serve as unknowns.
fn unknown_atom(l: usize, k: usize) -> Atom {
    Atom::Base(5 * l + k)
}

/// All loops, cut open. `free` are links of floating bodies, whose joints transmit nothing.
pub(super) fn cut_loops(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &UnreducedEquations,
    free: &BTreeSet<usize>,
) -> Result<Vec<CutLoop>, DeriveError> {
    let tree = &equations.tree;
    let mut cuts = Vec::new();
    for (l, closed) in mechanism.loops.iter().enumerate() {
        // Both sides of the loop, from the last common link.
        let paths = paths_from_common_link(graph, mechanism, tree, closed.joins)?;
        let [first, second] = &paths.links;
        // The axes of the cut are those after the first constant rotations of a path, in which planar loops have no gap
        // along z.
        let into = fixed_rotations(tree, first)
            .or_else(|| fixed_rotations(tree, second))
            .unwrap_or_default();
        let start = inverse_rotations(&into);
        let between = PointPairPath {
            paths: [first, second],
            at: paths.at,
        };
        let path = between.segments(graph, tree, &start);
        let gap = sum_segments(graph, &path);
        // The force is reported in the axes of the last joint of the first path that transmits something.
        let told = |i: usize| tree.links[i].is_moving() && !free.contains(&i);
        let moving = |i: usize| tree.links[i].is_moving();
        let last_joint = |links: &[usize], of: &dyn Fn(usize) -> bool| {
            let upto = links.iter().rposition(|i| of(*i))?;
            Some((links[upto], rotations_along(tree, &start, &links[..=upto])))
        };
        let found = last_joint(first, &told)
            .or_else(|| last_joint(second, &told))
            .or_else(|| last_joint(first, &moving))
            .or_else(|| last_joint(second, &moving));
        // A loop without a moving joint transmits nothing that depends on the motion.
        let Some((shown_in, shown)) = found else {
            continue;
        };
        let side = |k: usize| CutSide {
            link: paths.of_points[k],
            turns: rotations_along(tree, &start, &paths.links[k]),
            at: paths.at[k],
        };
        // Both ends of the cut.
        let sides = [side(0), side(1)];
        // Planar: points stay in a plane, and their frames rotate about its normal only.
        let is_planar = gap[2] == Graph::ZERO && sides.iter().all(|s| is_rotation_about_z(&s.turns));
        cuts.push(CutLoop {
            name: closed.name.clone(),
            gap,
            force: [0, 1, 2].map(|k| unknown_atom(l, k)),
            moment: is_planar.then(|| [3, 4].map(|k| unknown_atom(l, k))),
            shown_in,
            common: paths.common,
            sides,
            shown,
        });
    }
    Ok(cuts)
}

impl CutLoop {
    /// Loads on the joints because of the cut: force and moment act on both sides with opposite signs.
    pub(super) fn joint_loads(&self, graph: &mut Graph, tree: &KinematicTree) -> Vec<JointLoad> {
        debug_assert!(self.common.is_none_or(|c| c < tree.links.len()));
        let force = self.force.map(|atom| graph.atom(atom));
        let moment = match self.moment {
            Some([x, y]) => [graph.atom(x), graph.atom(y), Graph::ZERO],
            None => vector::ZERO,
        };
        let mut loads = Vec::new();
        for (k, side) in self.sides.iter().enumerate() {
            let Some(link) = side.link.filter(|link| Some(*link) != self.common) else {
                continue;
            };
            let [force, moment] = [force, moment].map(|v| {
                // The force pushes the first side, so its joints have to supply less.
                let v = if k == 0 { v.map(|x| graph.neg(x)) } else { v };
                rotate_into_inner(graph, &side.turns, &v)
            });
            // The force acts at the point, the moment is added.
            let wrench = force_through_point(graph, &side.at, force);
            let moment = graph.add_vectors(&[wrench.moment, moment]);
            loads.push(JointLoad {
                link,
                wrench: SymbolicWrench { force, moment },
                until: self.common,
            });
        }
        loads
    }

    /// The force on the first side, in the axes in which it is reported.
    pub(super) fn reported_force(&self, graph: &mut Graph, tree: &KinematicTree) -> SymbolicVector {
        let force = self.force.map(|atom| graph.atom(atom));
        let force = rotate_into_inner(graph, &self.shown, &force);
        tree.links[self.shown_in].to_named_axes(graph, &force)
    }
}

/// Values of the unknowns: forces along the gaps, and zero where there is no equation. If two loops have the same gap,
/// the first one gets its force; how they share it is not determined.
pub(super) fn known_values(
    graph: &mut Graph,
    cuts: &[CutLoop],
    of_gap: &BTreeMap<ExprId, ExprId>,
) -> BTreeMap<ExprId, ExprId> {
    let mut left = of_gap.clone();
    let mut known = BTreeMap::new();
    for cut in cuts {
        for (gap, atom) in cut.gap.iter().zip(cut.force) {
            let value = left.remove(gap).unwrap_or(Graph::ZERO);
            known.insert(graph.atom(atom), value);
        }
        for atom in cut.moment.into_iter().flatten() {
            known.insert(graph.atom(atom), Graph::ZERO);
        }
    }
    known
}

/// Loads of linear drives, whose force pushes their two points apart.
pub(super) fn drive_loads(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &UnreducedEquations,
    forces: &[ExprId],
) -> Result<Vec<JointLoad>, DeriveError> {
    let tree = &equations.tree;
    let mut loads = Vec::new();
    for (d, drive) in mechanism.drives.iter().enumerate() {
        let DriveKind::Linear { from, to } = drive.kind else {
            continue;
        };
        let paths = paths_from_common_link(graph, mechanism, tree, [to, from])?;
        let between = PointPairPath {
            paths: [&paths.links[0], &paths.links[1]],
            at: paths.at,
        };
        let path = between.segments(graph, tree, &[]);
        // The force as a vector: magnitude times the unit vector between the points.
        let along = sum_segments(graph, &path);
        let length = equations.projection.drives[d].coordinate;
        let per_length = graph.pow(length, -1);
        let scale = graph.mul(forces[d], per_length);
        let force = graph.scale_vector(scale, &along);
        for k in 0..2 {
            let Some(link) = paths.of_points[k].filter(|link| Some(*link) != paths.common) else {
                continue;
            };
            let supplied = if k == 0 { force.map(|x| graph.neg(x)) } else { force };
            let turns = rotations_along(tree, &[], &paths.links[k]);
            let supplied = rotate_into_inner(graph, &turns, &supplied);
            loads.push(JointLoad {
                link,
                wrench: force_through_point(graph, &paths.at[k], supplied),
                until: paths.common,
            });
        }
    }
    Ok(loads)
}

/// Loads of effects with mechanics of their own, at the points where they act.
pub(super) fn effect_loads(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &UnreducedEquations,
    value: &dyn Fn(&ParameterMonomial) -> ExprId,
) -> Result<Vec<JointLoad>, DeriveError> {
    let (tree, gravity) = (&equations.tree, &equations.gravity);
    let projection = &equations.projection;
    let mut loads = Vec::new();
    for effect in &mechanism.effects {
        // Values of the effect's parameters.
        let values: Vec<ExprId> = effect
            .terms
            .iter()
            .map(|term| value(&ParameterMonomial(vec![(term.parameter.0, 1)])))
            .collect();
        let forces = point_forces(graph, mechanism, tree, projection, gravity, effect, &values)?;
        for (point, force) in forces {
            // A force on the base loads no joint.
            let point = &mechanism.points[point.0];
            let Some(link) = tree.link_of(point.frame) else {
                continue;
            };
            let turns = rotations_along(tree, &[], &tree.path_to(Some(link)));
            let force = rotate_into_inner(graph, &turns, &force);
            let at = local_position(graph, point)?;
            loads.push(JointLoad {
                link,
                wrench: force_through_point(graph, &at, force),
                until: None,
            });
        }
    }
    Ok(loads)
}
