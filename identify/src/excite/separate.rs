//! How well a motion distinguishes effects. Input: columns of the base, of an effect and of its rivals. Output: the
//! size of the force that no fit of the base and the wrong effect can explain.
//!
//! Two models are distinguished by the part of one model's output that the other cannot explain when it is fitted to it
//! (W. G. Hunter and A. M. Reiner, "Designs for discriminating between two rival models", Technometrics 7, 1965; A. C.
//! Atkinson and V. V. Fedorov, "The design of experiments for discriminating between two rival models", Biometrika 62,
//! 1975). Angles between spans follow A. Bjoerck and G. H. Golub, "Numerical methods for computing angles between
//! linear subspaces", Mathematics of Computation 27 (1973).
//!
//! Decision: effects are separated by a force and not by an angle. The force is what is compared with the noise; an
//! angle can be large where both forces are small. The rival gets the constants with which it is most similar. In the
//! other direction its size is not known; it gets the effect's size and the values with which it is most similar, so
//! that the smallest angle between both spans decides. A rival that the effect contains as a special case is left out
//! there and reported. Signs of rates jump; differences over wide steps of the coefficients are slopes of their mean.

use nalgebra::DMatrix;

pub use super::thresholds::SEPARATION_ROUNDING;
use super::thresholds::SEPARATION_SPAN_TOLERANCE;

/// An effect and its rivals along a motion. Rows are samples and drives, in N or N m; if drives differ in their noise,
/// rows are divided by it.
#[derive(Clone, Debug)]
pub struct SeparationProblem {
    /// Columns that are fitted in any case.
    pub base: DMatrix<f64>,
    /// The expected force of the effect. Several columns are parts with unknown signs; their mean square over all signs
    /// counts.
    pub effect: DMatrix<f64>,
    /// Columns of the effect as it would be fitted, for each value of a searched constant.
    pub fitted: Vec<DMatrix<f64>>,
    /// Columns of its rivals, for each rival and each value of a searched constant.
    pub rivals: Vec<DMatrix<f64>>,
}

/// Rms forces over the rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeparationMeasure {
    /// Force of the effect.
    pub effect: f64,
    /// Part of it that the base cannot explain.
    pub outside_base: f64,
    /// Residual of the effect after a fit of the base and of the most similar rival.
    pub residual: f64,
    /// Residual in the other direction: that rival, with the values most similar to the effect and as large as
    /// `outside_base`, after a fit of base and effect.
    pub reverse_residual: f64,
    /// The most similar rival, as index into [`SeparationProblem::rivals`].
    pub rival: usize,
}

impl SeparationMeasure {
    /// Whether the base alone explains the effect.
    pub fn is_in_base(&self) -> bool {
        self.outside_base <= SEPARATION_ROUNDING * self.effect
    }

    /// Whether base and rival together explain the effect.
    pub fn is_mimicked(&self) -> bool {
        self.residual <= SEPARATION_ROUNDING * self.effect
    }

    /// Whether base and effect together explain the rival.
    pub fn can_explain_rival(&self) -> bool {
        self.reverse_residual <= SEPARATION_ROUNDING * self.effect
    }
}

/// Measures how well a motion distinguishes the effect from its rivals; `None` without rows, rivals, or force of the
/// effect.
///
/// ```
/// use modelmill_identify::excite::separate::{SeparationProblem, measure_separation};
/// use nalgebra::DMatrix;
/// // The forces (1, 1, 0) and (0, 1, 1) are 60 degrees apart.
/// let effect = DMatrix::from_column_slice(3, 1, &[1.0, 1.0, 0.0]);
/// let rival = DMatrix::from_column_slice(3, 1, &[0.0, 1.0, 1.0]);
/// let base = DMatrix::zeros(3, 0);
/// let fitted = vec![effect.clone()];
/// let found = measure_separation(&SeparationProblem { base, effect, fitted, rivals: vec![rival] }).unwrap();
/// assert!((found.residual - found.effect * 0.75_f64.sqrt()).abs() < 1e-12);
/// assert!((found.reverse_residual - found.residual).abs() < 1e-12);
/// ```
pub fn measure_separation(problem: &SeparationProblem) -> Option<SeparationMeasure> {
    let rows = problem.effect.nrows();
    let rms = |matrix: &DMatrix<f64>| matrix.norm() / (rows as f64).sqrt();
    let effect = rms(&problem.effect);
    let is_felt = effect.is_finite() && effect > 0.0;
    if rows == 0 || !is_felt {
        return None;
    }
    let base = orthonormal_basis(&problem.base);
    let beyond = project_out(&base, &problem.effect);
    let spans = problem.rivals.iter().map(|rival| orthonormal_extension(&base, rival));
    let (rival, span, left) = spans
        .enumerate()
        .map(|(k, span)| {
            let left = rms(&project_out(&span, &beyond));
            (k, span, left)
        })
        .min_by(|a, b| a.2.total_cmp(&b.2))?;
    let size = rms(&beyond);
    let angles = problem.fitted.iter().map(|fitted| {
        let own = orthonormal_extension(&base, fitted);
        smallest_angle_sine(&own, &span)
    });
    let sine = angles.min_by(f64::total_cmp).unwrap_or(1.0);
    let found = SeparationMeasure {
        effect,
        outside_base: size,
        residual: left,
        reverse_residual: size * sine,
        rival,
    };
    (found.residual.is_finite() && found.reverse_residual.is_finite()).then_some(found)
}

/// Coefficients of base and effect, in this order, that fit forces best. Singular directions are left out (smallest
/// solution).
pub fn fit_coefficients(base: &DMatrix<f64>, effect: &DMatrix<f64>, forces: &[f64]) -> Vec<f64> {
    let n = base.ncols() + effect.ncols();
    let column = |k: usize| {
        if k < base.ncols() {
            base.column(k)
        } else {
            effect.column(k - base.ncols())
        }
    };
    let norms: Vec<f64> = (0..n).map(|k| column(k).norm().max(f64::MIN_POSITIVE)).collect();
    let scaled = DMatrix::from_fn(base.nrows(), n, |i, k| column(k)[i] / norms[k]);
    let forces = nalgebra::DVector::from_column_slice(forces);
    let svd = scaled.svd(true, true);
    let found = svd.solve(&forces, SEPARATION_SPAN_TOLERANCE);
    found.map_or_else(
        |_| vec![0.0; n],
        |x| x.iter().zip(&norms).map(|(x, norm)| x / norm).collect(),
    )
}

/// The sine of the smallest angle between two spans, given by orthonormal columns; 1 if one of them is empty.
fn smallest_angle_sine(one: &DMatrix<f64>, other: &DMatrix<f64>) -> f64 {
    if one.ncols() == 0 || other.ncols() == 0 {
        return 1.0;
    }
    // Project the smaller span on the larger one: a remainder of the larger span is orthogonal in any case.
    let (large, small) = if one.ncols() >= other.ncols() {
        (one, other)
    } else {
        (other, one)
    };
    // Sines are accurate for small angles, cosines are not.
    let rest = project_out(large, small);
    let squares = rest.tr_mul(&rest).symmetric_eigenvalues();
    squares.min().max(0.0).sqrt().min(1.0)
}

/// Projects orthonormal columns out of others.
fn project_out(span: &DMatrix<f64>, columns: &DMatrix<f64>) -> DMatrix<f64> {
    let mut rest = columns.clone();
    // The second pass removes rounding errors.
    for _ in 0..2 {
        if span.ncols() > 0 {
            rest -= span * span.tr_mul(&rest);
        }
    }
    rest
}

/// Orthonormal columns with the span of others.
fn orthonormal_basis(columns: &DMatrix<f64>) -> DMatrix<f64> {
    orthonormal_extension(&DMatrix::zeros(columns.nrows(), 0), columns)
}

/// Orthonormal columns that, together with a span, have the span of both.
///
/// Modified Gram-Schmidt, twice. Dependent columns are left out, so that a poor motion is no error.
fn orthonormal_extension(span: &DMatrix<f64>, columns: &DMatrix<f64>) -> DMatrix<f64> {
    let rest = project_out(span, columns);
    let mut found: Vec<nalgebra::DVector<f64>> = Vec::new();
    for (k, column) in rest.column_iter().enumerate() {
        let size = columns.column(k).norm();
        let mut column = column.into_owned();
        for _ in 0..2 {
            for known in &found {
                let share = known.dot(&column);
                column.axpy(-share, known, 1.0);
            }
        }
        let norm = column.norm();
        if norm.is_finite() && norm > SEPARATION_SPAN_TOLERANCE * size {
            found.push(column / norm);
        }
    }
    if found.is_empty() {
        return DMatrix::zeros(columns.nrows(), 0);
    }
    DMatrix::from_columns(&found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::TestNoise;

    fn random(noise: &mut TestNoise, rows: usize, columns: usize) -> DMatrix<f64> {
        DMatrix::from_fn(rows, columns, |_, _| noise.normal())
    }

    /// Residual of forces by a solution of the normal equations, which shares no code with the projections.
    fn left(of: &DMatrix<f64>, columns: &[&DMatrix<f64>]) -> f64 {
        let all: Vec<_> = columns.iter().flat_map(|m| m.column_iter()).collect();
        let w = DMatrix::from_columns(&all);
        let x = (w.transpose() * &w)
            .cholesky()
            .expect("independent columns")
            .solve(&(w.transpose() * of));
        (of - w * x).norm() / (of.nrows() as f64).sqrt()
    }

    #[test]
    fn what_is_left_is_that_of_least_squares() {
        let mut noise = TestNoise::new(5);
        for _ in 0..20 {
            let base = random(&mut noise, 40, 4);
            let effect = random(&mut noise, 40, 2);
            let rivals: Vec<_> = (1..4).map(|n| random(&mut noise, 40, n)).collect();
            let fitted = vec![effect.clone()];
            let problem = SeparationProblem {
                base,
                effect,
                fitted,
                rivals,
            };
            let found = measure_separation(&problem).unwrap();
            let each = problem.rivals.iter();
            let least = each
                .map(|rival| left(&problem.effect, &[&problem.base, rival]))
                .fold(f64::INFINITY, f64::min);
            assert!((found.residual - least).abs() < 1e-12 * found.effect);
            let beyond = left(&problem.effect, &[&problem.base]);
            assert!((found.outside_base - beyond).abs() < 1e-12 * found.effect);
            assert!(found.residual <= found.outside_base && found.outside_base <= found.effect);
        }
    }

    /// The rival's values in which it is most like the effect, found by trying all.
    #[test]
    fn the_reverse_is_the_worst_of_all_values_of_the_rival() {
        let mut noise = TestNoise::new(9);
        let base = random(&mut noise, 30, 2);
        let effect = random(&mut noise, 30, 2);
        let rival = &effect * random(&mut noise, 2, 2) + 0.3 * random(&mut noise, 30, 2);
        let found = measure_separation(&SeparationProblem {
            base: base.clone(),
            effect: effect.clone(),
            fitted: vec![effect.clone()],
            rivals: vec![rival.clone()],
        })
        .unwrap();
        let share = |angle: f64| {
            let values = DMatrix::from_column_slice(2, 1, &[angle.cos(), angle.sin()]);
            let force = &rival * values;
            left(&force, &[&base, &effect]) / left(&force, &[&base])
        };
        let worst = (0..20_000)
            .map(|k| share(std::f64::consts::PI * f64::from(k) / 20_000.0))
            .fold(f64::INFINITY, f64::min);
        assert!((found.reverse_residual / found.outside_base - worst).abs() < 1e-6);
    }

    #[test]
    fn what_another_holds_is_not_told_apart() {
        let mut noise = TestNoise::new(11);
        let base = random(&mut noise, 30, 2);
        let both = random(&mut noise, 30, 2);
        let one = both.columns(0, 1) * 2.0 + base.columns(1, 1) * 3.0;
        let measured = |effect: &DMatrix<f64>, rival: &DMatrix<f64>| {
            measure_separation(&SeparationProblem {
                base: base.clone(),
                effect: effect.clone(),
                fitted: vec![effect.clone()],
                rivals: vec![rival.clone()],
            })
            .unwrap()
        };
        let special = measured(&one, &both);
        assert!(special.is_mimicked() && !special.is_in_base());
        let general = measured(&both, &one);
        assert!(!general.is_mimicked() && general.can_explain_rival());
        assert!(measured(&(&base * 1.5), &both).is_in_base());
    }

    #[test]
    fn sizes_are_found_beside_the_base() {
        let mut noise = TestNoise::new(13);
        let base = random(&mut noise, 30, 3);
        let effect = random(&mut noise, 30, 1) * 1e6;
        let forces = base.columns(0, 1) * 4.0 + &effect * 2e-5;
        let found = fit_coefficients(&base, &effect, forces.as_slice());
        assert!((found[3] - 2e-5).abs() < 1e-12 && (found[0] - 4.0).abs() < 1e-9);
    }
}
