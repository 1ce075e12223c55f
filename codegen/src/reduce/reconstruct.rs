//! Rational functions from their values in the prime field: which constants a factor depends on, its degree in each and
//! in all together, then its coefficients from one linear system, and a confirmation at fresh points.

use std::collections::BTreeMap;

use super::eliminate;
use super::rational_function::{Polynomial, Powers, RationalFunction, Variable, monomial_value};
use super::univariate;
use crate::DeriveError;
use crate::expr::{Atom, FieldPoint};
use crate::field::{Element, Stream};

/// Points at which degrees are looked for, at most.
const MOST_POINTS: usize = 26;

/// A black box: values of all functions at given constants.
pub(crate) type Oracle<'a> = dyn FnMut(&FieldPoint) -> Result<Vec<Element>, DeriveError> + 'a;

/// Reconstructs every function that `oracle` evaluates; `constants` are drawn by `draw`.
///
/// A function that resists (of a degree beyond all reason) comes back as `None`.
pub(crate) fn reconstruct(
    oracle: &mut Oracle<'_>,
    constants: &[(usize, bool)],
    roots: &[i64],
    draw: &dyn Fn(&mut Stream) -> FieldPoint,
    stream: &mut Stream,
) -> Result<Vec<Option<RationalFunction>>, DeriveError> {
    let origin = draw(stream);
    let at_origin = oracle(&origin)?;
    let elsewhere = oracle(&draw(stream))?;
    let n = at_origin.len();
    let mut shape: Vec<Shape> = vec![Shape::default(); n];
    let varying: Vec<usize> = (0..n).filter(|k| at_origin[*k] != elsewhere[*k]).collect();
    if !varying.is_empty() {
        for &(index, is_angle) in constants {
            probe(
                oracle,
                &origin,
                &at_origin,
                (index, is_angle),
                &varying,
                &mut shape,
                stream,
            )?;
        }
        total_degrees(oracle, &origin, constants, &varying, &mut shape, stream)?;
    }
    let mut samples = Samples {
        oracle,
        draw,
        points: Vec::new(),
    };
    let mut found = Vec::with_capacity(n);
    for (k, shape) in shape.iter().enumerate() {
        if !varying.contains(&k)
            && let Some(value) = at_origin[k].to_rational().filter(is_plausible)
        {
            found.push(Some(RationalFunction::constant(value)));
            continue;
        }
        found.push(shape.fit(&mut samples, k, roots, stream)?);
    }
    Ok(found)
}

/// A coefficient of a mechanism's equations is a small number; a random element of the field almost never is.
fn is_plausible(value: &crate::expr::Rational) -> bool {
    value
        .as_small()
        .is_some_and(|(n, d)| n.abs() < 1 << 20 && d < 1 << 20)
}

/// What is known about one function before its coefficients are.
#[derive(Clone, Debug, Default)]
struct Shape {
    /// Degrees of numerator and denominator in each constant that matters; in half the tangent for angles.
    degrees: BTreeMap<(usize, bool), (usize, usize)>,
    /// Degrees in all lengths together.
    total: Option<(usize, usize)>,
    /// Some degree could not be found.
    lost: bool,
}

/// Degrees in one constant, with all others at the origin.
fn probe(
    oracle: &mut Oracle<'_>,
    origin: &FieldPoint,
    at_origin: &[Element],
    (index, is_angle): (usize, bool),
    varying: &[usize],
    shape: &mut [Shape],
    stream: &mut Stream,
) -> Result<(), DeriveError> {
    let mut x = Vec::new();
    let mut y: Vec<Vec<Element>> = Vec::new();
    let mut open: Vec<usize> = varying.to_vec();
    while !open.is_empty() && x.len() < MOST_POINTS {
        let mut point = origin.clone();
        let t = stream.element();
        set(&mut point, index, is_angle, t);
        x.push(t);
        y.push(oracle(&point)?);
        if x.len() == 1 {
            open.retain(|k| y[0][*k] != at_origin[*k]);
            continue;
        }
        if x.len() < 4 || x.len() % 2 == 1 {
            continue;
        }
        open.retain(|k| {
            let values: Vec<Element> = y.iter().map(|row| row[*k]).collect();
            match univariate::degrees(&x, &values) {
                Some(degrees) => {
                    shape[*k].degrees.insert((index, is_angle), degrees);
                    false
                }
                None => true,
            }
        });
    }
    for k in open {
        shape[k].lost = true;
    }
    Ok(())
}

/// Degrees in all lengths together, along a random line.
fn total_degrees(
    oracle: &mut Oracle<'_>,
    origin: &FieldPoint,
    constants: &[(usize, bool)],
    varying: &[usize],
    shape: &mut [Shape],
    stream: &mut Stream,
) -> Result<(), DeriveError> {
    let lengths: Vec<usize> = constants
        .iter()
        .filter(|(_, is_angle)| !is_angle)
        .map(|(i, _)| *i)
        .collect();
    let direction: Vec<Element> = lengths.iter().map(|_| stream.element()).collect();
    let mut x = Vec::new();
    let mut y: Vec<Vec<Element>> = Vec::new();
    let mut open: Vec<usize> = varying
        .iter()
        .copied()
        .filter(|k| {
            shape[*k]
                .degrees
                .keys()
                .filter(|(_, is_angle)| !is_angle)
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
        y.push(oracle(&point)?);
        if x.len() < 4 || x.len() % 2 == 1 {
            continue;
        }
        open.retain(|k| {
            let values: Vec<Element> = y.iter().map(|row| row[*k]).collect();
            shape[*k].total = univariate::degrees(&x, &values);
            shape[*k].total.is_none()
        });
    }
    Ok(())
}

/// Sets a constant; an angle by half its tangent.
fn set(point: &mut FieldPoint, index: usize, is_angle: bool, t: Element) {
    point.values.insert(Atom::Constant(index), t);
    if is_angle && let Some(scale) = (Element::ONE + t * t).inverse() {
        point.angles.insert(
            Atom::Constant(index),
            ((Element::ONE - t * t) * scale, (t + t) * scale),
        );
    }
}

/// Random points with the values of all functions, shared between the fits.
struct Samples<'a, 'b> {
    oracle: &'a mut Oracle<'b>,
    draw: &'a dyn Fn(&mut Stream) -> FieldPoint,
    points: Vec<(FieldPoint, Vec<Element>)>,
}

impl Samples<'_, '_> {
    fn at_least(&mut self, n: usize, stream: &mut Stream) -> Result<(), DeriveError> {
        while self.points.len() < n {
            let point = (self.draw)(stream);
            let values = (self.oracle)(&point)?;
            self.points.push((point, values));
        }
        Ok(())
    }
}

impl Shape {
    /// Coefficients of numerator and denominator from `numerator - value * denominator = 0` at many points.
    fn fit(
        &self,
        samples: &mut Samples<'_, '_>,
        k: usize,
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
            .filter(|((_, is_angle), _)| *is_angle)
            .map(|(_, (n, d))| n.max(d).div_ceil(2))
            .max();
        let angle_degree = angle_degree.unwrap_or(0);
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
            let numerator = with_roots(self.monomials(true, angle_degree));
            let mut denominator = self.monomials(false, angle_in_denominator);
            if roots_in_denominator {
                denominator = with_roots(denominator);
            }
            let unknowns = numerator.len() + denominator.len();
            if unknowns > MOST_UNKNOWNS {
                continue;
            }
            // Roots take either sign by chance; every combination of signs must come up.
            let n_points = unknowns + 4 + 20 * (root_powers.len() - 1);
            samples.at_least(n_points, stream)?;
            let rows = samples.points[..n_points]
                .iter()
                .map(|(point, values)| {
                    let top = numerator.iter().map(|m| monomial_value(m, point));
                    let bottom = denominator
                        .iter()
                        .map(|m| monomial_value(m, point).map(|x| -(x * values[k])));
                    top.chain(bottom).collect::<Option<Vec<_>>>()
                })
                .collect::<Option<Vec<_>>>();
            let Some(rows) = rows else { return Ok(None) };
            let solutions = eliminate::null_space(rows, unknowns);
            for solution in solutions {
                if let Some(function) = rational_coefficients(&solution, &numerator, &denominator) {
                    return Ok(Some(function));
                }
            }
        }
        Ok(None)
    }

    /// Monomials that the numerator or denominator may have.
    fn monomials(&self, numerator: bool, angle_bound: usize) -> Vec<Powers> {
        let pick = |(n, d): (usize, usize)| if numerator { n } else { d };
        let mut monomials: Vec<(Powers, usize)> = vec![(Powers::new(), 0)];
        for ((index, is_angle), degrees) in &self.degrees {
            let mut extended = Vec::new();
            if *is_angle {
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

/// Scales a solution so that all coefficients are small rationals.
fn rational_coefficients(
    solution: &[Element],
    numerator: &[Powers],
    denominator: &[Powers],
) -> Option<RationalFunction> {
    let (top, bottom) = solution.split_at(numerator.len());
    let lead = bottom
        .iter()
        .rev()
        .find(|x| **x != Element::ZERO)?
        .inverse()?;
    let polynomial = |monomials: &[Powers], values: &[Element]| -> Option<Polynomial> {
        let mut p = Polynomial::new();
        for (powers, value) in monomials.iter().zip(values) {
            if *value != Element::ZERO {
                p.insert(
                    powers.clone(),
                    (*value * lead).to_rational().filter(is_plausible)?,
                );
            }
        }
        Some(p)
    };
    Some(RationalFunction::new(
        polynomial(numerator, top)?,
        polynomial(denominator, bottom)?,
    ))
}
