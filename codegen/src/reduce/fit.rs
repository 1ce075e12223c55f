//! The coefficients of a rational function whose degrees are known: an ansatz, solved in one field after the other.

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

/// What is known about one function before its coefficients are.
#[derive(Clone, Debug, Default)]
pub(super) struct FunctionShape {
    /// Degrees of numerator and denominator in each constant that matters; in half the tangent for angles.
    pub(super) degrees: BTreeMap<ConstantOccurrence, (usize, usize)>,
    /// Degrees in all lengths together.
    pub(super) total: Option<(usize, usize)>,
    /// Some degree could not be found.
    pub(super) lost: bool,
}

/// Random points of one field with the values of all functions, shared between the fits.
struct FieldSamples<const P: u64> {
    points: Vec<(FieldPoint<FieldElement<P>>, Vec<FieldElement<P>>)>,
}

/// An ansatz for one function.
struct RationalAnsatz {
    function: usize,
    numerator: Vec<PowerProduct>,
    denominator: Vec<PowerProduct>,
    n_points: usize,
}

/// A field in which an ansatz can be solved; solutions are residues, scaled so that the last coefficient of the
/// denominator is 1. `None` where a root or an inverse is missing.
trait AnsatzSolver<O> {
    fn modulus(&self) -> u64;
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
        while self.points.len() < ansatz.n_points {
            let point = oracle.constants(stream)?;
            let values = oracle.values(&point)?;
            self.points.push((point, values));
        }
        let n_top = ansatz.numerator.len();
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
                .filter_map(|x| {
                    let last = x[n_top..]
                        .iter()
                        .rev()
                        .find(|x| **x != FieldElement::ZERO)?;
                    let scale = last.inverse()?;
                    Some(x.iter().map(|x| (*x * scale).representative()).collect())
                })
                .collect(),
        ))
    }
}

/// All fields, with what was sampled in each.
pub(super) struct PrimeFields<O> {
    solvers: Vec<Box<dyn AnsatzSolver<O>>>,
    /// Points of the first field at which only some constants are drawn anew.
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

    /// Coefficients that solve an ansatz, over the rationals.
    fn solve_ansatz(
        &mut self,
        ansatz: &RationalAnsatz,
        oracle: &mut O,
        stream: &mut RandomStream,
    ) -> Result<Option<Vec<Rational>>, DeriveError> {
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
            let lifted: Option<Vec<Rational>> =
                residues.iter().map(|r| reconstruct_rational(r)).collect();
            if lifted.is_some() {
                return Ok(lifted);
            }
        }
        Ok(None)
    }
}

impl FunctionShape {
    /// Coefficients of numerator and denominator from `numerator - value * denominator = 0` at many points.
    pub(super) fn fit_function<O: PrimeFieldOracle>(
        &self,
        fields: &mut PrimeFields<O>,
        oracle: &mut O,
        function: usize,
        roots: &[i64],
        stream: &mut RandomStream,
    ) -> Result<Option<RationalFunction>, DeriveError> {
        const MOST_UNKNOWNS: usize = 400;
        if self.lost {
            return Ok(None);
        }
        // A quotient of degree 2k in half the tangent is a quotient of trigonometric polynomials of degree k.
        let angle_degree = self
            .degrees
            .iter()
            .filter(|((_, in_angle), _)| *in_angle)
            .map(|(_, (n, d))| n.max(d).div_ceil(2))
            .max();
        let angle_degree = angle_degree.unwrap_or(0);
        if roots.len() >= MOST_UNKNOWNS.ilog2() as usize {
            return Ok(None);
        }
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
        // The share of the angles in the denominator is raised until a function fits; lengths are known already.
        // Roots in the denominator are the last resort: most often they can be moved to the numerator.
        let mut attempts: Vec<(usize, bool)> = (0..=angle_degree).map(|d| (d, false)).collect();
        if !roots.is_empty() {
            attempts.extend((0..=angle_degree).map(|d| (d, true)));
        }
        for (angle_in_denominator, roots_in_denominator) in attempts {
            let mut numerator = with_roots(self.monomials(true, angle_degree));
            let mut denominator = self.monomials(false, angle_in_denominator);
            if roots_in_denominator {
                denominator = with_roots(denominator);
            }
            if numerator.len() + denominator.len() > MOST_UNKNOWNS {
                // Most of so many have no coefficient. Roots have a sign of their own at every point, so that no
                // place stays the same for them.
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
            // Roots take either sign by chance; every combination of signs must come up.
            let n_points = unknowns + 4 + 20 * (root_powers.len() - 1);
            let ansatz = RationalAnsatz {
                function,
                numerator,
                denominator,
                n_points,
            };
            if let Some(coefficients) = fields.solve_ansatz(&ansatz, oracle, stream)? {
                let (top, bottom) = coefficients.split_at(ansatz.numerator.len());
                let polynomial =
                    |monomials: &[PowerProduct], values: &[Rational]| -> TrigonometricPolynomial {
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

    /// Monomials that the numerator or denominator may have.
    fn monomials(&self, numerator: bool, angle_bound: usize) -> Vec<PowerProduct> {
        let pick = |(n, d): (usize, usize)| if numerator { n } else { d };
        let mut monomials: Vec<(PowerProduct, usize)> = vec![(PowerProduct::new(), 0)];
        for ((index, in_angle), degrees) in &self.degrees {
            let mut extended = Vec::new();
            if *in_angle {
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
        }
        let mut powers: Vec<PowerProduct> = monomials.into_iter().map(|(p, _)| p).collect();
        for p in &mut powers {
            p.sort_unstable();
        }
        powers
    }
}

fn push_power(powers: &mut PowerProduct, variable: FactorVariable, exponent: usize) {
    if exponent > 0 {
        powers.push((variable, u32::try_from(exponent).expect("a small degree")));
    }
}

/// 1 and every product of different roots.
fn root_products(roots: &[i64]) -> Vec<PowerProduct> {
    roots
        .iter()
        .fold(vec![PowerProduct::new()], |products, root| {
            let with = products.iter().map(|p| {
                p.iter()
                    .copied()
                    .chain([(FactorVariable::Root(*root), 1)])
                    .collect::<PowerProduct>()
            });
            products.iter().cloned().chain(with).collect()
        })
}
