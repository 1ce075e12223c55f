//! A model as the search for excitation uses it: regressor, and limits in addition to those of the active coordinates.

use modelmill_codegen::{ModelEvaluator, MotionStates};
use modelmill_identify::excite::{ExcitationMotion, ExcitationPlant, LimitMargin, least_singular_value};
use modelmill_spec::{Kinematics, MotionLimits, PointIdx};
use nalgebra::DMatrix;

use crate::model::Model;

/// Names of the axes of the base frame.
pub const AXES: [&str; 3] = ["x", "y", "z"];

/// Names of the limits of least singular values, which must stay above a fraction of those at the nominal pose.
const SINGULARITIES: [&str; 2] = ["singularity of the loops", "singularity of the drives"];

/// The fraction of a limit that a trajectory uses, 1 at the limit. For a range, it is the largest distance from the
/// middle, divided by half the range. For the distance from singular poses (`singularity` in the model file), it is the
/// limit divided by the smallest singular value along the trajectory.
pub fn used_fraction(margin: &LimitMargin) -> f64 {
    if SINGULARITIES.contains(&margin.name.as_str()) {
        1.0 / (1.0 - margin.excess).max(0.0)
    } else {
        (1.0 + margin.excess).max(0.0)
    }
}

/// A model with the limits of its motion.
pub struct ModelPlant<'a> {
    /// The model.
    model: &'a Model,
    /// Evaluates its programs.
    evaluator: ModelEvaluator<'a>,
    /// Poses and Jacobians.
    kinematics: Kinematics,
    /// All limits of the motion.
    limits: &'a MotionLimits,
    /// Indices of the active coordinates.
    active: Vec<usize>,
    /// Indices of the passive coordinates.
    passive: Vec<usize>,
    /// Columns of the regressor whose base parameters are unknown.
    unknown: Vec<usize>,
    /// Ranges of passive coordinates, by their index among these, rad or m.
    passive_ranges: Vec<(usize, [f64; 2])>,
    /// Ranges of points along an axis of the base frame, m.
    point_ranges: Vec<(PointIdx, usize, [f64; 2])>,
    /// Fraction of the least singular values that must be kept, and these values at the nominal pose: of the loops'
    /// and of the drives' Jacobian.
    singularity: Option<(f64, [f64; 2])>,
}

impl<'a> ModelPlant<'a> {
    /// A model with the limits that its motion must keep.
    pub fn new(model: &'a Model, limits: &'a MotionLimits) -> Self {
        let mechanism = &model.derivation.mechanism;
        let (active, passive) = model.derivation.coordinates();
        // Limits of active coordinates are handled by the search itself.
        let passive_ranges = limits
            .coordinates
            .iter()
            .filter_map(|(i, limits)| {
                let k = passive.iter().position(|p| *p == i.0)?;
                Some((k, limits.position?))
            })
            .collect();
        let point_ranges = limits
            .points
            .iter()
            .flat_map(|(point, ranges)| {
                let axes = ranges.iter().enumerate();
                axes.filter_map(|(axis, range)| Some((*point, axis, (*range)?)))
            })
            .collect();
        // The nominal singular values need the plant without this limit.
        let mut plant = Self {
            model,
            evaluator: ModelEvaluator::new(&model.derivation),
            kinematics: Kinematics::new(mechanism),
            limits,
            active,
            passive,
            unknown: (0..model.base.len()).filter(|k| !model.is_known(*k)).collect(),
            passive_ranges,
            point_ranges,
            singularity: None,
        };
        // The reference of the singularity limit is the nominal pose.
        if let Some(share) = limits.singularity {
            let still = |i: &usize| vec![mechanism.coordinates[*i].nominal];
            let nominal = ExcitationMotion {
                q: plant.active.iter().map(still).collect(),
                qd: vec![vec![0.0]; plant.active.len()],
                qdd: vec![vec![0.0]; plant.active.len()],
            };
            let least = plant
                .least_singular_values(&nominal)
                .map_or([0.0, 0.0], |both| both.map(|values| values[0]));
            plant.singularity = Some((share, least));
        }
        plant
    }

    /// Whether any base parameter is unknown.
    pub fn has_unknowns(&self) -> bool {
        !self.unknown.is_empty()
    }

    /// Forces of the nominal model along a motion, `[drive][sample]`, N or N m; `None` if a pose has no solution.
    pub fn forces(&self, motion: &ExcitationMotion) -> Option<Vec<Vec<f64>>> {
        let still = self.zero_load(motion);
        let states = states(motion, &still);
        self.evaluator.inverse_dynamics(&states, &self.model.values).ok()
    }

    /// Zero forces of all drives along a motion.
    fn zero_load(&self, motion: &ExcitationMotion) -> Vec<Vec<f64>> {
        let samples = motion.q.first().map_or(0, Vec::len);
        vec![vec![0.0; samples]; self.model.derivation.mechanism.drives.len()]
    }

    /// All coordinates along a motion, `[coordinate][sample]`; `None` if the loops cannot close.
    fn coordinates(&self, motion: &ExcitationMotion) -> Option<Vec<Vec<f64>>> {
        let mut all = vec![Vec::new(); self.active.len() + self.passive.len()];
        // Active coordinates are given, passive ones are computed.
        for (i, column) in self.active.iter().zip(&motion.q) {
            all[*i].clone_from(column);
        }
        if !self.passive.is_empty() {
            let still = self.zero_load(motion);
            let columns = self.evaluator.passive_motion(&states(motion, &still)).ok()?;
            for (i, column) in self.passive.iter().zip(columns) {
                all[*i] = column;
            }
        }
        Some(all)
    }

    /// Least singular values for each sample: of the loops' Jacobian with respect to the passive coordinates, and of
    /// the drives' with respect to the active ones.
    fn least_singular_values(&self, motion: &ExcitationMotion) -> Option<[Vec<f64>; 2]> {
        let all = self.coordinates(motion)?;
        let samples = motion.q.first().map_or(0, Vec::len);
        let mut of_loops = vec![f64::INFINITY; samples];
        if !self.passive.is_empty() {
            // Columns of the passive coordinates of the loops' gap Jacobian.
            for (sample, least) in of_loops.iter_mut().enumerate() {
                // Poses are evaluated one by one; Jacobians have no block evaluation.
                let at: Vec<f64> = all.iter().map(|column| column[sample]).collect();
                let rows = self.kinematics.gap_jacobian(&self.kinematics.poses(&at));
                let rows = rows
                    .iter()
                    .map(|row| self.passive.iter().map(|i| row[*i]).collect())
                    .collect::<Vec<Vec<f64>>>();
                *least = least_singular_value(&rows);
            }
        }
        let still = self.zero_load(motion);
        let columns = self.evaluator.drive_motion(&states(motion, &still)).ok()?;
        // The Jacobian of the drives is the last part of their motion, n x n.
        let n = self.active.len();
        let jacobian = &columns[columns.len() - n * n..];
        let of_drives = (0..samples).map(|sample| {
            let rows: Vec<Vec<f64>> = jacobian
                .chunks_exact(n)
                .map(|row| row.iter().map(|column| column[sample]).collect())
                .collect();
            least_singular_value(&rows)
        });
        let of_drives = of_drives.collect();
        Some([of_loops, of_drives])
    }
}

impl ExcitationPlant for ModelPlant<'_> {
    fn regressor(&self, motion: &ExcitationMotion) -> Option<DMatrix<f64>> {
        // Effects that depend on the load use the force of the nominal model.
        let load = if self.model.load_dependent_effects().is_empty() {
            self.zero_load(motion)
        } else {
            self.forces(motion)?
        };
        // Columns of known parameters are no part of the condition number.
        let matrix = self.evaluator.regressor(&states(motion, &load)).ok()?;
        if self.unknown.len() == matrix.ncols() {
            return Some(matrix);
        }
        Some(matrix.select_columns(&self.unknown))
    }

    fn limits(&self) -> Vec<String> {
        // The order of names is that of the excesses below.
        let mechanism = &self.model.derivation.mechanism;
        let passive = self
            .passive_ranges
            .iter()
            .map(|(k, _)| mechanism.coordinates[self.passive[*k]].name.clone());
        let forces = self
            .limits
            .forces
            .iter()
            .map(|(drive, _)| mechanism.drives[drive.0].name.clone());
        let points = self
            .point_ranges
            .iter()
            .map(|(point, axis, _)| format!("{}.{}", mechanism.points[point.0].name, AXES[*axis]));
        let mut names: Vec<String> = passive.chain(forces).chain(points).collect();
        if self.singularity.is_some() {
            names.extend(SINGULARITIES.map(str::to_owned));
        }
        names
    }

    fn excess(&self, motion: &ExcitationMotion) -> Option<Vec<Vec<f64>>> {
        let mut all = Vec::new();
        // The distance from the middle of the range, relative to its half; 0 at the limit.
        let beyond =
            |value: f64, [low, high]: [f64; 2]| (value - 0.5 * (low + high)).abs() / (0.5 * (high - low)) - 1.0;
        let needs_poses = !self.point_ranges.is_empty();
        if !self.passive_ranges.is_empty() || needs_poses {
            // Passive coordinates, in the order of their names.
            let coordinates = self.coordinates(motion)?;
            for (k, range) in &self.passive_ranges {
                let column = &coordinates[self.passive[*k]];
                all.push(column.iter().map(|v| beyond(*v, *range)).collect());
            }
        }
        if !self.limits.forces.is_empty() {
            // Forces of the nominal model.
            let forces = self.forces(motion)?;
            for (drive, range) in &self.limits.forces {
                let column = &forces[drive.0];
                all.push(column.iter().map(|v| beyond(*v, *range)).collect());
            }
        }
        // Points need the pose of every sample.
        if needs_poses {
            let coordinates = self.coordinates(motion)?;
            let samples = motion.q.first().map_or(0, Vec::len);
            let mut columns = vec![Vec::with_capacity(samples); self.point_ranges.len()];
            for sample in 0..samples {
                let at: Vec<f64> = coordinates.iter().map(|column| column[sample]).collect();
                let poses = self.kinematics.poses(&at);
                for (column, (point, axis, range)) in columns.iter_mut().zip(&self.point_ranges) {
                    column.push(beyond(self.kinematics.point_position(&poses, *point)[*axis], *range));
                }
            }
            all.append(&mut columns);
        }
        // Without loops the nominal value is infinite, and the limit is always kept.
        if let Some((share, nominal)) = self.singularity {
            let both = self.least_singular_values(motion)?;
            for (values, nominal) in both.iter().zip(nominal) {
                let of_limit = |v: &f64| {
                    if nominal.is_finite() {
                        1.0 - v / (share * nominal)
                    } else {
                        -1.0
                    }
                };
                all.push(values.iter().map(of_limit).collect());
            }
        }
        Some(all)
    }
}

/// A motion as states with a load.
fn states<'m>(motion: &'m ExcitationMotion, load: &'m [Vec<f64>]) -> MotionStates<'m> {
    fn slices(columns: &[Vec<f64>]) -> Vec<&[f64]> {
        columns.iter().map(Vec::as_slice).collect()
    }
    MotionStates {
        q: slices(&motion.q),
        qd: slices(&motion.qd),
        qdd: slices(&motion.qdd),
        load: slices(load),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pose far from singular ones uses little of its limit, not less than nothing.
    #[test]
    fn what_is_used_of_a_limit_is_never_negative() {
        let used = |name: &str, excess: f64| {
            let name = name.to_owned();
            used_fraction(&LimitMargin {
                name,
                excess,
                proven: false,
            })
        };
        let close = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-12, "{found}");
        // Ranges: the middle, the edge, beyond; sampling may put the middle a little below.
        for (excess, expected) in [(-1.01, 0.0), (-1.0, 0.0), (-0.25, 0.75), (0.0, 1.0), (0.5, 1.5)] {
            close(used("theta1", excess), expected);
        }
        // Least values of four times the limit, of the limit, and of half of it: excess is one less their ratio.
        for name in SINGULARITIES {
            for (excess, expected) in [(-3.0, 0.25), (0.0, 1.0), (0.5, 2.0)] {
                close(used(name, excess), expected);
            }
            assert!(used(name, -1e9) >= 0.0);
        }
    }
}
