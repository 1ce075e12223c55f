//! The coefficients of a rational function with known degrees: an ansatz that is solved in one field after the other.

use std::collections::BTreeMap;

use modelmill_algebra::eliminate;
use modelmill_algebra::field::{FieldElement, MODULUS, PRIMES, RandomStream};
use modelmill_algebra::lift::reconstruct_rational;

use super::oracle::{ConstantOccurrence, PrimeFieldOracle};
use super::rational_function::{
    FactorVariable, PowerProduct, RationalFunction, TrigonometricPolynomial, monomial_value,
};
use super::support::{PartialSamples, nonzero_monomials};
use crate::DeriveError;
use crate::expr::{FieldPoint, Rational};

/// Largest number of coefficients of one linear system.
const MOST_UNKNOWNS: usize = 400;

/// Largest number of monomials that are listed for a numerator or denominator, most of which have coefficient zero. Lists
/// are given up above it, because memory would go to gigabytes: a monomial takes some 100 bytes. By judgement.
const MOST_MONOMIALS: usize = 300_000;

/// What is known about a function before its coefficients are computed.
#[derive(Clone, Debug, Default)]
pub(super) struct FunctionShape {
    /// Degrees of numerator and denominator in each constant on which it depends; for angles in the tangent of half the
    /// angle.
    pub(super) degrees: BTreeMap<ConstantOccurrence, (usize, usize)>,
    /// Degrees of numerator and denominator in all lengths together.
    pub(super) total: Option<(usize, usize)>,
    /// Whether some degree could not be found.
    pub(super) lost: bool,
}

/// Random points of one field with the values of all functions, which all fits share.
struct FieldSamples<const P: u64> {
    /// Constants, and the values of all functions for them.
    points: Vec<(FieldPoint<FieldElement<P>>, Vec<FieldElement<P>>)>,
}

/// An ansatz for one function: monomials with unknown coefficients.
struct RationalAnsatz {
    /// Index of the function.
    function: usize,
    /// Monomials of the numerator.
    numerator: Vec<PowerProduct>,
    /// Monomials of the denominator.
    denominator: Vec<PowerProduct>,
    /// Number of points, which is the number of equations.
    n_points: usize,
}

/// A field in which an ansatz can be solved. Solutions are residues, scaled so that the last coefficient of the
/// denominator that is not zero is 1. `None` if a root or an inverse does not exist.
trait AnsatzSolver<O> {
    /// The prime of the field.
    fn modulus(&self) -> u64;
    /// All independent solutions, as coefficients of the numerator, then of the denominator.
    fn solutions(
        &mut self,
        ansatz: &RationalAnsatz,
        oracle: &mut O,
        stream: &mut RandomStream,
    ) -> Result<Option<Vec<Vec<u64>>>, DeriveError>;
}

impl<O: PrimeFieldOracle, const P: u64> AnsatzSolver<O> for FieldSamples<P> {
    fn modulus(&self) -> u64 {
        P
    }

    fn solutions(
        &mut self,
        ansatz: &RationalAnsatz,
        oracle: &mut O,
        stream: &mut RandomStream,
    ) -> Result<Option<Vec<Vec<u64>>>, DeriveError> {
        // Points are drawn as needed and kept for other functions.
        while self.points.len() < ansatz.n_points {
            let point = oracle.constants(stream)?;
            let values = oracle.values(&point)?;
            self.points.push((point, values));
        }
        let n_top = ansatz.numerator.len();
        // One equation per point: numerator - value * denominator = 0.
        let rows: Option<Vec<Vec<FieldElement<P>>>> = self.points[..ansatz.n_points]
            .iter()
            .map(|(point, values)| {
                let value = values[ansatz.function];
                let top = ansatz.numerator.iter().map(|m| monomial_value(m, point));
                let bottom = ansatz
                    .denominator
                    .iter()
                    .map(|m| monomial_value(m, point).map(|x| -(x * value)));
                top.chain(bottom).collect()
            })
            .collect();
        let Some(rows) = rows else { return Ok(None) };
        let n_unknowns = n_top + ansatz.denominator.len();
        oracle.charge(rows.len() * n_unknowns * n_unknowns)?;
        let solutions = eliminate::null_space(rows, n_unknowns);
        Ok(Some(
            solutions
                .into_iter()
                // The overall scale of a solution is chosen here.
                .filter_map(|x| {
                    let last = x[n_top..].iter().rev().find(|x| **x != FieldElement::ZERO)?;
                    let scale = last.inverse()?;
                    Some(x.iter().map(|x| (*x * scale).representative()).collect())
                })
                .collect(),
        ))
    }
}

/// All fields, with the points that were sampled in each.
pub(super) struct PrimeFields<O> {
    /// One solver per prime, in the order in which they are used.
    solvers: Vec<Box<dyn AnsatzSolver<O>>>,
    /// Points of the first field at which only some constants are drawn again.
    partial: PartialSamples,
}

impl<O: PrimeFieldOracle> PrimeFields<O> {
    /// `origin` and `constants` are those of [`PartialSamples`].
    pub(super) fn new(origin: &FieldPoint, constants: &[ConstantOccurrence]) -> Self {
        fn boxed_field<O: PrimeFieldOracle, const P: u64>() -> Box<dyn AnsatzSolver<O>> {
            Box::new(FieldSamples::<P> { points: Vec::new() })
        }
        const { assert!(PRIMES[0] == MODULUS) };
        let solvers = vec![
            boxed_field::<O, { PRIMES[0] }>(),
            boxed_field::<O, { PRIMES[1] }>(),
            boxed_field::<O, { PRIMES[2] }>(),
            boxed_field::<O, { PRIMES[3] }>(),
            boxed_field::<O, { PRIMES[4] }>(),
            boxed_field::<O, { PRIMES[5] }>(),
            boxed_field::<O, { PRIMES[6] }>(),
        ];
        Self {
            solvers,
            partial: PartialSamples::new(origin, constants),
        }
    }

    /// Rational coefficients that solve an ansatz; `None` if there is no solution, or none with short enough
    /// coefficients.
    fn solve_ansatz(
        &mut self,
        ansatz: &RationalAnsatz,
        oracle: &mut O,
        stream: &mut RandomStream,
    ) -> Result<Option<Vec<Rational>>, DeriveError> {
        // Residues of every coefficient in the fields so far.
        let mut residues: Vec<Vec<(u64, u64)>> = Vec::new();
        for field in &mut self.solvers {
            let modulus = field.modulus();
            let Some(solutions) = field.solutions(ansatz, oracle, stream)? else {
                return Ok(None);
            };
            let Some(solution) = solutions.into_iter().next() else {
                return Ok(None);
            };
            residues.resize(solution.len(), Vec::new());
            for (all, residue) in residues.iter_mut().zip(solution) {
                all.push((modulus, residue));
            }
            // Chinese remainders: each further field allows longer coefficients.
            let lifted: Option<Vec<Rational>> = residues.iter().map(|r| reconstruct_rational(r)).collect();
            if lifted.is_some() {
                return Ok(lifted);
            }
        }
        Ok(None)
    }
}

impl FunctionShape {
    /// The function from `numerator - value * denominator = 0` at many points; `None` if no ansatz fits.
    pub(super) fn fit_function<O: PrimeFieldOracle>(
        &self,
        fields: &mut PrimeFields<O>,
        oracle: &mut O,
        function: usize,
        roots: &[i64],
        stream: &mut RandomStream,
    ) -> Result<Option<RationalFunction>, DeriveError> {
        if self.lost {
            return Ok(None);
        }
        let angle_degree = self.angle_degree();
        if roots.len() >= MOST_UNKNOWNS.ilog2() as usize {
            return Ok(None);
        }
        // Every monomial may be multiplied by each product of different roots.
        let root_powers = root_products(roots);
        let with_roots = |monomials: Vec<PowerProduct>| -> Vec<PowerProduct> {
            monomials
                .iter()
                .flat_map(|m| {
                    root_powers.iter().map(move |r| {
                        let mut powers = m.clone();
                        powers.extend(r.iter().copied());
                        powers.sort_unstable();
                        powers
                    })
                })
                .collect()
        };
        // The degree in the angles of the denominator is raised until an ansatz fits; degrees in lengths are known.
        // Roots in the denominator are tried last: most often they can be moved to the numerator.
        let mut attempts: Vec<(usize, bool)> = (0..=angle_degree).map(|d| (d, false)).collect();
        if !roots.is_empty() {
            attempts.extend((0..=angle_degree).map(|d| (d, true)));
        }
        for (angle_in_denominator, roots_in_denominator) in attempts {
            let listed = self.monomials(true, angle_degree, MOST_MONOMIALS);
            let Some((numerator, denominator)) =
                listed.zip(self.monomials(false, angle_in_denominator, MOST_MONOMIALS))
            else {
                continue;
            };
            let (mut numerator, mut denominator) = (with_roots(numerator), denominator);
            if roots_in_denominator {
                denominator = with_roots(denominator);
            }
            if numerator.len() + denominator.len() > MOST_UNKNOWNS {
                // Most monomials have coefficient zero then, so the others are determined first. With roots this is not
                // possible: their signs differ at every point, so they cannot be kept fixed.
                if !roots.is_empty() {
                    continue;
                }
                let variables: Vec<ConstantOccurrence> = self.degrees.keys().copied().collect();
                let all = [numerator.as_slice(), denominator.as_slice()];
                let found = nonzero_monomials(
                    &mut fields.partial,
                    oracle,
                    function,
                    &variables,
                    all,
                    MOST_UNKNOWNS,
                    stream,
                )?;
                let Some(found) = found else { continue };
                [numerator, denominator] = found;
            }
            let unknowns = numerator.len() + denominator.len();
            // Roots have random signs at each point; every combination of signs must occur.
            let n_points = unknowns + 4 + 20 * (root_powers.len() - 1);
            let ansatz = RationalAnsatz {
                function,
                numerator,
                denominator,
                n_points,
            };
            if let Some(coefficients) = fields.solve_ansatz(&ansatz, oracle, stream)? {
                // Monomials with coefficient zero are dropped.
                let (top, bottom) = coefficients.split_at(ansatz.numerator.len());
                let polynomial = |monomials: &[PowerProduct], values: &[Rational]| -> TrigonometricPolynomial {
                    monomials
                        .iter()
                        .zip(values)
                        .filter(|(_, k)| !k.is_zero())
                        .map(|(powers, k)| (powers.clone(), k.clone()))
                        .collect()
                };
                return Ok(Some(RationalFunction::new(
                    polynomial(&ansatz.numerator, top),
                    polynomial(&ansatz.denominator, bottom),
                )));
            }
        }
        Ok(None)
    }

    /// Whether one linear system has all monomials that the degrees allow, in the first form that is tried.
    pub(super) fn is_short(&self) -> bool {
        let numerator = self.monomials(true, self.angle_degree(), MOST_UNKNOWNS);
        let denominator = self.monomials(false, 0, MOST_UNKNOWNS);
        let both = numerator.zip(denominator);
        both.is_some_and(|(above, below)| above.len() + below.len() <= MOST_UNKNOWNS)
    }

    /// The degree in cosines and sines together. A quotient of degree 2k in the tangent of half an angle is a quotient
    /// of trigonometric polynomials of degree k.
    fn angle_degree(&self) -> usize {
        let angles = self.degrees.iter().filter(|((_, in_angle), _)| *in_angle);
        let degrees = angles.map(|(_, (n, d))| n.max(d).div_ceil(2));
        degrees.max().unwrap_or(0)
    }

    /// All monomials that the degrees allow in the numerator or denominator; `None` if there are more than `most`.
    /// `angle_bound` limits the degree in cosine and sine.
    fn monomials(&self, numerator: bool, angle_bound: usize, most: usize) -> Option<Vec<PowerProduct>> {
        let pick = |(n, d): (usize, usize)| if numerator { n } else { d };
        let mut monomials: Vec<(PowerProduct, usize)> = vec![(PowerProduct::new(), 0)];
        // The list is extended by one constant at a time.
        for ((index, in_angle), degrees) in &self.degrees {
            let mut extended = Vec::new();
            if *in_angle {
                // sin^2 = 1 - cos^2, so the sine occurs at most once.
                let bound = angle_bound.min(degrees.0.max(degrees.1).div_ceil(2));
                for (powers, total) in &monomials {
                    for cosine in 0..=bound {
                        for sine in 0..=1.min(bound - cosine) {
                            let mut powers = powers.clone();
                            push_power(&mut powers, FactorVariable::Cos(*index), cosine);
                            push_power(&mut powers, FactorVariable::Sin(*index), sine);
                            extended.push((powers, *total));
                        }
                    }
                }
            } else {
                // The total degree in lengths limits the products of powers.
                let bound = self.total.map_or(usize::MAX, pick);
                for (powers, total) in &monomials {
                    for exponent in 0..=pick(*degrees) {
                        if total + exponent <= bound {
                            let mut powers = powers.clone();
                            push_power(&mut powers, FactorVariable::Constant(*index), exponent);
                            extended.push((powers, total + exponent));
                        }
                    }
                }
            }
            monomials = extended;
            // Each further constant adds monomials and removes none.
            if monomials.len() > most {
                return None;
            }
        }
        let mut powers: Vec<PowerProduct> = monomials.into_iter().map(|(p, _)| p).collect();
        for p in &mut powers {
            p.sort_unstable();
        }
        Some(powers)
    }
}

/// Appends a power unless its exponent is zero.
fn push_power(powers: &mut PowerProduct, variable: FactorVariable, exponent: usize) {
    if exponent > 0 {
        powers.push((variable, u32::try_from(exponent).expect("a small degree")));
    }
}

/// 1, and all products of different roots.
fn root_products(roots: &[i64]) -> Vec<PowerProduct> {
    roots.iter().fold(vec![PowerProduct::new()], |products, root| {
        let with = products.iter().map(|p| {
            p.iter()
                .copied()
                .chain([(FactorVariable::Root(*root), 1)])
                .collect::<PowerProduct>()
        });
        products.iter().cloned().chain(with).collect()
    })
}
