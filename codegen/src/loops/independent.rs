//! Which of the loops' equations are enough.
//!
//! Decision: two points on one axis close a revolute joint with one equation too many, and no linear relation shows
//! it. If there are more equations than passive coordinates, those are kept that determine them best at the nominal
//! pose, provided that the others hold too at poses around it.

use modelmill_algebra::field::Stream;
use modelmill_spec::Mechanism;
use nalgebra::DMatrix;

use super::magnitude;
use super::numeric_poses::NumericLoops;
use crate::DeriveError;
use crate::expr::independent::independent_functions;
use crate::expr::{ExprId, Graph};

/// The residuals without those that are constant combinations of others (a planar loop seen in a tilted frame).
pub(super) fn independent(graph: &Graph, residual: &[ExprId]) -> Result<Vec<ExprId>, DeriveError> {
    let columns = independent_functions(graph, residual)?;
    Ok(columns.into_iter().map(|i| residual[i]).collect())
}

/// As many residuals as there are passive coordinates, if the others follow from them: two points on the axis of a joint
/// that both coincide with two others leave one equation too many, since their distance is the same on both sides.
///
/// That this is so is seen in numbers, at poses around the nominal one at which all residuals vanish. Those equations are
/// taken that determine the passive coordinates best at the nominal pose.
pub(super) fn sufficient(
    graph: &mut Graph,
    mechanism: &Mechanism,
    residual: &[ExprId],
    n_passive: usize,
) -> Option<Vec<ExprId>> {
    /// Poses that are looked at besides the nominal one, and how far away, in rad or relative to the size of the loops.
    const POSES: usize = 6;
    const REACH: f64 = 0.05;
    /// Residuals relative to the size of the loops, and singular values relative to the largest, that count as zero.
    const CLOSED: f64 = 1e-7;
    const SINGULAR: f64 = 1e-7;
    let size = magnitude::at_nominal(graph, mechanism, residual);
    let loops = NumericLoops::new(graph, mechanism, residual);
    let mut stream = Stream::new(5);
    let mut poses = vec![loops.nominal()?];
    for _ in 0..POSES {
        poses.push(loops.random(REACH, &mut stream)?);
    }
    let is_regular = |jacobian: &DMatrix<f64>| {
        let values = jacobian.clone().svd(false, false).singular_values;
        values.len() == n_passive && values.min() > SINGULAR * values.max()
    };
    let mut chosen: Option<Vec<usize>> = None;
    for q in &poses {
        let (gaps, mut jacobian) = loops.linearise(q)?;
        let passive =
            (0..mechanism.coordinates.len()).filter(|i| mechanism.coordinates[*i].passive);
        for (mut column, i) in jacobian.column_iter_mut().zip(passive) {
            column *= loops.unit(i);
        }
        if gaps.amax() > CLOSED * size || !is_regular(&jacobian) {
            return None;
        }
        let rows = chosen.get_or_insert_with(|| most_different_rows(&jacobian, n_passive));
        if !is_regular(&jacobian.select_rows(rows.iter())) {
            return None;
        }
    }
    Some(chosen?.into_iter().map(|i| residual[i]).collect())
}

/// Rows of a matrix that span its row space well: each time the one of which most is left.
pub(crate) fn most_different_rows(matrix: &DMatrix<f64>, n: usize) -> Vec<usize> {
    let mut rest = matrix.clone();
    let mut chosen = Vec::new();
    for _ in 0..n.min(matrix.nrows()) {
        let norms: Vec<f64> = rest.row_iter().map(|row| row.norm()).collect();
        let best =
            (0..norms.len()).fold(0, |best, i| if norms[i] > norms[best] { i } else { best });
        if norms[best] <= 0.0 {
            break;
        }
        let direction = rest.row(best) / norms[best];
        let shares = &rest * direction.transpose();
        rest -= shares * direction;
        chosen.push(best);
    }
    chosen.sort_unstable();
    chosen
}
