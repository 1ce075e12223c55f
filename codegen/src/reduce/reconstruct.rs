//! Rational functions from their values in prime fields: the constants on which a factor depends, its degree in each
//! and in all together, then its coefficients from one linear system (`fit`). Long coefficients need several fields.
//!
//! Decision: one field of 61 bits finds every pattern and all short coefficients. Decimals of a geometry give long
//! ones, which come from Chinese remainders over up to seven fields; an eighth field confirms them. Work is bounded
//! in field operations and not in seconds, so that the same file gives the same text on every machine.

use modelmill_algebra::field::{FieldElement, RandomStream};
use modelmill_algebra::univariate;

use super::fit::{FunctionShape, PrimeFields};
use super::oracle::{ConstantOccurrence, PrimeFieldOracle};
use super::rational_function::RationalFunction;
use crate::DeriveError;
use crate::expr::{Atom, FieldPoint};

/// Largest number of points that are used to find a degree.
const MOST_POINTS: usize = 26;

/// Reconstructs every function that `oracle` evaluates.
///
/// A function that cannot be reconstructed (of too high a degree, or not rational) is returned as `None`, and so are
/// all functions, because the others would not be used.
pub(crate) fn reconstruct<O: PrimeFieldOracle>(
    oracle: &mut O,
    constants: &[ConstantOccurrence],
    roots: &[i64],
    stream: &mut RandomStream,
) -> Result<Vec<Option<RationalFunction>>, DeriveError> {
    let mut survey = DependenceSurvey::new(oracle, constants, roots, stream)?;
    let all: Vec<(usize, FunctionNeed)> = (0..survey.shapes.len()).map(|k| (k, FunctionNeed::ByOthers)).collect();
    survey.reconstruct_functions(oracle, &all, stream)
}

/// Whether a function is worth the work of a reconstruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FunctionNeed {
    /// The other functions are of no use without it.
    ByOthers,
    /// It is wanted whatever the work.
    ByItself,
    /// It is wanted if one linear system has all its monomials.
    IfShort,
}

/// Which functions depend on which constants, and what was sampled for that.
pub(super) struct DependenceSurvey<O> {
    /// Integers whose square roots factors may contain.
    roots: Vec<i64>,
    /// Constants on which any function may depend.
    constants: Vec<ConstantOccurrence>,
    /// The point from which constants are varied.
    origin: FieldPoint,
    /// Values of all functions there.
    at_origin: Vec<FieldElement>,
    /// Constants with an effect, each varied alone.
    moved: Vec<VariedConstant>,
    /// What is known about each function.
    shapes: Vec<FunctionShape>,
    /// Fields in which coefficients are computed, with their samples.
    fields: PrimeFields<O>,
}

impl<O: PrimeFieldOracle> DependenceSurvey<O> {
    /// Varies one constant after the other to find which functions depend on it.
    pub(super) fn new(
        oracle: &mut O,
        constants: &[ConstantOccurrence],
        roots: &[i64],
        stream: &mut RandomStream,
    ) -> Result<Self, DeriveError> {
        let origin = oracle.constants(stream)?;
        let at_origin = oracle.values(&origin)?;
        // A second point shows whether any function depends on constants at all.
        let elsewhere = oracle.constants(stream)?;
        let elsewhere = oracle.values(&elsewhere)?;
        let n = at_origin.len();
        let mut shapes: Vec<FunctionShape> = vec![FunctionShape::default(); n];
        let varying: Vec<usize> = (0..n).filter(|k| at_origin[*k] != elsewhere[*k]).collect();
        let moved = if varying.is_empty() {
            Vec::new()
        } else {
            vary_constants(oracle, &origin, &at_origin, constants, &mut shapes, stream)?
        };
        let fields = PrimeFields::new(&origin, constants);
        Ok(Self {
            roots: roots.to_vec(),
            constants: constants.to_vec(),
            origin,
            at_origin,
            moved,
            shapes,
            fields,
        })
    }

    /// Reconstructs some of the functions. If one that others need cannot be reconstructed, all that come after it are
    /// `None` as well.
    pub(super) fn reconstruct_functions(
        &mut self,
        oracle: &mut O,
        wanted: &[(usize, FunctionNeed)],
        stream: &mut RandomStream,
    ) -> Result<Vec<Option<RationalFunction>>, DeriveError> {
        // Only the requested functions take part in the steps below.
        let (origin, shapes) = (&self.origin, &mut self.shapes);
        let indices: Vec<usize> = wanted.iter().map(|(k, _)| *k).collect();
        // Degrees in single constants, then in all lengths together, then coefficients.
        for group in independent_groups(&self.moved, &indices, shapes) {
            probe_degrees(oracle, origin, &self.at_origin, &group, &indices, shapes, stream)?;
        }
        total_degrees(oracle, origin, &self.constants, &indices, shapes, stream)?;
        let mut found = Vec::with_capacity(wanted.len());
        for (k, need) in wanted {
            if *need == FunctionNeed::IfShort && !shapes[*k].is_short() {
                found.push(None);
                continue;
            }
            let function = shapes[*k].fit_function(&mut self.fields, oracle, *k, &self.roots, stream)?;
            // Other functions are not used without a needed one, so no work is spent on them.
            let resists = function.is_none();
            found.push(function);
            if resists && *need == FunctionNeed::ByOthers {
                found.resize(wanted.len(), None);
                break;
            }
        }
        Ok(found)
    }
}

/// One constant varied away from the origin.
struct VariedConstant {
    /// The constant.
    constant: ConstantOccurrence,
    /// Its value: half the tangent for an angle.
    at: FieldElement,
    /// Values of all functions there.
    values: Vec<FieldElement>,
}

/// Varies one constant after the other. Every function's shape gets the constants on which it depends, with unknown
/// degrees.
fn vary_constants<O: PrimeFieldOracle>(
    oracle: &mut O,
    origin: &FieldPoint,
    at_origin: &[FieldElement],
    constants: &[ConstantOccurrence],
    shapes: &mut [FunctionShape],
    stream: &mut RandomStream,
) -> Result<Vec<VariedConstant>, DeriveError> {
    let mut all = Vec::with_capacity(constants.len());
    for &constant in constants {
        // All constants stay at the origin except for this one.
        let mut point = origin.clone();
        let at = stream.next_element();
        set_constant(&mut point, constant, at);
        let values = oracle.values(&point)?;
        let mut has_effect = false;
        for (k, shape) in shapes.iter_mut().enumerate() {
            if values[k] != at_origin[k] {
                shape.degrees.insert(constant, (0, 0));
                has_effect = true;
            }
        }
        if has_effect {
            all.push(VariedConstant { constant, at, values });
        }
    }
    Ok(all)
}

/// Constants in groups such that no function depends on two constants of one group: these may be varied at once.
/// Constants of different joints of an arm are mostly of this kind.
fn independent_groups<'a>(
    moved: &'a [VariedConstant],
    functions: &[usize],
    shapes: &[FunctionShape],
) -> Vec<Vec<&'a VariedConstant>> {
    let mut groups: Vec<Vec<&VariedConstant>> = Vec::new();
    for one in moved {
        let depends = |k: &usize| shapes[*k].degrees.contains_key(&one.constant);
        // Constants without effect on the requested functions need no degrees.
        let own: Vec<usize> = functions.iter().copied().filter(depends).collect();
        if own.is_empty() {
            continue;
        }
        // Whether a function depends on both constants.
        let meet = |other: &VariedConstant| {
            let depends = |k: &usize| shapes[*k].degrees.contains_key(&other.constant);
            own.iter().any(depends)
        };
        let group = groups.iter_mut().find(|g| !g.iter().any(|m| meet(m)));
        match group {
            Some(group) => group.push(one),
            None => groups.push(vec![one]),
        }
    }
    groups
}

/// Finds the degrees in each constant of a group, with all others at the origin.
fn probe_degrees<O: PrimeFieldOracle>(
    oracle: &mut O,
    origin: &FieldPoint,
    at_origin: &[FieldElement],
    group: &[&VariedConstant],
    functions: &[usize],
    shapes: &mut [FunctionShape],
    stream: &mut RandomStream,
) -> Result<(), DeriveError> {
    // Every function with the position in the group of the one constant on which it depends.
    let mut open: Vec<(usize, usize)> = Vec::new();
    for (i, one) in group.iter().enumerate() {
        let depends = functions.iter().copied();
        let depends = depends.filter(|k| shapes[*k].degrees.contains_key(&one.constant));
        open.extend(depends.map(|k| (k, i)));
    }
    // Values of each constant: different ones for all, because equal lengths may be a special case.
    let mut places: Vec<Vec<FieldElement>> = group.iter().map(|one| vec![one.at]).collect();
    let mut sampled: Vec<Vec<FieldElement>> = Vec::new();
    while !open.is_empty() && sampled.len() + 2 < MOST_POINTS {
        let mut point = origin.clone();
        for (one, places) in group.iter().zip(&mut places) {
            let t = stream.next_element();
            set_constant(&mut point, one.constant, t);
            places.push(t);
        }
        sampled.push(oracle.values(&point)?);
        // Interpolants of both even and odd sizes are not needed: every second point is sufficient.
        if sampled.len() < 2 || sampled.len() % 2 == 1 {
            continue;
        }
        // A function is finished when its interpolant has lower degrees than the number of points requires.
        open.retain(|(k, i)| {
            let one = group[*i];
            let mut x = places[*i].clone();
            let mut y = vec![one.values[*k]];
            y.extend(sampled.iter().map(|row| row[*k]));
            // The origin is one more point; an angle of half a turn has no tangent there.
            if let Some(start) = constant_value(origin, one.constant) {
                x.push(start);
                y.push(at_origin[*k]);
            }
            match univariate::interpolant_degrees(&x, &y) {
                Some(degrees) => {
                    shapes[*k].degrees.insert(one.constant, degrees);
                    false
                }
                None => true,
            }
        });
    }
    // Degrees above the limit are not found.
    for (k, _) in open {
        shapes[k].lost = true;
    }
    Ok(())
}

/// Number of functions with sums in their denominators, which may vanish although no length does. Functions whose
/// degrees are above the limit count as such.
pub(super) fn n_quotients<O: PrimeFieldOracle>(
    oracle: &mut O,
    constants: &[ConstantOccurrence],
    stream: &mut RandomStream,
) -> Result<usize, DeriveError> {
    /// Number of lines that are tried. On each, a random half of the lengths is multiplied by a common factor. A sum of
    /// products of lengths is a power of that factor only by chance, and not on all lines.
    const LINES: usize = 4;
    let lengths = constants.iter().filter(|(_, in_angle)| !in_angle);
    let lengths: Vec<Atom> = lengths.map(|(i, _)| Atom::Constant(*i)).collect();
    // For each function whether a sum has been found.
    let mut has_sum: Vec<bool> = Vec::new();
    for _ in 0..LINES {
        let origin = oracle.constants(stream)?;
        let growing: Vec<Atom> = lengths
            .iter()
            .copied()
            .filter(|_| stream.next_bits() & 1 == 1)
            .collect();
        let (mut x, mut y): (Vec<FieldElement>, Vec<Vec<FieldElement>>) = Default::default();
        let mut open: Vec<usize> = Vec::new();
        while x.len() < MOST_POINTS {
            // The origin of this line with the chosen lengths multiplied by t.
            let (t, mut point) = (stream.next_element(), origin.clone());
            for atom in &growing {
                point.values.insert(*atom, origin.values[atom] * t);
            }
            x.push(t);
            y.push(oracle.values(&point)?);
            has_sum.resize(y[0].len(), false);
            if x.len() == 1 {
                open = (0..has_sum.len()).filter(|k| !has_sum[*k]).collect();
            }
            if x.len() < 4 || x.len() % 2 == 1 {
                continue;
            }
            // A denominator without sums is a power of the factor, and is removed by multiplying with that power.
            open.retain(|k| {
                let mut values: Vec<FieldElement> = y.iter().map(|row| row[*k]).collect();
                let Some((_, below)) = univariate::interpolant_degrees(&x, &values) else {
                    return true;
                };
                for (value, t) in values.iter_mut().zip(&x) {
                    *value = *value * t.power(below as u64);
                }
                match univariate::interpolant_degrees(&x, &values) {
                    Some((_, 0)) => false,
                    Some(_) => {
                        has_sum[*k] = true;
                        false
                    }
                    None => true,
                }
            });
            if open.is_empty() {
                break;
            }
        }
        // Functions without a degree below the limit count as quotients.
        for k in open {
            has_sum[k] = true;
        }
    }
    Ok(has_sum.into_iter().filter(|x| *x).count())
}

/// Finds the degrees in all lengths together, along a random line.
fn total_degrees<O: PrimeFieldOracle>(
    oracle: &mut O,
    origin: &FieldPoint,
    constants: &[ConstantOccurrence],
    functions: &[usize],
    shapes: &mut [FunctionShape],
    stream: &mut RandomStream,
) -> Result<(), DeriveError> {
    let lengths: Vec<usize> = constants
        .iter()
        .filter(|(_, in_angle)| !in_angle)
        .map(|(i, _)| *i)
        .collect();
    let direction: Vec<FieldElement> = lengths.iter().map(|_| stream.next_element()).collect();
    let mut x = Vec::new();
    let mut y: Vec<Vec<FieldElement>> = Vec::new();
    // Only functions of several lengths need a total degree.
    let mut open: Vec<usize> = functions
        .iter()
        .copied()
        .filter(|k| shapes[*k].degrees.keys().filter(|(_, in_angle)| !in_angle).count() > 1)
        .collect();
    while !open.is_empty() && x.len() < MOST_POINTS {
        // All lengths move along a line at once; angles stay at the origin.
        let mut point = origin.clone();
        let t = stream.next_element();
        for (index, slope) in lengths.iter().zip(&direction) {
            let value = point.values[&Atom::Constant(*index)] + t * *slope;
            point.values.insert(Atom::Constant(*index), value);
        }
        x.push(t);
        y.push(oracle.values(&point)?);
        if x.len() < 4 || x.len() % 2 == 1 {
            continue;
        }
        open.retain(|k| {
            let values: Vec<FieldElement> = y.iter().map(|row| row[*k]).collect();
            shapes[*k].total = univariate::interpolant_degrees(&x, &values);
            shapes[*k].total.is_none()
        });
    }
    Ok(())
}

/// Sets a constant; in sines and cosines by the tangent of half its angle.
fn set_constant(point: &mut FieldPoint, (index, in_angle): ConstantOccurrence, t: FieldElement) {
    let atom = Atom::Constant(index);
    if !in_angle {
        point.values.insert(atom, t);
    // An angle whose tangent t has 1 + t^2 = 0 in the field does not exist and leaves the point unchanged.
    } else if let Some(scale) = (FieldElement::ONE + t * t).inverse() {
        point
            .angles
            .insert(atom, ((FieldElement::ONE - t * t) * scale, (t + t) * scale));
    }
}

/// The value of a constant; in sines and cosines the tangent of half its angle.
fn constant_value(point: &FieldPoint, (index, in_angle): ConstantOccurrence) -> Option<FieldElement> {
    let atom = Atom::Constant(index);
    if !in_angle {
        return point.values.get(&atom).copied();
    }
    let (cosine, sine) = point.angles.get(&atom)?;
    // tan(a/2) = sin a / (1 + cos a).
    Some(*sine * (FieldElement::ONE + *cosine).inverse()?)
}
