//! The forms in which regressor and inverse dynamics can be written: equal values at different cost.

use std::collections::BTreeMap;

use crate::expr::vector::{self, AxisRotation};
use crate::expr::{ExprId, Graph};
use crate::newton_euler::inertia::InertiaByProduct;
use crate::newton_euler::{
    self, BodyInertia, CarryDepths, InertiaDiagonal, InertiaElement, InertiaFactors, JointSide,
    RecursionStyle, SymbolicWrench, TreeMotion,
};
use crate::tree::KinematicTree;
use crate::tree::expressions::ParameterMonomial;

/// How the columns of a regressor are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ColumnForm {
    pub(crate) style: RecursionStyle,
    pub(crate) depths: CarryDepths,
    /// Moments of inertia about a joint's own axis are written on the fixed side of the joint, and those about x and y
    /// as second moments less that.
    pub(crate) axial: bool,
    /// Links with parallel axes share the axes of what carries the first of them; inertia is turned there.
    pub(crate) fixed_axes: bool,
}

impl ColumnForm {
    /// As in the textbooks: each column by itself, link by link.
    pub(crate) const PLAIN: Self = Self {
        style: RecursionStyle::PLAIN,
        depths: CarryDepths {
            moments: 0,
            forces: 0,
        },
        axial: false,
        fixed_axes: false,
    };

    /// The wrenches of one product of value 1 among all products whose columns are written.
    pub(crate) fn wrenches(
        self,
        graph: &mut Graph,
        inertia: &InertiaByProduct,
        frames: &RecursionFrames,
        product: &ParameterMonomial,
        products: &[ParameterMonomial],
    ) -> Vec<(usize, JointSide, SymbolicWrench)> {
        let bodies: Vec<(usize, InertiaFactors)> = inertia
            .link_inertias(product)
            .map(|(link, inertia)| (link, *inertia))
            .collect();
        let (tree, motion) = (&frames.tree, &frames.motion);
        let mut wrenches = Vec::new();
        for (link, body) in &bodies {
            let only = single_moment(body).filter(|_| self.axial);
            match only {
                Some(2) => {
                    let moment = motion.axial_moment(graph, *link);
                    wrenches.push((*link, JointSide::Fixed, pure_moment(moment)));
                }
                Some(axis) if has_axial_column(inertia, *link, products) => {
                    let mut second = [Graph::ZERO; 2];
                    // The moment of inertia about x holds the second moment along y.
                    second[1 - axis] = Graph::ONE;
                    let body = BodyInertia {
                        spread: InertiaDiagonal::Flat(second),
                        ..BodyInertia::NONE
                    };
                    let body = frames.rotate_body(graph, *link, &body);
                    let flat = motion.wrench(graph, *link, &body);
                    let axial = motion.axial_moment(graph, *link);
                    let less = axial.map(|m| graph.neg(m));
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

/// How the inverse dynamics is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TotalForm {
    pub(crate) style: RecursionStyle,
    /// Second moments along joint axes are moved to what carries the joint.
    pub(crate) flat: bool,
    /// At the ends of the tree the inertia is turned rather than the motion.
    pub(crate) turn_ends: bool,
    /// As in [`ColumnForm`].
    pub(crate) fixed_axes: bool,
}

impl TotalForm {
    /// As in the textbooks.
    pub(crate) const PLAIN: Self = Self {
        style: RecursionStyle::PLAIN,
        flat: false,
        turn_ends: false,
        fixed_axes: false,
    };

    /// The wrenches of all links when every product has the value that `value` gives it.
    pub(crate) fn wrenches(
        self,
        graph: &mut Graph,
        inertia: &InertiaByProduct,
        tree: &KinematicTree,
        frames: &RecursionFrames,
        value: &dyn Fn(&ParameterMonomial) -> ExprId,
    ) -> Vec<(usize, JointSide, SymbolicWrench)> {
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

/// The frames in which a form is written, and how they move.
pub(crate) struct RecursionFrames {
    pub(crate) tree: KinematicTree,
    /// How the axes of every link are turned there; nothing for the links' own axes.
    turns: Vec<AxisRotation>,
    pub(crate) motion: TreeMotion,
}

impl RecursionFrames {
    pub(crate) fn new(
        graph: &mut Graph,
        tree: &KinematicTree,
        gravity: &vector::SymbolicVector,
        style: RecursionStyle,
        fixed_axes: bool,
    ) -> Self {
        let (tree, turns) = if fixed_axes {
            tree.to_fixed_axes(graph)
        } else {
            (tree.clone(), Vec::new())
        };
        let motion = newton_euler::forward_recursion(graph, &tree, gravity, style);
        Self {
            tree,
            turns,
            motion,
        }
    }

    pub(crate) fn rotate_body(
        &self,
        graph: &mut Graph,
        link: usize,
        body: &BodyInertia,
    ) -> BodyInertia {
        match self.turns.get(link) {
            Some(turn) => body.rotate(graph, turn),
            None => *body,
        }
    }
}

fn pure_moment(moment: vector::SymbolicVector) -> SymbolicWrench {
    SymbolicWrench {
        force: vector::ZERO,
        moment,
    }
}

/// The axis about which an inertia is a moment of inertia of 1, if it is nothing else.
fn single_moment(inertia: &InertiaFactors) -> Option<usize> {
    let mut nonzero = (0..inertia.len()).filter(|i| inertia[*i] != Graph::ZERO);
    let only = nonzero.next()?;
    if nonzero.next().is_some() || inertia[only] != Graph::ONE {
        return None;
    }
    [0, 3, 5]
        .iter()
        .position(|i| InertiaElement::Inertia(*i).index() == only)
}

/// Whether one of some products is the moment of inertia of a link about its joint's axis.
fn has_axial_column(
    inertia: &InertiaByProduct,
    link: usize,
    products: &[ParameterMonomial],
) -> bool {
    products.iter().any(|product| {
        let mut bodies = inertia.link_inertias(product);
        let only = bodies.next();
        only.is_some_and(|(l, inertia)| l == link && single_moment(inertia) == Some(2))
            && bodies.next().is_none()
    })
}
