//! The rows of a stretch: base columns, and those of everything that may have changed.

use modelmill_codegen::Evaluator;
use modelmill_identify::diagnose::Column;
use nalgebra::DVector;

use crate::along::{self, decimated, measured};
use crate::error::Outcome;
use crate::model::Model;
use crate::regressors::regressor;
use crate::runs::payload::Payloads;
use crate::stretch::Stretch;

/// The part by which a clock, and the rad or m by which an encoder is turned to see what that does.
const TURNED: f64 = 1e-3;

/// The rows of one stretch, drive by drive.
pub(crate) struct Laid {
    columns: Vec<Column>,
    /// Measured forces less those of known parameters, `[drive][sample]`.
    pub(crate) forces: Vec<Vec<f64>>,
    /// Which of them count.
    counts: Vec<Vec<bool>>,
}

impl Laid {
    /// The base columns alone.
    pub(crate) fn base(model: &Model, stretch: &Stretch) -> Outcome<Self> {
        let base = regressor(
            &[(stretch, false)],
            &Evaluator::new(&model.derivation),
            model,
        )?;
        let mut forces = measured(stretch)?;
        let mut columns = Vec::new();
        for (k, column) in base.into_iter().enumerate() {
            if model.is_known(k) {
                for (force, known) in forces.iter_mut().zip(&column.0) {
                    for (f, x) in force.iter_mut().zip(known.iter().flatten()) {
                        *f -= model.nominal[k] * x;
                    }
                }
            } else {
                columns.push(column);
            }
        }
        let counts = counts(stretch, &forces);
        for (force, counts) in forces.iter_mut().zip(&counts) {
            silence(force, counts);
        }
        for column in &mut columns {
            leave_out(column, &counts);
        }
        Ok(Self {
            columns,
            forces,
            counts,
        })
    }

    /// All columns; `values` are base parameters on which scales, clocks and encoders' zeros are built.
    pub(crate) fn all(
        model: &Model,
        stretch: &Stretch,
        payloads: &Payloads,
        values: &DVector<f64>,
    ) -> Outcome<Self> {
        let mut laid = Self::base(model, stretch)?;
        let mut further = of_payloads(model, stretch, payloads)?;
        further.extend(of_drives(model, stretch, laid.samples())?);
        further.extend(of_prediction(model, stretch, &laid, values)?);
        for column in &mut further {
            leave_out(column, &laid.counts);
        }
        laid.columns.extend(further);
        Ok(laid)
    }

    pub(crate) fn samples(&self) -> usize {
        self.forces.first().map_or(0, Vec::len)
    }

    pub(crate) fn column(&self, k: usize, drive: usize) -> Option<&[f64]> {
        self.columns.get(k)?.0.get(drive)?.as_deref()
    }

    /// What values of the first columns leave of a drive's force.
    pub(crate) fn rest(&self, drive: usize, values: &DVector<f64>) -> Vec<f64> {
        let mut rest = self.forces[drive].clone();
        for (k, value) in values.iter().enumerate() {
            let column = self.column(k, drive).unwrap_or_default();
            for (r, z) in rest.iter_mut().zip(column) {
                *r -= value * z;
            }
        }
        rest
    }

    /// Stretches of samples that count.
    pub(crate) fn pieces(&self, drive: usize) -> Vec<std::ops::Range<usize>> {
        let counts = &self.counts[drive];
        let mut pieces = Vec::new();
        let mut start = 0;
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

/// Which forces count, `[drive][sample]`. A kept sample has heard of all that its filter saw.
fn counts(stretch: &Stretch, forces: &[Vec<f64>]) -> Vec<Vec<bool>> {
    let n = forces.len();
    let weighs = |drive: usize, i: usize| {
        let weights = stretch.weights.as_ref();
        weights.is_none_or(|weights| weights[i * n + drive] > 0.0)
    };
    let of_drive = |(drive, force): (usize, &Vec<f64>)| {
        let samples = 0..force.len();
        samples
            .map(|i| weighs(drive, i) && !stretch.hears_of_faults(drive, i))
            .collect()
    };
    forces.iter().enumerate().map(of_drive).collect()
}

/// Ten columns for each body.
fn of_payloads(model: &Model, stretch: &Stretch, payloads: &Payloads) -> Outcome<Vec<Column>> {
    let evaluator = Evaluator::new(&payloads.derivation);
    let columns = regressor(&[(stretch, false)], &evaluator, model)?;
    let of = |k: &Option<usize>| k.map(|k| columns[k].clone()).unwrap_or_default();
    Ok(payloads.columns.iter().flatten().map(of).collect())
}

/// Dry and viscous friction of each drive, then a constant force on each.
fn of_drives(model: &Model, stretch: &Stretch, samples: usize) -> Outcome<Vec<Column>> {
    let n = model.drives().len();
    let only = |drive: usize, values: Vec<f64>| {
        let mut column = Column(vec![None; n]);
        column.0[drive] = Some(values);
        column
    };
    let mut columns = Vec::new();
    for (drive, rate) in along::drive_rates(model, stretch)?.into_iter().enumerate() {
        let sign = |x: &f64| if *x == 0.0 { 0.0 } else { x.signum() };
        let signs = rate.iter().map(sign).collect();
        let both = decimated(vec![signs, rate], stretch)?;
        columns.extend(both.into_iter().map(|values| only(drive, values)));
    }
    columns.extend((0..n).map(|drive| only(drive, vec![1.0; samples])));
    Ok(columns)
}

/// Puts 0 where a sample does not count.
fn silence(values: &mut [f64], counts: &[bool]) {
    for (value, _) in values
        .iter_mut()
        .zip(counts)
        .filter(|(_, counts)| !**counts)
    {
        *value = 0.0;
    }
}

/// A column without the samples that do not count.
fn leave_out(column: &mut Column, counts: &[Vec<bool>]) {
    for (values, counts) in column.0.iter_mut().zip(counts) {
        if let Some(values) = values {
            silence(values, counts);
        }
    }
}

/// Columns that are built on predicted forces: a scale of each drive; a clock that runs by a part slower, so that rates and
/// accelerations come out larger by once and twice that part; and each encoder with another zero.
fn of_prediction(
    model: &Model,
    stretch: &Stretch,
    laid: &Laid,
    values: &DVector<f64>,
) -> Outcome<Vec<Column>> {
    let n = laid.forces.len();
    let mut columns = Vec::new();
    for drive in 0..n {
        let rest = laid.rest(drive, values);
        let mut column = Column(vec![None; n]);
        let pairs = laid.forces[drive].iter().zip(&rest);
        column.0[drive] = Some(pairs.map(|(y, r)| y - r).collect());
        columns.push(column);
    }
    let mut next = values.iter();
    let all: Vec<f64> = (0..model.base.len())
        .map(|k| {
            if model.is_known(k) {
                model.nominal[k]
            } else {
                next.next().copied().unwrap_or(0.0)
            }
        })
        .collect();
    let forces = |turned: &Stretch| {
        along::forces(model, turned, &all).and_then(|forces| decimated(forces, stretch))
    };
    // Central differences.
    let slope = |turn: &dyn Fn(&mut Stretch, f64)| -> Outcome<Column> {
        let [ahead, back] = [TURNED, -TURNED].map(|by| {
            let mut turned = stretch.clone();
            turn(&mut turned, by);
            forces(&turned)
        });
        let pairs = ahead?.into_iter().zip(back?);
        let of_drive = |(a, b): (Vec<f64>, Vec<f64>)| -> Vec<f64> {
            a.iter()
                .zip(&b)
                .map(|(a, b)| (a - b) / (2.0 * TURNED))
                .collect()
        };
        Ok(Column::new(pairs.map(of_drive).collect()))
    };
    let scaled = |values: &mut [Vec<f64>], factor: f64| {
        for x in values.iter_mut().flatten() {
            *x *= factor;
        }
    };
    columns.push(slope(&|turned, part| {
        scaled(&mut turned.run.qd, 1.0 + part);
        scaled(&mut turned.run.qdd, (1.0 + part).powi(2));
    })?);
    for coordinate in 0..stretch.run.q.len() {
        columns.push(slope(&|turned, by| {
            for q in &mut turned.run.q[coordinate] {
                *q += by;
            }
        })?);
    }
    Ok(columns)
}
