//! Recursive Newton-Euler equations on the tree (Luh, Walker and Paul 1980; linear in the inertial parameters as in
//! Khalil and Kleinfinger 1987), in several forms of equal value and different cost.
//!
//! The tree and its inertia go in, and the generalised forces of all coordinates come out, as expressions.
//!
//! `motion` is the forward recursion: every link's motion in its own frame. `body` computes the wrench that moves a
//! link from its inertia and motion. `backward` carries wrenches down to the base and adds to each joint the
//! generalised force of its coordinate. `project` computes the same forces in one frame for all joints above it.

mod backward;
mod body;
mod composite;
pub(crate) mod inertia;
mod joints;
mod motion;
mod project;
mod rows;

use crate::expr::vector::{self, AxisRotation, SymbolicVector};
use crate::expr::{ExprId, Graph};
use crate::tree::{KinematicTree, TreeLink};

pub(crate) use backward::{CarryDepths, backward_recursion, carry_wrench};
pub(crate) use body::{BodyInertia, InertiaDiagonal, flatten_along_axes, wrenches};
pub(crate) use composite::mass_matrix;
pub(crate) use joints::{JointLoad, joint_wrenches};
pub(crate) use motion::{TreeMotion, forward_recursion};
pub(crate) use project::JointAxisCache;

/// An element in which a link's inertia is linear. The first moment occurs twice: in the balance of forces and in the
/// balance of moments. The two are equal except for lumped masses with different places in the two balances.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum InertiaElement {
    /// Mass, kg.
    Mass,
    /// First moment along an axis (0 to 2) in the balance of forces, kg m.
    ForceMoment(usize),
    /// First moment along an axis (0 to 2) in the balance of moments, kg m.
    MomentMoment(usize),
    /// Entry of the inertia matrix about the link's origin, kg m^2, by its position in xx, xy, xz, yy, yz, zz.
    Inertia(usize),
}

/// Number of elements: one mass, two first moments and six entries of the inertia matrix.
pub(crate) const ELEMENTS: usize = 13;

impl InertiaElement {
    /// Position of the element in [`InertiaFactors`].
    pub(crate) fn index(self) -> usize {
        match self {
            Self::Mass => 0,
            Self::ForceMoment(i) => 1 + i,
            Self::MomentMoment(i) => 4 + i,
            Self::Inertia(i) => 7 + i,
        }
    }
}

/// Inertia of one link: a factor for every [`InertiaElement`].
pub(crate) type InertiaFactors = [ExprId; ELEMENTS];

/// A force and a moment about the origin of a link, in one of the link's two frames.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SymbolicWrench {
    /// Force, N.
    pub(crate) force: SymbolicVector,
    /// Moment about the origin, N m.
    pub(crate) moment: SymbolicVector,
}

impl SymbolicWrench {
    /// Whether the force is not identically zero.
    fn has_force(&self) -> bool {
        self.force != vector::ZERO
    }
}

/// The frame of a wrench on a link: on the moving or on the fixed side of its joint. The two frames have the same
/// origin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum JointSide {
    /// The link's own frame, which rotates with the joint.
    Moving,
    /// The frame before the joint's rotation.
    Fixed,
}

/// How the recursions are written; all styles give the same values with different numbers of operations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct RecursionStyle {
    /// Several parallel axes are crossed at once, with the sum of their angles, instead of link by link.
    pub(crate) across_parallel_axes: bool,
    /// The acceleration of points on a joint's axis is equal on both sides of the joint. So that column of
    /// `[alpha]x + [omega]x [omega]x` is rotated from the parent, and quantities that depend on it are not computed
    /// again.
    pub(crate) axis_column: bool,
    /// An offset along the joint's own axis, if that is z, is handled in the link's frame.
    pub(crate) offset_after_turn: bool,
}

impl RecursionStyle {
    /// The recursion of the textbooks.
    pub(crate) const PLAIN: Self = Self {
        across_parallel_axes: false,
        axis_column: false,
        offset_after_turn: false,
    };

    /// The link at whose joint the rotation starts that leads to `link`: the first of parallel joints, or the link
    /// itself.
    fn first_rotated_link(self, tree: &KinematicTree, link: usize) -> usize {
        if self.across_parallel_axes {
            tree.links[link].first_parallel
        } else {
            link
        }
    }

    /// The rotation about z from the fixed side of [`Self::first_rotated_link`] to the link.
    pub(crate) fn joint_rotation(self, link: &TreeLink) -> &AxisRotation {
        if self.across_parallel_axes {
            &link.absolute
        } else {
            &link.joint
        }
    }

    /// A link's position in its parent's frame, split into the part across its own axis and the length along it, m.
    fn split_position(self, link: &TreeLink) -> (SymbolicVector, ExprId) {
        if self.offset_after_turn {
            (link.across, link.along)
        } else {
            (link.position, Graph::ZERO)
        }
    }
}

/// Components of a vector after several rotations, from its components before them.
pub(crate) fn rotate_into_inner(graph: &mut Graph, turns: &[AxisRotation], v: &SymbolicVector) -> SymbolicVector {
    turns.iter().fold(*v, |v, turn| graph.rotate_in(turn, &v))
}

/// Components of a vector before several rotations, from its components after them.
fn rotate_into_outer(graph: &mut Graph, turns: &[AxisRotation], v: &SymbolicVector) -> SymbolicVector {
    turns.iter().rev().fold(*v, |v, turn| graph.rotate_out(turn, &v))
}
