//! The forms in which regressor and inverse dynamics can be written. All have equal values and different cost.

use std::collections::BTreeMap;

use crate::expr::vector::{self, AxisRotation};
use crate::expr::{ExprId, Graph};
use crate::newton_euler::inertia::InertiaByProduct;
use crate::newton_euler::{
    self, BodyInertia, CarryDepths, InertiaDiagonal, InertiaElement, InertiaFactors, JointAxisCache, JointSide,
    RecursionStyle, SymbolicWrench, TreeMotion,
};
use crate::tree::KinematicTree;
use crate::tree::expressions::ParameterMonomial;

/// The form of a regressor's columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ColumnForm {
    /// Style of the recursion.
    pub(crate) style: RecursionStyle,
    /// Depths up to which moments and forces are carried link by link.
    pub(crate) depths: CarryDepths,
    /// Whether moments of inertia about a joint's axis are written on the fixed side of the joint, and those about x
    /// and y as second moments minus that.
    pub(crate) axial: bool,
    /// Whether links with parallel axes use the axes of the link that carries the first of them; inertia is rotated
    /// there.
    pub(crate) fixed_axes: bool,
}

impl ColumnForm {
    /// The textbook form: each column by itself, link by link.
    pub(crate) const PLAIN: Self = Self {
        style: RecursionStyle::PLAIN,
        depths: CarryDepths { moments: 0, forces: 0 },
        axial: false,
        fixed_axes: false,
    };

    /// The wrenches of one product of value 1; `products` are all products whose columns are written.
    pub(crate) fn wrenches(
        self,
        graph: &mut Graph,
        inertia: &InertiaByProduct,
        frames: &RecursionFrames,
        product: &ParameterMonomial,
        products: &[ParameterMonomial],
    ) -> Vec<(usize, JointSide, SymbolicWrench)> {
        // Links to which the product contributes.
        let bodies: Vec<(usize, InertiaFactors)> = inertia
            .link_inertias(product)
            .map(|(link, inertia)| (link, *inertia))
            .collect();
        let (tree, motion) = (&frames.tree, &frames.motion);
        let mut wrenches = Vec::new();
        for (link, body) in &bodies {
            // A single moment of inertia may have a cheaper form.
            let only = single_moment(body).filter(|_| self.axial);
            match only {
                Some(2) => {
                    let moment = motion.axial_moment(graph, *link);
                    wrenches.push((*link, JointSide::Fixed, pure_moment(moment)));
                }
                Some(axis) if has_axial_column(inertia, *link, products) => {
                    let mut second = [Graph::ZERO; 2];
                    // The moment of inertia about x contains the second moment along y.
                    second[1 - axis] = Graph::ONE;
                    let body = BodyInertia {
                        spread: InertiaDiagonal::Flat(second),
                        ..BodyInertia::NONE
                    };
                    let body = frames.rotate_body(graph, *link, &body);
                    let flat = motion.wrench(graph, *link, &body);
                    let axial = motion.axial_moment(graph, *link);
                    // Minus the moment about the joint's axis, whose column exists anyway.
                    let less = axial.map(|m| graph.neg(m));
                    // Deep in the tree both parts are added at once, on the fixed side of the joint.
                    let depth = tree.path_to(Some(*link)).len();
                    if depth <= self.depths.moments {
                        wrenches.push((*link, JointSide::Moving, flat));
                        wrenches.push((*link, JointSide::Fixed, pure_moment(less)));
                    } else {
                        let turn = self.style.joint_rotation(&tree.links[*link]);
                        let turned = graph.rotate_out(turn, &flat.moment);
                        let moment = graph.add_vectors(&[turned, less]);
                        wrenches.push((*link, JointSide::Fixed, pure_moment(moment)));
                    }
                }
                _ => {
                    let body = frames.rotate_body(graph, *link, &BodyInertia::new(body));
                    let wrench = motion.wrench(graph, *link, &body);
                    wrenches.push((*link, JointSide::Moving, wrench));
                }
            }
        }
        wrenches
    }
}

/// The form of the inverse dynamics.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TotalForm {
    /// Style of the recursion.
    pub(crate) style: RecursionStyle,
    /// Whether second moments along joint axes are moved to the link that carries the joint.
    pub(crate) flat: bool,
    /// Whether the inertia is rotated instead of the motion at the ends of the tree.
    pub(crate) turn_ends: bool,
    /// As in [`ColumnForm`].
    pub(crate) fixed_axes: bool,
}

impl TotalForm {
    /// The textbook form.
    pub(crate) const PLAIN: Self = Self {
        style: RecursionStyle::PLAIN,
        flat: false,
        turn_ends: false,
        fixed_axes: false,
    };

    /// The wrenches of all links if every product has the value that `value` returns.
    pub(crate) fn wrenches(
        self,
        graph: &mut Graph,
        inertia: &InertiaByProduct,
        tree: &KinematicTree,
        frames: &RecursionFrames,
        value: &dyn Fn(&ParameterMonomial) -> ExprId,
    ) -> Vec<(usize, JointSide, SymbolicWrench)> {
        // All products together.
        let inertia = inertia.total_inertias(graph, value);
        let mut bodies: BTreeMap<usize, BodyInertia> = inertia
            .iter()
            .map(|(link, inertia)| (*link, BodyInertia::new(inertia)))
            .collect();
        let motion = &frames.motion;
        if self.flat {
            newton_euler::flatten_along_axes(graph, tree, motion, &mut bodies);
        }
        for (link, body) in &mut bodies {
            *body = frames.rotate_body(graph, *link, body);
        }
        newton_euler::wrenches(graph, &frames.tree, motion, &bodies, self.turn_ends)
    }
}

/// The frames in which a form is written, and their motion.
pub(crate) struct RecursionFrames {
    /// The tree in these frames.
    pub(crate) tree: KinematicTree,
    /// Rotation of the axes of every link; empty for the links' own axes.
    turns: Vec<AxisRotation>,
    /// Motion of the links in these frames.
    pub(crate) motion: TreeMotion,
    /// Axes of the joints in these frames, as far as columns needed them.
    pub(crate) axes: JointAxisCache,
}

impl RecursionFrames {
    /// The frames of a style, in the links' own axes or in fixed ones.
    pub(crate) fn new(
        graph: &mut Graph,
        tree: &KinematicTree,
        gravity: &vector::SymbolicVector,
        style: RecursionStyle,
        fixed_axes: bool,
    ) -> Self {
        // In fixed axes, links with parallel joints share the axes of the first one.
        let (tree, turns) = if fixed_axes {
            tree.to_fixed_axes(graph)
        } else {
            (tree.clone(), Vec::new())
        };
        // Velocities and accelerations from the base to the ends.
        let motion = newton_euler::forward_recursion(graph, &tree, gravity, style);
        Self {
            tree,
            turns,
            motion,
            axes: JointAxisCache::default(),
        }
    }

    /// An inertia of a link in the axes of its frame.
    pub(crate) fn rotate_body(&self, graph: &mut Graph, link: usize, body: &BodyInertia) -> BodyInertia {
        match self.turns.get(link) {
            Some(turn) => body.rotate(graph, turn),
            None => *body,
        }
    }
}

/// A wrench without force.
fn pure_moment(moment: vector::SymbolicVector) -> SymbolicWrench {
    SymbolicWrench {
        force: vector::ZERO,
        moment,
    }
}

/// The axis of a moment of inertia of 1, if the inertia has no other entry.
fn single_moment(inertia: &InertiaFactors) -> Option<usize> {
    let mut nonzero = (0..inertia.len()).filter(|i| inertia[*i] != Graph::ZERO);
    let only = nonzero.next()?;
    if nonzero.next().is_some() || inertia[only] != Graph::ONE {
        return None;
    }
    // Positions of xx, yy and zz.
    [0, 3, 5]
        .iter()
        .position(|i| InertiaElement::Inertia(*i).index() == only)
}

/// Whether one of the products is the moment of inertia of a link about the axis of its joint.
fn has_axial_column(inertia: &InertiaByProduct, link: usize, products: &[ParameterMonomial]) -> bool {
    products.iter().any(|product| {
        let mut bodies = inertia.link_inertias(product);
        let only = bodies.next();
        only.is_some_and(|(l, inertia)| l == link && single_moment(inertia) == Some(2)) && bodies.next().is_none()
    })
}
