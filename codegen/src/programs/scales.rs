//! Scales with which Newton's method on the loops compares residuals and steps.

use std::collections::HashMap;

use modelmill_spec::Mechanism;

use crate::expr::{ExprId, Graph, Rational, Unary, coordinates_of};
use crate::loops::KinematicLoops;
use crate::loops::magnitude::expression_magnitude;

/// Largest value of a dependent residual, relative to its scale, that counts as zero. By judgement: lengths that contradict
/// each other by measurement are off by less, and another assembly soon by more.
const CONTRADICTION: f64 = 1e-3;

/// A contradiction may be this many times the change of constants with which all equations agree. By judgement: the
/// change is the least one, and residuals add several.
const PER_CHANGE: f64 = 10.0;

/// Scales of the residuals, of the passive coordinates and of the active ones, in this order.
///
/// The scale of a residual is the sum of the magnitudes of its terms, with a sine counted as 1. The scale of a
/// coordinate is 1 for an angle, the sum of its residuals' scales for a length, and 0 if no loop depends on it.
///
/// In loops with more equations than unknowns, the selected equations may have a solution at which the others do not hold:
/// another assembly, which the mechanism does not have. There the scale of the first residual is negative, with which the
/// loops never count as closed. `change` is the relative change of constants with which all equations agree.
pub(crate) fn residual_scales(
    graph: &mut Graph,
    mechanism: &Mechanism,
    loops: &KinematicLoops,
    change: f64,
) -> Vec<ExprId> {
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
    if let (Some(first), false) = (scales.first_mut(), loops.dependent_residual.is_empty()) {
        let sizes: Vec<(ExprId, ExprId)> = (loops.dependent_residual.iter())
            .map(|r| (*r, expression_magnitude(graph, mechanism, &mut known, *r)))
            .collect();
        let factor = one_if_all_small(graph, &sizes, CONTRADICTION.max(PER_CHANGE * change));
        *first = graph.mul(factor, *first);
    }
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

/// 1 where all residuals are below the share `limit` of their sizes in absolute value, and a negative number elsewhere.
fn one_if_all_small(graph: &mut Graph, residuals: &[(ExprId, ExprId)], limit: f64) -> ExprId {
    #[expect(clippy::cast_possible_truncation, reason = "a share has few millionths")]
    let limit = Rational::new((limit.min(1.0) * 1e6).ceil() as i64, 1_000_000);
    let mut sum = Graph::ZERO;
    for (residual, size) in residuals {
        let most = graph.scale(*size, &limit);
        let absolute = graph.unary(Unary::Abs, *residual);
        let rest = graph.sub(most, absolute);
        let sign = graph.unary(Unary::Sign, rest);
        sum = graph.add(sum, sign);
    }
    // The sum of n signs is n where all are positive, and at most n - 1 elsewhere.
    let twice = graph.scale(sum, &Rational::integer(2));
    #[expect(clippy::cast_possible_wrap, reason = "a mechanism has few equations")]
    let most = graph.integer(2 * residuals.len() as i64 - 1);
    graph.sub(twice, most)
}
