//! Square roots that need no root sign: a polynomial in cosines, sines, lengths and constants whose square is a given
//! one, as the yaw of a platform on three equal legs has, or the crossed one of two equal pairs of links.
//!
//! Along a line through a point, the root of a polynomial follows from its value at that point, as a power series. So
//! the root divided by its value at one point can be evaluated anywhere, with one and the same sign; its coefficients
//! follow from a linear system. That the square is the radicand is shown at the end.
//!
//! Decision: the polynomial is evaluated and never expanded or factored. With it, the yaw of a platform on three
//! equal legs, crossed parallelograms and deltoids have rational closed forms.

use modelmill_algebra::eliminate::null_space;
use modelmill_algebra::field::{Element, MODULUS, Stream};
use modelmill_algebra::lift::lift;
use modelmill_algebra::univariate::interpolate;

use crate::expr::{Atom, ExprId, FieldPoint, Graph, Node, Rational, Tape, Unary};

/// Draws at which a radicand must be a square everywhere, or nowhere, before any work is done.
const CHARACTERS: usize = 24;
/// Most terms that a root may have, and the highest degree in one variable that is looked for.
const MOST_TERMS: usize = 300;
const HIGHEST: usize = 8;

/// A quantity on which the radicand depends.
#[derive(Clone, Copy)]
struct Variable {
    atom: Atom,
    /// Whether it stands in cosines and sines.
    is_angle: bool,
    /// Its degree in the root, in cosine and sine together for an angle.
    degree: usize,
}

/// A monomial: for every variable the exponent of its value, or of its cosine and (0 or 1) sine.
type Powers = Vec<(usize, usize)>;

/// The polynomial whose square an expression is, with either sign; `None` if there is none, or none with short
/// coefficients.
pub(crate) fn exact_root(graph: &mut Graph, radicand: ExprId) -> Option<ExprId> {
    let tape = Tape::new(graph, &[radicand]);
    let mut variables = variables(graph, radicand)?;
    let mut stream = Stream::new(6);
    if !may_be_square(&tape, &variables, &mut stream) {
        return None;
    }
    for k in 0..variables.len() {
        variables[k].degree = degree(&tape, &variables, k, &mut stream)? / 2;
    }
    let monomials = monomials(&variables)?;
    let factors = coefficients(&tape, &variables, &monomials, &mut stream)?;
    let root = written(graph, &variables, &monomials, &factors);
    let square = graph.mul(root, root);
    let ratio = constant_ratio(graph, &variables, radicand, square, &mut stream)?;
    if ratio.is_negative() || ratio.is_zero() {
        return None;
    }
    let ratio = graph.rational(ratio);
    let scale = graph.unary(Unary::Sqrt, ratio);
    Some(graph.mul(scale, root))
}

/// What a polynomial depends on; `None` if it is none, or an atom stands both in angles and outside.
fn variables(graph: &Graph, radicand: ExprId) -> Option<Vec<Variable>> {
    let mut found: Vec<Variable> = Vec::new();
    let mut note = |atom: Atom, is_angle: bool| {
        match found.iter().find(|v| v.atom == atom) {
            Some(known) => return known.is_angle == is_angle,
            None => found.push(Variable {
                atom,
                is_angle,
                degree: 0,
            }),
        }
        matches!(atom, Atom::Coordinate(_) | Atom::Constant(_))
    };
    let is_sound = graph.nodes_of(&[radicand]).all(|node| match node {
        Node::Atom(atom) => note(*atom, false),
        Node::Sin(angle) | Node::Cos(angle) => angle.atoms().all(|atom| note(atom, true)),
        Node::Unary(function, inner) => {
            *function == Unary::Sqrt && matches!(graph.node(*inner), Node::Rational(_))
        }
        _ => true,
    });
    (is_sound && !found.is_empty()).then_some(found)
}

/// Where each variable goes along a line: its value, or the tangent of half its angle.
type Line = Vec<(Element, Element)>;

fn random_line(variables: &[Variable], start: Option<&[Element]>, stream: &mut Stream) -> Line {
    let mut draw = |k: usize| {
        let from = start.map_or_else(|| stream.element(), |start| start[k]);
        (from, stream.element())
    };
    (0..variables.len()).map(&mut draw).collect()
}

/// The point at `t` of a line; `None` where an angle has no tangent.
fn at(variables: &[Variable], line: &Line, t: Element) -> Option<FieldPoint> {
    let mut point = FieldPoint::default();
    for (variable, (from, by)) in variables.iter().zip(line) {
        let x = *from + t * *by;
        if variable.is_angle {
            let square = x * x;
            let inverse = (Element::ONE + square).inverse()?;
            let circle = ((Element::ONE - square) * inverse, (x + x) * inverse);
            point.angles.insert(variable.atom, circle);
        } else {
            point.values.insert(variable.atom, x);
        }
    }
    Some(point)
}

fn may_be_square(tape: &Tape, variables: &[Variable], stream: &mut Stream) -> bool {
    let mut seen = [0, 0];
    for _ in 0..CHARACTERS {
        let line = random_line(variables, None, stream);
        let value = at(variables, &line, Element::ZERO).and_then(|point| tape.evaluate(&point));
        let Some(value) = value else {
            return false;
        };
        if value[0] != Element::ZERO {
            seen[usize::from(value[0].square_root().is_some())] += 1;
        }
    }
    seen.contains(&0) && seen != [0, 0]
}

/// The degree of the radicand in one variable, if it is a polynomial of even degree in it.
fn degree(tape: &Tape, variables: &[Variable], k: usize, stream: &mut Stream) -> Option<usize> {
    let mut line = random_line(variables, None, stream);
    for (other, (_, by)) in line.iter_mut().enumerate() {
        if other != k {
            *by = Element::ZERO;
        }
    }
    let at_most = |d: usize| if variables[k].is_angle { 2 * d } else { d };
    let mut x: Vec<Element> = Vec::new();
    let mut y: Vec<Element> = Vec::new();
    while x.len() < at_most(HIGHEST) + 3 {
        let t = stream.element();
        y.push(tape.evaluate(&at(variables, &line, t)?)?[0]);
        x.push(t);
    }
    (0..=HIGHEST).step_by(2).find(|d| {
        let cleared: Vec<Element> = (x.iter().zip(&y))
            .map(|(t, y)| *y * clearing(&variables[k], line[k], *t, *d))
            .collect();
        interpolate(&x, &cleared).len() <= at_most(*d) + 1
    })
}

/// What clears the denominator that an angle brings into a polynomial of some degree in its cosine and sine.
fn clearing(
    variable: &Variable,
    (from, by): (Element, Element),
    t: Element,
    degree: usize,
) -> Element {
    if !variable.is_angle {
        return Element::ONE;
    }
    let x = from + t * by;
    (Element::ONE + x * x).power(degree as u64)
}

/// All monomials of the root; `None` if they are too many.
fn monomials(variables: &[Variable]) -> Option<Vec<Powers>> {
    let mut all: Vec<Powers> = vec![Vec::new()];
    for variable in variables {
        let mut own: Vec<(usize, usize)> = (0..=variable.degree).map(|n| (n, 0)).collect();
        if variable.is_angle {
            own.extend((1..=variable.degree).map(|n| (n - 1, 1)));
        }
        if all.len() * own.len() > MOST_TERMS {
            return None;
        }
        all = all
            .iter()
            .flat_map(|powers| {
                own.iter().map(move |p| {
                    let mut powers = powers.clone();
                    powers.push(*p);
                    powers
                })
            })
            .collect();
    }
    Some(all)
}

/// The coefficients of a multiple of the root whose first coefficient is one.
fn coefficients(
    tape: &Tape,
    variables: &[Variable],
    monomials: &[Powers],
    stream: &mut Stream,
) -> Option<Vec<Rational>> {
    /// Rows beyond those that settle the coefficients: a wrong one would be seen.
    const MORE: usize = 8;
    let start: Vec<Element> = variables.iter().map(|_| stream.element()).collect();
    let mut rows: Vec<Vec<Element>> = Vec::new();
    while rows.len() < monomials.len() + MORE {
        let line = random_line(variables, Some(&start), stream);
        rows.extend(rows_along(tape, variables, monomials, &line, stream)?);
    }
    let solutions = null_space(rows, monomials.len() + 1);
    let [solution] = solutions.as_slice() else {
        return None;
    };
    let factors = &solution[..monomials.len()];
    let first = factors.iter().find(|x| **x != Element::ZERO)?.inverse()?;
    factors
        .iter()
        .map(|x| lift(&[(MODULUS, (*x * first).representative())]))
        .collect()
}

/// Along a line the monomials and the root over its value at the line's start, at some places.
fn rows_along(
    tape: &Tape,
    variables: &[Variable],
    monomials: &[Powers],
    line: &Line,
    stream: &mut Stream,
) -> Option<Vec<Vec<Element>>> {
    let half: usize = variables
        .iter()
        .map(|v| if v.is_angle { 2 * v.degree } else { v.degree })
        .sum();
    let cleared_by = |t: Element, times: usize| {
        variables
            .iter()
            .zip(line)
            .map(|(v, l)| clearing(v, *l, t, times * v.degree))
            .fold(Element::ONE, |product, x| product * x)
    };
    let places: Vec<Element> = (0..=2 * half).map(|_| stream.element()).collect();
    let values: Option<Vec<Element>> = places
        .iter()
        .map(|t| Some(tape.evaluate(&at(variables, line, *t)?)?[0] * cleared_by(*t, 2)))
        .collect();
    let square = interpolate(&places, &values?);
    let root = series_root(&square, half + 1)?;
    let at_start = cleared_by(Element::ZERO, 1);
    let rows = places[..=half].iter().map(|t| {
        let point = at(variables, line, *t)?;
        let value = root
            .iter()
            .rev()
            .fold(Element::ZERO, |sum, c| sum * *t + *c);
        let value = value * at_start * cleared_by(*t, 1).inverse()?;
        let mut row: Vec<Element> = monomials
            .iter()
            .map(|powers| monomial(variables, powers, &point))
            .collect();
        row.push(-value);
        Some(row)
    });
    rows.collect()
}

/// The first `n` coefficients of the root of a polynomial over its value at zero.
fn series_root(square: &[Element], n: usize) -> Option<Vec<Element>> {
    let inverse = square.first()?.inverse()?;
    let half = (Element::ONE + Element::ONE).inverse()?;
    let mut root = vec![Element::ONE];
    for k in 1..n {
        let whole = square.get(k).map_or(Element::ZERO, |c| *c * inverse);
        let known = (1..k).fold(Element::ZERO, |sum, i| sum + root[i] * root[k - i]);
        root.push((whole - known) * half);
    }
    Some(root)
}

fn monomial(variables: &[Variable], powers: &Powers, point: &FieldPoint) -> Element {
    let factor = |(variable, (n, m)): (&Variable, &(usize, usize))| {
        if variable.is_angle {
            let (c, s) = point.angles[&variable.atom];
            c.power(*n as u64) * s.power(*m as u64)
        } else {
            point.values[&variable.atom].power(*n as u64)
        }
    };
    let all = variables.iter().zip(powers).map(factor);
    all.fold(Element::ONE, |product, x| product * x)
}

/// The polynomial as an expression.
fn written(
    graph: &mut Graph,
    variables: &[Variable],
    monomials: &[Powers],
    factors: &[Rational],
) -> ExprId {
    let mut terms = Vec::new();
    for (powers, factor) in monomials.iter().zip(factors) {
        if factor.is_zero() {
            continue;
        }
        let mut product = Vec::new();
        for (variable, (n, m)) in variables.iter().zip(powers) {
            if variable.is_angle {
                let angle = crate::expr::AngleSum::new([(variable.atom, 1)]);
                let (c, s) = graph.cos_sin(&angle, 0);
                product.extend([(c, exponent(*n)), (s, exponent(*m))]);
            } else {
                product.push((graph.atom(variable.atom), exponent(*n)));
            }
        }
        product.retain(|(_, n)| *n != 0);
        terms.push((graph.product(&product), factor.clone()));
    }
    graph.sum(&terms)
}

fn exponent(n: usize) -> i32 {
    i32::try_from(n).expect("degrees are small")
}

/// The rational number that one expression is of another, if it is one: shown at a few points.
fn constant_ratio(
    graph: &Graph,
    variables: &[Variable],
    of: ExprId,
    to: ExprId,
    stream: &mut Stream,
) -> Option<Rational> {
    let tape = Tape::new(graph, &[of, to]);
    let mut draw = || -> Option<Element> {
        let line = random_line(variables, None, stream);
        let values = tape.evaluate(&at(variables, &line, Element::ZERO)?)?;
        Some(values[0] * values[1].inverse()?)
    };
    let ratio = draw()?;
    for _ in 0..3 {
        if draw()? != ratio {
            return None;
        }
    }
    lift(&[(MODULUS, ratio.representative())])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expr::AngleSum;

    /// Squares of what `make` makes of a graph are found back, with either sign.
    #[track_caller]
    fn check(make: impl Fn(&mut Graph) -> ExprId) {
        let mut graph = Graph::new();
        let root = make(&mut graph);
        let square = graph.mul(root, root);
        let found = exact_root(&mut graph, square).expect("a root");
        let again = graph.mul(found, found);
        let tape = Tape::new(&graph, &[square, again]);
        let mut stream = Stream::new(1);
        for _ in 0..5 {
            let mut point = FieldPoint::<Element>::default();
            for atom in graph.atoms(&[square]) {
                point.values.insert(atom, stream.element());
                point.angles.insert(atom, stream.circle());
            }
            let values = tape.evaluate(&point).unwrap();
            assert_eq!(values[0], values[1]);
        }
        // One more than a square is none.
        let more = graph.add(square, Graph::ONE);
        assert_eq!(exact_root(&mut graph, more), None);
    }

    fn circle(graph: &mut Graph, i: usize) -> (ExprId, ExprId) {
        graph.cos_sin(&AngleSum::new([(Atom::Coordinate(i), 1)]), 0)
    }

    #[test]
    fn roots_of_squares_are_found() {
        // The yaw of a platform on three equal legs.
        check(|graph| {
            let ((p, _), (r, _)) = (circle(graph, 0), circle(graph, 1));
            let product = graph.mul(p, r);
            graph.add(Graph::ONE, product)
        });
        // Twice the product of a pair of links and the sine between them, with constants.
        check(|graph| {
            let (_, s) = circle(graph, 0);
            let (a, b) = (graph.atom(Atom::Constant(0)), graph.atom(Atom::Constant(1)));
            graph.product(&[(a, 1), (b, 1), (s, 1)])
        });
        // With a length, a number under a root, and a leading term that is no square.
        check(|graph| {
            let (c, s) = circle(graph, 2);
            let length = graph.atom(Atom::Coordinate(3));
            let three = graph.integer(3);
            let root = graph.unary(Unary::Sqrt, three);
            let (x, y) = (graph.mul(length, c), graph.mul(length, s));
            let sum = graph.combine([(x, Rational::new(2, 3)), (y, Rational::integer(-5))]);
            let sum = graph.add(sum, length);
            graph.mul(root, sum)
        });
    }

    #[test]
    fn what_is_no_square_of_a_polynomial_has_no_root() {
        let mut graph = Graph::new();
        let (c, _) = circle(&mut graph, 0);
        let two = graph.integer(2);
        let sum = graph.add(two, c);
        assert_eq!(exact_root(&mut graph, sum), None);
        // The square of a sine, below zero.
        let (_, s) = circle(&mut graph, 1);
        let square = graph.mul(s, s);
        let below = graph.neg(square);
        assert_eq!(exact_root(&mut graph, below), None);
    }
}
