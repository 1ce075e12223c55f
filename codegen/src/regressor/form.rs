//! The forms in which regressor and inverse dynamics can be written: equal values at different cost.

use std::collections::BTreeMap;

use crate::expr::vector::{self, Turn};
use crate::expr::{ExprId, Graph};
use crate::newton_euler::inertia::InertiaByProduct;
use crate::newton_euler::{
    self, Body, Depths, Element, Inertia, Motion, Side, Spread, Style, Wrench,
};
use crate::tree::Tree;
use crate::tree::expressions::Monomial;

/// How the columns of a regressor are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ColumnForm {
    pub(crate) style: Style,
    pub(crate) depths: Depths,
    /// Moments of inertia about a joint's own axis are written on the fixed side of the joint, and those about x and y
    /// as second moments less that.
    pub(crate) axial: bool,
    /// Links with parallel axes share the axes of what carries the first of them; inertia is turned there.
    pub(crate) fixed_axes: bool,
}

impl ColumnForm {
    /// As in the textbooks: each column by itself, link by link.
    pub(crate) const PLAIN: Self = Self {
        style: Style::PLAIN,
        depths: Depths {
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
        frames: &Frames,
        product: &Monomial,
        products: &[Monomial],
    ) -> Vec<(usize, Side, Wrench)> {
        let bodies: Vec<(usize, Inertia)> = inertia
            .by_link(product)
            .map(|(link, inertia)| (link, *inertia))
            .collect();
        let (tree, motion) = (&frames.tree, &frames.motion);
        let mut wrenches = Vec::new();
        for (link, body) in &bodies {
            let only = single_moment(body).filter(|_| self.axial);
            match only {
                Some(2) => {
                    let moment = motion.axial_moment(graph, *link);
                    wrenches.push((*link, Side::Fixed, pure(moment)));
                }
                Some(axis) if has_axial_column(inertia, *link, products) => {
                    let mut second = [Graph::ZERO; 2];
                    // The moment of inertia about x holds the second moment along y.
                    second[1 - axis] = Graph::ONE;
                    let body = Body {
                        spread: Spread::Flat(second),
                        ..Body::NONE
                    };
                    let body = frames.turned(graph, *link, &body);
                    let flat = motion.wrench(graph, *link, &body);
                    let axial = motion.axial_moment(graph, *link);
                    let less = axial.map(|m| graph.neg(m));
                    let depth = tree.path(Some(*link)).len();
                    if depth <= self.depths.moments {
                        wrenches.push((*link, Side::Moving, flat));
                        wrenches.push((*link, Side::Fixed, pure(less)));
                    } else {
                        let turn = self.style.turn(&tree.links[*link]);
                        let turned = graph.turn_out(turn, &flat.moment);
                        let moment = graph.add_vectors(&[turned, less]);
                        wrenches.push((*link, Side::Fixed, pure(moment)));
                    }
                }
                _ => {
                    let body = frames.turned(graph, *link, &Body::new(body));
                    let wrench = motion.wrench(graph, *link, &body);
                    wrenches.push((*link, Side::Moving, wrench));
                }
            }
        }
        wrenches
    }
}

/// How the inverse dynamics is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TotalForm {
    pub(crate) style: Style,
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
        style: Style::PLAIN,
        flat: false,
        turn_ends: false,
        fixed_axes: false,
    };

    /// The wrenches of all links when every product has the value that `value` gives it.
    pub(crate) fn wrenches(
        self,
        graph: &mut Graph,
        inertia: &InertiaByProduct,
        tree: &Tree,
        frames: &Frames,
        value: &dyn Fn(&Monomial) -> ExprId,
    ) -> Vec<(usize, Side, Wrench)> {
        let inertia = inertia.total(graph, value);
        let mut bodies: BTreeMap<usize, Body> = inertia
            .iter()
            .map(|(link, inertia)| (*link, Body::new(inertia)))
            .collect();
        let motion = &frames.motion;
        if self.flat {
            newton_euler::flatten_along_axes(graph, tree, motion, &mut bodies);
        }
        for (link, body) in &mut bodies {
            *body = frames.turned(graph, *link, body);
        }
        newton_euler::wrenches(graph, &frames.tree, motion, &bodies, self.turn_ends)
    }
}

/// The frames in which a form is written, and how they move.
pub(crate) struct Frames {
    pub(crate) tree: Tree,
    /// How the axes of every link are turned there; nothing for the links' own axes.
    turns: Vec<Turn>,
    pub(crate) motion: Motion,
}

impl Frames {
    pub(crate) fn new(
        graph: &mut Graph,
        tree: &Tree,
        gravity: &vector::Vector,
        style: Style,
        fixed_axes: bool,
    ) -> Self {
        let (tree, turns) = if fixed_axes {
            tree.in_fixed_axes(graph)
        } else {
            (tree.clone(), Vec::new())
        };
        let motion = newton_euler::forward(graph, &tree, gravity, style);
        Self {
            tree,
            turns,
            motion,
        }
    }

    pub(crate) fn turned(&self, graph: &mut Graph, link: usize, body: &Body) -> Body {
        match self.turns.get(link) {
            Some(turn) => body.turned(graph, turn),
            None => *body,
        }
    }
}

fn pure(moment: vector::Vector) -> Wrench {
    Wrench {
        force: vector::ZERO,
        moment,
    }
}

/// The axis about which an inertia is a moment of inertia of 1, if it is nothing else.
fn single_moment(inertia: &Inertia) -> Option<usize> {
    let mut nonzero = (0..inertia.len()).filter(|i| inertia[*i] != Graph::ZERO);
    let only = nonzero.next()?;
    if nonzero.next().is_some() || inertia[only] != Graph::ONE {
        return None;
    }
    [0, 3, 5]
        .iter()
        .position(|i| Element::Inertia(*i).index() == only)
}

/// Whether one of some products is the moment of inertia of a link about its joint's axis.
fn has_axial_column(inertia: &InertiaByProduct, link: usize, products: &[Monomial]) -> bool {
    products.iter().any(|product| {
        let mut bodies = inertia.by_link(product);
        let only = bodies.next();
        only.is_some_and(|(l, inertia)| l == link && single_moment(inertia) == Some(2))
            && bodies.next().is_none()
    })
}
