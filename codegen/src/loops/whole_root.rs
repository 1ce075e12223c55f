//! Square roots that need no root sign: a polynomial in cosines, sines, lengths and constants whose square is a given
//! one. Examples are the yaw of a platform on three equal legs, and the crossed linkage of two equal pairs of links.
//!
//! Along a line through a point, the root of a polynomial is determined by its value at that point, as a power series.
//! So the root divided by its value at one point can be evaluated anywhere, with one and the same sign. Its
//! coefficients are the solution of a linear system. Finally it is tested that the square is the radicand.
//!
//! Decision: the polynomial is evaluated and never expanded or factored. With it, the yaw of a platform on three
//! equal legs, crossed parallelograms and deltoids have rational closed forms.

use modelmill_algebra::eliminate::null_space;
use modelmill_algebra::field::{FieldElement, MODULUS, RandomStream};
use modelmill_algebra::lift::reconstruct_rational;
use modelmill_algebra::univariate::interpolate;

use crate::expr::{Atom, EvaluationTape, ExprId, FieldPoint, Graph, Node, Rational, Unary};

/// Number of draws at which a radicand must be a square everywhere, or nowhere, before the polynomial is computed.
const SQUARE_TESTS: usize = 24;
/// Largest number of terms of a root.
const MOST_TERMS: usize = 300;
/// Highest degree of the radicand in one variable.
const HIGHEST_DEGREE: usize = 8;

/// A quantity on which the radicand depends.
#[derive(Clone, Copy)]
struct RadicandVariable {
    /// The coordinate or constant.
    atom: Atom,
    /// Whether it occurs in cosines and sines.
    is_angle: bool,
    /// Its degree in the root, in cosine and sine together for an angle.
    degree: usize,
}

/// A monomial: for every variable the exponent of its value, or of its cosine and (0 or 1) sine.
type RadicandMonomial = Vec<(usize, usize)>;

/// The polynomial whose square an expression is, with either sign; `None` if there is none, or if its coefficients are
/// no short fractions.
pub(crate) fn exact_root(graph: &mut Graph, radicand: ExprId) -> Option<ExprId> {
    let tape = EvaluationTape::new(graph, &[radicand]);
    let mut variables = radicand_variables(graph, radicand)?;
    let mut stream = RandomStream::new(6);
    if !may_be_square(&tape, &variables, &mut stream) {
        return None;
    }
    // The root has half the degree of the radicand.
    for k in 0..variables.len() {
        variables[k].degree = radicand_degree(&tape, &variables, k, &mut stream)? / 2;
    }
    let monomials = root_monomials(&variables)?;
    let factors = root_coefficients(&tape, &variables, &monomials, &mut stream)?;
    let root = polynomial_expression(graph, &variables, &monomials, &factors);
    // The root is known up to a constant factor, whose square is the ratio to the radicand.
    let square = graph.mul(root, root);
    let ratio = constant_ratio(graph, &variables, radicand, square, &mut stream)?;
    if ratio.is_negative() || ratio.is_zero() {
        return None;
    }
    let ratio = graph.rational(ratio);
    let scale = graph.unary(Unary::Sqrt, ratio);
    Some(graph.mul(scale, root))
}

/// The quantities on which a polynomial depends; `None` if the expression is no polynomial, or if an atom occurs both
/// in angles and outside.
fn radicand_variables(graph: &Graph, radicand: ExprId) -> Option<Vec<RadicandVariable>> {
    let mut found: Vec<RadicandVariable> = Vec::new();
    // Records an atom, and returns whether it may occur in this way.
    let mut note = |atom: Atom, is_angle: bool| {
        match found.iter().find(|v| v.atom == atom) {
            Some(known) => return known.is_angle == is_angle,
            None => found.push(RadicandVariable {
                atom,
                is_angle,
                degree: 0,
            }),
        }
        matches!(atom, Atom::Coordinate(_) | Atom::Constant(_))
    };
    // Roots of numbers are constants; other functions are no polynomials.
    let is_sound = graph.nodes_of(&[radicand]).all(|node| match node {
        Node::Atom(atom) => note(*atom, false),
        Node::Sin(angle) | Node::Cos(angle) => angle.atoms().all(|atom| note(atom, true)),
        Node::Unary(function, inner) => *function == Unary::Sqrt && matches!(graph.node(*inner), Node::Rational(_)),
        _ => true,
    });
    (is_sound && !found.is_empty()).then_some(found)
}

/// A line in the space of the variables, as start and slope per variable: its value, or the tangent of half its angle.
type VariableLine = Vec<(FieldElement, FieldElement)>;

/// A random line, from a given point or a random one.
fn random_line(
    variables: &[RadicandVariable],
    start: Option<&[FieldElement]>,
    stream: &mut RandomStream,
) -> VariableLine {
    let mut draw = |k: usize| {
        let from = start.map_or_else(|| stream.next_element(), |start| start[k]);
        (from, stream.next_element())
    };
    (0..variables.len()).map(&mut draw).collect()
}

/// The point at `t` of a line; `None` where an angle has no tangent.
fn point_on_line(variables: &[RadicandVariable], line: &VariableLine, t: FieldElement) -> Option<FieldPoint> {
    let mut point = FieldPoint::default();
    for (variable, (from, by)) in variables.iter().zip(line) {
        let x = *from + t * *by;
        // Rational parametrisation of the circle by the tangent of half the angle.
        if variable.is_angle {
            let square = x * x;
            let inverse = (FieldElement::ONE + square).inverse()?;
            let circle = ((FieldElement::ONE - square) * inverse, (x + x) * inverse);
            point.angles.insert(variable.atom, circle);
        } else {
            point.values.insert(variable.atom, x);
        }
    }
    Some(point)
}

/// Whether the radicand is a square at all drawn points, or at none: a square times a constant is either.
fn may_be_square(tape: &EvaluationTape, variables: &[RadicandVariable], stream: &mut RandomStream) -> bool {
    let mut seen = [0, 0];
    for _ in 0..SQUARE_TESTS {
        let line = random_line(variables, None, stream);
        let value = point_on_line(variables, &line, FieldElement::ZERO).and_then(|point| tape.evaluate(&point));
        let Some(value) = value else {
            return false;
        };
        if value[0] != FieldElement::ZERO {
            seen[usize::from(value[0].square_root().is_some())] += 1;
        }
    }
    seen.contains(&0) && seen != [0, 0]
}

/// The degree of the radicand in one variable, if it is a polynomial of even degree in it, up to [`HIGHEST_DEGREE`].
fn radicand_degree(
    tape: &EvaluationTape,
    variables: &[RadicandVariable],
    k: usize,
    stream: &mut RandomStream,
) -> Option<usize> {
    let mut line = random_line(variables, None, stream);
    // Only variable k changes along this line.
    for (other, (_, by)) in line.iter_mut().enumerate() {
        if other != k {
            *by = FieldElement::ZERO;
        }
    }
    let at_most = |d: usize| if variables[k].is_angle { 2 * d } else { d };
    let mut x: Vec<FieldElement> = Vec::new();
    let mut y: Vec<FieldElement> = Vec::new();
    // A few points more than coefficients show that the degree is not higher.
    while x.len() < at_most(HIGHEST_DEGREE) + 3 {
        let t = stream.next_element();
        y.push(tape.evaluate(&point_on_line(variables, &line, t)?)?[0]);
        x.push(t);
    }
    (0..=HIGHEST_DEGREE).step_by(2).find(|d| {
        let cleared: Vec<FieldElement> = (x.iter().zip(&y))
            .map(|(t, y)| *y * clearing_factor(&variables[k], line[k], *t, *d))
            .collect();
        interpolate(&x, &cleared).len() <= at_most(*d) + 1
    })
}

/// The factor that removes the denominator of an angle's parametrisation from a polynomial of some degree in its cosine
/// and sine.
fn clearing_factor(
    variable: &RadicandVariable,
    (from, by): (FieldElement, FieldElement),
    t: FieldElement,
    degree: usize,
) -> FieldElement {
    if !variable.is_angle {
        return FieldElement::ONE;
    }
    let x = from + t * by;
    (FieldElement::ONE + x * x).power(degree as u64)
}

/// All monomials of the root; `None` if there are more than [`MOST_TERMS`].
fn root_monomials(variables: &[RadicandVariable]) -> Option<Vec<RadicandMonomial>> {
    let mut all: Vec<RadicandMonomial> = vec![Vec::new()];
    for variable in variables {
        // Powers of the variable; for an angle also powers of its cosine times its sine, because sin^2 = 1 - cos^2.
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

/// The coefficients of the multiple of the root whose first coefficient that is not zero is 1.
fn root_coefficients(
    tape: &EvaluationTape,
    variables: &[RadicandVariable],
    monomials: &[RadicandMonomial],
    stream: &mut RandomStream,
) -> Option<Vec<Rational>> {
    /// Number of rows in addition to the coefficients: they detect a wrong solution.
    const MORE: usize = 8;
    let start: Vec<FieldElement> = variables.iter().map(|_| stream.next_element()).collect();
    let mut rows: Vec<Vec<FieldElement>> = Vec::new();
    while rows.len() < monomials.len() + MORE {
        let line = random_line(variables, Some(&start), stream);
        rows.extend(rows_along(tape, variables, monomials, &line, stream)?);
    }
    // Unknowns are the coefficients and the scale of the root; the solution must be unique.
    let solutions = null_space(rows, monomials.len() + 1);
    let [solution] = solutions.as_slice() else {
        return None;
    };
    let factors = &solution[..monomials.len()];
    let first = factors.iter().find(|x| **x != FieldElement::ZERO)?.inverse()?;
    factors
        .iter()
        .map(|x| reconstruct_rational(&[(MODULUS, (*x * first).representative())]))
        .collect()
}

/// Rows of the linear system from one line: at several places the values of the monomials, then the negative of the
/// root divided by its value at the start of the line.
fn rows_along(
    tape: &EvaluationTape,
    variables: &[RadicandVariable],
    monomials: &[RadicandMonomial],
    line: &VariableLine,
    stream: &mut RandomStream,
) -> Option<Vec<Vec<FieldElement>>> {
    // Degree of the root along the line, after its denominators are removed.
    let half: usize = variables
        .iter()
        .map(|v| if v.is_angle { 2 * v.degree } else { v.degree })
        .sum();
    let cleared_by = |t: FieldElement, times: usize| {
        variables
            .iter()
            .zip(line)
            .map(|(v, l)| clearing_factor(v, *l, t, times * v.degree))
            .fold(FieldElement::ONE, |product, x| product * x)
    };
    // The radicand along the line as a polynomial, from enough values.
    let places: Vec<FieldElement> = (0..=2 * half).map(|_| stream.next_element()).collect();
    let values: Option<Vec<FieldElement>> = places
        .iter()
        .map(|t| Some(tape.evaluate(&point_on_line(variables, line, *t)?)?[0] * cleared_by(*t, 2)))
        .collect();
    let square = interpolate(&places, &values?);
    let root = series_root(&square, half + 1)?;
    let at_start = cleared_by(FieldElement::ZERO, 1);
    let rows = places[..=half].iter().map(|t| {
        let point = point_on_line(variables, line, *t)?;
        // Horner's scheme.
        let value = root.iter().rev().fold(FieldElement::ZERO, |sum, c| sum * *t + *c);
        let value = value * at_start * cleared_by(*t, 1).inverse()?;
        let mut row: Vec<FieldElement> = monomials
            .iter()
            .map(|powers| monomial_value(variables, powers, &point))
            .collect();
        row.push(-value);
        Some(row)
    });
    rows.collect()
}

/// The first `n` coefficients of the root of a polynomial, divided by the root's value at zero.
fn series_root(square: &[FieldElement], n: usize) -> Option<Vec<FieldElement>> {
    let inverse = square.first()?.inverse()?;
    let half = (FieldElement::ONE + FieldElement::ONE).inverse()?;
    let mut root = vec![FieldElement::ONE];
    // Coefficient k of the square of the series has twice the new coefficient and products of known ones.
    for k in 1..n {
        let whole = square.get(k).map_or(FieldElement::ZERO, |c| *c * inverse);
        let known = (1..k).fold(FieldElement::ZERO, |sum, i| sum + root[i] * root[k - i]);
        root.push((whole - known) * half);
    }
    Some(root)
}

/// The value of a monomial at a point of the field.
fn monomial_value(variables: &[RadicandVariable], powers: &RadicandMonomial, point: &FieldPoint) -> FieldElement {
    let factor = |(variable, (n, m)): (&RadicandVariable, &(usize, usize))| {
        if variable.is_angle {
            let (c, s) = point.angles[&variable.atom];
            c.power(*n as u64) * s.power(*m as u64)
        } else {
            point.values[&variable.atom].power(*n as u64)
        }
    };
    let all = variables.iter().zip(powers).map(factor);
    all.fold(FieldElement::ONE, |product, x| product * x)
}

/// The polynomial as an expression of the graph.
fn polynomial_expression(
    graph: &mut Graph,
    variables: &[RadicandVariable],
    monomials: &[RadicandMonomial],
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
                let angle = crate::expr::AtomAngleSum::new([(variable.atom, 1)]);
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

/// A degree as an exponent of the graph.
fn exponent(n: usize) -> i32 {
    i32::try_from(n).expect("degrees are small")
}

/// The constant rational ratio of two expressions, if it is constant; tested at a few points.
fn constant_ratio(
    graph: &Graph,
    variables: &[RadicandVariable],
    of: ExprId,
    to: ExprId,
    stream: &mut RandomStream,
) -> Option<Rational> {
    let tape = EvaluationTape::new(graph, &[of, to]);
    let mut draw = || -> Option<FieldElement> {
        let line = random_line(variables, None, stream);
        let values = tape.evaluate(&point_on_line(variables, &line, FieldElement::ZERO)?)?;
        Some(values[0] * values[1].inverse()?)
    };
    // The ratio must be the same at all points.
    let ratio = draw()?;
    for _ in 0..3 {
        if draw()? != ratio {
            return None;
        }
    }
    reconstruct_rational(&[(MODULUS, ratio.representative())])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expr::AtomAngleSum;

    /// Squares of what `make` makes of a graph are found back, with either sign.
    #[track_caller]
    fn check(make: impl Fn(&mut Graph) -> ExprId) {
        let mut graph = Graph::new();
        let root = make(&mut graph);
        let square = graph.mul(root, root);
        let found = exact_root(&mut graph, square).expect("a root");
        let again = graph.mul(found, found);
        let tape = EvaluationTape::new(&graph, &[square, again]);
        let mut stream = RandomStream::new(1);
        for _ in 0..5 {
            let mut point = FieldPoint::<FieldElement>::default();
            for atom in graph.atoms(&[square]) {
                point.values.insert(atom, stream.next_element());
                point.angles.insert(atom, stream.next_circle_point());
            }
            let values = tape.evaluate(&point).unwrap();
            assert_eq!(values[0], values[1]);
        }
        // One more than a square is none.
        let more = graph.add(square, Graph::ONE);
        assert_eq!(exact_root(&mut graph, more), None);
    }

    fn circle(graph: &mut Graph, i: usize) -> (ExprId, ExprId) {
        graph.cos_sin(&AtomAngleSum::new([(Atom::Coordinate(i), 1)]), 0)
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
            let sum = graph.linear_combination([(x, Rational::new(2, 3)), (y, Rational::integer(-5))]);
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
