//! Recursive Newton-Euler equations on the tree (Luh, Walker and Paul 1980; linear in the inertial parameters as in
//! Khalil and Kleinfinger 1987), in several forms of equal value and different cost.
//!
//! `motion` is the forward recursion: every link's motion in its own frame. `body` turns a link's inertia into the
//! wrench that moves it; `backward` carries wrenches down to the base and reads off, at each joint, the generalised
//! force of its coordinate; `project` reads off the same forces in one frame for all joints above it.

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

/// What a link's inertia is linear in. The first moment stands twice: as the balance of forces sees it and as the
/// balance of moments sees it; the two agree except for lumped masses that are placed apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum InertiaElement {
    Mass,
    ForceMoment(usize),
    MomentMoment(usize),
    /// Position in xx, xy, xz, yy, yz, zz.
    Inertia(usize),
}

/// Number of elements.
pub(crate) const ELEMENTS: usize = 13;

impl InertiaElement {
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
    pub(crate) force: SymbolicVector,
    pub(crate) moment: SymbolicVector,
}

impl SymbolicWrench {
    fn has_force(&self) -> bool {
        self.force != vector::ZERO
    }
}

/// The frame of a wrench on a link: it turns with the joint or stands on the fixed side of it. Their origins agree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum JointSide {
    Moving,
    Fixed,
}

/// How the recursions are written; all styles give the same values at different cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct RecursionStyle {
    /// Several parallel axes are passed at once, with the sum of their angles, rather than link by link.
    pub(crate) across_parallel_axes: bool,
    /// The acceleration of points on a joint's axis is the same on both sides of it. So that column of
    /// `[alpha]x + [omega]x [omega]x` is turned from the parent, and what it implies is not computed again.
    pub(crate) axis_column: bool,
    /// An offset along the joint's own axis is passed on the link's side, where the axis is z.
    pub(crate) offset_after_turn: bool,
}

impl RecursionStyle {
    /// The recursion of the textbooks.
    pub(crate) const PLAIN: Self = Self {
        across_parallel_axes: false,
        axis_column: false,
        offset_after_turn: false,
    };

    /// The link before whose joint vectors are turned, on the way to `link`.
    fn first_rotated_link(self, tree: &KinematicTree, link: usize) -> usize {
        if self.across_parallel_axes {
            tree.links[link].first_parallel
        } else {
            link
        }
    }

    /// The turn about z from the fixed side of [`Self::first`] to the link.
    pub(crate) fn joint_rotation(self, link: &TreeLink) -> &AxisRotation {
        if self.across_parallel_axes {
            &link.absolute
        } else {
            &link.joint
        }
    }

    /// A link's position in its parent's frame, but for what lies along its own axis, and that.
    fn split_position(self, link: &TreeLink) -> (SymbolicVector, ExprId) {
        if self.offset_after_turn {
            (link.across, link.along)
        } else {
            (link.position, Graph::ZERO)
        }
    }
}

/// Components behind several turns of a vector given before them.
pub(crate) fn rotate_into_inner(
    graph: &mut Graph,
    turns: &[AxisRotation],
    v: &SymbolicVector,
) -> SymbolicVector {
    turns.iter().fold(*v, |v, turn| graph.rotate_in(turn, &v))
}

/// Components before several turns of a vector given behind them.
fn rotate_into_outer(
    graph: &mut Graph,
    turns: &[AxisRotation],
    v: &SymbolicVector,
) -> SymbolicVector {
    turns
        .iter()
        .rev()
        .fold(*v, |v, turn| graph.rotate_out(turn, &v))
}
