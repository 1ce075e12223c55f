//! Closed form of a planar loop with two unknown coordinates: the intersection of two circles, of a circle and a line,
//! or of two lines (the dyads of mechanism theory, e.g. Erdman and Sandor 1997).
//!
//! The same expressions serve the emitted code and the exact sampling of the loop's variety in a prime field.

use std::collections::BTreeSet;

use crate::expr::{Atom, AtomAngleSum, ExprId, Graph, Rational, coordinates_of};
use crate::loops::closure::{LoopClosure, PlanarLeg};
use crate::loops::solved::{ClosureSolution, SignedRoot, rotate_vector};
use crate::loops::whole_root;

/// The vectors that rotate with the same unknown angles, as one vector in a frame rotated by `angle`.
struct LegGroup {
    /// Unknown coordinates in the angle, with their integer factors.
    unknown: BTreeSet<(usize, i32)>,
    /// The angle of the first of these vectors, with its known part.
    angle: AtomAngleSum,
    /// Sum of the vectors in that frame, m.
    vector: [ExprId; 2],
}

/// Solves `closure` for the coordinates `unknown` (one or two); every other coordinate is known.
///
/// `positive` chooses the sign of the square root. Returns `None` where no closed form of this family applies.
pub(crate) fn solve(
    graph: &mut Graph,
    closure: &LoopClosure,
    unknown: &[usize],
    positive: bool,
) -> Option<ClosureSolution> {
    if !closure.relations.is_empty() {
        let relations = closure.relations.clone();
        return Some(ClosureSolution {
            angles: Vec::new(),
            relations,
            values: Vec::new(),
            root: None,
        });
    }
    // Vectors without unknown angles add up to one known vector; the others are grouped by their unknown angles.
    let legs = closure.chain.as_ref()?;
    let mut known = [Graph::ZERO; 2];
    let mut groups: Vec<LegGroup> = Vec::new();
    // Unknown coordinates that change the length of a vector, as prismatic joints do.
    let slides: Vec<usize> = unknown
        .iter()
        .copied()
        .filter(|c| legs.iter().any(|leg| has_coordinate(graph, &leg.vector, *c)))
        .collect();
    for leg in legs {
        let inside: BTreeSet<(usize, i32)> = leg
            .angle
            .terms()
            .iter()
            .filter_map(|(atom, n)| match atom {
                Atom::Coordinate(i) if unknown.contains(i) => Some((*i, *n)),
                _ => None,
            })
            .collect();
        // A vector without unknown angles belongs to the known one.
        if inside.is_empty() {
            let v = rotate_leg(graph, leg, &AtomAngleSum::NONE);
            known = [graph.add(known[0], v[0]), graph.add(known[1], v[1])];
            continue;
        }
        // A vector with the unknown angles of an earlier one is written in the frame of that group.
        match groups.iter_mut().find(|g| g.unknown == inside) {
            Some(group) => {
                let v = rotate_leg(graph, leg, &group.angle);
                group.vector = [graph.add(group.vector[0], v[0]), graph.add(group.vector[1], v[1])];
            }
            None => {
                let v = rotate_leg(
                    graph,
                    &PlanarLeg {
                        angle: AtomAngleSum::NONE,
                        ..leg.clone()
                    },
                    &AtomAngleSum::NONE,
                );
                groups.push(LegGroup {
                    unknown: inside,
                    angle: leg.angle.clone(),
                    vector: v,
                });
            }
        }
    }
    // Two unknown directions, one direction and one length, or two lengths.
    match (groups.as_slice(), slides.as_slice()) {
        ([first, second], []) => intersect_circles(graph, known, first, second, positive),
        ([group], [slide]) => intersect_circle_and_line(graph, known, group, *slide, positive),
        ([], [a, b]) => intersect_lines(graph, known, *a, *b),
        _ => None,
    }
    .filter(|solved| has_determined_unknowns(solved, unknown))
}

/// Whether the solved angles determine every unknown coordinate, one at a time and with factors of 1 or -1.
fn has_determined_unknowns(solved: &ClosureSolution, unknown: &[usize]) -> bool {
    let mut left: BTreeSet<usize> = unknown.iter().copied().collect();
    for (slide, _) in &solved.values {
        left.remove(slide);
    }
    // Each sum with a single remaining unknown determines that one.
    loop {
        let found = solved.angles.iter().find_map(|(angle, _)| {
            let inside: Vec<_> = angle
                .terms()
                .iter()
                .filter(|(atom, _)| matches!(atom, Atom::Coordinate(i) if left.contains(i)))
                .collect();
            match inside.as_slice() {
                [(Atom::Coordinate(i), 1 | -1)] => Some(*i),
                _ => None,
            }
        });
        match found {
            Some(i) => _ = left.remove(&i),
            None => return left.is_empty(),
        }
    }
}

/// Whether any of the expressions depends on a coordinate.
fn has_coordinate(graph: &Graph, roots: &[ExprId], coordinate: usize) -> bool {
    graph.atoms(roots).contains(&Atom::Coordinate(coordinate))
}

/// The leg's vector in a frame rotated by `reference`.
fn rotate_leg(graph: &mut Graph, leg: &PlanarLeg, reference: &AtomAngleSum) -> [ExprId; 2] {
    let rest = leg.angle.plus(reference, -1);
    let (c, s) = graph.cos_sin(&rest, leg.pi12);
    rotate_vector(graph, [c, s], leg.vector)
}

/// Scalar product of two vectors in the plane.
fn dot(graph: &mut Graph, a: [ExprId; 2], b: [ExprId; 2]) -> ExprId {
    let (x, y) = (graph.mul(a[0], b[0]), graph.mul(a[1], b[1]));
    graph.add(x, y)
}

/// The component of the vector product along the normal of the plane.
fn cross(graph: &mut Graph, a: [ExprId; 2], b: [ExprId; 2]) -> ExprId {
    let (x, y) = (graph.mul(a[0], b[1]), graph.mul(a[1], b[0]));
    graph.sub(x, y)
}

/// Cosine and sine of the angle that rotates `arm` onto `v`; both have the same length, whose square is `arm_squared`.
fn rotation_between(graph: &mut Graph, v: [ExprId; 2], arm: [ExprId; 2], arm_squared: ExprId) -> [ExprId; 2] {
    // An arm along the x axis needs only its length.
    if arm[1] == Graph::ZERO {
        return v.map(|x| graph.div(x, arm[0]));
    }
    let inverse = graph.pow(arm_squared, -1);
    let (along, across) = (dot(graph, arm, v), cross(graph, arm, v));
    [graph.mul(along, inverse), graph.mul(across, inverse)]
}

/// The root, negated unless `positive`.
fn apply_sign(graph: &mut Graph, root: ExprId, positive: bool) -> ExprId {
    if positive { root } else { graph.neg(root) }
}

/// The square root as a node of the graph.
fn square_root(graph: &mut Graph, radicand: ExprId) -> ExprId {
    graph.unary(crate::expr::Unary::Sqrt, radicand)
}

/// `known + v1 + v2 = 0`, where both vectors have known lengths: `v1 = alpha d + beta d'`, with `d = -known` and `d'`
/// normal to it.
///
/// `None` where one of the three lengths is exactly zero.
fn intersect_circles(
    graph: &mut Graph,
    known: [ExprId; 2],
    first: &LegGroup,
    second: &LegGroup,
    positive: bool,
) -> Option<ClosureSolution> {
    let d = known.map(|x| graph.neg(x));
    let [dd, aa, bb] = [d, first.vector, second.vector].map(|v| dot(graph, v, v));
    // A vector of length zero has no direction.
    if [dd, aa, bb].contains(&Graph::ZERO) {
        return None;
    }
    let inverse = graph.pow(dd, -1);
    // alpha = (d^2 + a^2 - b^2) / (2 d^2), beta^2 = a^2 / d^2 - alpha^2
    let difference = graph.sub(aa, bb);
    let ratio = graph.mul(difference, inverse);
    let half = Rational::new(1, 2);
    let one_half = graph.rational(half.clone());
    let alpha = graph.linear_combination([(one_half, Rational::ONE), (ratio, half)]);
    let (square, alpha_square) = (graph.mul(aa, inverse), graph.mul(alpha, alpha));
    let radicand = graph.sub(square, alpha_square);
    // 4 d^4 beta^2 = 4 a^2 d^2 - (d^2 + a^2 - b^2)^2, sixteen times the square of the triangle's area
    let sum = graph.add(dd, difference);
    let (four, square_of_sum) = (graph.mul(aa, dd), graph.mul(sum, sum));
    let four = graph.scale(four, &Rational::integer(4));
    let area = graph.sub(four, square_of_sum);
    // The root without a root sign, if the area is the square of a polynomial.
    let whole = whole_root::exact_root(graph, area).map(|root| {
        let root = graph.mul(root, inverse);
        graph.scale(root, &Rational::new(1, 2))
    });
    let root = whole.unwrap_or_else(|| square_root(graph, radicand));
    let beta = apply_sign(graph, root, positive);
    let normal = [graph.neg(d[1]), d[0]];
    let v1: [ExprId; 2] = std::array::from_fn(|i| {
        let (x, y) = (graph.mul(alpha, d[i]), graph.mul(beta, normal[i]));
        graph.add(x, y)
    });
    // The second vector closes the triangle.
    let v2: [ExprId; 2] = std::array::from_fn(|i| graph.sub(d[i], v1[i]));
    // The same root from the coordinates themselves, which shows its sign at a pose: beta = (d x v1)/d^2.
    let (c, s) = graph.cos_sin(&first.angle, 0);
    let actual = rotate_vector(graph, [c, s], first.vector);
    let across = cross(graph, d, actual);
    let witness = graph.mul(across, inverse);
    Some(ClosureSolution {
        angles: vec![
            (first.angle.clone(), rotation_between(graph, v1, first.vector, aa)),
            (second.angle.clone(), rotation_between(graph, v2, second.vector, bb)),
        ],
        relations: Vec::new(),
        values: Vec::new(),
        root: Some(SignedRoot {
            radicand,
            witness,
            exact: whole,
        }),
    })
}

/// `known(s) + R(angle) arm(s) = 0`, where both vectors are at most linear in the prismatic coordinate `s`.
fn intersect_circle_and_line(
    graph: &mut Graph,
    known: [ExprId; 2],
    group: &LegGroup,
    slide: usize,
    positive: bool,
) -> Option<ClosureSolution> {
    // Both vectors as constant part plus s times a factor.
    let (k0, k1) = split_linear(graph, known, slide)?;
    let (a0, a1) = split_linear(graph, group.vector, slide)?;
    // |k0 + s k1|^2 = |a0 + s a1|^2, that is p s^2 + 2 q s + r = 0
    let mut gap = |x: [ExprId; 2], y: [ExprId; 2], u: [ExprId; 2], v: [ExprId; 2]| {
        let (one, two) = (dot(graph, x, y), dot(graph, u, v));
        graph.sub(one, two)
    };
    let (p, q, r) = (gap(k1, k1, a1, a1), gap(k0, k1, a0, a1), gap(k0, k0, a0, a0));
    let at = graph.atom(Atom::Coordinate(slide));
    let (value, root) = if p == Graph::ZERO {
        // Both change with s at the same rate: the equation is linear.
        if q == Graph::ZERO {
            return None;
        }
        let ratio = graph.div(r, q);
        (graph.scale(ratio, &Rational::new(-1, 2)), None)
    } else {
        // Divided by a length of the arm, so that loops of equal shape and unequal size have the same radicand.
        let one = a0
            .into_iter()
            .find(|x| *x != Graph::ZERO && coordinates_of(graph, &[*x]).is_empty())
            .unwrap_or(Graph::ONE);
        let inverse = graph.pow(one, -2);
        let (square, product) = (graph.mul(q, q), graph.mul(p, r));
        let difference = graph.sub(square, product);
        let radicand = graph.mul(difference, inverse);
        let whole = whole_root::exact_root(graph, difference).map(|root| graph.div(root, one));
        let root = whole.unwrap_or_else(|| square_root(graph, radicand));
        let root = apply_sign(graph, root, positive);
        let root_of_length = graph.mul(root, one);
        // s = (root - q)/p
        let numerator = graph.sub(root_of_length, q);
        // The same root from the coordinate itself: p s + q.
        let linear = graph.mul(p, at);
        let sum = graph.add(linear, q);
        let witness = graph.div(sum, one);
        let root = SignedRoot {
            radicand,
            witness,
            exact: whole,
        };
        (graph.div(numerator, p), Some(root))
    };
    // With s known, the arm and its target are known, and the angle is the one between them.
    let put = |graph: &mut Graph, v0: [ExprId; 2], v1: [ExprId; 2]| -> [ExprId; 2] {
        std::array::from_fn(|i| {
            let moved = graph.mul(value, v1[i]);
            graph.add(v0[i], moved)
        })
    };
    let v = put(graph, k0, k1).map(|x| graph.neg(x));
    let arm = put(graph, a0, a1);
    let arm_squared = dot(graph, arm, arm);
    let angles = vec![(group.angle.clone(), rotation_between(graph, v, arm, arm_squared))];
    Some(ClosureSolution {
        angles,
        relations: Vec::new(),
        values: vec![(slide, value)],
        root,
    })
}

/// `k0 + s a + t b = 0` for two prismatic coordinates `s` and `t` with directions `a` and `b`, by Cramer's rule.
fn intersect_lines(graph: &mut Graph, known: [ExprId; 2], first: usize, second: usize) -> Option<ClosureSolution> {
    let (rest, a) = split_linear(graph, known, first)?;
    let (k0, b) = split_linear(graph, rest, second)?;
    let determinant = cross(graph, a, b);
    if determinant == Graph::ZERO || has_coordinate(graph, &a, second) {
        return None;
    }
    let (s, t) = (cross(graph, b, k0), cross(graph, k0, a));
    let (s, t) = (graph.div(s, determinant), graph.div(t, determinant));
    Some(ClosureSolution {
        angles: Vec::new(),
        relations: Vec::new(),
        values: vec![(first, s), (second, t)],
        root: None,
    })
}

/// Splits a vector into the part that does not depend on a coordinate and the factor of the coordinate; `None` if the
/// vector is not linear in it.
fn split_linear(graph: &mut Graph, v: [ExprId; 2], coordinate: usize) -> Option<([ExprId; 2], [ExprId; 2])> {
    let slope = graph.differentiate(&v, Atom::Coordinate(coordinate));
    if has_coordinate(graph, &slope, coordinate) {
        return None;
    }
    let at = graph.atom(Atom::Coordinate(coordinate));
    let offset = graph.substitute(&v, &std::collections::BTreeMap::from([(at, Graph::ZERO)]));
    Some(([offset[0], offset[1]], [slope[0], slope[1]]))
}
