//! The comparison: both treatments of m4 on runs of a rig, and the share of the paper's error that is the force of the
//! misplaced mass.

use modelmill_identify::interpret::{PhysicalInterpretation, PhysicalSolution, interpret};
use modelmill_identify::{FitFile, PreparedRun};

use crate::printed;
use modelmill::Model;
use modelmill::along;
use modelmill::identify::{EstimatorOptions, Identification, identify, regression};
use modelmill::interpret as table_1;
use modelmill::segment::RecordingSegment;
use modelmill::{Error, Outcome};

/// Forces as `[drive][sample]`, N.
pub(crate) type DriveColumns = Vec<Vec<f64>>;

/// The parameters that Table 1 determines.
pub(crate) const UNKNOWN: [&str; 5] = ["m2", "m4", "dc3", "Ic12", "Ic32"];

/// One rig with both treatments.
pub(crate) struct TreatmentStudy {
    /// Runs: identification, verification.
    pub(crate) runs: [TreatmentRun; 2],
    /// Fits of the paper's and of the consistent treatment.
    pub(crate) fits: [Identification; 2],
    /// Physical parameters of the paper's treatment, as in Table 1: all real solutions.
    pub(crate) physical: Vec<PhysicalSolution>,
}

/// A run of the rig with the forces of both treatments.
pub(crate) struct TreatmentRun {
    /// Times, s.
    pub(crate) time: Vec<f64>,
    /// Forces of the rig, N.
    pub(crate) measured: DriveColumns,
    /// Forces with calculated parameters, `[treatment]`, the paper's first.
    pub(crate) calculated: [DriveColumns; 2],
    /// Forces with estimated parameters, `[treatment]`.
    pub(crate) estimated: [DriveColumns; 2],
    /// The paper's treatment with the parameters that the paper estimated on its own robot.
    pub(crate) printed: DriveColumns,
}

/// The part of an error that one known force explains.
#[derive(Clone, Copy)]
pub(crate) struct ExplainedError {
    /// 2-norm of the error minus that force, relative to the error.
    pub(crate) remains: f64,
    /// Correlation coefficient (Pearson) of the error with that force, each drive about its own mean.
    pub(crate) correlation: f64,
    /// Share of the variation of the error about its mean that the force explains, 1 minus the ratio of the squares.
    pub(crate) variation: f64,
}

/// Error figures of one drive.
#[derive(Clone, Copy)]
pub(crate) struct DriveErrors {
    /// Mean of |error| / |measured|.
    pub(crate) mean_relative: f64,
    /// Median of the same.
    pub(crate) median_relative: f64,
    /// 2-norm of the error divided by that of the measured force.
    pub(crate) nrms: f64,
}

impl TreatmentStudy {
    /// Identifies both models on the first run and compares them with both runs.
    pub(crate) fn new(
        models: [&Model; 2],
        identification: RecordingSegment,
        verification: RecordingSegment,
    ) -> Outcome<Self> {
        let data = [identification];
        let check = [verification];
        let [paper, consistent] = models;
        // Ordinary least squares, since the rig has no noise.
        let plain = EstimatorOptions::default();
        let fits = [
            identify(paper, &data, &[], &check, &plain)?,
            identify(consistent, &data, &[], &check, &plain)?,
        ];
        // Table 1 is computed from the fit of the paper's treatment.
        let physical = physical(paper, &fits[0].fit)?;
        let [identification] = &data;
        let [verification] = &check;
        // Forces of both treatments along a run.
        let along = |one: &RecordingSegment| -> Outcome<TreatmentRun> {
            let forces = |values: [&[f64]; 2]| -> Outcome<[DriveColumns; 2]> {
                Ok([
                    along::forces(paper, one, values[0])?,
                    along::forces(consistent, one, values[1])?,
                ])
            };
            Ok(TreatmentRun {
                time: one.time(),
                measured: along::measured_forces(one)?,
                calculated: forces([&paper.values, &consistent.values])?,
                estimated: forces([&fits[0].values(), &fits[1].values()])?,
                printed: along::forces(paper, one, &values_with(paper, &printed::ESTIMATED))?,
            })
        };
        Ok(Self {
            runs: [along(identification)?, along(verification)?],
            physical,
            fits,
        })
    }
}

impl TreatmentRun {
    /// Measured minus modelled forces, N.
    pub(crate) fn error(&self, modelled: &DriveColumns) -> DriveColumns {
        difference(&self.measured, modelled)
    }

    /// The force of the platform's mass at its place minus that at the place where the paper assumes it: the difference
    /// of both treatments, from the models alone, N.
    pub(crate) fn placement(&self) -> DriveColumns {
        difference(&self.calculated[1], &self.calculated[0])
    }

    /// The change of the forces by the paper's own identification, in its treatment and along this run, N.
    pub(crate) fn printed_change(&self) -> DriveColumns {
        difference(&self.printed, &self.calculated[0])
    }

    /// The part of the error of the paper's treatment that the placement explains, over all drives.
    pub(crate) fn explained_error(&self) -> ExplainedError {
        explain_error(&self.error(&self.calculated[0]), &self.placement())
    }

    /// Error figures of a drive for modelled forces.
    pub(crate) fn errors(&self, drive: usize, modelled: &DriveColumns) -> DriveErrors {
        self.errors_of_every(1, drive, modelled)
    }

    /// The same for every k-th sample alone.
    pub(crate) fn errors_of_every(&self, k: usize, drive: usize, modelled: &DriveColumns) -> DriveErrors {
        let pairs = || self.measured[drive].iter().zip(&modelled[drive]).step_by(k);
        // Samples with a force of zero have no relative error.
        let mut relative: Vec<f64> = pairs()
            .filter(|(y, _)| **y != 0.0)
            .map(|(y, m)| ((y - m) / y).abs())
            .collect();
        relative.sort_by(f64::total_cmp);
        let error: f64 = pairs().map(|(y, m)| (y - m).powi(2)).sum();
        let size: f64 = pairs().map(|(y, _)| y * y).sum();
        DriveErrors {
            mean_relative: relative.iter().sum::<f64>() / relative.len().max(1) as f64,
            median_relative: relative.get(relative.len() / 2).copied().unwrap_or(0.0),
            nrms: (error / size).sqrt(),
        }
    }

    /// Times at which the measured force of a drive passes through zero.
    pub(crate) fn zeros(&self, drive: usize) -> Vec<f64> {
        let force = &self.measured[drive];
        (1..force.len())
            .filter(|i| (force[i - 1] < 0.0) != (force[*i] < 0.0))
            // Linear interpolation between the two samples.
            .map(|i| {
                let share = force[i - 1] / (force[i - 1] - force[i]);
                self.time[i - 1] + share * (self.time[i] - self.time[i - 1])
            })
            .collect()
    }

    /// Share of the samples of a drive whose force is below a share of its root mean square, and the share of the
    /// mean relative error that these samples cause.
    pub(crate) fn near_zero(&self, drive: usize, modelled: &DriveColumns, below: f64) -> [f64; 2] {
        let force = &self.measured[drive];
        let n = force.len() as f64;
        let rms = (force.iter().map(|y| y * y).sum::<f64>() / n).sqrt();
        let (mut count, mut part, mut all) = (0.0, 0.0, 0.0);
        // Counts samples near zero, and sums relative errors near zero and in total.
        for (y, m) in force.iter().zip(&modelled[drive]).filter(|(y, _)| **y != 0.0) {
            let relative = ((y - m) / y).abs();
            all += relative;
            if y.abs() < below * rms {
                count += 1.0;
                part += relative;
            }
        }
        [count / n, part / all]
    }
}

/// The part of some forces that others explain, over all drives.
pub(crate) fn explain_error(forces: &DriveColumns, by: &DriveColumns) -> ExplainedError {
    // Nothing is fitted: the factor of the known force is 1.
    let rest = difference(forces, by);
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let norm = |a: &[f64]| dot(a, a).sqrt();
    // The mean of each drive is subtracted, so that a constant force counts neither as likeness nor as variation.
    let [varying, varying_by, varying_rest] = [forces, by, &rest].map(|columns| about_means(columns).concat());
    ExplainedError {
        remains: norm(&rest.concat()) / norm(&forces.concat()),
        correlation: dot(&varying, &varying_by) / (norm(&varying) * norm(&varying_by)),
        variation: 1.0 - dot(&varying_rest, &varying_rest) / dot(&varying, &varying),
    }
}

/// Each column about its mean.
fn about_means(columns: &DriveColumns) -> DriveColumns {
    let centred = |column: &Vec<f64>| {
        let mean = column.iter().sum::<f64>() / column.len().max(1) as f64;
        column.iter().map(|x| x - mean).collect()
    };
    columns.iter().map(centred).collect()
}

/// The largest difference of two sets of forces, relative to the largest force.
pub(crate) fn largest_difference(a: &DriveColumns, b: &DriveColumns) -> f64 {
    let largest = |columns: &DriveColumns| columns.iter().flatten().fold(0.0_f64, |m, x| m.max(x.abs()));
    largest(&difference(a, b)) / largest(a)
}

/// The single drives of some forces, each as columns of its own.
pub(crate) fn single_drives(columns: &DriveColumns) -> impl Iterator<Item = DriveColumns> + '_ {
    columns.iter().map(|column| vec![column.clone()])
}

/// `a - b`, sample by sample.
fn difference(a: &DriveColumns, b: &DriveColumns) -> DriveColumns {
    let columns = a.iter().zip(b);
    columns
        .map(|(a, b)| a.iter().zip(b).map(|(a, b)| a - b).collect())
        .collect()
}

/// The paper's base parameters that give the forces of the consistent treatment. It is the special case in which the
/// half masses are at the ends of the couplers, so least squares determines them without error.
pub(crate) fn consistent_values(paper: &Model, consistent: &Model, data: &RecordingSegment) -> Outcome<Vec<f64>> {
    // The forces of the consistent model take the place of measured ones.
    let run = PreparedRun {
        force: Some(along::forces(consistent, data, &consistent.values)?),
        ..data.run.clone()
    };
    Ok(
        regression::identify(paper, &[RecordingSegment::from(run)], &[], &EstimatorOptions::default())?
            .solution
            .values,
    )
}

/// The paper's base parameters for other values of some parameters, in the order of `p_min`.
pub(crate) fn values_with(model: &Model, changed: &[(&str, f64)]) -> Vec<f64> {
    let mechanism = &model.derivation.mechanism;
    let parameters: Vec<f64> = mechanism
        .parameters
        .iter()
        .map(|p| {
            let other = changed.iter().find(|(name, _)| *name == p.name);
            other.map_or(p.nominal, |(_, value)| *value)
        })
        .collect();
    let constants: Vec<f64> = mechanism.constants.iter().map(|c| c.value).collect();
    model.derivation.base_values(&parameters, &constants)
}

/// Table 1 from the base parameters that the paper's own estimates give: its solution and all others.
pub(crate) fn printed_solutions(model: &Model, fit: &FitFile) -> Outcome<Vec<PhysicalSolution>> {
    let mut fit = fit.clone();
    for (parameter, value) in fit.parameters.iter_mut().zip(values_with(model, &printed::ESTIMATED)) {
        parameter.value = value;
    }
    physical(model, &fit)
}

/// Table 1: all real solutions for the parameters that the paper determines; empty if they are undetermined.
fn physical(model: &Model, fit: &FitFile) -> Outcome<Vec<PhysicalSolution>> {
    let names = UNKNOWN.map(str::to_owned);
    let unknown = table_1::unknown_indices(model, &names)?;
    let values: Vec<f64> = fit.parameters.iter().map(|p| p.value).collect();
    // The equations of the base parameters, solved for the unknown physical parameters.
    let (system, _) = table_1::system(model, &unknown, &values, fit);
    match interpret(&system) {
        Ok(PhysicalInterpretation::Exact { solutions } | PhysicalInterpretation::LeastSquares { solutions, .. }) => {
            Ok(solutions)
        }
        Ok(PhysicalInterpretation::Undetermined { .. }) => Ok(Vec::new()),
        Err(error) => Err(Error::input(format!("{}: {error}", model.path))),
    }
}
