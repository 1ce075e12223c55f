//! Effects with mechanics of their own, see [`Mechanics`]: one file for each kind that needs forces.

mod rod;
mod strut;

use modelmill_spec::{Mechanics, Mechanism, ModelEffect, PointIdx};

use crate::DeriveError;
use crate::expr::vector::SymbolicVector;
use crate::expr::{ExprId, Graph};
use crate::regressor::projection::LoopProjection;
use crate::tree::KinematicTree;

/// Generalised forces of an effect on all coordinates of the open tree, `[i][t][c]`: for its i-th place, for term `t`
/// with a parameter of one, on coordinate `c`. Empty if the effect needs none.
pub(crate) fn generalised_forces(
    graph: &mut Graph,
    mechanism: &Mechanism,
    tree: &KinematicTree,
    projection: &LoopProjection,
    gravity: &SymbolicVector,
    effect: &ModelEffect,
) -> Result<Vec<Vec<Vec<ExprId>>>, DeriveError> {
    match effect.mechanics {
        Some(Mechanics::Rod) => rod::generalised_forces(graph, mechanism, tree, projection, gravity, effect),
        Some(Mechanics::Strut) => strut::generalised_forces(graph, mechanism, tree, effect),
        // Their bodies are part of the mechanism's, and gravity is rotated already.
        Some(Mechanics::Placement | Mechanics::Part | Mechanics::Tilt | Mechanics::Delay) | None => Ok(Vec::new()),
    }
}

/// Forces at points, in the axes of the base, that balance an effect with given values of its parameters, N.
pub(crate) fn point_forces(
    graph: &mut Graph,
    mechanism: &Mechanism,
    tree: &KinematicTree,
    projection: &LoopProjection,
    gravity: &SymbolicVector,
    effect: &ModelEffect,
    values: &[ExprId],
) -> Result<Vec<(PointIdx, SymbolicVector)>, DeriveError> {
    match effect.mechanics {
        Some(Mechanics::Rod) => rod::point_forces(graph, mechanism, tree, projection, gravity, effect, values),
        Some(Mechanics::Strut) => strut::point_forces(graph, mechanism, tree, effect, values),
        Some(Mechanics::Placement | Mechanics::Part | Mechanics::Tilt | Mechanics::Delay) | None => Ok(Vec::new()),
    }
}
