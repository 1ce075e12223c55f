//! The columns of a segment: those of the base parameters, and those of everything that may have changed.

use modelmill_codegen::ModelEvaluator;
use modelmill_identify::PreparedRun;
use modelmill_identify::diagnose::ForceColumn;
use nalgebra::DVector;

use crate::along::{self, filter_and_decimate, measured_forces};
use crate::error::Outcome;
use crate::model::Model;
use crate::regressors::regressor;
use crate::runs::payload::PayloadColumns;
use crate::segment::RecordingSegment;

/// Step of the central differences: fraction of a clock's rate, or rad or m of an encoder's zero.
const TURNED: f64 = 1e-3;

/// Powers of the clock's factor by which the derivatives of a coordinate scale. Derivatives of positions scale once and
/// twice; what was recorded does not depend on time stamps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TimeScaling {
    /// Power for rates: 0 or 1.
    pub(crate) rates: i32,
    /// Power for accelerations: 0 to 2.
    pub(crate) accelerations: i32,
}

impl TimeScaling {
    /// The time base is known, so that nothing scales.
    pub(crate) const KNOWN: Self = Self {
        rates: 0,
        accelerations: 0,
    };

    /// Multiplies the derivatives of a coordinate by powers of a factor.
    pub(crate) fn scale_coordinate(self, run: &mut PreparedRun, coordinate: usize, factor: f64) {
        for (columns, power) in [(&mut run.qd, self.rates), (&mut run.qdd, self.accelerations)] {
            let by = factor.powi(power);
            for x in columns.get_mut(coordinate).into_iter().flatten() {
                *x *= by;
            }
        }
    }
}

/// The rows of one segment, drive by drive.
pub(crate) struct SegmentRows {
    /// Columns in the order of [`RunColumnLayout`](crate::runs::layout::RunColumnLayout).
    columns: Vec<ForceColumn>,
    /// Measured forces minus those of known parameters, `[drive][sample]`, N or N m.
    pub(crate) forces: Vec<Vec<f64>>,
    /// Whether each of them counts.
    counts: Vec<Vec<bool>>,
}

impl SegmentRows {
    /// The columns of the unknown base parameters alone; the force of known ones is subtracted.
    ///
    /// Fails when a pose has no solution, or a force was not measured.
    pub(crate) fn base_columns(model: &Model, stretch: &RecordingSegment) -> Outcome<Self> {
        let base = regressor(&[(stretch, false)], &ModelEvaluator::new(&model.derivation), model)?;
        let mut forces = measured_forces(stretch)?;
        let mut columns = Vec::new();
        for (k, column) in base.into_iter().enumerate() {
            if model.is_known(k) {
                for (force, known) in forces.iter_mut().zip(&column.0) {
                    for (f, x) in force.iter_mut().zip(known.iter().flatten()) {
                        *f -= model.values[k] * x;
                    }
                }
            } else {
                columns.push(column);
            }
        }
        // Samples that do not count are zero on both sides of the equations.
        let counts = counts(stretch, &forces);
        for (force, counts) in forces.iter_mut().zip(&counts) {
            zero_uncounted(force, counts);
        }
        for column in &mut columns {
            clear_uncounted(column, &counts);
        }
        Ok(Self {
            columns,
            forces,
            counts,
        })
    }

    /// All columns. `values` are the base parameters with which the columns of scales, clocks and encoders' zeros
    /// are computed, and `scaling` has the derivatives of each coordinate that depend on the clock.
    ///
    /// Fails as [`Self::base_columns`] does.
    pub(crate) fn all_columns(
        model: &Model,
        stretch: &RecordingSegment,
        payloads: &PayloadColumns,
        values: &DVector<f64>,
        scaling: &[TimeScaling],
    ) -> Outcome<Self> {
        let mut laid = Self::base_columns(model, stretch)?;
        let mut further = payload_columns(model, stretch, payloads)?;
        further.extend(drive_columns(model, stretch, laid.samples())?);
        further.extend(prediction_columns(model, stretch, &laid, values, scaling)?);
        for column in &mut further {
            clear_uncounted(column, &laid.counts);
        }
        laid.columns.extend(further);
        Ok(laid)
    }

    /// Number of decimated samples.
    pub(crate) fn samples(&self) -> usize {
        self.forces.first().map_or(0, Vec::len)
    }

    /// A column on a drive; `None` if it is zero there.
    pub(crate) fn column(&self, k: usize, drive: usize) -> Option<&[f64]> {
        self.columns.get(k)?.0.get(drive)?.as_deref()
    }

    /// The residual of a drive's force for values of the first columns.
    pub(crate) fn residual(&self, drive: usize, values: &DVector<f64>) -> Vec<f64> {
        let mut rest = self.forces[drive].clone();
        for (k, value) in values.iter().enumerate() {
            let column = self.column(k, drive).unwrap_or_default();
            for (r, z) in rest.iter_mut().zip(column) {
                *r -= value * z;
            }
        }
        rest
    }

    /// Ranges of consecutive samples that count.
    pub(crate) fn pieces(&self, drive: usize) -> Vec<std::ops::Range<usize>> {
        let counts = &self.counts[drive];
        let mut pieces = Vec::new();
        let mut start = 0;
        // A sample that does not count ends a range.
        for end in 0..=counts.len() {
            if end == counts.len() || !counts[end] {
                if end > start {
                    pieces.push(start..end);
                }
                start = end + 1;
            }
        }
        pieces
    }
}

/// Whether each force counts, `[drive][sample]`. A decimated sample depends on all samples that its filter used.
fn counts(stretch: &RecordingSegment, forces: &[Vec<f64>]) -> Vec<Vec<bool>> {
    let n = forces.len();
    // Weights of zero exclude a sample, as at standstill.
    let weighs = |drive: usize, i: usize| {
        let weights = stretch.weights.as_ref();
        weights.is_none_or(|weights| weights[i * n + drive] > 0.0)
    };
    let of_drive = |(drive, force): (usize, &Vec<f64>)| {
        let samples = 0..force.len();
        samples
            .map(|i| weighs(drive, i) && !stretch.has_excluded_input(drive, i))
            .collect()
    };
    forces.iter().enumerate().map(of_drive).collect()
}

/// The columns of payloads: ten for each body.
fn payload_columns(model: &Model, stretch: &RecordingSegment, payloads: &PayloadColumns) -> Outcome<Vec<ForceColumn>> {
    let evaluator = ModelEvaluator::new(&payloads.derivation);
    let columns = regressor(&[(stretch, false)], &evaluator, model)?;
    let of = |k: &Option<usize>| k.map(|k| columns[k].clone()).unwrap_or_default();
    Ok(payloads.columns.iter().flatten().map(of).collect())
}

/// Columns of dry and viscous friction of each drive, followed by a constant force on each.
fn drive_columns(model: &Model, stretch: &RecordingSegment, samples: usize) -> Outcome<Vec<ForceColumn>> {
    let n = model.row_names().len();
    // Each of these columns acts on one drive.
    let only = |drive: usize, values: Vec<f64>| {
        let mut column = ForceColumn(vec![None; n]);
        column.0[drive] = Some(values);
        column
    };
    let mut columns = Vec::new();
    for (drive, rate) in along::drive_rates(model, stretch)?.into_iter().enumerate() {
        // At exact standstill dry friction has no direction.
        let sign = |x: &f64| if *x == 0.0 { 0.0 } else { x.signum() };
        let signs = rate.iter().map(sign).collect();
        let both = filter_and_decimate(vec![signs, rate], stretch)?;
        columns.extend(both.into_iter().map(|values| only(drive, values)));
    }
    columns.extend((0..n).map(|drive| only(drive, vec![1.0; samples])));
    Ok(columns)
}

/// Sets values to 0 where a sample does not count.
fn zero_uncounted(values: &mut [f64], counts: &[bool]) {
    for (value, _) in values.iter_mut().zip(counts).filter(|(_, counts)| !**counts) {
        *value = 0.0;
    }
}

/// Sets a column to 0 where a sample does not count.
fn clear_uncounted(column: &mut ForceColumn, counts: &[Vec<bool>]) {
    for (values, counts) in column.0.iter_mut().zip(counts) {
        if let Some(values) = values {
            zero_uncounted(values, counts);
        }
    }
}

/// Columns that are computed from predicted forces: a scale of each drive; a clock that is slow by a fraction, so
/// that derivatives of positions become larger by once and twice that fraction; and another zero of each encoder.
fn prediction_columns(
    model: &Model,
    stretch: &RecordingSegment,
    laid: &SegmentRows,
    values: &DVector<f64>,
    scaling: &[TimeScaling],
) -> Outcome<Vec<ForceColumn>> {
    let n = laid.forces.len();
    let mut columns = Vec::new();
    // The column of a scale is the predicted force itself.
    for drive in 0..n {
        // Measured force minus residual is the prediction.
        let rest = laid.residual(drive, values);
        let mut column = ForceColumn(vec![None; n]);
        let pairs = laid.forces[drive].iter().zip(&rest);
        column.0[drive] = Some(pairs.map(|(y, r)| y - r).collect());
        columns.push(column);
    }
    // Known and unknown base parameters are joined in the order of the model.
    let mut next = values.iter();
    let all: Vec<f64> = (0..model.base.len())
        .map(|k| {
            if model.is_known(k) {
                model.values[k]
            } else {
                next.next().copied().unwrap_or(0.0)
            }
        })
        .collect();
    let forces = |turned: &RecordingSegment| {
        along::forces(model, turned, &all).and_then(|forces| filter_and_decimate(forces, stretch))
    };
    // The derivative of the predicted forces, by central differences.
    let slope = |turn: &dyn Fn(&mut RecordingSegment, f64)| -> Outcome<ForceColumn> {
        // The model is evaluated with the motion changed in either direction.
        let [ahead, back] = [TURNED, -TURNED].map(|by| {
            let mut turned = stretch.clone();
            turn(&mut turned, by);
            forces(&turned)
        });
        let pairs = ahead?.into_iter().zip(back?);
        let of_drive = |(a, b): (Vec<f64>, Vec<f64>)| -> Vec<f64> {
            a.iter().zip(&b).map(|(a, b)| (a - b) / (2.0 * TURNED)).collect()
        };
        Ok(ForceColumn::new(pairs.map(of_drive).collect()))
    };
    // Clock: recorded derivatives stay, computed ones scale.
    columns.push(slope(&|turned, part| {
        for (coordinate, scaling) in scaling.iter().enumerate() {
            scaling.scale_coordinate(&mut turned.run, coordinate, 1.0 + part);
        }
    })?);
    // Zeros: positions are shifted, one coordinate after the other.
    for coordinate in 0..stretch.run.q.len() {
        columns.push(slope(&|turned, by| {
            for q in &mut turned.run.q[coordinate] {
                *q += by;
            }
        })?);
    }
    Ok(columns)
}
