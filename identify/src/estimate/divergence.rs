//! Minimum of misfit plus divergence over physical parameters; the function is in [`physical`](super::physical).

use nalgebra::{DMatrix, DVector};

use crate::estimate::body_matrices::{BodyMatrix, NominalBodyMatrix};
use crate::estimate::error::PhysicalError;
use crate::signal::ScaledNormalEquations;

/// Base parameters as a function of physical parameters, with derivatives (rows: base parameters), in the order of the
/// regressor's columns.
pub type BaseMap<'a> = dyn Fn(&[f64]) -> (DVector<f64>, DMatrix<f64>) + 'a;

/// Steps for central differences, in the units of the parameters; the matrices are polynomials of low degree, so the
/// differences are nearly exact.
pub(crate) fn step_scales(nominal: &[f64]) -> Vec<f64> {
    nominal
        .iter()
        .map(|x| 1e-4 * if *x == 0.0 { 1.0 } else { x.abs() })
        .collect()
}

/// Misfit and divergence as a function of the physical parameters.
pub(crate) struct MisfitFunction<'a> {
    /// R factor of the rows, divided by the standard deviation of the noise.
    pub(crate) r: DMatrix<f64>,
    /// Right side, divided in the same way.
    pub(crate) right: DVector<f64>,
    /// Base parameters of physical parameters.
    pub(crate) base: &'a BaseMap<'a>,
    /// Matrices that must be positive definite.
    pub(crate) bodies: &'a [BodyMatrix<'a>],
    /// The same matrices at the nominal values.
    pub(crate) references: Vec<NominalBodyMatrix>,
    /// Steps for differences, one per physical parameter.
    pub(crate) scales: Vec<f64>,
}

/// Value and derivatives at a point.
pub(crate) struct MisfitPoint {
    /// Misfit plus weighted divergence.
    pub(crate) value: f64,
    /// Its gradient with respect to the physical parameters.
    pub(crate) gradient: DVector<f64>,
    /// Second derivatives of the misfit (Gauss-Newton).
    pub(crate) data: DMatrix<f64>,
    /// Second derivatives of the divergence.
    pub(crate) prior: DMatrix<f64>,
}

impl MisfitFunction<'_> {
    /// Value at a point with a weight of the divergence; `None` if a body is impossible there.
    pub(crate) fn value(&self, x: &DVector<f64>, weight: f64) -> Option<f64> {
        let (p, _) = (self.base)(x.as_slice());
        let mut value = 0.5 * (&self.r * p - &self.right).norm_squared();
        for (body, reference) in self.bodies.iter().zip(&self.references) {
            let relative = reference.relative(&(body.matrix)(x.as_slice()));
            let trace = relative.trace();
            let n = relative.nrows() as f64;
            let cholesky = relative.cholesky()?;
            let log_det: f64 = cholesky.l_dirty().diagonal().iter().map(|d| 2.0 * d.ln()).sum();
            value += weight * (trace - log_det - n) / reference.copies;
        }
        value.is_finite().then_some(value)
    }

    /// Value and derivatives at a point; `None` if a body is impossible there.
    pub(crate) fn evaluate_at(&self, x: &DVector<f64>, weight: f64) -> Option<MisfitPoint> {
        let n = x.len();
        let (p, jacobian) = (self.base)(x.as_slice());
        let residual = &self.r * p - &self.right;
        let slope = &self.r * jacobian;
        let mut gradient = slope.transpose() * &residual;
        let data = slope.transpose() * slope;
        let mut prior = DMatrix::zeros(n, n);
        for (body, reference) in self.bodies.iter().zip(&self.references) {
            let relative = reference.relative(&(body.matrix)(x.as_slice()));
            let inverse = relative.cholesky()?.inverse();
            let mut moved = x.clone();
            // Derivatives of the relative matrix, only with respect to parameters on which it depends.
            let mut slopes: Vec<(usize, DMatrix<f64>)> = Vec::new();
            for i in 0..n {
                let h = self.scales[i];
                moved[i] = x[i] + h;
                let up = (body.matrix)(moved.as_slice());
                moved[i] = x[i] - h;
                let down = (body.matrix)(moved.as_slice());
                moved[i] = x[i];
                let slope = (up - down) / (2.0 * h);
                if slope.iter().any(|x| *x != 0.0) {
                    slopes.push((i, reference.relative(&slope)));
                }
            }
            let factor = weight / reference.copies;
            // Gradient tr(S) - tr(P^-1 S) and second derivative tr(P^-1 S_i P^-1 S_j) of the divergence.
            let turned: Vec<DMatrix<f64>> = slopes.iter().map(|(_, slope)| &inverse * slope).collect();
            for (k, (i, slope)) in slopes.iter().enumerate() {
                gradient[*i] += factor * (slope.trace() - turned[k].trace());
                for (l, (j, _)) in slopes.iter().enumerate().take(k + 1) {
                    let second = factor * turned[k].dot(&turned[l].transpose());
                    prior[(*i, *j)] += second;
                    if i != j {
                        prior[(*j, *i)] += second;
                    }
                }
            }
        }
        Some(MisfitPoint {
            value: self.value(x, weight)?,
            gradient,
            data,
            prior,
        })
    }

    /// Minimises by the Levenberg-Marquardt method, with steps that keep all bodies possible. Returns the number of
    /// iterations.
    pub(crate) fn minimise(&self, x: &mut DVector<f64>, weight: f64) -> Result<usize, PhysicalError> {
        let mut damping = 1e-9;
        for iteration in 0..500 {
            let point = self.evaluate_at(x, weight).ok_or(PhysicalError::NoConvergence)?;
            let second = &point.data + &point.prior;
            let mut moved = false;
            while !moved && damping < 1e9 {
                let mut damped = second.clone();
                for i in 0..x.len() {
                    // A parameter without any influence stays constant.
                    damped[(i, i)] += damping * second[(i, i)];
                    if damped[(i, i)] == 0.0 {
                        damped[(i, i)] = 1.0;
                    }
                }
                // Parameters differ in units.
                let Some(factor) = ScaledNormalEquations::new(damped, 0.0) else {
                    damping *= 100.0;
                    continue;
                };
                let step = -factor.solve(&point.gradient);
                let slope = point.gradient.dot(&step);
                // Negligible decrease: one unit is half a squared standard deviation.
                if -slope <= 1e-8 * (1.0 + point.value.abs().min(1e4)) {
                    return Ok(iteration);
                }
                // Shorten the step until all bodies are possible and the value decreases enough.
                let mut length = 1.0;
                while length > 1e-6 {
                    let next = &*x + length * &step;
                    if self
                        .value(&next, weight)
                        .is_some_and(|v| v <= point.value + 1e-4 * length * slope)
                    {
                        *x = next;
                        moved = true;
                        break;
                    }
                    length *= 0.5;
                }
                // Short steps mean that the quadratic model is poor there.
                damping = if length < 0.1 {
                    damping * 100.0
                } else {
                    (damping * 0.01).max(1e-9)
                };
            }
            // No step decreases the value beyond rounding.
            if !moved {
                return Ok(iteration);
            }
        }
        Err(PhysicalError::NoConvergence)
    }
}
