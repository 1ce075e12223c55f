//! A sufficient set of the loops' equations: residuals go in, and as many of them as needed come out.
//!
//! Decision: two points on one axis close a revolute joint with one equation too many, and no linear relation shows
//! it. If there are more equations than passive coordinates, those that determine them best at the nominal pose are
//! selected, provided that the others are satisfied too at poses around it.

use modelmill_algebra::field::RandomStream;
use modelmill_spec::Mechanism;
use nalgebra::DMatrix;

use super::magnitude;
use super::numeric_poses::NumericLoops;
use crate::DeriveError;
use crate::expr::independent::independent_functions;
use crate::expr::{ExprId, Graph};

/// The residuals without those that are constant combinations of others, such as those of a planar loop in a tilted
/// frame.
///
/// # Errors
/// As [`independent_functions`].
pub(super) fn independent_residuals(graph: &Graph, residual: &[ExprId]) -> Result<Vec<ExprId>, DeriveError> {
    let columns = independent_functions(graph, residual)?;
    Ok(columns.into_iter().map(|i| residual[i]).collect())
}

/// As many equations as there are passive coordinates, and those that depend on them.
pub(super) struct SufficientResiduals {
    /// The selected residuals, in their order.
    pub(super) selected: Vec<ExprId>,
    /// The other ones.
    pub(super) dependent: Vec<ExprId>,
    /// The largest value of any residual at poses near the nominal one, relative to the size of the loops: rounding, and
    /// the contradiction of rounded lengths.
    pub(super) contradiction: f64,
}

/// As many residuals as there are passive coordinates, if the others depend on them. For example, two points on the
/// axis of a joint that both coincide with two others give one equation too many, because their distance is equal on
/// both sides.
///
/// This is checked numerically, at poses around the nominal one at which all residuals vanish. The equations that
/// determine the passive coordinates best at the nominal pose are selected.
///
/// `None` if the loops cannot be followed, or if no selection determines the passive coordinates at every pose.
pub(super) fn sufficient_residuals(
    graph: &mut Graph,
    mechanism: &Mechanism,
    residual: &[ExprId],
    n_passive: usize,
) -> Option<SufficientResiduals> {
    /// Number of poses in addition to the nominal one.
    const POSES: usize = 6;
    /// Number of draws for them: in some directions the loops end near the nominal pose.
    const DRAWS: usize = 24;
    /// How far away these are, in rad or relative to the largest loop equation.
    const REACH: f64 = 0.05;
    /// How often the distance to a pose may be halved where a loop ends before it. At the least distance an equation
    /// that does not depend on the others is off by the square of 3e-3, far above `CLOSED`.
    const HALVINGS: i32 = 4;
    /// Residuals relative to the size of the loops that count as zero.
    const CLOSED: f64 = 1e-7;
    /// Singular values relative to the largest that count as zero.
    const SINGULAR: f64 = 1e-7;
    let size = magnitude::nominal_magnitude(graph, mechanism, residual);
    let loops = NumericLoops::new(graph, mechanism, residual);
    let mut stream = RandomStream::new(5);
    let mut poses = vec![loops.closed_nominal_pose()?];
    let drawn = (0..DRAWS).filter_map(|_| loops.random_pose_within(REACH, HALVINGS, &mut stream));
    poses.extend(drawn.take(POSES));
    if poses.len() <= POSES {
        return None;
    }
    // Full rank by the passive coordinates.
    let is_regular = |jacobian: &DMatrix<f64>| {
        let values = jacobian.clone().svd(false, false).singular_values;
        values.len() == n_passive && values.min() > SINGULAR * values.max()
    };
    let mut chosen: Option<Vec<usize>> = None;
    let mut contradiction = 0.0_f64;
    for q in &poses {
        let (gaps, mut jacobian) = loops.linearise(q)?;
        let passive = (0..mechanism.coordinates.len()).filter(|i| mechanism.coordinates[*i].passive);
        for (mut column, i) in jacobian.column_iter_mut().zip(passive) {
            column *= loops.coordinate_unit(i);
        }
        contradiction = contradiction.max(gaps.amax() / size);
        if contradiction > CLOSED || !is_regular(&jacobian) {
            return None;
        }
        // Rows are selected at the nominal pose and must be sufficient at all poses.
        let rows = chosen.get_or_insert_with(|| best_conditioned_rows(&jacobian, n_passive));
        if !is_regular(&jacobian.select_rows(rows.iter())) {
            return None;
        }
    }
    let rows = chosen?;
    let (selected, dependent): (Vec<usize>, Vec<usize>) = (0..residual.len()).partition(|i| rows.contains(i));
    let of = |rows: Vec<usize>| rows.into_iter().map(|i| residual[i]).collect();
    Some(SufficientResiduals {
        selected: of(selected),
        dependent: of(dependent),
        contradiction,
    })
}

/// Rows of a matrix that span its row space well, at most `n`: each time the row with the largest norm orthogonal to
/// those before it (Gram-Schmidt with pivoting). Indices are returned in increasing order.
pub(crate) fn best_conditioned_rows(matrix: &DMatrix<f64>, n: usize) -> Vec<usize> {
    let mut rest = matrix.clone();
    let mut chosen = Vec::new();
    for _ in 0..n.min(matrix.nrows()) {
        let norms: Vec<f64> = rest.row_iter().map(|row| row.norm()).collect();
        let best = (0..norms.len()).fold(0, |best, i| if norms[i] > norms[best] { i } else { best });
        if norms[best] <= 0.0 {
            break;
        }
        // The chosen direction is removed from all rows.
        let direction = rest.row(best) / norms[best];
        let shares = &rest * direction.transpose();
        rest -= shares * direction;
        chosen.push(best);
    }
    chosen.sort_unstable();
    chosen
}
