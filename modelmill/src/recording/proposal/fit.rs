//! How much of each force column a model can explain: positions go in, one share for each drive and column comes out.

use modelmill_codegen::{ModelEvaluator, MotionStates};
use modelmill_identify::{RecordingFiles, StatePreparation};
use nalgebra::{DMatrix, DVector};

use super::super::columns::read_options;
use super::super::states::prepare;
use super::thresholds::FIT_MOST_SAMPLES;
use crate::error::Outcome;
use crate::model::Model;
use crate::recording::RecordingOptions;
use crate::segment::RecordingSegment;

/// Singular values below this share of the largest one are zero.
const RANK_TOLERANCE: f64 = 1e-9;
/// Further columns of a drive: an offset, its rate and the sign of it, for friction that the model may lack.
const MORE: usize = 3;

/// How forces agree with a model.
pub(super) struct ForceAgreement {
    /// Shares of the variance of forces that the model explains with estimated parameters, `[drive][column]`, from 0 to 1.
    pub(super) shares: Vec<Vec<f64>>,
    /// Correlation with the forces of the nominal parameters, `[drive][column]`; zero if there are none.
    pub(super) nominal: Vec<Vec<f64>>,
}

/// Compares columns of forces with a model.
///
/// `motion` has the time and all active coordinates in SI units, `forces` the columns to explain, with as many samples.
/// `None` if the motion cannot be prepared, or the model has no pose for it.
pub(super) fn compare_forces(
    model: &Model,
    motion: Vec<(String, Vec<f64>)>,
    forces: &[&[f64]],
) -> Outcome<Option<ForceAgreement>> {
    let file = RecordingFiles::from_table("the proposed columns", motion)?;
    let reading = RecordingOptions {
        preparation: StatePreparation {
            unexamined: true,
            ..StatePreparation::default()
        },
        ..RecordingOptions::default()
    };
    let names = file.names()?;
    let prepared = read_options(model, &reading, &names, file.name())
        .and_then(|(options, _)| Ok(file.read(&options)?))
        .and_then(|raw| prepare(model, &raw, &reading, 0.0));
    // A motion that cannot be prepared only means that the numbers say nothing.
    let Ok(segments) = prepared else {
        return Ok(None);
    };
    let total: usize = segments.iter().map(RecordingSegment::samples).sum();
    let step = (total / FIT_MOST_SAMPLES).max(1);
    let n_drives = model.row_names().len();
    let mut rows: Vec<DMatrix<f64>> = Vec::new();
    let mut nominal: Vec<Vec<f64>> = vec![Vec::new(); n_drives];
    let parameters = nominal_parameters(model);
    let mut samples: Vec<usize> = Vec::new();
    for one in &segments {
        let run = &one.run;
        let chosen: Vec<usize> = (0..one.samples()).step_by(step).collect();
        let pick = |columns: &[Vec<f64>]| -> Vec<Vec<f64>> {
            let pick = |column: &Vec<f64>| chosen.iter().map(|k| column[*k]).collect();
            columns.iter().map(pick).collect()
        };
        let [q, qd, qdd] = [&run.q, &run.qd, &run.qdd].map(|columns| pick(columns));
        let states = MotionStates {
            q: q.iter().map(Vec::as_slice).collect(),
            qd: qd.iter().map(Vec::as_slice).collect(),
            qdd: qdd.iter().map(Vec::as_slice).collect(),
            load: Vec::new(),
        };
        let evaluator = ModelEvaluator::new(&model.derivation);
        let (Ok(regressor), Ok(drives)) = (evaluator.regressor(&states), evaluator.drive_motion(&states)) else {
            return Ok(None);
        };
        if let Some(parameters) = parameters
            .as_ref()
            .filter(|parameters| parameters.len() == regressor.ncols())
        {
            let forces = &regressor * parameters;
            for (i, force) in forces.iter().enumerate() {
                nominal[i % n_drives].push(*force);
            }
        }
        rows.push(with_friction(regressor, &drives[n_drives..2 * n_drives]));
        // Rows of a table count from 1.
        samples.extend(chosen.iter().map(|k| usize::try_from(run.lines[*k]).unwrap_or(1) - 1));
    }
    let of_drive = |computed: &Vec<f64>| -> Vec<f64> {
        let correlate = |force: &&[f64]| {
            let measured: Vec<f64> = samples.iter().map(|k| force[*k]).collect();
            correlation(computed, &measured)
        };
        forces.iter().map(correlate).collect()
    };
    Ok(Some(ForceAgreement {
        nominal: nominal.iter().map(of_drive).collect(),
        shares: shares_of_rows(&rows, n_drives, &samples, forces),
    }))
}

/// The nominal values of all base parameters; `None` if one has none.
fn nominal_parameters(model: &Model) -> Option<DVector<f64>> {
    let values = model.base_parameter_values().values;
    let is_known = (0..values.len()).all(|k| model.has_values(k));
    is_known.then(|| DVector::from_vec(values))
}

/// Correlation of two signals; zero if one of them is constant or has another length.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    if a.len() != b.len() || a.is_empty() {
        return 0.0;
    }
    let centred = |values: &[f64]| {
        let values = DVector::from_column_slice(values);
        let mean = values.mean();
        values.add_scalar(-mean)
    };
    let (a, b) = (centred(a), centred(b));
    let size = a.norm() * b.norm();
    if size > 0.0 { a.dot(&b) / size } else { 0.0 }
}

/// The regressor with further columns for the drive of each row; `rates` has the rate of each drive at each sample.
fn with_friction(regressor: DMatrix<f64>, rates: &[Vec<f64>]) -> DMatrix<f64> {
    let (width, n) = (regressor.ncols(), rates.len());
    let mut rows = regressor.resize_horizontally(width + MORE, 0.0);
    for i in 0..rows.nrows() {
        let rate = rates[i % n][i / n];
        let sign = if rate == 0.0 { 0.0 } else { rate.signum() };
        for (k, value) in [1.0, rate, sign].into_iter().enumerate() {
            rows[(i, width + k)] = value;
        }
    }
    rows
}

/// Shares for each drive and column by least squares, adjusted for the number of parameters.
fn shares_of_rows(rows: &[DMatrix<f64>], n_drives: usize, samples: &[usize], forces: &[&[f64]]) -> Vec<Vec<f64>> {
    let width = rows.first().map_or(0, DMatrix::ncols);
    let mut all = Vec::new();
    for drive in 0..n_drives {
        // Rows are interleaved by drive.
        let own = rows.iter().flat_map(|block| {
            let places = (drive..block.nrows()).step_by(n_drives);
            places.map(move |i| block.row(i).into_owned())
        });
        let own: Vec<_> = own.collect();
        let mut matrix = DMatrix::from_fn(own.len(), width, |i, j| own[i][j]);
        if own.len() < 2 || matrix.iter().any(|x| !x.is_finite()) {
            all.push(vec![0.0; forces.len()]);
            continue;
        }
        // Parameters of different units get columns of one size.
        for mut column in matrix.column_iter_mut() {
            let size = column.norm();
            if size > 0.0 {
                column /= size;
            }
        }
        let Some(factors) = matrix.try_svd(true, false, f64::EPSILON, 0) else {
            all.push(vec![0.0; forces.len()]);
            continue;
        };
        let largest = factors.singular_values.max();
        let rank = factors
            .singular_values
            .iter()
            .filter(|s| **s > RANK_TOLERANCE * largest)
            .count();
        let basis = factors.u.map(|u| u.columns(0, rank).into_owned());
        let share = |force: &&[f64]| {
            let values = DVector::from_iterator(samples.len(), samples.iter().map(|k| force[*k]));
            let mean = values.mean();
            let spread = values.add_scalar(-mean).norm_squared();
            let Some(basis) = &basis else { return 0.0 };
            let rest = (values.norm_squared() - basis.tr_mul(&values).norm_squared()).max(0.0);
            // Each parameter explains a little of any noise.
            let freedom = (samples.len() - 1) as f64 / samples.len().saturating_sub(rank).max(1) as f64;
            let share = 1.0 - freedom * rest / spread;
            if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 }
        };
        all.push(forces.iter().map(share).collect());
    }
    all
}
