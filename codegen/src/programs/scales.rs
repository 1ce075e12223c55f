//! Scales with which Newton's method on the loops compares residuals and steps.

use std::collections::HashMap;

use modelmill_spec::Mechanism;

use crate::expr::{ExprId, Graph, coordinates_of};
use crate::loops::KinematicLoops;
use crate::loops::magnitude::expression_magnitude;

/// Scales of the residuals, of the passive coordinates and of the active ones, in this order.
///
/// The scale of a residual is the sum of the magnitudes of its terms, with a sine counted as 1. The scale of a
/// coordinate is 1 for an angle, the sum of its residuals' scales for a length, and 0 if no loop depends on it.
pub(crate) fn residual_scales(graph: &mut Graph, mechanism: &Mechanism, loops: &KinematicLoops) -> Vec<ExprId> {
    let mut known = HashMap::new();
    let residuals: Vec<ExprId> = loops
        .residual
        .iter()
        .map(|r| expression_magnitude(graph, mechanism, &mut known, *r))
        .collect();
    // Coordinates on which each residual depends.
    let of: Vec<Vec<usize>> = loops.residual.iter().map(|r| coordinates_of(graph, &[*r])).collect();
    // Residuals first, then coordinates.
    let mut scales = residuals.clone();
    for i in loops.passive.iter().chain(&loops.active) {
        let rows = residuals.iter().zip(&of).filter(|(_, of)| of.contains(i));
        let rows: Vec<ExprId> = rows.map(|(scale, _)| *scale).collect();
        let is_angle = mechanism.coordinates[*i].motion.is_angle();
        scales.push(if is_angle && !rows.is_empty() {
            Graph::ONE
        } else {
            graph.add_all(&rows)
        });
    }
    scales
}
