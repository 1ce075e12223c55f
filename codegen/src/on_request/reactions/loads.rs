//! Loads on the tree besides its bodies: forces at the cuts of loops, along linear drives, and of effects with mechanics.

use std::collections::{BTreeMap, BTreeSet};

use modelmill_spec::{DriveKind, FrameAxis, Mechanism, PointIdx};

use super::force_through_point;
use crate::DeriveError;
use crate::expr::vector::{self, AxisRotation, SymbolicVector, push_rotation};
use crate::expr::{Atom, ExprId, Graph};
use crate::loops::stretch::{
    PointPairPath, fixed_rotations, inverse_rotations, local_position, sum_segments,
};
use crate::newton_euler::{JointLoad, SymbolicWrench, rotate_into_inner};
use crate::regressor::UnreducedEquations;
use crate::regressor::mechanics::point_forces;
use crate::tree::KinematicTree;
use crate::tree::expressions::ParameterMonomial;

/// A loop cut open: the force and the moment that its first side gets from the second, as unknown numbers.
pub(super) struct CutLoop {
    pub(super) name: String,
    /// What closes the loop, along three axes that stand still on the common link.
    pub(super) gap: SymbolicVector,
    /// Unknown force along these axes.
    pub(super) force: [Atom; 3],
    /// Unknown moment about two of them that a pin could transmit; none for loops in space, whose cut is a ball joint.
    pub(super) moment: Option<[Atom; 2]>,
    /// The link with the joint in whose axes the force is shown.
    pub(super) shown_in: usize,
    common: Option<usize>,
    /// Turns from the three axes to each link, and the links' points.
    sides: [CutSide; 2],
    shown: Vec<AxisRotation>,
}

struct CutSide {
    link: Option<usize>,
    turns: Vec<AxisRotation>,
    at: SymbolicVector,
}

/// Paths of two points from the link that carries both, that link, and the points' places in their own frames.
struct CutPaths {
    links: [Vec<usize>; 2],
    common: Option<usize>,
    of_points: [Option<usize>; 2],
    at: [SymbolicVector; 2],
}

fn paths_from_common_link(
    graph: &mut Graph,
    mechanism: &Mechanism,
    tree: &KinematicTree,
    points: [PointIdx; 2],
) -> Result<CutPaths, DeriveError> {
    let points = points.map(|p| &mechanism.points[p.0]);
    let of_points = points.map(|p| tree.link_of(p.frame));
    let [a, b] = of_points.map(|link| tree.path_to(link));
    let shared = a.iter().zip(&b).take_while(|(x, y)| x == y).count();
    Ok(CutPaths {
        common: shared.checked_sub(1).map(|last| a[last]),
        links: [a[shared..].to_vec(), b[shared..].to_vec()],
        of_points,
        at: [
            local_position(graph, points[0])?,
            local_position(graph, points[1])?,
        ],
    })
}

/// Turns along a path of links, behind others.
fn rotations_along(
    tree: &KinematicTree,
    start: &[AxisRotation],
    links: &[usize],
) -> Vec<AxisRotation> {
    let mut turns = Vec::new();
    let of_links = links.iter().map(|i| &tree.links[*i]);
    let along = of_links.flat_map(|link| link.pre.iter().chain([&link.joint]));
    for turn in start.iter().chain(along) {
        push_rotation(&mut turns, turn);
    }
    turns
}

/// Whether turns, but for fixed ones at their inner end, are one about z.
fn is_rotation_about_z(turns: &[AxisRotation]) -> bool {
    let fixed = turns.iter().rev().take_while(|turn| turn.sum.is_empty());
    match &turns[..turns.len() - fixed.count()] {
        [] => true,
        [turn] => turn.axis == FrameAxis::Z,
        _ => false,
    }
}

/// Unknown number `k` of cut `l`. Base parameters have no part in reactions, so that their atoms are free.
fn unknown_atom(l: usize, k: usize) -> Atom {
    Atom::Base(5 * l + k)
}

/// All loops, cut open; `free` are links whose joints transmit nothing.
pub(super) fn cut_loops(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &UnreducedEquations,
    free: &BTreeSet<usize>,
) -> Result<Vec<CutLoop>, DeriveError> {
    let tree = &equations.tree;
    let mut cuts = Vec::new();
    for (l, closed) in mechanism.loops.iter().enumerate() {
        let paths = paths_from_common_link(graph, mechanism, tree, closed.joins)?;
        let [first, second] = &paths.links;
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
        // A loop without a joint closes nothing that could move.
        let Some((shown_in, shown)) = found else {
            continue;
        };
        let side = |k: usize| CutSide {
            link: paths.of_points[k],
            turns: rotations_along(tree, &start, &paths.links[k]),
            at: paths.at[k],
        };
        let sides = [side(0), side(1)];
        // Points stay in one plane, and their frames turn about its normal alone.
        let is_planar =
            gap[2] == Graph::ZERO && sides.iter().all(|s| is_rotation_about_z(&s.turns));
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
    /// What the joints must supply because of the cut.
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
                // The first side is pushed, so that its joints supply less.
                let v = if k == 0 { v.map(|x| graph.neg(x)) } else { v };
                rotate_into_inner(graph, &side.turns, &v)
            });
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

    /// The force on the first side, in the axes in which it is shown.
    pub(super) fn reported_force(&self, graph: &mut Graph, tree: &KinematicTree) -> SymbolicVector {
        let force = self.force.map(|atom| graph.atom(atom));
        let force = rotate_into_inner(graph, &self.shown, &force);
        tree.links[self.shown_in].to_named_axes(graph, &force)
    }
}

/// Values for the unknown numbers: forces along the gaps, and nothing where there is no equation. A gap that two loops
/// share is closed by the first of them; how they share its force is not determined.
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

/// Forces of linear drives, which push their points apart.
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
        let along = sum_segments(graph, &path);
        let length = equations.projection.drives[d].coordinate;
        let per_length = graph.pow(length, -1);
        let scale = graph.mul(forces[d], per_length);
        let force = graph.scale_vector(scale, &along);
        for k in 0..2 {
            let Some(link) = paths.of_points[k].filter(|link| Some(*link) != paths.common) else {
                continue;
            };
            let supplied = if k == 0 {
                force.map(|x| graph.neg(x))
            } else {
                force
            };
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

/// What effects with mechanics of their own need at points.
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
        let values: Vec<ExprId> = effect
            .terms
            .iter()
            .map(|term| value(&ParameterMonomial(vec![(term.parameter.0, 1)])))
            .collect();
        let forces = point_forces(graph, mechanism, tree, projection, gravity, effect, &values)?;
        for (point, force) in forces {
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
