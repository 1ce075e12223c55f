//! The body that is cut free and its vectors: the links that are fixed to each other, the axes of all components, and
//! the motion of points.
//!
//! Components are along the axes of the base if all motion is in one of its planes, as in the paper. Otherwise they are
//! along the axes of the body, in which lever arms and inertia are constant.

use std::collections::BTreeSet;

use modelmill_spec::{ExactExpression, FrameIdx, Mechanism};

use super::CutFreeError;
use crate::expr::vector::{self, AxisRotation, SymbolicVector, push_rotation};
use crate::expr::{ExprId, Graph};
use crate::loops::segment::{path_segments, sum_segments};
use crate::newton_euler::{
    self, BodyInertia, ELEMENTS, InertiaElement, RecursionStyle, SymbolicWrench, TreeMotion, rotate_into_inner,
};
use crate::on_request::reactions::link_names;
use crate::reduce::base;
use crate::regressor::UnreducedEquations;
use crate::tree::KinematicTree;
use crate::tree::expressions;
use crate::{Derivation, DeriveError};

/// A body with the expressions of its vectors.
pub(super) struct BodyGeometry<'a> {
    /// The arena in which vectors are built.
    pub(super) graph: Graph,
    /// The mechanism.
    pub(super) mechanism: &'a Mechanism,
    /// Its equations.
    pub(super) equations: &'a UnreducedEquations,
    /// The requested name.
    pub(super) part: String,
    /// The link behind the joint that carries the body; its origin is the origin of the body.
    pub(super) root: usize,
    /// Names of all links.
    pub(super) names: Vec<String>,
    /// The axis of the base (0 to 2) that is normal to all motion; `None` if the motion is spatial.
    pub(super) normal: Option<usize>,
    /// Motion of all links without gravity.
    motion: TreeMotion,
}

impl<'a> BodyGeometry<'a> {
    /// Selects the body that carries a part or a frame.
    pub(super) fn new(derivation: &'a Derivation, part: &str) -> Result<Self, CutFreeError> {
        let (mechanism, equations) = (&derivation.mechanism, &derivation.equations);
        let tree = &equations.tree;
        let Some(frame) = find_frame(mechanism, part) else {
            return Err(CutFreeError::UnknownPart {
                name: part.to_owned(),
                parts: movable_parts(mechanism, tree),
            });
        };
        let Some(root) = root_link(tree, tree.link_of(frame)) else {
            return Err(CutFreeError::FixedToBase {
                name: part.to_owned(),
                parts: movable_parts(mechanism, tree),
            });
        };
        let mut graph = derivation.graph.clone();
        let motion = newton_euler::forward_recursion(&mut graph, tree, &vector::ZERO, RecursionStyle::PLAIN);
        Ok(Self {
            normal: plane_normal(&mut graph, tree, &equations.gravity),
            names: link_names(mechanism, tree),
            part: part.to_owned(),
            graph,
            mechanism,
            equations,
            root,
            motion,
        })
    }

    /// The tree of links.
    pub(super) fn tree(&self) -> &'a KinematicTree {
        &self.equations.tree
    }

    /// Whether a link belongs to the body.
    pub(super) fn has_link(&self, link: Option<usize>) -> bool {
        link.is_some() && root_link(self.tree(), link) == Some(self.root)
    }

    /// Frames of the body, by index.
    pub(super) fn frames(&self) -> Vec<usize> {
        let frames = 1..self.mechanism.frames.len();
        frames
            .filter(|f| self.has_link(self.tree().link_of(FrameIdx(*f))))
            .collect()
    }

    /// The name of the axes of all components.
    pub(super) fn axes_name(&self) -> String {
        match self.normal {
            Some(_) => "base".to_owned(),
            None => self.names[self.root].clone(),
        }
    }

    /// Axes (0 to 2) along which forces are balanced.
    pub(super) fn force_axes(&self) -> Vec<usize> {
        (0..3).filter(|k| Some(*k) != self.normal).collect()
    }

    /// Axes (0 to 2) about which moments are balanced.
    pub(super) fn moment_axes(&self) -> Vec<usize> {
        (0..3).filter(|k| self.normal.is_none_or(|n| n == *k)).collect()
    }

    /// Components of a vector that is given in the frame of a link, `None` for the base.
    pub(super) fn express_in_body_axes(&mut self, v: &SymbolicVector, from: Option<usize>) -> SymbolicVector {
        if self.normal.is_some() {
            return self.transfer(v, from, None);
        }
        let v = self.transfer(v, from, Some(self.root));
        self.tree().links[self.root].to_named_axes(&mut self.graph, &v)
    }

    /// Components in the frame of one link of a vector that is given in that of another, by way of their last common
    /// link.
    fn transfer(&mut self, v: &SymbolicVector, from: Option<usize>, to: Option<usize>) -> SymbolicVector {
        let tree = self.tree();
        let [outward, inward] = [from, to].map(|link| tree.path_to(link));
        let shared = outward.iter().zip(&inward).take_while(|(a, b)| a == b).count();
        let turns = rotations_along(tree, &outward[shared..]);
        let v = turns.iter().rev().fold(*v, |v, turn| self.graph.rotate_out(turn, &v));
        rotate_into_inner(&mut self.graph, &rotations_along(tree, &inward[shared..]), &v)
    }

    /// Lever arm from the origin of the body to a point of a link, m. The link moves with the body, or the point is
    /// given in the frame of such a link.
    pub(super) fn lever_arm(&mut self, link: Option<usize>, at: &SymbolicVector) -> SymbolicVector {
        let path = self.tree().path_to(link);
        let start = path.iter().position(|i| *i == self.root).map_or(0, |i| i + 1);
        let segments = path_segments(self.tree(), &path[start..], &[], at);
        let arm = sum_segments(&mut self.graph, &segments);
        self.express_in_body_axes(&arm, Some(self.root))
    }

    /// Acceleration of a point of a link, m/s^2.
    pub(super) fn acceleration(&mut self, link: usize, at: &SymbolicVector) -> SymbolicVector {
        if self.normal.is_some() {
            let segments = path_segments(self.tree(), &self.tree().path_to(Some(link)), &[], at);
            let position = sum_segments(&mut self.graph, &segments);
            return self.differentiate_twice(&position);
        }
        // The force on a unit mass at the point.
        let force = self.unit_wrench(link, Graph::ONE, at, [Graph::ZERO; 6]).force;
        self.express_in_body_axes(&force, Some(link))
    }

    /// Second time derivative of a first moment of mass that is fixed to a link, kg m/s^2.
    pub(super) fn first_moment_derivative(&mut self, link: usize, moment: &SymbolicVector) -> SymbolicVector {
        if self.normal.is_some() {
            let moment = self.express_in_body_axes(moment, Some(link));
            return self.differentiate_twice(&moment);
        }
        let force = self.unit_wrench(link, Graph::ZERO, moment, [Graph::ZERO; 6]).force;
        self.express_in_body_axes(&force, Some(link))
    }

    /// `I alpha + omega x (I omega)` for an inertia matrix xx, xy, xz, yy, yz, zz along the axes of a link, N m.
    pub(super) fn gyroscopic_moment(&mut self, link: usize, inertia: [ExprId; 6]) -> SymbolicVector {
        let moment = self.unit_wrench(link, Graph::ZERO, &vector::ZERO, inertia).moment;
        self.express_in_body_axes(&moment, Some(link))
    }

    /// Acceleration of gravity, m/s^2.
    pub(super) fn gravity(&mut self) -> SymbolicVector {
        let path = self.tree().path_to(Some(self.root));
        let first = path[0];
        if self.tree().links[first].free.is_none() {
            let gravity = self.equations.gravity;
            return self.express_in_body_axes(&gravity, None);
        }
        // The axes of a free body follow from its quaternion: gravity is what the recursion adds to its acceleration.
        let (tree, style) = (self.tree(), RecursionStyle::PLAIN);
        let lifted = newton_euler::forward_recursion(&mut self.graph, tree, &self.equations.gravity, style);
        let body = unit_body(Graph::ONE, &vector::ZERO, [Graph::ZERO; 6]);
        let [plain, lifted] = [&self.motion, &lifted].map(|motion| motion.wrench(&mut self.graph, first, &body).force);
        let gravity = self.graph.sub_vectors(&plain, &lifted);
        self.express_in_body_axes(&gravity, Some(first))
    }

    /// The wrench on a link with the given mass, first moment and inertia.
    fn unit_wrench(
        &mut self,
        link: usize,
        mass: ExprId,
        moment: &SymbolicVector,
        inertia: [ExprId; 6],
    ) -> SymbolicWrench {
        let body = unit_body(mass, moment, inertia);
        self.motion.wrench(&mut self.graph, link, &body)
    }

    /// Second time derivative of a vector in axes at standstill.
    fn differentiate_twice(&mut self, v: &SymbolicVector) -> SymbolicVector {
        let once = self.graph.time_derivative(v);
        let twice = self.graph.time_derivative(&once);
        [twice[0], twice[1], twice[2]]
    }

    /// An expression of the model file over constants and dynamic parameters.
    pub(super) fn expression(&mut self, exact: &ExactExpression) -> Result<ExprId, DeriveError> {
        let polynomial = expressions::polynomial(&mut self.graph, exact)?;
        let terms = polynomial.0.into_iter().map(|(product, factor)| {
            let product = base::product_expression(&mut self.graph, &product);
            self.graph.mul(product, factor)
        });
        let terms: Vec<ExprId> = terms.collect();
        Ok(self.graph.add_all(&terms))
    }

    /// A vector of the model file over constants and dynamic parameters.
    pub(super) fn vector(&mut self, exact: &[ExactExpression; 3]) -> Result<SymbolicVector, DeriveError> {
        Ok([
            self.expression(&exact[0])?,
            self.expression(&exact[1])?,
            self.expression(&exact[2])?,
        ])
    }
}

/// The link that carries a body: the last moving one on the way to a link.
pub(super) fn root_link(tree: &KinematicTree, link: Option<usize>) -> Option<usize> {
    let mut next = link;
    while let Some(i) = next {
        if tree.links[i].is_moving() {
            return Some(i);
        }
        next = tree.links[i].parent;
    }
    None
}

/// Rotations along a path of links, merged where they are about one axis.
fn rotations_along(tree: &KinematicTree, links: &[usize]) -> Vec<AxisRotation> {
    let mut turns = Vec::new();
    for link in links.iter().map(|i| &tree.links[*i]) {
        for turn in link.pre.iter().chain([&link.joint]) {
            push_rotation(&mut turns, turn);
        }
    }
    turns
}

/// A body with the given elements.
fn unit_body(mass: ExprId, moment: &SymbolicVector, inertia: [ExprId; 6]) -> BodyInertia {
    let mut factors = [Graph::ZERO; ELEMENTS];
    factors[InertiaElement::Mass.index()] = mass;
    for k in 0..3 {
        factors[InertiaElement::ForceMoment(k).index()] = moment[k];
        factors[InertiaElement::MomentMoment(k).index()] = moment[k];
    }
    for (k, element) in inertia.into_iter().enumerate() {
        factors[InertiaElement::Inertia(k).index()] = element;
    }
    BodyInertia::new(&factors)
}

/// The frame that carries the part of this name, or that has this name.
fn find_frame(mechanism: &Mechanism, name: &str) -> Option<FrameIdx> {
    let of_effects = mechanism.effects.iter().flat_map(|effect| &effect.bodies.parts);
    let mut parts = mechanism.parts.iter().chain(of_effects);
    let part = parts.find(|part| part.name == name).map(|part| part.frame);
    part.or_else(|| {
        let frame = mechanism.frames.iter().position(|frame| frame.name == name)?;
        Some(FrameIdx(frame))
    })
}

/// Names of everything that can be cut free: parts, and frames without a part of their own.
fn movable_parts(mechanism: &Mechanism, tree: &KinematicTree) -> Vec<String> {
    let moves = |frame: FrameIdx| root_link(tree, tree.link_of(frame)).is_some();
    let parts = mechanism.parts.iter().filter(|part| moves(part.frame));
    let mut names: Vec<String> = parts.clone().map(|part| part.name.clone()).collect();
    let with_part: BTreeSet<usize> = parts.map(|part| part.frame.0).collect();
    let frames = (1..mechanism.frames.len()).filter(|f| moves(FrameIdx(*f)) && !with_part.contains(f));
    names.extend(frames.map(|f| mechanism.frames[f].name.clone()));
    let mut seen = BTreeSet::new();
    names.retain(|name| seen.insert(name.clone()));
    names
}

/// The axis of the base that is normal to all motion and to gravity, if there is one.
fn plane_normal(graph: &mut Graph, tree: &KinematicTree, gravity: &SymbolicVector) -> Option<usize> {
    let mut candidates: Vec<usize> = (0..3).filter(|k| gravity[*k] == Graph::ZERO).collect();
    for i in 0..tree.links.len() {
        let link = &tree.links[i];
        if link.free.is_some() {
            return None;
        }
        if !link.is_moving() {
            continue;
        }
        // Direction of the joint's axis in the base.
        let turns = rotations_along(tree, &tree.path_to(Some(i)));
        let z = [Graph::ZERO, Graph::ZERO, Graph::ONE];
        let axis = turns.iter().rev().fold(z, |v, turn| graph.rotate_out(turn, &v));
        candidates.retain(|n| {
            let in_plane = (0..3).filter(|k| k != n).all(|k| axis[k] == Graph::ZERO);
            let turns_well = link.turns.is_empty() || in_plane;
            turns_well && (link.slides.is_empty() || axis[*n] == Graph::ZERO)
        });
    }
    match candidates[..] {
        [only] => Some(only),
        // Prismatic joints along one line alone: z is the usual normal.
        _ => candidates.last().copied(),
    }
}
