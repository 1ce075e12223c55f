//! Coordinates that are determined by others through gears, belts, screws or cams: each is a closure of its own, given by its
//! value.
//!
//! In the field, an angle that is a fraction of another one is composed of parts that both have in common: with `q2 =
//! 7/10 q1` both are multiples of the angle `q1/10`. A ratio that is a constant of the file makes an independent angle,
//! because sine and cosine of `n q` are no algebraic functions of those of `q`. The base is then valid for every value
//! of the constant. For a special value the numeric rank may be lower, which is reported.

use std::collections::BTreeMap;

use modelmill_spec::Mechanism;

use super::closure::LoopClosure;
use super::relation::AngleRelation;
use super::solved::{multiply_angle, rotate_vector};
use crate::DeriveError;
use crate::expr::{Atom, AtomAngleSum, ExprId, Graph, Node, Rational, Unary, coordinates_of};
use crate::tree::expressions::expression;

/// Largest number of parts that an angle is divided into, and largest multiple of a part.
const MOST_PARTS: i64 = 1000;

/// A coordinate that is determined by others.
#[derive(Clone, Debug)]
pub(crate) struct CoupledCoordinate {
    /// Index of the coordinate.
    pub(crate) coordinate: usize,
    /// Its value, rad or m, in terms of the coordinates that determine it.
    pub(crate) value: ExprId,
    /// Cosine and sine of an angle, composed of the parts of the angles that determine it, as the field needs them.
    pub(crate) in_parts: Option<[ExprId; 2]>,
}

/// All couplings of a mechanism.
pub(crate) struct CouplingClosures {
    /// One closure per coupling.
    pub(crate) closures: Vec<LoopClosure>,
    /// Angles of which others are fractions, with the number of parts into which the field divides them.
    pub(crate) divided: Vec<(usize, i64)>,
}

/// The couplings of a mechanism as closures, in the order of the file.
///
/// # Errors
/// A [`DeriveError`] of an expression of the file that cannot be written into the graph.
pub(crate) fn couplings(graph: &mut Graph, mechanism: &Mechanism) -> Result<CouplingClosures, DeriveError> {
    let is_angle = |i: usize| mechanism.coordinates[i].motion.is_angle();
    // The value of every coupled coordinate: an offset, factors times other coordinates, and a function that is not affine.
    let mut values = Vec::new();
    for coupling in &mechanism.couplings {
        let mut terms = vec![expression(graph, &coupling.offset)?];
        for (i, factor) in &coupling.terms {
            let factor = expression(graph, factor)?;
            let followed = graph.atom(Atom::Coordinate(i.0));
            terms.push(graph.mul(factor, followed));
        }
        if let Some(function) = &coupling.function {
            terms.push(expression(graph, &function.value)?);
        }
        values.push((coupling.coordinate.0, graph.add_all(&terms)));
    }
    // A coordinate that depends on a coupled one is expressed by the coordinates behind that one.
    let known: BTreeMap<ExprId, ExprId> = values
        .iter()
        .map(|(i, value)| (graph.atom(Atom::Coordinate(*i)), *value))
        .collect();
    let mut resolved: Vec<ExprId> = values.iter().map(|(_, value)| *value).collect();
    for _ in 1..values.len() {
        resolved = graph.substitute(&resolved, &known);
    }
    // The common denominator of all factors by which an angle enters others.
    let mut parts: BTreeMap<ExprId, i64> = BTreeMap::new();
    let turning = values.iter().zip(&resolved).filter(|((i, _), _)| is_angle(*i));
    for (_, value) in turning {
        for (base, factor) in scaled_terms(graph, *value) {
            let denominator = factor.as_small().map_or(0, |(_, d)| d);
            let common = parts.entry(base).or_insert(1);
            let both = lcm(*common, denominator);
            if (1..=MOST_PARTS).contains(&both) {
                *common = both;
            }
        }
    }
    // One closure per coupling, with a relation where the factors are integers.
    let mut closures = Vec::new();
    for ((coordinate, value), resolved) in values.into_iter().zip(resolved) {
        let own = graph.atom(Atom::Coordinate(coordinate));
        let residual = vec![graph.sub(own, value)];
        let relation = is_angle(coordinate)
            .then(|| coupled_angle_relation(graph, mechanism, coordinate, value))
            .flatten();
        // Cosine and sine by the addition theorems, term by term.
        let in_parts = is_angle(coordinate).then(|| {
            let all = scaled_terms(graph, resolved);
            all.into_iter()
                .fold([Graph::ONE, Graph::ZERO], |so_far, (base, factor)| {
                    let piece = term_cos_sin(graph, mechanism, base, &factor, &parts);
                    rotate_vector(graph, piece, so_far)
                })
        });
        closures.push(LoopClosure {
            name: mechanism.coordinates[coordinate].name.clone(),
            coordinates: coordinates_of(graph, &residual),
            residual,
            n_independent: 1,
            chain: None,
            equations: Vec::new(),
            follower: Some(CoupledCoordinate {
                coordinate,
                value,
                in_parts,
            }),
            relations: relation.into_iter().collect(),
        });
    }
    // Only angles that are divided into more than one part are of interest.
    let divided = parts.into_iter().filter(|(_, n)| *n > 1);
    let divided = divided.filter_map(|(base, n)| match graph.node(base) {
        Node::Atom(Atom::Coordinate(i)) if is_angle(*i) => Some((*i, n)),
        _ => None,
    });
    Ok(CouplingClosures {
        closures,
        divided: divided.collect(),
    })
}

/// The terms of a sum, each with its rational factor; an expression that is no sum is its only term.
fn scaled_terms(graph: &Graph, value: ExprId) -> Vec<(ExprId, Rational)> {
    match graph.node(value) {
        Node::Sum(terms) => terms.clone(),
        Node::Rational(number) if number.is_zero() => Vec::new(),
        Node::Rational(number) => vec![(Graph::ONE, number.clone())],
        _ => vec![(value, Rational::ONE)],
    }
}

/// A term that is an integer multiple of an angle, or of pi/12, as an exact angle; `None` for other terms.
fn integer_multiple(
    graph: &Graph,
    mechanism: &Mechanism,
    base: ExprId,
    factor: &Rational,
) -> Option<(AtomAngleSum, i32)> {
    let count = |factor: &Rational| {
        let (n, _) = factor.as_small().filter(|(_, d)| *d == 1)?;
        i32::try_from(n).ok().filter(|n| i64::from(n.abs()) <= MOST_PARTS)
    };
    // Angles are coordinates of revolute joints and constants with the unit of an angle.
    match graph.node(base) {
        Node::Atom(Atom::Pi) => {
            let twelfths = count(&(factor * &Rational::integer(12)))?;
            Some((AtomAngleSum::NONE, twelfths.rem_euclid(24)))
        }
        Node::Atom(atom @ Atom::Coordinate(i)) if mechanism.coordinates[*i].motion.is_angle() => {
            Some((AtomAngleSum::new([(*atom, count(factor)?)]), 0))
        }
        Node::Atom(atom @ Atom::Constant(i)) if mechanism.constants[*i].is_angle => {
            Some((AtomAngleSum::new([(*atom, count(factor)?)]), 0))
        }
        _ => None,
    }
}

/// The relation of an angle that is a sum of integer multiples of other angles and of pi/12; `None` for other values.
fn coupled_angle_relation(
    graph: &Graph,
    mechanism: &Mechanism,
    coordinate: usize,
    value: ExprId,
) -> Option<AngleRelation> {
    let mut relation = AngleRelation {
        coordinate,
        sum: AtomAngleSum::NONE,
        pi12: 0,
    };
    for (base, factor) in scaled_terms(graph, value) {
        let (sum, pi12) = integer_multiple(graph, mechanism, base, &factor)?;
        relation.sum = relation.sum.plus(&sum, 1);
        relation.pi12 = (relation.pi12 + pi12).rem_euclid(24);
    }
    Some(relation)
}

/// Cosine and sine of one term of an angle, `factor * base`. `parts` has the number of parts of every divided angle.
fn term_cos_sin(
    graph: &mut Graph,
    mechanism: &Mechanism,
    base: ExprId,
    factor: &Rational,
    parts: &BTreeMap<ExprId, i64>,
) -> [ExprId; 2] {
    // Integer multiples have exact cosines and sines.
    if let Some((sum, pi12)) = integer_multiple(graph, mechanism, base, factor) {
        let (c, s) = graph.cos_sin(&sum, pi12);
        return [c, s];
    }
    let n_parts = Rational::integer(parts[&base]);
    let count = (factor * &n_parts).as_small();
    let count = count.filter(|(n, d)| *d == 1 && n.abs() <= MOST_PARTS);
    // A term without parts in common with others is an independent angle.
    let (part, n) = match count {
        Some((n, _)) => (n_parts.recip(), n),
        None => (factor.clone(), 1),
    };
    let part = graph.scale(base, &part);
    let circle = [Unary::Cos, Unary::Sin].map(|function| graph.unary(function, part));
    multiply_angle(graph, circle, n)
}

/// Least common multiple; saturates where it overflows, and is 0 for two zeros.
fn lcm(a: i64, b: i64) -> i64 {
    let (mut x, mut y) = (a, b);
    while y != 0 {
        (x, y) = (y, x % y);
    }
    if x == 0 { 0 } else { (a / x).saturating_mul(b) }
}
