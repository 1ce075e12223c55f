//! Columns of a regressor along several recordings, joined in their order; every drive is decimated alike.

use modelmill_codegen::ModelEvaluator;
use modelmill_identify::diagnose::ForceColumn;

use crate::along::filter_and_decimate;
use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::segment::RecordingSegment;

/// Segments, each with whether it belongs to the validation runs.
pub(crate) type SegmentList<'a> = [(&'a RecordingSegment, bool)];

/// Columns of a regressor along all segments: `[column][drive][sample]`, zero columns empty.
///
/// Fails when a pose has no solution, or a segment is too short to be filtered.
pub(crate) fn regressor(
    all: &SegmentList<'_>,
    evaluator: &ModelEvaluator<'_>,
    model: &Model,
) -> Outcome<Vec<ForceColumn>> {
    regressor_of(all, evaluator, model, &|_| true)
}

/// As [`regressor`], for the columns that `wanted` selects; the others are zero.
///
/// Fails as [`regressor`] does.
pub(crate) fn regressor_of(
    all: &SegmentList<'_>,
    evaluator: &ModelEvaluator<'_>,
    model: &Model,
    wanted: &dyn Fn(usize) -> bool,
) -> Outcome<Vec<ForceColumn>> {
    let n_drives = model.row_names().len();
    let mut stacked: Vec<Option<Vec<f64>>> = Vec::new();
    let mut before = 0;
    // Each segment is filtered alone; a column that is zero up to here has no values yet.
    for (one, _) in all {
        let columns = nonzero_columns(one, evaluator, model, wanted)?;
        stacked.resize(columns.len(), None);
        let (slots, mut columns): (Vec<_>, Vec<_>) = (stacked.iter_mut().zip(columns))
            .filter_map(|(slot, column)| Some((slot, column?)))
            .unzip();
        // One value that is not finite spoils a filtered column; the complete segment is marked NaN.
        let mut is_none = vec![false; columns.len()];
        for (column, is_none) in columns.iter_mut().zip(&mut is_none) {
            if column.iter().any(|x| !x.is_finite()) {
                column.fill(0.0);
                *is_none = true;
            }
        }
        let columns = filter_and_decimate(columns, one)?.into_iter().zip(is_none);
        for (slot, (mut column, is_none)) in slots.into_iter().zip(columns) {
            if is_none {
                column.fill(f64::NAN);
            }
            slot.get_or_insert_with(|| vec![0.0; before]).extend(column);
        }
        // Columns that are zero along this segment are extended by zeros.
        before += one.samples().div_ceil(one.decimation());
        for column in stacked.iter_mut().flatten() {
            column.resize(before, 0.0);
        }
    }
    let n = stacked.len() / n_drives.max(1);
    // The evaluator returns drives outermost, columns within each drive.
    let mut by_column = vec![ForceColumn::default(); n];
    for (k, values) in stacked.into_iter().enumerate() {
        by_column[k % n].0.push(values);
    }
    Ok(by_column)
}

/// Columns along one segment, drive by drive; `None` where a column is zero throughout, as most are on most drives.
///
/// Fails when the mechanism cannot reach a pose.
fn nonzero_columns(
    one: &RecordingSegment,
    evaluator: &ModelEvaluator<'_>,
    model: &Model,
    wanted: &dyn Fn(usize) -> bool,
) -> Outcome<Vec<Option<Vec<f64>>>> {
    let mut columns: Vec<Option<Vec<f64>>> = Vec::new();
    let mut before = 0;
    let n_drives = model.row_names().len().max(1);
    // Columns that are not wanted are neither stored nor tested.
    let mut is_wanted: Vec<bool> = Vec::new();
    one.for_each_block(model, |states| {
        Ok::<_, Error>(evaluator.regressor_column_blocks(states, wanted, |samples, block| {
            if columns.is_empty() {
                let n = block.len() / n_drives;
                columns.resize(block.len(), None);
                is_wanted = (0..block.len()).map(|k| wanted(k % n)).collect();
            }
            let columns = columns.iter_mut().zip(block).zip(&is_wanted);
            for ((column, values), _) in columns.filter(|(_, is_wanted)| **is_wanted) {
                // A column gets memory only at its first value that is not zero.
                if column.is_none() && values.iter().all(|x| *x == 0.0) {
                    continue;
                }
                let column = column.get_or_insert_with(|| {
                    let mut zeros = Vec::with_capacity(one.samples());
                    zeros.resize(before, 0.0);
                    zeros
                });
                column.extend_from_slice(values);
            }
            before += samples;
            Ok(())
        }))
    })?;
    Ok(columns)
}
