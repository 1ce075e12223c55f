//! The tree of links: every frame of the model file becomes one or more links whose joint rotates about or translates
//! along their own z axis, as in the modified Denavit-Hartenberg convention (Khalil and Kleinfinger 1986).
//!
//! Loops are cut here; they are closed again in `loops`.

pub(crate) mod checks;
pub(crate) mod expressions;
pub(crate) mod free;

use modelmill_spec::{FrameAxis, FrameIdx, FrameStep, FreeBody, Mechanism};

use crate::DeriveError;
use crate::expr::vector::{self, AxisRotation, SymbolicVector, push_rotation};
use crate::expr::{Atom, AtomAngleSum, ExprId, Graph, Rational};

/// A rigid frame that rotates about or translates along its own z axis relative to its parent, or is fixed to it.
#[derive(Clone, Debug)]
pub(crate) struct TreeLink {
    /// The link that carries it; `None` for the base.
    pub(crate) parent: Option<usize>,
    /// The fixed rotation from the parent, before the joint.
    pub(crate) pre: Vec<AxisRotation>,
    /// The joint's rotation about z, including any fixed offset.
    pub(crate) joint: AxisRotation,
    /// The axis of the model file about or along which the joint moves; the link's own z lies along it.
    pub(crate) named_axis: FrameAxis,
    /// Position of the origin in the parent's frame, m.
    pub(crate) position: SymbolicVector,
    /// Coordinates that rotate it, with their integer factors.
    pub(crate) turns: Vec<(usize, i32)>,
    /// Coordinates that translate it along z, with their factors.
    pub(crate) slides: Vec<(usize, Rational)>,
    /// The free motion of a body without a joint. Such a body is carried by the base, and its rotations and position
    /// are unused.
    pub(crate) free: Option<FreeBody>,
    /// The first of the links above it whose z axes are all parallel to its own; the link itself if its parent's axis
    /// is not.
    pub(crate) first_parallel: usize,
    /// Its rotation about z relative to the fixed side of that first link's joint.
    pub(crate) absolute: AxisRotation,
    /// The axis (0 to 2) of its parent's frame that its joint is parallel to, and whether the directions are equal.
    pub(crate) axis: Option<(usize, bool)>,
    /// The position without its component along that axis, m.
    pub(crate) across: SymbolicVector,
    /// The component along the joint's own axis, m.
    pub(crate) along: ExprId,
}

impl TreeLink {
    /// Whether it moves relative to its parent, or freely.
    pub(crate) fn is_moving(&self) -> bool {
        !self.turns.is_empty() || !self.slides.is_empty() || self.free.is_some()
    }

    /// Components, in the axes of the model file behind the joint, of a vector given in the link's own axes.
    pub(crate) fn to_named_axes(&self, graph: &mut Graph, v: &SymbolicVector) -> SymbolicVector {
        match rotation_from_z(self.named_axis) {
            Some((axis, pi12)) => graph.rotate_out(&fixed_rotation(axis, pi12), v),
            None => *v,
        }
    }

    /// Determines the axis of the joint in the parent's frame, and splits the position by it.
    fn find_axis(&mut self, graph: &mut Graph) {
        if self.free.is_some() {
            return;
        }
        // The direction of z in the parent's frame.
        let z = [Graph::ZERO, Graph::ZERO, Graph::ONE];
        let z = self.pre.iter().rev().fold(z, |v, turn| graph.rotate_out(turn, &v));
        let minus = graph.neg(Graph::ONE);
        (self.across, self.along, self.axis) = (self.position, Graph::ZERO, None);
        // The joint is along an axis of the parent if exactly one component is 1 or -1.
        let mut nonzero = (0..3).filter(|i| z[*i] != Graph::ZERO);
        if let (Some(axis), None) = (nonzero.next(), nonzero.next())
            && (z[axis] == Graph::ONE || z[axis] == minus)
        {
            let positive = z[axis] == Graph::ONE;
            let along = std::mem::replace(&mut self.across[axis], Graph::ZERO);
            self.along = if positive { along } else { graph.neg(along) };
            self.axis = Some((axis, positive));
        }
    }
}

/// All links; parents stand before their children.
#[derive(Clone, Debug)]
pub(crate) struct KinematicTree {
    /// The links.
    pub(crate) links: Vec<TreeLink>,
    /// The link that carries each frame of the file, by the frame's index; `None` for the base.
    pub(crate) of_frame: Vec<Option<usize>>,
}

impl KinematicTree {
    /// Builds the links of every frame of a mechanism.
    ///
    /// # Errors
    /// A [`DeriveError`] of a length that cannot be written as an expression.
    pub(crate) fn new(graph: &mut Graph, mechanism: &Mechanism) -> Result<Self, DeriveError> {
        let mut tree = Self {
            links: Vec::new(),
            of_frame: vec![None],
        };
        for frame in &mechanism.frames[1..] {
            let mut builder = Builder::new(tree.of_frame[frame.parent.0]);
            for step in &frame.steps {
                builder.add_step(graph, &mut tree.links, step)?;
            }
            let link = builder.finish(&mut tree.links);
            tree.of_frame.push(Some(link));
        }
        for link in &mut tree.links {
            link.find_axis(graph);
        }
        Ok(tree)
    }

    /// The same tree with every link's quantities in the axes of the fixed side of the first of its parallel joints, so
    /// that there is no rotation between parallel links, and the rotation from each link's own axes to these.
    pub(crate) fn to_fixed_axes(&self, graph: &mut Graph) -> (Self, Vec<AxisRotation>) {
        let mut fixed = self.clone();
        for (i, link) in fixed.links.iter_mut().enumerate() {
            let own = &self.links[i];
            link.joint = NO_TURN;
            link.absolute = NO_TURN;
            link.first_parallel = i;
            let Some(parent) = own.parent else { continue };
            // Positions are given in the parent's new axes.
            let turned = &self.links[parent].absolute;
            link.position = graph.rotate_out(turned, &own.position);
            // Where the axis changes direction, the parent's rotation comes before the fixed ones.
            if own.first_parallel == i {
                link.pre.clear();
                for turn in std::iter::once(turned).chain(&own.pre) {
                    push_rotation(&mut link.pre, turn);
                }
            } else {
                link.pre.clear();
            }
        }
        for link in &mut fixed.links {
            link.find_axis(graph);
        }
        let turns = self.links.iter().map(|link| link.absolute.clone());
        (fixed, turns.collect())
    }

    /// The link that carries a frame of the file; `None` for the base.
    pub(crate) fn link_of(&self, frame: FrameIdx) -> Option<usize> {
        self.of_frame[frame.0]
    }

    /// The links from the first one on the base down to `link`.
    pub(crate) fn path_to(&self, link: Option<usize>) -> Vec<usize> {
        let mut path = Vec::new();
        let mut next = link;
        while let Some(i) = next {
            path.push(i);
            next = self.links[i].parent;
        }
        path.reverse();
        path
    }

    /// Components in the link's frame of a vector given in its parent's frame.
    pub(crate) fn to_link(&self, graph: &mut Graph, link: usize, v: &SymbolicVector) -> SymbolicVector {
        let link = &self.links[link];
        let mut v = *v;
        for turn in &link.pre {
            v = graph.rotate_in(turn, &v);
        }
        graph.rotate_in(&link.joint, &v)
    }
}

/// The fixed rotation, by its axis and its multiple of pi/12, that maps z to an axis of the model file; `None` for z
/// itself.
fn rotation_from_z(axis: FrameAxis) -> Option<(FrameAxis, i32)> {
    match axis {
        FrameAxis::X => Some((FrameAxis::Y, 6)),
        FrameAxis::Y => Some((FrameAxis::X, -6)),
        FrameAxis::Z => None,
    }
}

/// A constant rotation by a multiple of pi/12.
fn fixed_rotation(axis: FrameAxis, pi12: i32) -> AxisRotation {
    AxisRotation {
        axis,
        sum: AtomAngleSum::NONE,
        pi12,
    }
}

/// Collects elementary steps into links: a link ends where the next step does not commute with its joint.
struct Builder {
    /// The link that carries the one being built.
    parent: Option<usize>,
    /// Fixed rotations before the joint.
    pre: Vec<AxisRotation>,
    /// Axis of the file about or along which the joint moves.
    named: FrameAxis,
    /// Position of the origin in the parent's frame, m.
    position: SymbolicVector,
    /// Rotation of the joint about z.
    joint: AxisRotation,
    /// Coordinates that rotate, with their factors.
    turns: Vec<(usize, i32)>,
    /// Coordinates that translate, with their factors.
    slides: Vec<(usize, Rational)>,
    /// Free motion, if it is a free body.
    free: Option<FreeBody>,
}

/// No rotation about z.
const NO_TURN: AxisRotation = AxisRotation {
    axis: FrameAxis::Z,
    sum: AtomAngleSum::NONE,
    pi12: 0,
};

impl Builder {
    /// A link without any steps yet.
    fn new(parent: Option<usize>) -> Self {
        Self {
            parent,
            pre: Vec::new(),
            named: FrameAxis::Z,
            position: vector::ZERO,
            joint: NO_TURN,
            turns: Vec::new(),
            slides: Vec::new(),
            free: None,
        }
    }

    /// Whether a coordinate moves the link so far.
    fn has_joint(&self) -> bool {
        !self.turns.is_empty() || !self.slides.is_empty()
    }

    /// Adds one step of the model file; may end the link and begin another.
    fn add_step(&mut self, graph: &mut Graph, links: &mut Vec<TreeLink>, step: &FrameStep) -> Result<(), DeriveError> {
        match step {
            // In a valid file this is the only step of a frame on the base.
            FrameStep::Free(body) => self.free = Some(*body),
            FrameStep::Rotate(axis, angle) => {
                let (sum, pi12) = expressions::angle_sum(angle);
                // The coordinates in the angle make the step a joint.
                let turns: Vec<(usize, i32)> = sum
                    .terms()
                    .iter()
                    .filter_map(|(atom, n)| {
                        if let Atom::Coordinate(i) = atom {
                            Some((*i, *n))
                        } else {
                            None
                        }
                    })
                    .collect();
                let turn = AxisRotation { axis: *axis, sum, pi12 };
                self.add_step_about_z(graph, links, *axis, !turns.is_empty(), |builder, _, axis| {
                    // Fixed rotations before a joint stay separate; after it they are part of the joint's angle.
                    if turns.is_empty() && !builder.has_joint() {
                        push_rotation(&mut builder.pre, &AxisRotation { axis, ..turn.clone() });
                    } else {
                        builder.joint.sum = builder.joint.sum.plus(&turn.sum, 1);
                        builder.joint.pi12 = (builder.joint.pi12 + turn.pi12).rem_euclid(24);
                        builder.turns.extend(&turns);
                    }
                });
            }
            FrameStep::Translate(axis, length) => {
                let value = expressions::length(graph, length)?;
                let slides: Vec<(usize, Rational)> = length
                    .coordinates
                    .iter()
                    .map(|(c, k)| (c.0, Rational::from(k.clone())))
                    .collect();
                self.add_step_about_z(graph, links, *axis, !slides.is_empty(), |builder, graph, axis| {
                    // The translation in the axes of the parent.
                    let mut along = vector::ZERO;
                    along[axis as usize] = value;
                    for turn in builder.pre.iter().rev() {
                        along = graph.rotate_out(turn, &along);
                    }
                    builder.position = graph.add_vectors(&[builder.position, along]);
                    builder.slides.extend(slides.iter().cloned());
                });
            }
        }
        Ok(())
    }

    /// Applies a step; if it moves, its axis is first rotated to z. A new link begins if the step cannot join the
    /// present one.
    fn add_step_about_z(
        &mut self,
        graph: &mut Graph,
        links: &mut Vec<TreeLink>,
        axis: FrameAxis,
        moves: bool,
        apply: impl Fn(&mut Self, &mut Graph, FrameAxis),
    ) {
        if self.has_joint() && axis != FrameAxis::Z {
            self.close_link(links);
        }
        let Some((about, pi12)) = rotation_from_z(axis).filter(|_| moves) else {
            apply(self, graph, axis);
            return;
        };
        // A = Ry(pi/2) maps z to x, and A = Rx(-pi/2) maps z to y. Motion about x is A (motion about z) A^-1.
        push_rotation(&mut self.pre, &fixed_rotation(about, pi12));
        self.named = axis;
        apply(self, graph, FrameAxis::Z);
        self.close_link(links);
        push_rotation(&mut self.pre, &fixed_rotation(about, -pi12));
    }

    /// Ends the present link and begins an empty one on it.
    fn close_link(&mut self, links: &mut Vec<TreeLink>) {
        let fresh = Self::new(Some(links.len()));
        let done = std::mem::replace(self, fresh);
        // The axis is parallel to the parent's if only rotations about z lie between them.
        let parallel = done
            .parent
            .filter(|parent| links[*parent].free.is_none())
            .filter(|_| done.pre.iter().all(|turn| turn.axis == FrameAxis::Z));
        let mut absolute = NO_TURN;
        let mut first_parallel = links.len();
        // Angles of parallel joints add up.
        if let Some(parent) = parallel {
            first_parallel = links[parent].first_parallel;
            absolute = links[parent].absolute.clone();
            for turn in &done.pre {
                absolute.sum = absolute.sum.plus(&turn.sum, 1);
                absolute.pi12 += turn.pi12;
            }
        }
        absolute.sum = absolute.sum.plus(&done.joint.sum, 1);
        absolute.pi12 = (absolute.pi12 + done.joint.pi12).rem_euclid(24);
        links.push(TreeLink {
            parent: done.parent,
            pre: done.pre,
            named_axis: done.named,
            joint: done.joint,
            position: done.position,
            turns: done.turns,
            slides: done.slides,
            free: done.free,
            first_parallel,
            absolute,
            axis: None,
            across: done.position,
            along: Graph::ZERO,
        });
    }

    /// Ends the last link and returns its index.
    fn finish(mut self, links: &mut Vec<TreeLink>) -> usize {
        self.close_link(links);
        links.len() - 1
    }
}
