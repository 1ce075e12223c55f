//! All real solutions of a system of polynomial equations with finitely many solutions. Input: polynomials; output:
//! points in floating point, each the nearest to an exact solution.
//!
//! Multiplication by a linear form acts on the quotient ring. If its minimal polynomial has as many roots as the ring
//! has dimensions, the coordinates of each solution are polynomials in the value of the form (the shape lemma: D. Cox,
//! J. Little, D. O'Shea, "Using Algebraic Geometry", 2.4). Multiple solutions are made simple first by A. Seidenberg's
//! lemma (1974).

use num_rational::BigRational;
use num_traits::{One, Signed, Zero};

use modelmill_algebra::groebner::{
    GroebnerLimitExceeded, GroebnerWork, groebner_basis, has_no_solution, remainder, standard_terms,
};
use modelmill_algebra::polynomial::{Polynomial, TermExponents, nearest_f64, unknown_polynomial};
use modelmill_algebra::real_roots::{
    RationalInterval, UnivariatePolynomial, halve_interval, is_squarefree, isolate_roots, squarefree_part,
};

/// Largest number of complex solutions of a system.
const MOST_SOLUTIONS: usize = 64;
/// Number of linear forms that are tried before solutions are assumed to be multiple.
const FORMS: i64 = 6;
/// Largest number of halvings of a root's interval, far below the resolution of floating point.
const MOST_HALVINGS: usize = 2000;

/// The solutions of a system.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum RealSolutions {
    /// All real solutions.
    Finite(Vec<Vec<f64>>),
    /// Complex solutions form curves or surfaces.
    Infinite,
}

/// Solves equations `polynomial = 0` in `n` unknowns; an error if the computation is too large.
pub(crate) fn solve(equations: &[Polynomial], n: usize) -> Result<RealSolutions, GroebnerLimitExceeded> {
    let mut work = GroebnerWork::default();
    let mut basis = groebner_basis(equations, &mut work)?;
    let mut is_radical = false;
    loop {
        if has_no_solution(&basis) {
            return Ok(RealSolutions::Finite(Vec::new()));
        }
        // Monomials that are a basis of the quotient ring; their number is that of complex solutions.
        let Some(terms) = standard_terms(&basis, n, MOST_SOLUTIONS)? else {
            return Ok(RealSolutions::Infinite);
        };
        let ring = QuotientRing {
            basis: &basis,
            terms: &terms,
        };
        // A form that separates all solutions gives the answer.
        for k in 1..=FORMS {
            if let Some(shape) = ring.solve_shape_lemma(k, &mut work)? {
                return Ok(RealSolutions::Finite(shape.points()));
            }
        }
        if is_radical {
            return Err(GroebnerLimitExceeded);
        }
        // Add the squarefree part of each unknown's minimal polynomial, which makes multiple solutions simple.
        let mut more = basis.clone();
        for i in 0..n {
            let minimal = ring.minimal_polynomial(&unknown_polynomial(n, i), &mut work)?;
            let mut equation = Polynomial::new(n);
            for (exponent, factor) in squarefree_part(&minimal).iter().enumerate() {
                let exponent = u32::try_from(exponent).expect("a small exponent");
                equation.add_term(&[(i, exponent)], factor);
            }
            more.push(equation);
        }
        basis = groebner_basis(&more, &mut work)?;
        is_radical = true;
    }
}

/// The quotient ring: polynomials modulo the equations.
struct QuotientRing<'a> {
    /// Groebner basis of the equations.
    basis: &'a [Polynomial],
    /// Monomials that span the ring.
    terms: &'a [TermExponents],
}

/// The solutions: each real root of one polynomial gives the coordinates by further polynomials.
struct ShapeLemmaSolution {
    /// Minimal polynomial of the linear form; its roots are the values of the form.
    minimal: UnivariatePolynomial,
    /// Each coordinate as a polynomial in the value of the form.
    coordinates: Vec<UnivariatePolynomial>,
}

impl QuotientRing<'_> {
    /// Coefficients of a reduced polynomial for the monomials of the ring.
    fn vector(&self, polynomial: &Polynomial) -> Vec<BigRational> {
        let factor = |term| polynomial.terms.get(term).cloned();
        let terms = self.terms.iter();
        terms
            .map(|term| factor(term).unwrap_or_else(BigRational::zero))
            .collect()
    }

    /// The powers 1, form, form^2, ... as vectors, one more than there are dimensions.
    fn powers(
        &self,
        form: &Polynomial,
        work: &mut GroebnerWork,
    ) -> Result<Vec<Vec<BigRational>>, GroebnerLimitExceeded> {
        let n = form.n;
        let mut one = Polynomial::new(n);
        one.add(TermExponents::unit_term(n), &BigRational::one());
        let mut power = remainder(&one, self.basis, work)?;
        let mut vectors = vec![self.vector(&power)];
        for _ in 0..self.terms.len() {
            let mut product = Polynomial::new(n);
            for (term, factor) in &form.terms {
                product.add_shifted(&power, term, factor);
            }
            power = remainder(&product, self.basis, work)?;
            vectors.push(self.vector(&power));
        }
        Ok(vectors)
    }

    /// Monic polynomial of least degree that is zero for the form, modulo the equations.
    fn minimal_polynomial(
        &self,
        form: &Polynomial,
        work: &mut GroebnerWork,
    ) -> Result<UnivariatePolynomial, GroebnerLimitExceeded> {
        let powers = self.powers(form, work)?;
        // The first power that is a combination of lower ones gives the polynomial.
        for k in 1..powers.len() {
            if let Some(mut factors) = solve_combinations(&powers[..k], &[&powers[k]]) {
                let mut minimal: UnivariatePolynomial = factors.remove(0).into_iter().map(|f| -f).collect();
                minimal.push(BigRational::one());
                return Ok(minimal);
            }
        }
        unreachable!("more vectors than dimensions are dependent")
    }

    /// The solutions by the shape lemma for the k-th linear form; `None` if the form does not separate all solutions.
    fn solve_shape_lemma(
        &self,
        k: i64,
        work: &mut GroebnerWork,
    ) -> Result<Option<ShapeLemmaSolution>, GroebnerLimitExceeded> {
        let n = self.basis[0].n;
        let mut form = Polynomial::new(n);
        // Integer weights of the unknowns, different for each k.
        let mut weight = 1_i64;
        for i in 0..n {
            form.add(TermExponents::unknown(n, i), &BigRational::from_integer(weight.into()));
            weight = (weight * (k + 1) + k) % 1009;
        }
        let mut powers = self.powers(&form, work)?;
        let last = powers.pop().expect("at least one power");
        // The highest power and all coordinates as combinations of lower powers.
        let mut targets = vec![last];
        for i in 0..n {
            let coordinate = remainder(&unknown_polynomial(n, i), self.basis, work)?;
            targets.push(self.vector(&coordinate));
        }
        let targets: Vec<&Vec<BigRational>> = targets.iter().collect();
        let Some(mut factors) = solve_combinations(&powers, &targets) else {
            return Ok(None);
        };
        let mut minimal: UnivariatePolynomial = factors.remove(0).into_iter().map(|f| -f).collect();
        minimal.push(BigRational::one());
        Ok(is_squarefree(&minimal).then_some(ShapeLemmaSolution {
            minimal,
            coordinates: factors,
        }))
    }
}

impl ShapeLemmaSolution {
    /// All real solutions in floating point.
    fn points(&self) -> Vec<Vec<f64>> {
        isolate_roots(&self.minimal)
            .into_iter()
            .map(|root| self.refine_point(root))
            .collect()
    }

    /// One solution: the interval of the root is halved until every coordinate is known to the last bit.
    fn refine_point(&self, mut root: RationalInterval) -> Vec<f64> {
        // Relative accuracy of 2^-60, or absolute 2^-1000 for a coordinate near zero.
        let fine = BigRational::new(1.into(), num_bigint::BigInt::from(1) << 60);
        let tiny = BigRational::new(1.into(), num_bigint::BigInt::from(1) << 1000);
        for _ in 0..MOST_HALVINGS {
            let images = self.coordinates.iter().map(|p| root.image(p));
            let all_known = images.into_iter().all(|image| {
                let size = image.low.abs().max(image.high.abs());
                image.width() <= size * &fine || image.width() <= tiny
            });
            if all_known {
                break;
            }
            // Several halvings between two tests, since a test costs more than a halving.
            for _ in 0..16 {
                halve_interval(&self.minimal, &mut root);
            }
        }
        let images = self.coordinates.iter().map(|p| root.image(p).middle());
        images.map(|value| nearest_f64(&value)).collect()
    }
}

/// Each target as a combination of vectors, by Gauss-Jordan elimination. `None` unless the vectors are independent and
/// span all targets.
fn solve_combinations(vectors: &[Vec<BigRational>], targets: &[&Vec<BigRational>]) -> Option<Vec<Vec<BigRational>>> {
    let (rows, columns) = (vectors[0].len(), vectors.len());
    let mut matrix: Vec<Vec<BigRational>> = (0..rows)
        .map(|r| {
            let left = vectors.iter().map(|v| v[r].clone());
            left.chain(targets.iter().map(|t| t[r].clone())).collect()
        })
        .collect();
    for c in 0..columns {
        let pivot = (c..rows).find(|r| !matrix[*r][c].is_zero())?;
        matrix.swap(c, pivot);
        let inverse = matrix[c][c].recip();
        for entry in &mut matrix[c][c..] {
            *entry *= &inverse;
        }
        let row = matrix[c].clone();
        for other in (0..rows).filter(|r| *r != c) {
            let factor = matrix[other][c].clone();
            if factor.is_zero() {
                continue;
            }
            for (entry, k) in matrix[other].iter_mut().zip(&row).skip(c) {
                *entry -= &factor * k;
            }
        }
    }
    // Rows below the pivots must vanish, or a target is outside of the span.
    let spans = matrix[columns..]
        .iter()
        .all(|row| row[columns..].iter().all(Zero::is_zero));
    spans.then(|| {
        (0..targets.len())
            .map(|t| (0..columns).map(|c| matrix[c][columns + t].clone()).collect())
            .collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interpret::exact_decimal;

    type Terms<'a> = &'a [(f64, &'a [(usize, u32)])];

    fn system(n: usize, equations: &[Terms<'_>]) -> Vec<Polynomial> {
        let one = |terms: &Terms<'_>| {
            let mut p = Polynomial::new(n);
            for (factor, powers) in *terms {
                p.add_term(powers, &exact_decimal(*factor));
            }
            p
        };
        equations.iter().map(one).collect()
    }

    fn sorted(solutions: RealSolutions) -> Vec<Vec<f64>> {
        let RealSolutions::Finite(mut points) = solutions else {
            panic!("finitely many are expected");
        };
        points.sort_by(|a, b| a.partial_cmp(b).unwrap());
        points
    }

    #[test]
    fn a_circle_meets_a_hyperbola_in_four_points() {
        // x^2 + y^2 = 25, x y = 12
        let equations = system(
            2,
            &[
                &[(1.0, &[(0, 2)]), (1.0, &[(1, 2)]), (-25.0, &[])],
                &[(1.0, &[(0, 1), (1, 1)]), (-12.0, &[])],
            ],
        );
        let found = sorted(solve(&equations, 2).unwrap());
        assert_eq!(found, [[-4.0, -3.0], [-3.0, -4.0], [3.0, 4.0], [4.0, 3.0]]);
    }

    #[test]
    fn complex_and_double_solutions_are_told_apart_from_real_and_simple_ones() {
        // (x - 2)^2 = 0, y^2 = x: one double x, two y.
        let double = system(
            2,
            &[
                &[(1.0, &[(0, 2)]), (-4.0, &[(0, 1)]), (4.0, &[])],
                &[(1.0, &[(1, 2)]), (-1.0, &[(0, 1)])],
            ],
        );
        let found = sorted(solve(&double, 2).unwrap());
        let root = 2.0_f64.sqrt();
        assert_eq!(found, [[2.0, -root], [2.0, root]]);
        // x^2 + 1 = 0 has no real solution; x = 1 and x = 2 contradict each other; x y = 1 is a curve.
        let complex = system(1, &[&[(1.0, &[(0, 2)]), (1.0, &[])]]);
        assert_eq!(sorted(solve(&complex, 1).unwrap()), Vec::<Vec<f64>>::new());
        let contradiction = system(1, &[&[(1.0, &[(0, 1)]), (-1.0, &[])], &[(1.0, &[(0, 1)]), (-2.0, &[])]]);
        assert_eq!(sorted(solve(&contradiction, 1).unwrap()), Vec::<Vec<f64>>::new());
        let curve = system(2, &[&[(1.0, &[(0, 1), (1, 1)]), (-1.0, &[])]]);
        assert_eq!(solve(&curve, 2).unwrap(), RealSolutions::Infinite);
    }
}
