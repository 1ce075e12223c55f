//! Rational functions from their values in prime fields: which constants a factor depends on, its degree in each and
//! in all together, then its coefficients from one linear system. Long coefficients take several fields.

use std::collections::BTreeMap;

use super::eliminate;
use super::lift::lift;
use super::rational_function::{Polynomial, Powers, RationalFunction, Variable, monomial_value};
use super::support::support;
use super::univariate;
use crate::DeriveError;
use crate::expr::{Atom, FieldPoint, Rational};
use crate::field::{Element, MODULUS, PRIMES, Stream};

/// Points at which degrees are looked for, at most.
const MOST_POINTS: usize = 26;

/// A black box in every prime field.
pub(crate) trait Oracle {
    /// Random constants.
    fn constants<const P: u64>(
        &self,
        stream: &mut Stream,
    ) -> Result<FieldPoint<Element<P>>, DeriveError>;
    /// Values of all functions at given constants.
    fn values<const P: u64>(
        &mut self,
        constants: &FieldPoint<Element<P>>,
    ) -> Result<Vec<Element<P>>, DeriveError>;
    /// Says that so many operations will be done beside evaluation; an error where they are too many.
    fn spend(&mut self, operations: usize) -> Result<(), DeriveError>;
}

/// How many operations of the field may still be done. Time would differ from machine to machine, and with it the result.
#[derive(Clone, Debug)]
pub(super) struct Budget {
    all: u64,
    left: u64,
}

impl Budget {
    pub(super) fn new(operations: u64) -> Self {
        Self {
            all: operations,
            left: operations,
        }
    }

    pub(super) fn spend(&mut self, operations: usize) -> Result<(), DeriveError> {
        let operations = u64::try_from(operations).unwrap_or(u64::MAX);
        let left = self.left.checked_sub(operations);
        self.left = left.ok_or(DeriveError::FactorsTooLong {
            operations: self.all,
        })?;
        Ok(())
    }
}

/// A way in which a constant occurs, by index and whether inside sines and cosines. A constant that occurs in both ways
/// counts as two: no rational function ties a number to its sine.
pub(crate) type Occurrence = (usize, bool);

/// Reconstructs every function that `oracle` evaluates.
///
/// A function that resists (of a degree beyond all reason, or not rational) comes back as `None`, and with it all others:
/// what they are would not be used.
pub(crate) fn reconstruct<O: Oracle>(
    oracle: &mut O,
    constants: &[Occurrence],
    roots: &[i64],
    stream: &mut Stream,
) -> Result<Vec<Option<RationalFunction>>, DeriveError> {
    let mut survey = Survey::new(oracle, constants, roots, stream)?;
    let all: Vec<(usize, bool)> = (0..survey.shapes.len()).map(|k| (k, true)).collect();
    survey.functions(oracle, &all, stream)
}

/// Which functions depend on which constants, and what was sampled for that.
pub(super) struct Survey<O> {
    roots: Vec<i64>,
    constants: Vec<Occurrence>,
    origin: FieldPoint,
    at_origin: Vec<Element>,
    moved: Vec<Moved>,
    shapes: Vec<Shape>,
    fields: Fields<O>,
}

impl<O: Oracle> Survey<O> {
    /// Moves one constant after the other.
    pub(super) fn new(
        oracle: &mut O,
        constants: &[Occurrence],
        roots: &[i64],
        stream: &mut Stream,
    ) -> Result<Self, DeriveError> {
        let origin = oracle.constants(stream)?;
        let at_origin = oracle.values(&origin)?;
        let elsewhere = oracle.constants(stream)?;
        let elsewhere = oracle.values(&elsewhere)?;
        let n = at_origin.len();
        let mut shapes: Vec<Shape> = vec![Shape::default(); n];
        let varying: Vec<usize> = (0..n).filter(|k| at_origin[*k] != elsewhere[*k]).collect();
        let moved = if varying.is_empty() {
            Vec::new()
        } else {
            moved(oracle, &origin, &at_origin, constants, &mut shapes, stream)?
        };
        Ok(Self {
            roots: roots.to_vec(),
            constants: constants.to_vec(),
            origin,
            at_origin,
            moved,
            shapes,
            fields: Fields::new(),
        })
    }

    /// On how many constants a function depends.
    pub(super) fn n_constants(&self, function: usize) -> usize {
        self.shapes[function].degrees.len()
    }

    /// Some of the functions, each with whether the others are useless without it: where such a one resists, all that come
    /// after it are `None` too.
    pub(super) fn functions(
        &mut self,
        oracle: &mut O,
        wanted: &[(usize, bool)],
        stream: &mut Stream,
    ) -> Result<Vec<Option<RationalFunction>>, DeriveError> {
        let (origin, shapes) = (&self.origin, &mut self.shapes);
        let indices: Vec<usize> = wanted.iter().map(|(k, _)| *k).collect();
        for group in apart(&self.moved, &indices, shapes) {
            probe(
                oracle,
                origin,
                &self.at_origin,
                &group,
                &indices,
                shapes,
                stream,
            )?;
        }
        total_degrees(oracle, origin, &self.constants, &indices, shapes, stream)?;
        let mut found = Vec::with_capacity(wanted.len());
        for (k, is_needed) in wanted {
            let function =
                shapes[*k].fit(&mut self.fields, oracle, origin, *k, &self.roots, stream)?;
            let resists = function.is_none();
            found.push(function);
            if resists && *is_needed {
                found.resize(wanted.len(), None);
                break;
            }
        }
        Ok(found)
    }
}

/// What is known about one function before its coefficients are.
#[derive(Clone, Debug, Default)]
struct Shape {
    /// Degrees of numerator and denominator in each constant that matters; in half the tangent for angles.
    degrees: BTreeMap<Occurrence, (usize, usize)>,
    /// Degrees in all lengths together.
    total: Option<(usize, usize)>,
    /// Some degree could not be found.
    lost: bool,
}

/// One constant moved away from the origin.
struct Moved {
    constant: Occurrence,
    /// Where it stands then, and the values of all functions.
    at: Element,
    values: Vec<Element>,
}

/// Moves one constant after the other; every function gets the constants on which it depends, of degrees not yet known.
fn moved<O: Oracle>(
    oracle: &mut O,
    origin: &FieldPoint,
    at_origin: &[Element],
    constants: &[Occurrence],
    shapes: &mut [Shape],
    stream: &mut Stream,
) -> Result<Vec<Moved>, DeriveError> {
    let mut all = Vec::with_capacity(constants.len());
    for &constant in constants {
        let mut point = origin.clone();
        let at = stream.element();
        set(&mut point, constant, at);
        let values = oracle.values(&point)?;
        let mut is_felt = false;
        for (k, shape) in shapes.iter_mut().enumerate() {
            if values[k] != at_origin[k] {
                shape.degrees.insert(constant, (0, 0));
                is_felt = true;
            }
        }
        if is_felt {
            all.push(Moved {
                constant,
                at,
                values,
            });
        }
    }
    Ok(all)
}

/// Constants in groups such that none of some functions depends on two of one group: they may be varied at once. Those of
/// different joints of an arm mostly are such.
fn apart<'a>(moved: &'a [Moved], functions: &[usize], shapes: &[Shape]) -> Vec<Vec<&'a Moved>> {
    let mut groups: Vec<Vec<&Moved>> = Vec::new();
    for one in moved {
        let felt = |k: &usize| shapes[*k].degrees.contains_key(&one.constant);
        let own: Vec<usize> = functions.iter().copied().filter(felt).collect();
        if own.is_empty() {
            continue;
        }
        let meet = |other: &Moved| {
            let felt = |k: &usize| shapes[*k].degrees.contains_key(&other.constant);
            own.iter().any(felt)
        };
        let group = groups.iter_mut().find(|g| !g.iter().any(|m| meet(m)));
        match group {
            Some(group) => group.push(one),
            None => groups.push(vec![one]),
        }
    }
    groups
}

/// Degrees in each constant of a group, with all others at the origin.
fn probe<O: Oracle>(
    oracle: &mut O,
    origin: &FieldPoint,
    at_origin: &[Element],
    group: &[&Moved],
    functions: &[usize],
    shapes: &mut [Shape],
    stream: &mut Stream,
) -> Result<(), DeriveError> {
    // Every function with the position in the group of the one constant on which it depends.
    let mut open: Vec<(usize, usize)> = Vec::new();
    for (i, one) in group.iter().enumerate() {
        let felt = functions.iter().copied();
        let felt = felt.filter(|k| shapes[*k].degrees.contains_key(&one.constant));
        open.extend(felt.map(|k| (k, i)));
    }
    // Places of each constant: different ones, since lengths that are equal may be special.
    let mut places: Vec<Vec<Element>> = group.iter().map(|one| vec![one.at]).collect();
    let mut sampled: Vec<Vec<Element>> = Vec::new();
    while !open.is_empty() && sampled.len() + 2 < MOST_POINTS {
        let mut point = origin.clone();
        for (one, places) in group.iter().zip(&mut places) {
            let t = stream.element();
            set(&mut point, one.constant, t);
            places.push(t);
        }
        sampled.push(oracle.values(&point)?);
        if sampled.len() < 2 || sampled.len() % 2 == 1 {
            continue;
        }
        open.retain(|(k, i)| {
            let one = group[*i];
            let mut x = places[*i].clone();
            let mut y = vec![one.values[*k]];
            y.extend(sampled.iter().map(|row| row[*k]));
            if let Some(start) = place(origin, one.constant) {
                x.push(start);
                y.push(at_origin[*k]);
            }
            match univariate::degrees(&x, &y) {
                Some(degrees) => {
                    shapes[*k].degrees.insert(one.constant, degrees);
                    false
                }
                None => true,
            }
        });
    }
    for (k, _) in open {
        shapes[k].lost = true;
    }
    Ok(())
}

/// Degrees in all lengths together, along a random line.
fn total_degrees<O: Oracle>(
    oracle: &mut O,
    origin: &FieldPoint,
    constants: &[Occurrence],
    functions: &[usize],
    shapes: &mut [Shape],
    stream: &mut Stream,
) -> Result<(), DeriveError> {
    let lengths: Vec<usize> = constants
        .iter()
        .filter(|(_, in_angle)| !in_angle)
        .map(|(i, _)| *i)
        .collect();
    let direction: Vec<Element> = lengths.iter().map(|_| stream.element()).collect();
    let mut x = Vec::new();
    let mut y: Vec<Vec<Element>> = Vec::new();
    let mut open: Vec<usize> = functions
        .iter()
        .copied()
        .filter(|k| {
            shapes[*k]
                .degrees
                .keys()
                .filter(|(_, in_angle)| !in_angle)
                .count()
                > 1
        })
        .collect();
    while !open.is_empty() && x.len() < MOST_POINTS {
        let mut point = origin.clone();
        let t = stream.element();
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
            let values: Vec<Element> = y.iter().map(|row| row[*k]).collect();
            shapes[*k].total = univariate::degrees(&x, &values);
            shapes[*k].total.is_none()
        });
    }
    Ok(())
}

/// Sets a constant; inside sines and cosines by half the tangent.
fn set(point: &mut FieldPoint, (index, in_angle): Occurrence, t: Element) {
    let atom = Atom::Constant(index);
    if !in_angle {
        point.values.insert(atom, t);
    } else if let Some(scale) = (Element::ONE + t * t).inverse() {
        point
            .angles
            .insert(atom, ((Element::ONE - t * t) * scale, (t + t) * scale));
    }
}

/// Where a constant stands; half the tangent if inside sines and cosines.
fn place(point: &FieldPoint, (index, in_angle): Occurrence) -> Option<Element> {
    let atom = Atom::Constant(index);
    if !in_angle {
        return point.values.get(&atom).copied();
    }
    let (cosine, sine) = point.angles.get(&atom)?;
    Some(*sine * (Element::ONE + *cosine).inverse()?)
}

/// Random points of one field with the values of all functions, shared between the fits.
struct Samples<const P: u64> {
    points: Vec<(FieldPoint<Element<P>>, Vec<Element<P>>)>,
}

/// An ansatz for one function.
struct Ansatz {
    function: usize,
    numerator: Vec<Powers>,
    denominator: Vec<Powers>,
    n_points: usize,
}

/// A field in which an ansatz can be solved; solutions are residues, scaled so that the last coefficient of the
/// denominator is 1. `None` where a root or an inverse is missing.
trait Solve<O> {
    fn modulus(&self) -> u64;
    fn solutions(
        &mut self,
        ansatz: &Ansatz,
        oracle: &mut O,
        stream: &mut Stream,
    ) -> Result<Option<Vec<Vec<u64>>>, DeriveError>;
}

impl<O: Oracle, const P: u64> Solve<O> for Samples<P> {
    fn modulus(&self) -> u64 {
        P
    }

    fn solutions(
        &mut self,
        ansatz: &Ansatz,
        oracle: &mut O,
        stream: &mut Stream,
    ) -> Result<Option<Vec<Vec<u64>>>, DeriveError> {
        while self.points.len() < ansatz.n_points {
            let point = oracle.constants(stream)?;
            let values = oracle.values(&point)?;
            self.points.push((point, values));
        }
        let n_top = ansatz.numerator.len();
        let rows: Option<Vec<Vec<Element<P>>>> = self.points[..ansatz.n_points]
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
        oracle.spend(rows.len() * n_unknowns * n_unknowns)?;
        let solutions = eliminate::null_space(rows, n_unknowns);
        Ok(Some(
            solutions
                .into_iter()
                .filter_map(|x| {
                    let last = x[n_top..].iter().rev().find(|x| **x != Element::ZERO)?;
                    let scale = last.inverse()?;
                    Some(x.iter().map(|x| (*x * scale).representative()).collect())
                })
                .collect(),
        ))
    }
}

/// All fields, with what was sampled in each.
struct Fields<O>(Vec<Box<dyn Solve<O>>>);

impl<O: Oracle> Fields<O> {
    fn new() -> Self {
        fn field<O: Oracle, const P: u64>() -> Box<dyn Solve<O>> {
            Box::new(Samples::<P> { points: Vec::new() })
        }
        const { assert!(PRIMES[0] == MODULUS) };
        Self(vec![
            field::<O, { PRIMES[0] }>(),
            field::<O, { PRIMES[1] }>(),
            field::<O, { PRIMES[2] }>(),
            field::<O, { PRIMES[3] }>(),
            field::<O, { PRIMES[4] }>(),
            field::<O, { PRIMES[5] }>(),
            field::<O, { PRIMES[6] }>(),
        ])
    }

    /// Coefficients that solve an ansatz, over the rationals.
    fn solve(
        &mut self,
        ansatz: &Ansatz,
        oracle: &mut O,
        stream: &mut Stream,
    ) -> Result<Option<Vec<Rational>>, DeriveError> {
        let mut residues: Vec<Vec<(u64, u64)>> = Vec::new();
        for field in &mut self.0 {
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
            let lifted: Option<Vec<Rational>> = residues.iter().map(|r| lift(r)).collect();
            if lifted.is_some() {
                return Ok(lifted);
            }
        }
        Ok(None)
    }
}

impl Shape {
    /// Coefficients of numerator and denominator from `numerator - value * denominator = 0` at many points.
    fn fit<O: Oracle>(
        &self,
        fields: &mut Fields<O>,
        oracle: &mut O,
        origin: &FieldPoint,
        function: usize,
        roots: &[i64],
        stream: &mut Stream,
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
        let with_roots = |monomials: Vec<Powers>| -> Vec<Powers> {
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
                let variables: Vec<Occurrence> = self.degrees.keys().copied().collect();
                let all = [numerator.as_slice(), denominator.as_slice()];
                let found = support(
                    oracle,
                    origin,
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
            let ansatz = Ansatz {
                function,
                numerator,
                denominator,
                n_points,
            };
            if let Some(coefficients) = fields.solve(&ansatz, oracle, stream)? {
                let (top, bottom) = coefficients.split_at(ansatz.numerator.len());
                let polynomial = |monomials: &[Powers], values: &[Rational]| -> Polynomial {
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
    fn monomials(&self, numerator: bool, angle_bound: usize) -> Vec<Powers> {
        let pick = |(n, d): (usize, usize)| if numerator { n } else { d };
        let mut monomials: Vec<(Powers, usize)> = vec![(Powers::new(), 0)];
        for ((index, in_angle), degrees) in &self.degrees {
            let mut extended = Vec::new();
            if *in_angle {
                let bound = angle_bound.min(degrees.0.max(degrees.1).div_ceil(2));
                for (powers, total) in &monomials {
                    for cosine in 0..=bound {
                        for sine in 0..=1.min(bound - cosine) {
                            let mut powers = powers.clone();
                            push_power(&mut powers, Variable::Cos(*index), cosine);
                            push_power(&mut powers, Variable::Sin(*index), sine);
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
                            push_power(&mut powers, Variable::Constant(*index), exponent);
                            extended.push((powers, total + exponent));
                        }
                    }
                }
            }
            monomials = extended;
        }
        let mut powers: Vec<Powers> = monomials.into_iter().map(|(p, _)| p).collect();
        for p in &mut powers {
            p.sort_unstable();
        }
        powers
    }
}

fn push_power(powers: &mut Powers, variable: Variable, exponent: usize) {
    if exponent > 0 {
        powers.push((variable, u32::try_from(exponent).expect("a small degree")));
    }
}

/// 1 and every product of different roots.
fn root_products(roots: &[i64]) -> Vec<Powers> {
    roots.iter().fold(vec![Powers::new()], |products, root| {
        let with = products.iter().map(|p| {
            p.iter()
                .copied()
                .chain([(Variable::Root(*root), 1)])
                .collect::<Powers>()
        });
        products.iter().cloned().chain(with).collect()
    })
}
