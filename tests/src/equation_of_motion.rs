//! Laws of mass matrix, velocity terms, gravity, effects and forward dynamics.

use modelmill_codegen::{DynamicsPrograms, ModelEvaluator, PoseFault};
use nalgebra::{Cholesky, DMatrix, DVector};

use crate::base_parameters::{base, nominal};
use crate::laws::{ACCURACY, Case, coordinates, directions};
use crate::mechanics::{Jet, Numbers};
use crate::sample::Sample;

/// Terms of the equation of motion at one state.
pub struct Terms {
    /// Mass matrix.
    pub mass: DMatrix<f64>,
    /// What rates ask for.
    pub coriolis: DVector<f64>,
    /// What weight asks for.
    pub gravity: DVector<f64>,
    /// What effects ask for.
    pub effects: DVector<f64>,
}

/// Evaluates all terms at the only state of a sample.
pub fn terms(
    evaluator: &ModelEvaluator<'_>,
    dynamics: &DynamicsPrograms,
    one: &Sample,
    p_min: &[f64],
) -> Result<Terms, PoseFault> {
    let states = one.states();
    let n = one.q.len();
    let vector = |columns: Vec<Vec<f64>>| DVector::from_iterator(n, columns.iter().map(|c| c[0]));
    let mass = evaluator.mass_matrix(dynamics, &states, p_min)?;
    Ok(Terms {
        mass: DMatrix::from_fn(n, n, |a, b| mass[a * n + b][0]),
        coriolis: vector(evaluator.coriolis(dynamics, &states, p_min)?),
        gravity: vector(evaluator.gravity(dynamics, &states, p_min)?),
        effects: vector(evaluator.effects(dynamics, &states, p_min)?),
    })
}

impl Case {
    /// `J' f = M q'' + c + g + e` with the inverse dynamics' forces f, whatever accelerations the terms are shown; with
    /// them forward dynamics gives the accelerations back. Returns the largest relative error of the equation.
    pub fn equation_of_motion_is_the_inverse_dynamics(&self) -> Result<f64, String> {
        let evaluator = ModelEvaluator::new(&self.derivation);
        let dynamics = self.derivation.dynamics().map_err(|e| self.breach(&e.to_string()))?;
        let p_min = base(&self.derivation, &nominal(self.mechanism()));
        let fault = |e: PoseFault| self.breach(&e.to_string());
        let mut worst: f64 = 0.0;
        for i in 0..self.sample.len().min(10) {
            let one = self.sample.only(i);
            let n = one.q.len();
            let forces = evaluator.inverse_dynamics(&one.states(), &p_min).map_err(fault)?;
            let drives = evaluator.drive_motion(&one.states()).map_err(fault)?;
            let n_drives = forces.len();
            let jacobian = DMatrix::from_fn(n_drives, n, |d, a| drives[2 * n_drives + d * n + a][0]);
            let f = DVector::from_iterator(n_drives, forces.iter().map(|f| f[0]));
            let qdd = DVector::from_iterator(n, one.qdd.iter().map(|x| x[0]));
            let mut other = one.clone();
            for acceleration in &mut other.qdd {
                acceleration[0] += 3.7;
            }
            let found = terms(&evaluator, &dynamics, &other, &p_min).map_err(fault)?;
            let supplied = jacobian.transpose() * &f;
            let needed = &found.mass * &qdd + &found.coriolis + &found.gravity + &found.effects;
            let scale = supplied.amax()
                + (found.mass.abs() * qdd.abs()).amax()
                + found.coriolis.amax()
                + found.gravity.amax()
                + found.effects.amax()
                + 1e-9;
            let error = (&supplied - &needed).amax() / scale;
            worst = worst.max(error);
            if error.is_nan() || error > ACCURACY {
                return Err(self.breach(&format!(
                    "the drives give {supplied}, the terms {needed}, error {error:.1e}"
                )));
            }
            let given: Vec<&[f64]> = forces.iter().map(Vec::as_slice).collect();
            let condition = {
                let values = found.mass.clone().singular_values();
                values.max() / values.min()
            };
            // Parameters are anything: there may be no mass that resists.
            if condition.is_nan() || condition > 1e8 {
                continue;
            }
            let back = evaluator
                .forward_dynamics(&dynamics, &other.states(), &p_min, &given)
                .map_err(fault)?;
            let back = DVector::from_iterator(n, back.iter().map(|x| x[0]));
            let smallest = found.mass.clone().singular_values().min();
            let error = (&back - &qdd).amax() * smallest / scale;
            if error.is_nan() || error > 100.0 * ACCURACY {
                return Err(self.breach(&format!(
                    "forward dynamics gives {back}, expected {qdd}, error {error:.1e}"
                )));
            }
        }
        Ok(worst)
    }

    /// The mass matrix is what d'Alembert's principle says, body by body; it is symmetric, and positive for real bodies.
    pub fn mass_matrix_is_that_of_bodies_by_themselves(&self, is_physical: bool) -> Result<f64, String> {
        let mechanism = self.mechanism();
        let evaluator = ModelEvaluator::new(&self.derivation);
        let dynamics = self.derivation.dynamics().map_err(|e| self.breach(&e.to_string()))?;
        let parameters = nominal(mechanism);
        let p_min = base(&self.derivation, &parameters);
        let numbers = Numbers::new(mechanism, parameters);
        let mut worst: f64 = 0.0;
        for i in 0..self.sample.len().min(5) {
            let one = self.sample.only(i);
            let load: Vec<f64> = one.load.iter().map(|l| l[0]).collect();
            let n = one.q.len();
            let found = terms(&evaluator, &dynamics, &one, &p_min).map_err(|e| self.breach(&e.to_string()))?;
            let pose = coordinates(&evaluator, mechanism, &one);
            let accelerated = |by: Option<&[f64]>| -> Vec<Jet> {
                pose.iter()
                    .enumerate()
                    .map(|(k, q)| Jet([*q, 0.0, by.map_or(0.0, |by| by[k])]))
                    .collect()
            };
            let still = accelerated(None);
            // The first is the actual motion, which there is none of.
            let ways = &directions(mechanism, &numbers, &still)[1..];
            for a in 0..n {
                let weight = numbers.virtual_power(&still, &ways[a], &load);
                for b in 0..n {
                    let all = numbers.virtual_power(&accelerated(Some(&ways[b])), &ways[a], &load);
                    let expected = all.value - weight.value;
                    let scale = all.magnitude + weight.magnitude + found.mass.amax() + 1e-9;
                    let error = (found.mass[(a, b)] - expected).abs() / scale;
                    worst = worst.max(error);
                    if error.is_nan() || error > ACCURACY {
                        return Err(self.breach(&format!(
                            "entry {a}, {b} of the mass matrix is {}, expected {expected}, error {error:.1e}",
                            found.mass[(a, b)]
                        )));
                    }
                }
            }
            if is_physical {
                let asymmetry = (&found.mass - found.mass.transpose()).amax();
                if asymmetry > ACCURACY * found.mass.amax() {
                    return Err(self.breach(&format!("not symmetric: {}", found.mass)));
                }
                if Cholesky::new(found.mass.clone()).is_none() {
                    return Err(self.breach(&format!("not positive: {}", found.mass)));
                }
            }
        }
        Ok(worst)
    }
}
