//! The monomials of a rational function that have a coefficient, for degrees that allow too many for one linear system.
//!
//! Variables are varied one after the other while the rest stay at a point (Zippel 1979, 1990). A monomial can only
//! have a coefficient if it had one before, without its last variable.

use std::collections::{BTreeMap, BTreeSet};

use modelmill_algebra::eliminate;
use modelmill_algebra::field::{FieldElement, RandomStream};

use super::oracle::{ConstantOccurrence, PrimeFieldOracle};
use super::rational_function::{FactorVariable, PowerProduct, monomial_value};
use crate::DeriveError;
use crate::expr::{Atom, FieldPoint};

/// Points at which the constants up to one of them are drawn again and the others stay at the origin, with the values
/// of all functions. They are grouped by the last constant that is drawn.
///
/// A function does not change with constants on which it does not depend. So the same points can be used for all
/// functions, whichever of these constants each one depends on.
pub(super) struct PartialSamples {
    /// The point from which constants are varied.
    origin: FieldPoint,
    /// All constants on which any function may depend.
    constants: Vec<ConstantOccurrence>,
    /// Points with values, by the last constant that is drawn.
    by_last_constant: BTreeMap<ConstantOccurrence, Vec<(FieldPoint, Vec<FieldElement>)>>,
}

impl PartialSamples {
    /// Without points; `constants` are all constants on which any function may depend.
    pub(super) fn new(origin: &FieldPoint, constants: &[ConstantOccurrence]) -> Self {
        Self {
            origin: origin.clone(),
            constants: constants.to_vec(),
            by_last_constant: BTreeMap::new(),
        }
    }

    /// At least `n` points at which the constants up to `last` are drawn again.
    fn at_least<O: PrimeFieldOracle>(
        &mut self,
        n: usize,
        last: ConstantOccurrence,
        oracle: &mut O,
        stream: &mut RandomStream,
    ) -> Result<&[(FieldPoint, Vec<FieldElement>)], DeriveError> {
        let samples = self.by_last_constant.entry(last).or_default();
        if samples.len() < n {
            let up_to_last = self.constants.iter().copied().filter(|c| *c <= last);
            let loose: Vec<ConstantOccurrence> = up_to_last.collect();
            while samples.len() < n {
                let point = redraw_constants(oracle, &self.origin, &loose, stream)?;
                let values = oracle.values(&point)?;
                samples.push((point, values));
            }
        }
        Ok(samples)
    }
}

/// The monomials of numerator and denominator that have a coefficient at a random point, among the given ones. `None`
/// if a stage has more unknowns than `most`, or more than one solution. `variables` are in ascending order.
pub(super) fn nonzero_monomials<O: PrimeFieldOracle>(
    samples: &mut PartialSamples,
    oracle: &mut O,
    function: usize,
    variables: &[ConstantOccurrence],
    [numerator, denominator]: [&[PowerProduct]; 2],
    most: usize,
    stream: &mut RandomStream,
) -> Result<Option<[Vec<PowerProduct>; 2]>, DeriveError> {
    /// Number of equations in addition to the unknowns: they confirm the ansatz.
    const MORE: usize = 4;
    // With no variable varied, the only monomial is 1.
    let mut kept: [BTreeSet<PowerProduct>; 2] = [0, 1].map(|_| BTreeSet::from([PowerProduct::new()]));
    for n in 1..=variables.len() {
        let loose = &variables[..n];
        oracle.charge((numerator.len() + denominator.len()) * 100)?;
        // Candidates: monomials whose part without the new variable had a coefficient.
        let [top, bottom] = [(numerator, &kept[0]), (denominator, &kept[1])].map(|(all, kept)| {
            let candidates: BTreeSet<PowerProduct> = all
                .iter()
                .filter(|m| kept.contains(&restrict_monomial(m, &variables[..n - 1])))
                .map(|m| restrict_monomial(m, loose))
                .collect();
            candidates.into_iter().collect::<Vec<PowerProduct>>()
        });
        let unknowns = top.len() + bottom.len();
        if unknowns > most {
            return Ok(None);
        }
        let n_rows = unknowns + MORE;
        let points = samples.at_least(n_rows, loose[n - 1], oracle, stream)?;
        // One equation per point: numerator - value * denominator = 0.
        let mut rows = Vec::with_capacity(n_rows);
        for (point, values) in &points[..n_rows] {
            let value = values[function];
            let row: Option<Vec<FieldElement>> = (top.iter().map(|m| monomial_value(m, point)))
                .chain((bottom.iter()).map(|m| monomial_value(m, point).map(|x| -(x * value))))
                .collect();
            let Some(row) = row else { return Ok(None) };
            rows.push(row);
        }
        oracle.charge(rows.len() * unknowns * unknowns)?;
        let solutions = eliminate::null_space(rows, unknowns);
        let [solution] = solutions.as_slice() else {
            return Ok(None);
        };
        // Monomials with a coefficient remain for the next stage.
        let with_coefficient = |monomials: &[PowerProduct], factors: &[FieldElement]| -> BTreeSet<PowerProduct> {
            let pairs = monomials.iter().zip(factors);
            let with_coefficient = pairs.filter(|(_, x)| **x != FieldElement::ZERO);
            with_coefficient.map(|(m, _)| m.clone()).collect()
        };
        let (above, below) = solution.split_at(top.len());
        kept = [with_coefficient(&top, above), with_coefficient(&bottom, below)];
    }
    Ok(Some(kept.map(|set| set.into_iter().collect())))
}

/// The part of a monomial that consists of some variables; roots are kept.
fn restrict_monomial(powers: &PowerProduct, variables: &[ConstantOccurrence]) -> PowerProduct {
    let is_in = |variable: &FactorVariable| match variable {
        FactorVariable::Constant(i) => variables.contains(&(*i, false)),
        FactorVariable::Cos(i) | FactorVariable::Sin(i) => variables.contains(&(*i, true)),
        FactorVariable::Root(_) => true,
    };
    powers.iter().filter(|(v, _)| is_in(v)).copied().collect()
}

/// The origin with some constants drawn again, such that all functions exist.
fn redraw_constants<O: PrimeFieldOracle>(
    oracle: &O,
    origin: &FieldPoint,
    loose: &[ConstantOccurrence],
    stream: &mut RandomStream,
) -> Result<FieldPoint, DeriveError> {
    let fresh: FieldPoint = oracle.constants(stream)?;
    let mut point = origin.clone();
    for (index, in_angle) in loose {
        let atom = Atom::Constant(*index);
        if *in_angle {
            point.angles.insert(atom, fresh.angles[&atom]);
        } else {
            point.values.insert(atom, fresh.values[&atom]);
        }
    }
    Ok(point)
}
