//! Parameters that bodies can have: reduced rows and a description of the bodies go in, physical
//! parameters with positive definite pseudo-inertias come out, nearest to the nominal ones among
//! those that fit the recording.
//!
//! A body is possible if and only if its pseudo-inertia `[S h; h' m]`, `S = 1/2 tr(I) 1 - I`, is
//! positive definite: P. M. Wensing, S. Kim and J.-J. E. Slotine, "Linear matrix inequalities for
//! physically consistent inertial parameter identification", IEEE RA-L 3 (2018). The minimum of
//!
//! `1/2 |R p(x) - Q'y|^2 / s^2 + g sum_b D(P_b(x) | P_b(nominal))`,
//! `D(P | P0) = tr(P0^-1 P) - log det(P0^-1 P) - 4`,
//!
//! is looked for over the physical parameters `x`, where `s` is the residuals' standard deviation
//! with autocorrelation allowed for. `D` is the entropic (Bregman) divergence of T. Lee, P. M.
//! Wensing and F. C. Park, "Geometric robot dynamic identification", IEEE T-RO 36 (2020): free of
//! units and of the choice of frames, and infinite where a body ends to be possible, so that it
//! keeps all of them inside; unlike the log-Cholesky parametrisation of C. Rucker and P. M. Wensing
//! (RA-L 7, 2022) it needs no body with ten parameters of its own, so that parameters may be shared
//! between bodies, and planar and lumped ones are treated alike. With a small `g` it decides only
//! what the recording does not. The minimum is found by Gauss's and Newton's steps, damped after
//! Levenberg and Marquardt and shortened to stay inside, with `g` falling from where both terms weigh alike.

use std::fmt;

use nalgebra::{DMatrix, DVector};

use crate::estimate::deviations::Deviations;
use crate::estimate::prior::inflation;
use crate::estimate::solution::Solution;
use crate::estimate::triangle::Triangle;

/// A matrix as a function of the physical parameters.
pub type MatrixMap<'a> = Box<dyn Fn(&[f64]) -> DMatrix<f64> + 'a>;

/// What must be positive definite for a body to be possible, as a function of the physical parameters.
pub struct Body<'a> {
    /// Its name for people.
    pub name: String,
    /// A symmetric matrix of fixed size; a mass or an inertia alone is one number.
    pub matrix: MatrixMap<'a>,
    /// How often the matrix holds each of its numbers: 2 for [`planar`], else 1.
    pub copies: f64,
}

/// The base parameters for given physical parameters with their derivatives (rows: base parameters), in the order of the
/// regressor's columns.
pub type BaseMap<'a> = dyn Fn(&[f64]) -> (DVector<f64>, DMatrix<f64>) + 'a;

/// Weight of the nominal values in the end; see the module.
pub const NOMINAL_WEIGHT: f64 = 0.01;

/// Why no possible parameters were found.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum PhysicalError {
    /// A body is not possible with its nominal values, so that nothing can be near to them.
    NominalImpossible {
        /// The body.
        body: String,
        /// What is wrong with it.
        why: String,
    },
    /// The iteration did not settle; only extreme numbers can cause it.
    NoConvergence,
}

impl fmt::Display for PhysicalError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NominalImpossible { body, why } => write!(
                f,
                "the nominal values of {body} are those of no body: {why}; give nominal values that a body can have, as a \
                 CAD system prints them"
            ),
            Self::NoConvergence => {
                f.write_str("the search for physical parameters did not settle; are the nominal values of the right size?")
            }
        }
    }
}

impl std::error::Error for PhysicalError {}

/// Directions below this share of the largest singular value are told by rounding only.
const WITHIN_SPAN: f64 = 1e-10;

/// Physical parameters that are possible.
#[derive(Debug, Clone, PartialEq)]
pub struct Physical {
    /// All physical parameters.
    pub parameters: Vec<f64>,
    /// Their standard deviations if nominal values may be off by their own size (`g = 1`).
    pub std: Vec<f64>,
    /// By how much the recording lowers the variance that the nominal values alone leave, 0 to 1; near 0 it is the nominal
    /// value that one sees. What is not [`alone`](Self::alone) owes some of it to nominal values of others.
    pub from_recording: Vec<f64>,
    /// Whether the recording tells a parameter by itself. If not, it tells combinations of it with others only, and what
    /// bodies can be and nominal values of the others share them out.
    pub alone: Vec<bool>,
    /// The base parameters that follow.
    pub base: Vec<f64>,
    /// Their standard deviations.
    pub base_std: Vec<f64>,
    /// Norm of the residual.
    pub residual_norm: f64,
    /// For each body the smallest eigenvalue of its matrix relative to the nominal one.
    pub margins: Vec<f64>,
    /// Steps that were made.
    pub iterations: usize,
}

/// The pseudo-inertia of a body in space from mass, first moment (kg m) and inertia about the origin (xx, xy, xz, yy, yz,
/// zz).
pub fn pseudo_inertia(mass: f64, moment: [f64; 3], inertia: [f64; 6]) -> DMatrix<f64> {
    let [xx, xy, xz, yy, yz, zz] = inertia;
    let half = 0.5 * (xx + yy + zz);
    let [x, y, z] = moment;
    DMatrix::from_row_slice(
        4,
        4,
        &[
            half - xx,
            -xy,
            -xz,
            x,
            -xy,
            half - yy,
            -yz,
            y,
            -xz,
            -yz,
            half - zz,
            z,
            x,
            y,
            z,
            mass,
        ],
    )
}

/// The same for a body that is only seen turning about one axis: positive definite exactly if the mass is positive and so
/// is the inertia about the axis through the centre. Every number stands in it twice.
pub fn planar(mass: f64, moment: [f64; 2], inertia: f64) -> DMatrix<f64> {
    let [x, y] = moment;
    DMatrix::from_row_slice(
        4,
        4,
        &[
            inertia, 0.0, x, y, 0.0, inertia, -y, x, x, -y, mass, 0.0, y, x, 0.0, mass,
        ],
    )
}

/// Possible physical parameters that fit the rows of `triangle`, whose solution and deviations are given, nearest to
/// `nominal`, at which every body must be possible.
pub fn physical(
    triangle: &Triangle,
    solution: &Solution,
    deviations: &Deviations,
    nominal: &[f64],
    base: &BaseMap<'_>,
    bodies: &[Body<'_>],
) -> Result<Physical, PhysicalError> {
    let noise = (solution.residual_variance() * inflation(solution, deviations)).sqrt();
    let least = 1e-7 * solution.measured_norm / (solution.rows.max(1) as f64).sqrt();
    let noise = if noise > least {
        noise
    } else {
        least.max(f64::MIN_POSITIVE.sqrt())
    };
    let references = bodies
        .iter()
        .map(|body| Reference::of(body, nominal))
        .collect::<Result<Vec<_>, _>>()?;
    let problem = Problem {
        r: triangle.r() / noise,
        right: triangle.right() / noise,
        base,
        bodies,
        references,
        scales: step_scales(nominal),
    };
    let mut x = DVector::from_column_slice(nominal);
    let mut iterations = 0;
    // From where nominal values and recording weigh alike, along the path of minima.
    let mut weight = problem.value(&x, 0.0).unwrap_or(1.0).max(1.0);
    while weight > NOMINAL_WEIGHT {
        weight = (weight * 0.1_f64).max(NOMINAL_WEIGHT);
        iterations += problem.minimise(&mut x, weight)?;
    }
    // What is left open if nominal values may be off by their own size.
    let point = problem.at(&x, 1.0).ok_or(PhysicalError::NoConvergence)?;
    let inverse = invert(&(&point.data + &point.prior));
    let before = invert(&point.prior);
    let (p, slopes) = base(x.as_slice());
    let spread = &slopes * &inverse * slopes.transpose();
    let misfit = triangle.right() - triangle.r() * &p;
    let n = nominal.len();
    Ok(Physical {
        std: (0..n).map(|i| inverse[(i, i)].max(0.0).sqrt()).collect(),
        from_recording: (0..n)
            .map(|i| {
                if before[(i, i)] > 0.0 {
                    (1.0 - inverse[(i, i)] / before[(i, i)]).clamp(0.0, 1.0)
                } else {
                    f64::from(u8::from(point.data[(i, i)] > 0.0))
                }
            })
            .collect(),
        alone: told_alone(&(&problem.r * &slopes)),
        residual_norm: misfit.norm().hypot(triangle.corner()),
        base: p.iter().copied().collect(),
        base_std: spread
            .diagonal()
            .iter()
            .map(|v| v.max(0.0).sqrt())
            .collect(),
        margins: problem
            .references
            .iter()
            .zip(bodies)
            .map(|(reference, body)| reference.margin(&(body.matrix)(x.as_slice())))
            .collect(),
        parameters: x.iter().copied().collect(),
        iterations,
    })
}

/// Which unknowns of linear equations have a value of their own: those whose unit vector lies in the span of the rows.
fn told_alone(rows: &DMatrix<f64>) -> Vec<bool> {
    let mut scaled = rows.clone();
    for mut column in scaled.column_iter_mut() {
        let norm = column.norm();
        if norm > 0.0 {
            column.unscale_mut(norm);
        }
    }
    let svd = scaled.svd(false, true);
    let largest = svd.singular_values.iter().copied().fold(0.0, f64::max);
    let Some(span) = svd.v_t.filter(|_| largest > 0.0) else {
        return vec![false; rows.ncols()];
    };
    let mut within = vec![0.0; rows.ncols()];
    for (direction, value) in span.row_iter().zip(svd.singular_values.iter()) {
        if *value > WITHIN_SPAN * largest {
            for (sum, component) in within.iter_mut().zip(direction.iter()) {
                *sum += component * component;
            }
        }
    }
    within.iter().map(|share| *share > 1.0 - 1e-6).collect()
}

/// The nominal matrix of a body, by its inverse root.
struct Reference {
    /// `L^-1` of `P0 = L L'`.
    root_inverse: DMatrix<f64>,
    copies: f64,
}

impl Reference {
    fn of(body: &Body<'_>, nominal: &[f64]) -> Result<Self, PhysicalError> {
        let matrix = (body.matrix)(nominal);
        let n = matrix.nrows();
        let impossible = || PhysicalError::NominalImpossible {
            body: body.name.clone(),
            why: why_impossible(&matrix),
        };
        let cholesky = matrix.clone().cholesky().ok_or_else(impossible)?;
        let root_inverse = cholesky
            .l()
            .solve_lower_triangular(&DMatrix::identity(n, n))
            .filter(|inverse| inverse.iter().all(|x| x.is_finite()))
            .ok_or_else(impossible)?;
        let copies = body.copies;
        Ok(Self {
            root_inverse,
            copies,
        })
    }

    /// `L^-1 P L'^-1`, the identity at the nominal values.
    fn relative(&self, matrix: &DMatrix<f64>) -> DMatrix<f64> {
        let relative = &self.root_inverse * matrix * self.root_inverse.transpose();
        0.5 * (&relative + relative.transpose())
    }

    fn margin(&self, matrix: &DMatrix<f64>) -> f64 {
        self.relative(matrix).symmetric_eigenvalues().min()
    }
}

fn why_impossible(matrix: &DMatrix<f64>) -> String {
    let n = matrix.nrows();
    if n == 1 {
        return format!("{} is not positive", matrix[(0, 0)]);
    }
    let mass = matrix[(n - 1, n - 1)];
    if mass.is_nan() || mass <= 0.0 {
        return format!("its mass {mass} kg is not positive");
    }
    "its inertia about the centre of mass is not that of any distribution of mass (principal moments must be positive, and \
     each at most the sum of the other two)"
        .to_owned()
}

/// Steps for differences: matrices are polynomials of low degree, so that central differences are nearly exact.
fn step_scales(nominal: &[f64]) -> Vec<f64> {
    nominal
        .iter()
        .map(|x| 1e-4 * if *x == 0.0 { 1.0 } else { x.abs() })
        .collect()
}

struct Problem<'a> {
    /// In units of the noise.
    r: DMatrix<f64>,
    right: DVector<f64>,
    base: &'a BaseMap<'a>,
    bodies: &'a [Body<'a>],
    references: Vec<Reference>,
    scales: Vec<f64>,
}

/// Value and derivatives at a point.
struct Point {
    value: f64,
    gradient: DVector<f64>,
    /// Second derivatives by the recording (Gauss and Newton) and by the divergence.
    data: DMatrix<f64>,
    prior: DMatrix<f64>,
}

impl Problem<'_> {
    /// The value; none outside.
    fn value(&self, x: &DVector<f64>, weight: f64) -> Option<f64> {
        let (p, _) = (self.base)(x.as_slice());
        let mut value = 0.5 * (&self.r * p - &self.right).norm_squared();
        for (body, reference) in self.bodies.iter().zip(&self.references) {
            let relative = reference.relative(&(body.matrix)(x.as_slice()));
            let trace = relative.trace();
            let n = relative.nrows() as f64;
            let cholesky = relative.cholesky()?;
            let log_det: f64 = cholesky
                .l_dirty()
                .diagonal()
                .iter()
                .map(|d| 2.0 * d.ln())
                .sum();
            value += weight * (trace - log_det - n) / reference.copies;
        }
        value.is_finite().then_some(value)
    }

    fn at(&self, x: &DVector<f64>, weight: f64) -> Option<Point> {
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
            // Derivatives of the relative matrix, only by what it depends on.
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
            let turned: Vec<DMatrix<f64>> =
                slopes.iter().map(|(_, slope)| &inverse * slope).collect();
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
        Some(Point {
            value: self.value(x, weight)?,
            gradient,
            data,
            prior,
        })
    }

    /// Levenberg and Marquardt, with steps that stay where all bodies are possible.
    fn minimise(&self, x: &mut DVector<f64>, weight: f64) -> Result<usize, PhysicalError> {
        let mut damping = 1e-9;
        for iteration in 0..500 {
            let point = self.at(x, weight).ok_or(PhysicalError::NoConvergence)?;
            let second = &point.data + &point.prior;
            let mut moved = false;
            while !moved && damping < 1e9 {
                let mut damped = second.clone();
                for i in 0..x.len() {
                    // What nothing depends on stays where it is.
                    damped[(i, i)] += damping * second[(i, i)];
                    if damped[(i, i)] == 0.0 {
                        damped[(i, i)] = 1.0;
                    }
                }
                let step = solve_scaled(&damped, &point.gradient).map(|step| -step);
                let Some(step) = step else {
                    damping *= 100.0;
                    continue;
                };
                let slope = point.gradient.dot(&step);
                // Far below what shows: a unit is half a squared standard deviation.
                if -slope <= 1e-8 * (1.0 + point.value.abs().min(1e4)) {
                    return Ok(iteration);
                }
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
                damping = if length < 0.1 {
                    damping * 100.0
                } else {
                    (damping * 0.01).max(1e-9)
                };
            }
            // Rounding hides what is left of the slope.
            if !moved {
                return Ok(iteration);
            }
        }
        Err(PhysicalError::NoConvergence)
    }
}

/// Solves a positive definite system after scaling its diagonal to 1, since parameters differ in units.
fn solve_scaled(matrix: &DMatrix<f64>, right: &DVector<f64>) -> Option<DVector<f64>> {
    let scale = matrix
        .diagonal()
        .map(|d| if d > 0.0 { d.sqrt().recip() } else { 1.0 });
    let scaled = DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| {
        scale[i] * matrix[(i, j)] * scale[j]
    });
    let solved = scaled.cholesky()?.solve(&right.component_mul(&scale));
    Some(solved.component_mul(&scale))
}

/// Inverse of a symmetric matrix where it has one; nothing is known along the rest, which is left away.
fn invert(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let n = matrix.nrows();
    let scale = matrix
        .diagonal()
        .map(|d| if d > 0.0 { d.sqrt().recip() } else { 0.0 });
    let scaled = DMatrix::from_fn(n, n, |i, j| scale[i] * matrix[(i, j)] * scale[j]);
    let eigen = scaled.symmetric_eigen();
    let mut inverse = DMatrix::zeros(n, n);
    for (k, value) in eigen.eigenvalues.iter().enumerate() {
        if *value > 1e-13 * n as f64 {
            let direction = eigen.eigenvectors.column(k).component_mul(&scale);
            inverse += &direction * direction.transpose() / *value;
        }
    }
    inverse
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::deviations::autocorrelated;
    use crate::test_noise::Noise;
    use crate::{LeastSquares, LeastSquaresError};

    /// The pseudo-inertia of point masses: always possible, and exactly what a body is.
    fn random_body(noise: &mut Noise) -> [f64; 10] {
        let mut body = [0.0; 10];
        for _ in 0..6 {
            let m = noise.uniform();
            let [x, y, z] = [
                0.3 * noise.normal(),
                0.2 * noise.normal(),
                0.1 + 0.4 * noise.normal(),
            ];
            let one = [
                m,
                m * x,
                m * y,
                m * z,
                m * (y * y + z * z),
                -m * x * y,
                -m * x * z,
                m * (x * x + z * z),
                -m * y * z,
                m * (x * x + y * y),
            ];
            for (sum, term) in body.iter_mut().zip(one) {
                *sum += term;
            }
        }
        body
    }

    fn matrix_of(x: &[f64]) -> DMatrix<f64> {
        pseudo_inertia(
            x[0],
            [x[1], x[2], x[3]],
            [x[4], x[5], x[6], x[7], x[8], x[9]],
        )
    }

    /// Two bodies; of their 20 parameters 14 combinations are seen through a random regressor with noise.
    struct Case {
        truth: Vec<f64>,
        nominal: Vec<f64>,
        map: DMatrix<f64>,
        regression: LeastSquares,
        w: Vec<f64>,
        y: Vec<f64>,
    }

    fn case(seed: u64, sigma: f64) -> Case {
        let mut noise = Noise::new(seed);
        let truth: Vec<f64> = [random_body(&mut noise), random_body(&mut noise)].concat();
        let nominal: Vec<f64> = [random_body(&mut noise), random_body(&mut noise)].concat();
        let map = DMatrix::from_fn(14, 20, |_, _| noise.normal());
        let p = &map * DVector::from_column_slice(&truth);
        let (mut w, mut y) = (Vec::new(), Vec::new());
        for _ in 0..400 {
            let row: Vec<f64> = (0..14).map(|_| noise.normal()).collect();
            y.push(
                row.iter().zip(p.iter()).map(|(w, p)| w * p).sum::<f64>() + sigma * noise.normal(),
            );
            w.extend(row);
        }
        let mut regression = LeastSquares::new(14);
        regression.add_rows(&w, &y).unwrap();
        Case {
            truth,
            nominal,
            map,
            regression,
            w,
            y,
        }
    }

    fn bodies() -> Vec<Body<'static>> {
        (0..2)
            .map(|k| Body {
                name: format!("body {k}"),
                matrix: Box::new(move |x: &[f64]| matrix_of(&x[10 * k..10 * k + 10])),
                copies: 1.0,
            })
            .collect()
    }

    fn solved(case: &Case) -> (Triangle, Solution, Deviations) {
        let solution = case.regression.solve().unwrap();
        let deviations: Result<Deviations, LeastSquaresError> =
            autocorrelated(&solution, 1, |visit| visit(&case.w, &case.y));
        (
            Triangle::of(&case.regression),
            solution,
            deviations.unwrap(),
        )
    }

    fn find(case: &Case) -> Physical {
        let (triangle, solution, deviations) = solved(case);
        let base = |x: &[f64]| (&case.map * DVector::from_column_slice(x), case.map.clone());
        physical(
            &triangle,
            &solution,
            &deviations,
            &case.nominal,
            &base,
            &bodies(),
        )
        .unwrap()
    }

    #[test]
    fn what_comes_out_is_possible_and_fits_as_well_as_least_squares() {
        for seed in 0..12 {
            let case = case(seed, 0.05);
            let (_, solution, _) = solved(&case);
            let found = find(&case);
            for body in found.parameters.chunks_exact(10) {
                assert!(matrix_of(body).cholesky().is_some());
            }
            assert!(found.margins.iter().all(|margin| *margin > 0.0));
            // The truth is possible and fits to the noise, so that possible parameters can as well.
            assert!(
                found.residual_norm < 1.05 * solution.residual_norm,
                "seed {seed}"
            );
            assert!(found.residual_norm >= solution.residual_norm * (1.0 - 1e-9));
            let p = &case.map * DVector::from_column_slice(&case.truth);
            for (found, p) in found.base.iter().zip(p.iter()) {
                assert!((found - p).abs() < 0.05, "seed {seed}: {found} and {p}");
            }
        }
    }

    /// With heavy noise least squares is often impossible: no parameters of bodies have its values.
    #[test]
    fn under_heavy_noise_no_possible_neighbour_is_better() {
        let case = case(40, 3.0);
        let (triangle, solution, deviations) = solved(&case);
        let found = find(&case);
        let noise = (solution.residual_variance() * inflation(&solution, &deviations)).sqrt();
        let references: Vec<Reference> = bodies()
            .iter()
            .map(|body| Reference::of(body, &case.nominal).unwrap())
            .collect();
        let objective = |x: &[f64]| -> f64 {
            let misfit = (triangle.r() * (&case.map * DVector::from_column_slice(x))
                - triangle.right())
                / noise;
            let prior: f64 = (0..2)
                .map(|k| {
                    let relative = references[k].relative(&matrix_of(&x[10 * k..10 * k + 10]));
                    let eigenvalues = relative.symmetric_eigenvalues();
                    eigenvalues
                        .iter()
                        .map(|l| {
                            if *l > 0.0 {
                                l - l.ln() - 1.0
                            } else {
                                f64::INFINITY
                            }
                        })
                        .sum::<f64>()
                })
                .sum();
            0.5 * misfit.norm_squared() + NOMINAL_WEIGHT * prior
        };
        let best = objective(&found.parameters);
        let mut random = Noise::new(9);
        for size in [1e-1, 1e-2, 1e-3, 1e-4] {
            for _ in 0..2000 {
                let near: Vec<f64> = found
                    .parameters
                    .iter()
                    .map(|x| x + size * random.normal())
                    .collect();
                assert!(objective(&near) >= best - 1e-7 * best.abs().max(1.0));
            }
        }
        assert!(best <= objective(&case.nominal) && best <= objective(&case.truth));
    }

    /// What the recording does not say stays at its nominal value, and is known to do so.
    #[test]
    fn without_information_the_nominal_values_stay() {
        let mut case = case(7, 1e-4);
        // Only the first body is seen.
        let unseen = case.map.columns(10, 10) * DVector::from_column_slice(&case.truth[10..]);
        for (row, y) in case.w.chunks_exact(14).zip(&mut case.y) {
            *y -= row
                .iter()
                .zip(unseen.iter())
                .map(|(w, p)| w * p)
                .sum::<f64>();
        }
        case.regression = LeastSquares::new(14);
        case.regression.add_rows(&case.w, &case.y).unwrap();
        case.map.columns_mut(10, 10).fill(0.0);
        let found = find(&case);
        for j in 10..20 {
            assert!((found.parameters[j] - case.nominal[j]).abs() < 1e-6);
            assert!(found.from_recording[j] < 1e-9);
        }
        assert!(found.from_recording[..10].iter().all(|share| *share > 0.5));
        // Fourteen combinations of ten numbers tell each of them.
        assert_eq!(found.alone, [[true; 10], [false; 10]].concat());
    }

    /// Of `x + y` and `z` only the last has a value of its own, whatever nominal values say beside.
    #[test]
    fn what_is_told_in_sums_only_is_not_told_alone() {
        let rows = DMatrix::from_row_slice(
            3,
            4,
            &[1e3, 1e3, 0.0, 0.0, 2e3, 2e3, 1e-3, 0.0, 0.0, 0.0, 1e-3, 0.0],
        );
        assert_eq!(told_alone(&rows), [false, false, true, false]);
        assert_eq!(told_alone(&DMatrix::zeros(2, 2)), [false, false]);
        // Fourteen combinations of twenty numbers tell none of them.
        assert_eq!(find(&case(3, 0.05)).alone, [false; 20]);
    }

    #[test]
    fn planar_bodies_need_inertia_about_their_centre() {
        assert!(planar(2.0, [0.6, 0.8], 0.51).cholesky().is_some());
        assert!(planar(2.0, [0.6, 0.8], 0.49).cholesky().is_none());
        let body = Body {
            name: "link".to_owned(),
            matrix: Box::new(|x: &[f64]| planar(x[0], [x[1], 0.0], x[2])),
            copies: 2.0,
        };
        let error = Reference::of(&body, &[2.0, 1.0, 0.4]).err().unwrap();
        assert!(
            error.to_string().contains("link") && error.to_string().contains("inertia"),
            "{error}"
        );
        let error = Reference::of(&body, &[0.0, 0.0, 0.4]).err().unwrap();
        assert!(error.to_string().contains("mass"), "{error}");
    }
}
