//! Reactions: forces and moments in the joints of the tree and at the points where loops are closed.
//!
//! Newton and Euler's equations of the tree (Luh, Walker and Paul 1980) with the forces of the loops as additional
//! loads. The equations of the passive coordinates determine these forces: `J' lambda = tau - (d l / d q)' f`, with the
//! Jacobian J of the closure equations and the forces f of the drives. In an overconstrained mechanism, such as a
//! planar one in space, the equations of motion determine only some components (`determined`); the others are left out.
//!
//! Reactions depend on all inertial parameters. Bearings carry loads of parameters that have no effect on the drives,
//! and base parameters do not contain those.
//!
//! Decision: a pair of forces ends at the link that is common to both sides, so that nothing cancels by rounding.
//! Reactions are derived on request, like the equation of motion.

mod determined;
mod loads;

use std::collections::{BTreeMap, BTreeSet};

use modelmill_spec::{EffectPlace, FrameAxis, Mechanism};
use nalgebra::DMatrix;

use crate::expr::vector::SymbolicVector;
use crate::expr::{Atom, ExprId, Graph, nominal_value};
use crate::loops::independent::best_conditioned_rows;
use crate::lower::StraightLineProgram;
use crate::newton_euler::{self, JointLoad, RecursionStyle, SymbolicWrench, joint_wrenches};
use crate::programs::closing::PassiveClosure;
use crate::reduce::base;
use crate::regressor::UnreducedEquations;
use crate::tree::KinematicTree;
use crate::tree::expressions::ParameterMonomial;
use crate::{Derivation, DeriveError};

use loads::CutLoop;

/// Reactions of a mechanism: where they act, and the program that computes the components that are determined.
#[derive(Clone, Debug)]
pub struct ReactionPrograms {
    /// Joints of the tree, from the base outwards.
    pub joints: Vec<JointReaction>,
    /// Closed loops, in the order of the model file.
    pub loops: Vec<LoopReaction>,
    /// All components that are determined; inputs are the parameters of the model file, not base parameters.
    pub program: StraightLineProgram,
}

/// Force and moment that a joint transmits to the side away from the base, including its drive and friction.
///
/// Components are in the axes that the frame's steps reach after the joint (the frame's own if no step follows). The
/// moment is about the origin reached there, which lies on the joint's axis.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JointReaction {
    /// Name of the frame, followed by the coordinate where the frame has several joints: `upper`, `wrist.q4`.
    pub name: String,
    /// Coordinates that move the joint.
    pub coordinates: Vec<String>,
    /// The axis about or along which it moves.
    pub axis: FrameAxis,
    /// Position of each component in the program's outputs; `None` if the equations of motion do not determine it.
    pub force: [Option<usize>; 3],
    /// The same for the moment.
    pub moment: [Option<usize>; 3],
}

/// The force at the point where a loop is closed, on the side of its first point.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LoopReaction {
    /// Name of the loop.
    pub name: String,
    /// The joint along whose axes its components are: the last one before the first point, or before the second one if
    /// the first lies on a free body.
    pub axes: String,
    /// Position of each component in the program's outputs; `None` if the equations of motion do not determine it.
    pub force: [Option<usize>; 3],
}

impl Derivation {
    /// Forces and moments that the joints transmit. They are derived by this call.
    ///
    /// # Errors
    /// Loops with too many coupled unknowns to be solved symbolically for their forces.
    pub fn reactions(&self) -> Result<ReactionPrograms, DeriveError> {
        let mut graph = self.graph.clone();
        reactions(&mut graph, &self.mechanism, &self.equations, &self.closing)
    }
}

/// Derives the program and the tables of joints and loops.
fn reactions(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &UnreducedEquations,
    closing: &PassiveClosure,
) -> Result<ReactionPrograms, DeriveError> {
    let tree = &equations.tree;
    // Links without a joint that could transmit anything, and the cuts of the loops.
    let free = free_links(mechanism, equations);
    let cuts = loads::cut_loops(graph, mechanism, equations, &free)?;
    let value = product_values(graph, equations);
    let value = |m: &ParameterMonomial| value.get(m).copied().unwrap_or(Graph::ZERO);
    // Loads: bodies, then drives and effects, then the unknown forces of the cuts.
    let mut all = body_wrenches(graph, equations, &value);
    let on_tree = required_forces(graph, mechanism, equations, &value, &all)?;
    let drives = equations.projection.drive_forces(graph, &on_tree)?;
    let closing_forces = loop_closure_forces(graph, mechanism, equations, &cuts, &on_tree, &drives)?;
    all.extend(loads::drive_loads(graph, mechanism, equations, &drives)?);
    all.extend(loads::effect_loads(graph, mechanism, equations, &value)?);
    for cut in &cuts {
        all.extend(cut.joint_loads(graph, tree));
    }

    // Components in the order of the tables: force and moment per joint, then force per loop.
    let places = reaction_joints(mechanism, equations, &free);
    let mut components: Vec<[ExprId; 3]> = Vec::new();
    let wrenches = joint_wrenches(graph, tree, all);
    for place in &places {
        let (link, wrench) = (&tree.links[place.link], &wrenches[place.link]);
        components.push(link.to_named_axes(graph, &wrench.force));
        components.push(link.to_named_axes(graph, &wrench.moment));
    }
    for cut in &cuts {
        components.push(cut.reported_force(graph, tree));
    }
    let components: Vec<ExprId> = components.concat();
    let determined = determined::determined_components(graph, mechanism, equations, &cuts, &components);

    // Components that are not determined do not depend on the choice of the unknown forces, so these are set to zero.
    let known = loads::known_values(graph, &cuts, &closing_forces.of_gap);
    let outputs: Vec<ExprId> = components
        .iter()
        .zip(&determined)
        .filter_map(|(component, determined)| determined.then_some(*component))
        .collect();
    let outputs = graph.substitute(&outputs, &known);
    // Poses where the forces of the loops do not exist are refused.
    let mut closing = closing.clone();
    closing.add_guards(graph, mechanism, &closing_forces.determinants);
    let program = closing.program(graph, equations, &outputs);

    // Positions of the determined components among the outputs.
    let mut next = 0;
    let mut place_of = determined.iter().map(|determined| {
        determined.then(|| {
            next += 1;
            next - 1
        })
    });
    // The next three positions.
    let mut three = || [(); 3].map(|()| place_of.next().flatten());
    let joints = places.iter().map(|place| JointReaction {
        name: place.name.clone(),
        coordinates: place.coordinates.clone(),
        axis: tree.links[place.link].named_axis,
        force: three(),
        moment: three(),
    });
    let joints: Vec<JointReaction> = joints.collect();
    let names = link_names(mechanism, tree);
    let loops = cuts.iter().map(|cut| LoopReaction {
        name: cut.name.clone(),
        axes: names[cut.shown_in].clone(),
        force: three(),
    });
    let loops = loops.collect();
    Ok(ReactionPrograms { joints, loops, program })
}

/// Every product of parameters as an expression of single parameters.
fn product_values(graph: &mut Graph, equations: &UnreducedEquations) -> BTreeMap<ParameterMonomial, ExprId> {
    let products = equations.products.iter();
    products
        .map(|m| (m.clone(), base::product_expression(graph, m)))
        .collect()
}

/// Wrenches that accelerate the bodies and carry their weight, link by link.
fn body_wrenches(
    graph: &mut Graph,
    equations: &UnreducedEquations,
    value: &dyn Fn(&ParameterMonomial) -> ExprId,
) -> Vec<JointLoad> {
    let tree = &equations.tree;
    let motion = newton_euler::forward_recursion(graph, tree, &equations.gravity, RecursionStyle::PLAIN);
    let inertia = equations.inertia.total_inertias(graph, value);
    let loads = inertia.into_iter().map(|(link, inertia)| JointLoad {
        link,
        wrench: motion.wrench(graph, link, &newton_euler::BodyInertia::new(&inertia)),
        until: None,
    });
    loads.collect()
}

/// Generalised forces that the open tree needs on its coordinates, including effects.
fn required_forces(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &UnreducedEquations,
    value: &dyn Fn(&ParameterMonomial) -> ExprId,
    bodies: &[JointLoad],
) -> Result<Vec<ExprId>, DeriveError> {
    let n = mechanism.coordinates.len();
    // Wrenches of the bodies, projected on the joints.
    let wrenches: Vec<_> = bodies
        .iter()
        .map(|load| (load.link, newton_euler::JointSide::Moving, load.wrench))
        .collect();
    let on_tree = newton_euler::backward_recursion(graph, &equations.tree, RecursionStyle::PLAIN, n, wrenches);
    let effects = equations.effect_forces(graph, mechanism, value)?;
    Ok(on_tree
        .iter()
        .zip(effects.on_tree)
        .map(|(a, b)| graph.add(*a, b))
        .collect())
}

/// Forces in the closures of loops.
struct LoopClosureForces {
    /// Force by gap; gaps that are not listed have none.
    of_gap: BTreeMap<ExprId, ExprId>,
    /// Determinants that must not be zero for these forces to exist.
    determinants: Vec<ExprId>,
}

/// Forces in the closures of the loops, if the drives act with the given forces.
fn loop_closure_forces(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &UnreducedEquations,
    cuts: &[CutLoop],
    on_tree: &[ExprId],
    drives: &[ExprId],
) -> Result<LoopClosureForces, DeriveError> {
    let projection = &equations.projection;
    if projection.loops.passive.is_empty() {
        return Ok(LoopClosureForces {
            of_gap: BTreeMap::new(),
            determinants: Vec::new(),
        });
    }
    let coordinates: Vec<ExprId> = projection.drives.iter().map(|d| d.coordinate).collect();
    // Generalised forces that the drives do not supply.
    let left: Vec<ExprId> = (0..mechanism.coordinates.len())
        .map(|i| {
            // What the drives supply, by the transposed derivative of their lengths.
            let slopes = graph.differentiate(&coordinates, Atom::Coordinate(i));
            let driven: Vec<ExprId> = slopes
                .iter()
                .zip(drives)
                .map(|(slope, force)| graph.mul(*slope, *force))
                .collect();
            let driven = graph.add_all(&driven);
            graph.sub(on_tree[i], driven)
        })
        .collect();
    // As many gaps as passive coordinates, or the forces are not determined.
    let gaps = closing_gaps(graph, mechanism, equations, cuts);
    if gaps.len() != projection.loops.passive.len() {
        return Err(DeriveError::Singular {
            what: "the forces of the loops".to_owned(),
        });
    }
    let solution = projection.multipliers(graph, &gaps, &left)?;
    let forces = solution.values.into_iter().map(|row| row[0]);
    Ok(LoopClosureForces {
        of_gap: gaps.into_iter().zip(forces).collect(),
        determinants: solution.determinants,
    })
}

/// As many components of the gaps as there are passive coordinates, which they determine. These are the residuals by
/// which the loops were solved, if they are gaps; otherwise the best conditioned ones at the nominal pose.
fn closing_gaps(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &UnreducedEquations,
    cuts: &[CutLoop],
) -> Vec<ExprId> {
    let projection = &equations.projection;
    // Couplings have no cut, but their residual transmits force as well.
    let couplings = &projection.loops.closures[mechanism.loops.len()..];
    let mut all: Vec<ExprId> = couplings.iter().flat_map(|c| c.residual.clone()).collect();
    for gap in cuts.iter().flat_map(|cut| cut.gap) {
        if gap != Graph::ZERO && !all.contains(&gap) {
            all.push(gap);
        }
    }
    if projection.loops.residual.iter().all(|row| all.contains(row)) {
        return projection.loops.residual.clone();
    }
    // Derivatives of all gaps by the passive coordinates, at the nominal pose.
    let slopes: Vec<ExprId> = projection
        .loops
        .passive
        .iter()
        .flat_map(|p| graph.differentiate(&all, Atom::Coordinate(*p)))
        .collect();
    let values = slopes.iter().map(|slope| {
        let value = nominal_value(graph, mechanism, *slope);
        value.filter(|x| x.is_finite()).unwrap_or(0.0)
    });
    let n = projection.loops.passive.len();
    let jacobian = DMatrix::from_iterator(all.len(), n, values);
    let rows = best_conditioned_rows(&jacobian, n);
    rows.into_iter().map(|row| all[row]).collect()
}

/// A joint whose reaction is reported.
struct ReactionJoint {
    /// Index of its link.
    link: usize,
    /// Name for the tables.
    name: String,
    /// Names of its coordinates.
    coordinates: Vec<String>,
}

/// The frame of each link; a frame with several joints has several links.
fn link_frames(tree: &KinematicTree) -> Vec<usize> {
    let mut frames = Vec::with_capacity(tree.links.len());
    for (frame, last) in tree.of_frame.iter().enumerate() {
        if let Some(last) = last {
            frames.resize(last + 1, frame);
        }
    }
    frames
}

/// Names of the coordinates that move a link, in the order of the model.
fn coordinates_of(mechanism: &Mechanism, tree: &KinematicTree, link: usize) -> Vec<String> {
    let link = &tree.links[link];
    let turns = link.turns.iter().map(|(c, _)| *c);
    let all: BTreeSet<usize> = turns.chain(link.slides.iter().map(|(c, _)| *c)).collect();
    let name = |i: usize| mechanism.coordinates[i].name.clone();
    all.into_iter().map(name).collect()
}

/// Names of all links: the name of the frame, with coordinates where a frame has several joints.
pub(crate) fn link_names(mechanism: &Mechanism, tree: &KinematicTree) -> Vec<String> {
    let frames = link_frames(tree);
    let moving = |i: &usize| tree.links[*i].is_moving();
    (0..tree.links.len())
        .map(|i| {
            let frame = &mechanism.frames[frames[i]].name;
            // Other moving links of the same frame.
            let others = (0..tree.links.len()).filter(|k| frames[*k] == frames[i]);
            if others.filter(moving).count() < 2 {
                return frame.clone();
            }
            format!("{frame}.{}", coordinates_of(mechanism, tree, i).join("+"))
        })
        .collect()
}

/// All joints that transmit something: those of floating bodies only count coordinates.
fn reaction_joints(
    mechanism: &Mechanism,
    equations: &UnreducedEquations,
    free: &BTreeSet<usize>,
) -> Vec<ReactionJoint> {
    let tree = &equations.tree;
    let names = link_names(mechanism, tree);
    let joints = (0..tree.links.len()).filter(|i| tree.links[*i].is_moving() && !free.contains(i));
    joints
        .map(|link| ReactionJoint {
            link,
            name: names[link].clone(),
            coordinates: coordinates_of(mechanism, tree, link),
        })
        .collect()
}

/// Names of the loops that transmit a force, each with whether its pin could also transmit moments across its axis.
#[cfg(any(test, feature = "review"))]
pub(crate) fn cut_loop_names(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &UnreducedEquations,
) -> Result<Vec<(String, bool)>, DeriveError> {
    let free = free_links(mechanism, equations);
    let cuts = loads::cut_loops(graph, mechanism, equations, &free)?;
    Ok(cuts.into_iter().map(|cut| (cut.name, cut.moment.is_some())).collect())
}

/// Links of floating bodies: frames with six coordinates of their own on which no drive and no effect acts.
fn free_links(mechanism: &Mechanism, equations: &UnreducedEquations) -> BTreeSet<usize> {
    let tree = &equations.tree;
    let frames = link_frames(tree);
    let driven = |i: usize| {
        // Drives and effects on the coordinate.
        let by_drive = mechanism
            .drives
            .iter()
            .any(|d| matches!(d.kind, modelmill_spec::DriveKind::Joint(c) if c.0 == i));
        let mut places = mechanism.effects.iter().flat_map(|e| &e.places);
        by_drive || places.any(|p| matches!(p, EffectPlace::Coordinate(c) if c.0 == i))
    };
    let mut free = BTreeSet::new();
    for frame in 1..mechanism.frames.len() {
        let links = (0..tree.links.len()).filter(|i| frames[*i] == frame);
        let links: Vec<usize> = links.filter(|i| tree.links[*i].is_moving()).collect();
        let coordinates = |i: &usize| {
            let link = &tree.links[*i];
            let turns = link.turns.iter().map(|(c, _)| *c);
            let slides = link.slides.iter().map(|(c, _)| *c);
            turns.chain(slides).collect::<Vec<usize>>()
        };
        let all: BTreeSet<usize> = links.iter().flat_map(coordinates).collect();
        // A coordinate that also moves another frame couples the two.
        let elsewhere = (0..tree.links.len())
            .filter(|i| frames[*i] != frame)
            .any(|i| coordinates(&i).iter().any(|c| all.contains(c)));
        if all.len() == 6 && !elsewhere && !all.iter().any(|i| driven(*i)) {
            free.extend(links);
        }
    }
    free
}

/// A force through a point as a wrench about the origin.
fn force_through_point(graph: &mut Graph, at: &SymbolicVector, force: SymbolicVector) -> SymbolicWrench {
    let moment = graph.cross(at, &force);
    SymbolicWrench { force, moment }
}
