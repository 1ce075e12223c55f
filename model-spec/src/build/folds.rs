//! Warns of a nominal pose next to a fold, where two assembly modes of the loops meet and passive rates grow without bound.
//!
//! A mechanism with closed loops goes in; warnings come out. At a fold the determinant `D` of `J'J`, with the Jacobian `J` of
//! the closure equations by the passive coordinates, is zero. It falls in proportion to the distance of an independent
//! coordinate from the fold, so that `1/|d ln D/dq|` is this distance near one, and of the order of the mechanism elsewhere.

use crate::build::MechanismSpans;
use crate::build::thresholds::{FOLD_DISTANCE, FOLD_LENGTH_SHARE, FOLD_STEP};
use crate::diagnostic::{Diagnostic, DiagnosticLog};
use crate::mechanism::Mechanism;
use crate::numeric::{DenseRows, least_squares};
use crate::pose::loop_gaps;

/// Warns of each independent coordinate whose nominal value is next to a fold.
pub(super) fn warn_of_folds(mechanism: &Mechanism, places: &MechanismSpans, log: &mut DiagnosticLog) {
    if mechanism.loops.is_empty() {
        return;
    }
    let passive: Vec<usize> = (0..mechanism.coordinates.len())
        .filter(|i| mechanism.coordinates[*i].passive)
        .collect();
    let closed = loop_gaps(mechanism);
    let size = closed.size.max(1e-6);
    // Columns of angles and of lengths differ in size by far; fixed scales change no difference of logarithms.
    let scales: Vec<f64> = passive
        .iter()
        .map(|i| closed.rows.iter().map(|row| row[*i] * row[*i]).sum::<f64>().sqrt())
        .collect();
    for (i, coordinate) in mechanism.coordinates.iter().enumerate() {
        if coordinate.passive || coordinate.motion.is_quaternion() {
            continue;
        }
        let unit = if coordinate.motion.is_angle() {
            1.0
        } else {
            FOLD_LENGTH_SHARE * size
        };
        let logarithm = |by: f64| log_determinant(mechanism, &passive, &scales, (i, by * unit));
        // Positive if the fold lies above; both steps must agree, since rounding does not.
        let slope = |step: f64| Some((logarithm(-step)? - logarithm(step)?) / (2.0 * step));
        let (Some(near), Some(far)) = (slope(FOLD_STEP), slope(3.0 * FOLD_STEP)) else {
            continue;
        };
        if (near - far).abs() > 0.2 * near.abs() {
            continue;
        }
        let distance = near.abs().recip();
        if distance < FOLD_DISTANCE {
            let direction = if near > 0.0 { "above" } else { "below" };
            log.push(
                Diagnostic::warning(
                    places.coordinates[i],
                    "the nominal pose is next to a fold, where two ways to assemble the loops meet",
                )
                .label(format!(
                    "about {:.1e} {} {direction} this value the loops cannot close any more",
                    distance * unit,
                    coordinate.motion.unit()
                ))
                .help("choose a nominal pose in the middle of the motion: near a fold rates are large and the assembly mode is uncertain"),
            );
        }
    }
}

/// `ln det(J'J)` with one coordinate moved by a distance and the loops closed again; `None` if they do not close. Columns of J
/// are divided by `scales`.
fn log_determinant(mechanism: &Mechanism, passive: &[usize], scales: &[f64], (moved, by): (usize, f64)) -> Option<f64> {
    let mut at = mechanism.clone();
    at.coordinates[moved].nominal += by;
    for _ in 0..6 {
        let gaps = loop_gaps(&at);
        if gaps.values.iter().all(|x| x.abs() < 1e-14 * gaps.size) {
            break;
        }
        let step = least_squares(&passive_columns(&gaps.rows, passive), &gaps.values, 0.0)?;
        for (i, change) in passive.iter().zip(step) {
            at.coordinates[*i].nominal -= change;
        }
    }
    let gaps = loop_gaps(&at);
    let error = gaps.values.iter().map(|x| x.abs()).fold(0.0, f64::max);
    if error.is_nan() || error > 1e-9 * gaps.size {
        return None;
    }
    let mut rows = passive_columns(&gaps.rows, passive);
    for row in &mut rows {
        for (entry, scale) in row.iter_mut().zip(scales) {
            *entry /= scale;
        }
    }
    let n = passive.len();
    // Elimination of the positive definite matrix J'J; the pivots multiply to its determinant.
    let mut matrix: DenseRows = (0..n)
        .map(|a| (0..n).map(|b| rows.iter().map(|row| row[a] * row[b]).sum()).collect())
        .collect();
    let mut total = 0.0;
    for k in 0..n {
        let pivot = matrix[k][k];
        if pivot.is_nan() || pivot <= 0.0 {
            return None;
        }
        total += pivot.ln();
        let (done, rest) = matrix.split_at_mut(k + 1);
        for row in rest {
            let factor = row[k] / pivot;
            for (entry, above) in row.iter_mut().zip(&done[k]).skip(k) {
                *entry -= factor * above;
            }
        }
    }
    Some(total)
}

/// The columns of the passive coordinates.
fn passive_columns(rows: &DenseRows, passive: &[usize]) -> DenseRows {
    rows.iter()
        .map(|row| passive.iter().map(|i| row[*i]).collect())
        .collect()
}
