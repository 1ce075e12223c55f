//! Scales with which Newton's method on the loops compares residuals and steps.

use std::collections::HashMap;

use modelmill_spec::Mechanism;

use crate::expr::{ExprId, Graph, Rational, Unary, coordinates_of, nominal_value};
use crate::loops::KinematicLoops;
use crate::loops::magnitude::{expression_magnitude, nominal_magnitude};

/// A dependent residual counts as zero up to this share of its size. By judgement: nearer to a pose at which assemblies
/// meet they cannot be distinguished.
const CLOSED: f64 = 1e-7;

/// The same as a multiple of the contradiction at the nominal pose: rounded lengths contradict each other more elsewhere.
const CONTRADICTION_SHARE: f64 = 1e3;

/// Largest limit that these two may give, as a share of the size.
const WIDEST: f64 = 1e-3;

/// A dependent residual is compared where its size is at least this share of the size of all loops. Smaller ones are the
/// rounding of lengths that cancel each other, which no sum of forces depends on.
const LEAST_SIZE: f64 = 1e-4;

/// Scales of the residuals, of the passive coordinates and of the active ones, in this order.
///
/// The scale of a residual is the sum of the magnitudes of its terms, with a sine counted as 1. The scale of a
/// coordinate is 1 for an angle, the sum of its residuals' scales for a length, and 0 if no loop depends on it.
///
/// In loops with more equations than unknowns, the selected equations may have a solution at which the others do not hold:
/// another assembly, which the mechanism does not have. There the scale of the first residual is negative, with which the
/// loops never count as closed.
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
    let total = nominal_magnitude(graph, mechanism, &loops.residual);
    let mut sizes = Vec::new();
    for r in &loops.dependent_residual {
        let size = expression_magnitude(graph, mechanism, &mut known, *r);
        if nominal_value(graph, mechanism, size).is_some_and(|size| size > LEAST_SIZE * total) {
            sizes.push((*r, size));
        }
    }
    if let (Some(first), false) = (scales.first_mut(), sizes.is_empty()) {
        let factor = one_if_all_small(
            graph,
            &sizes,
            (CONTRADICTION_SHARE * loops.contradiction).clamp(CLOSED, WIDEST),
        );
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

/// 1 where all residuals are below the share `limit` of their sizes, and a negative number elsewhere.
fn one_if_all_small(graph: &mut Graph, residuals: &[(ExprId, ExprId)], limit: f64) -> ExprId {
    #[expect(clippy::cast_possible_truncation, reason = "at most 1e7")]
    let limit = Rational::new(1, limit.recip().round() as i64);
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
