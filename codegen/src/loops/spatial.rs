//! Closed form of a loop in space: equations of the loop that contain one unknown coordinate are solved one after the
//! other.
//!
//! Seen from a joint, the closing vector's component along its axis and the distance of the closing point from its
//! origin do not depend on its own angle. Written for every joint of a loop, such equations solve the chains of a
//! universal joint and a slide, of three revolute axes two of which meet or are parallel, and others (Pieper 1968,
//! Raghavan and Roth 1993, for the first axes of an arm). The same expressions serve the emitted code and exact
//! sampling.
//!
//! Decision: an equation with a single unknown is solved next, whichever it is. Two equations that are linear in
//! its cosine and sine need no root; prismatic coordinates that occur linearly are eliminated across loops; the
//! prime field then proves that the result closes the loops. This covers UPS, RUS, RRS and PRS legs and planar ones
//! without a table of leg types.

use std::collections::{BTreeMap, BTreeSet};

use modelmill_algebra::field::{FieldElement, RandomStream};
use modelmill_spec::Mechanism;

use crate::expr::vector::{AxisRotation, push_rotation};
use crate::expr::{
    Atom, AtomAngleSum, EvaluationTape, ExprId, FieldPoint, Graph, Node, Rational, Unary, nominal_value,
};
use crate::loops::magnitude;
use crate::loops::segment::{PathSegment, PointPairPath, inverse_rotations, path_segments, sum_segments};
use crate::loops::solved::{ClosureSolution, SignedRoot};
use crate::loops::whole_root;
use crate::tree::KinematicTree;

/// An expression below this share of the magnitudes of its terms counts as zero at the nominal pose, and is no divisor.
const SINGULAR: f64 = 1e-9;

/// Equations that are true where the loop closes: its vector in every frame along it, and the squares of distances from
/// every origin along it.
///
/// The equations are sorted by id and have no duplicates.
pub(crate) fn equations(graph: &mut Graph, tree: &KinematicTree, between: &PointPairPath) -> Vec<ExprId> {
    let mut found = BTreeSet::new();
    // Components of the closing vector in a frame along the loop.
    let mut in_frame = |graph: &mut Graph, turns: &[AxisRotation]| {
        let path = between.segments(graph, tree, &inverse_rotations(turns));
        found.extend(sum_segments(graph, &path));
    };
    for turns in between.frames(tree) {
        in_frame(graph, &turns);
    }
    // From the origin of each joint, the squared distance to the closing point is the same along both paths.
    for side in 0..2 {
        let (path, at) = (between.paths[side], &between.at[side]);
        let other = path_segments(tree, between.paths[1 - side], &[], &between.at[1 - side]);
        for k in 0..path.len() {
            let child = path_segments(tree, &path[k + 1..], &[], at);
            let mut rest: Vec<PathSegment> = path_segments(tree, &path[..=k], &[], &[Graph::ZERO; 3]);
            // The path from the joint's origin back to the root, and on to the point along the other side.
            for stretch in &mut rest {
                stretch.vector = stretch.vector.map(|x| graph.neg(x));
            }
            rest.extend(other.iter().cloned());
            let (one, two) = (squared_length(graph, &child), squared_length(graph, &rest));
            found.insert(graph.sub(one, two));
        }
    }
    found.remove(&Graph::ZERO);
    found.into_iter().collect()
}

/// The square of the length of a path, as a sum over pairs of vectors, in which no joint's cosine or sine is squared.
fn squared_length(graph: &mut Graph, path: &[PathSegment]) -> ExprId {
    let mut terms = Vec::new();
    for (i, first) in path.iter().enumerate() {
        terms.push((graph.dot(&first.vector, &first.vector), Rational::ONE));
        // Twice the scalar product with every later vector, in the frame of the first one.
        for second in &path[i + 1..] {
            let mut turns = inverse_rotations(&first.turns);
            for turn in &second.turns {
                push_rotation(&mut turns, turn);
            }
            let turned = turns
                .iter()
                .rev()
                .fold(second.vector, |v, turn| graph.rotate_out(turn, &v));
            let product = graph.dot(&first.vector, &turned);
            terms.push((product, Rational::integer(2)));
        }
    }
    graph.sum(&terms)
}

/// Solves one or more loops for all of `unknown`, one coordinate after the other; every other coordinate is known.
///
/// Where no equation has a single unknown, a prismatic coordinate that is linear in one, with a known factor, is
/// eliminated and determined at the end. Square roots have the sign that they have at the nominal pose. Returns `None`
/// where no order is found, or where the solution does not close the loops.
pub(crate) fn solve(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &[ExprId],
    residual: &[ExprId],
    unknown: &[usize],
) -> Option<Vec<(usize, ClosureSolution)>> {
    // Unknowns that are not determined yet.
    let mut left: BTreeSet<usize> = unknown.iter().copied().collect();
    // Steps in order, and eliminated coordinates, which are evaluated last.
    let (mut steps, mut last) = (Vec::new(), Vec::new());
    // Equations with the unknowns that they contain.
    let mut open: Vec<(ExprId, BTreeSet<usize>)> = equations
        .iter()
        .map(|e| (*e, equation_unknowns(graph, *e, &left)))
        .collect();
    while !left.is_empty() {
        // All ways to solve an equation that has one remaining unknown.
        let mut ways: Vec<CandidateSolution> = Vec::new();
        for &coordinate in &left {
            let own: Vec<ExprId> = open
                .iter()
                .filter(|(_, all)| all.intersection(&left).eq([&coordinate]))
                .map(|(e, _)| *e)
                .collect();
            ways.extend(candidate_solutions(graph, mechanism, coordinate, &own));
        }
        // Solutions without a root come first, then those with the fewest nodes.
        let best = ways
            .into_iter()
            .min_by_key(|way| (way.solved.root.is_some(), way.size, way.coordinate));
        if let Some(best) = best {
            left.remove(&best.coordinate);
            steps.push((best.coordinate, best.solved));
            continue;
        }
        // No equation has a single unknown: one prismatic coordinate is eliminated from all of them.
        let (coordinate, value) = find_eliminable_slide(graph, mechanism, &open, &left)?;
        left.remove(&coordinate);
        let all: Vec<ExprId> = open.iter().map(|(e, _)| *e).collect();
        let at = graph.atom(Atom::Coordinate(coordinate));
        let all = graph.substitute(&all, &BTreeMap::from([(at, value)]));
        let mut rest: Vec<ExprId> = Vec::new();
        for e in all {
            if !is_zero(graph, e) && !rest.contains(&e) {
                rest.push(e);
            }
        }
        open = rest
            .into_iter()
            .map(|e| (e, equation_unknowns(graph, e, &left)))
            .collect();
        last.insert(0, (coordinate, length_solution(coordinate, value)));
    }
    steps.extend(last);
    is_loop_closed(graph, residual, &steps).then_some(steps)
}

/// Unknown coordinates that an equation contains.
fn equation_unknowns(graph: &Graph, equation: ExprId, left: &BTreeSet<usize>) -> BTreeSet<usize> {
    let all = crate::expr::coordinates_of(graph, &[equation]);
    all.into_iter().filter(|c| left.contains(c)).collect()
}

/// A prismatic coordinate that is linear, with a known factor, in the equation with the fewest unknowns, and its value.
fn find_eliminable_slide(
    graph: &mut Graph,
    mechanism: &Mechanism,
    open: &[(ExprId, BTreeSet<usize>)],
    left: &BTreeSet<usize>,
) -> Option<(usize, ExprId)> {
    let mut order: Vec<&(ExprId, BTreeSet<usize>)> = open.iter().collect();
    order.sort_by_key(|(e, all)| (all.intersection(left).count(), *e));
    order.into_iter().find_map(|(equation, all)| {
        let inside = all.intersection(left).copied();
        let slides: Vec<usize> = inside
            .filter(|c| mechanism.coordinates[*c].motion.is_length())
            .collect();
        // The factor must be known and must not vanish at the nominal pose.
        slides.into_iter().find_map(|slide| {
            let slope = graph.differentiate(&[*equation], Atom::Coordinate(slide))[0];
            if !equation_unknowns(graph, slope, left).is_empty() || !is_regular(graph, mechanism, slope) {
                return None;
            }
            let rest = set_to_zero(graph, &[*equation], slide)[0];
            let ratio = graph.div(rest, slope);
            Some((slide, graph.neg(ratio)))
        })
    })
}

/// One way to solve for a coordinate.
struct CandidateSolution {
    /// Index of the coordinate.
    coordinate: usize,
    /// Its expressions.
    solved: ClosureSolution,
    /// Number of nodes that it evaluates.
    size: usize,
}

/// All solutions for a coordinate from `own`, the equations in which it is the only unknown.
fn candidate_solutions(
    graph: &mut Graph,
    mechanism: &Mechanism,
    coordinate: usize,
    own: &[ExprId],
) -> Vec<CandidateSolution> {
    let solved: Vec<ClosureSolution> = if mechanism.coordinates[coordinate].motion.is_angle() {
        // Each equation alone gives a root; each pair of equations gives cosine and sine without a root.
        let linear: Vec<TrigonometricEquation> = own
            .iter()
            .filter_map(|e| TrigonometricEquation::from_equation(graph, *e, coordinate))
            .collect();
        let mut solved: Vec<ClosureSolution> = linear
            .iter()
            .filter_map(|e| e.solve(graph, mechanism, coordinate))
            .collect();
        for (i, first) in linear.iter().enumerate() {
            for second in &linear[i + 1..] {
                solved.extend(solve_equation_pair(graph, mechanism, first, second, coordinate));
            }
        }
        solved
    } else {
        own.iter()
            .filter_map(|e| solve_prismatic(graph, mechanism, *e, coordinate))
            .collect()
    };
    let size = |graph: &Graph, solved: &ClosureSolution| {
        let mut roots: Vec<ExprId> = solved.angles.iter().flat_map(|(_, cs)| *cs).collect();
        roots.extend(solved.values.iter().map(|(_, value)| *value));
        graph.nodes_of(&roots).count()
    };
    solved
        .into_iter()
        .map(|solved| CandidateSolution {
            coordinate,
            size: size(graph, &solved),
            solved,
        })
        .collect()
}

/// `cosine cos q + sine sin q + rest = 0`, with factors that do not depend on `q`.
struct TrigonometricEquation {
    /// Factor of the cosine.
    cosine: ExprId,
    /// Factor of the sine.
    sine: ExprId,
    /// The part without the angle.
    rest: ExprId,
}

impl TrigonometricEquation {
    /// Writes an equation in this form, if it has it; tested in the field.
    fn from_equation(graph: &mut Graph, equation: ExprId, coordinate: usize) -> Option<Self> {
        let atom = Atom::Coordinate(coordinate);
        // At q = 0 the first derivative is the factor of the sine, and the second is the negative factor of the cosine.
        let slope = graph.differentiate(&[equation], atom);
        let bend = graph.differentiate(&slope, atom);
        let [at_zero, slope, bend] = set_to_zero(graph, &[equation, slope[0], bend[0]], coordinate)[..] else {
            return None;
        };
        let cosine = graph.neg(bend);
        let rest = graph.sub(at_zero, cosine);
        let (c, s) = graph.cos_sin(&AtomAngleSum::new([(atom, 1)]), 0);
        let (x, y) = (graph.mul(cosine, c), graph.mul(slope, s));
        let form = graph.add_all(&[x, y, rest]);
        // The form is correct if it differs from the equation by zero.
        let gap = graph.sub(equation, form);
        let is_it = is_zero(graph, gap) && !is_zero(graph, cosine) | !is_zero(graph, slope);
        let simplified = |graph: &Graph, x: ExprId| if is_zero(graph, x) { Graph::ZERO } else { x };
        is_it.then(|| Self {
            cosine: simplified(graph, cosine),
            sine: simplified(graph, slope),
            rest: simplified(graph, rest),
        })
    }

    /// Solves one equation: with `r = cosine sin q - sine cos q`, `r^2 = cosine^2 + sine^2 - rest^2`.
    fn solve(&self, graph: &mut Graph, mechanism: &Mechanism, coordinate: usize) -> Option<ClosureSolution> {
        let Self { cosine, sine, rest } = *self;
        let (c, s) = graph.cos_sin(&AtomAngleSum::new([(Atom::Coordinate(coordinate), 1)]), 0);
        let (x, y) = (graph.mul(cosine, s), graph.mul(sine, c));
        let witness = graph.sub(x, y);
        let squares = [cosine, sine, rest].map(|x| graph.mul(x, x));
        let arm = graph.add(squares[0], squares[1]);
        let radicand = graph.sub(arm, squares[2]);
        if is_zero(graph, radicand) || !is_regular(graph, mechanism, arm) {
            return None;
        }
        let (root, branch) = signed_root(graph, mechanism, radicand, witness)?;
        if branch.is_none() && rest == Graph::ZERO {
            // Then the arm is the square of the root.
            let minus = graph.neg(sine);
            let angle = [graph.div(minus, root), graph.div(cosine, root)];
            return Some(angle_solution(coordinate, angle));
        }
        // cos q = -(cosine rest + sine r) / arm, sin q = (cosine r - sine rest) / arm
        let quotient = |graph: &mut Graph, terms: [(ExprId, ExprId, i64); 2]| {
            let terms = terms.map(|(x, y, sign)| (graph.mul(x, y), Rational::integer(sign)));
            let sum = graph.sum(&terms);
            graph.div(sum, arm)
        };
        let angle = [
            quotient(graph, [(cosine, rest, -1), (sine, root, -1)]),
            quotient(graph, [(cosine, root, 1), (sine, rest, -1)]),
        ];
        Some(ClosureSolution {
            root: branch,
            ..angle_solution(coordinate, angle)
        })
    }
}

/// The solution of an angle by its cosine and sine.
fn angle_solution(coordinate: usize, cos_sin: [ExprId; 2]) -> ClosureSolution {
    ClosureSolution {
        angles: vec![(AtomAngleSum::new([(Atom::Coordinate(coordinate), 1)]), cos_sin)],
        relations: Vec::new(),
        values: Vec::new(),
        root: None,
    }
}

/// The solution of a prismatic coordinate by its value.
fn length_solution(coordinate: usize, value: ExprId) -> ClosureSolution {
    ClosureSolution {
        angles: Vec::new(),
        relations: Vec::new(),
        values: vec![(coordinate, value)],
        root: None,
    }
}

/// Solves two equations for cosine and sine without a root, by Cramer's rule; `None` if their determinant vanishes.
fn solve_equation_pair(
    graph: &mut Graph,
    mechanism: &Mechanism,
    first: &TrigonometricEquation,
    second: &TrigonometricEquation,
    coordinate: usize,
) -> Option<ClosureSolution> {
    let mut cross = |a: ExprId, b: ExprId, c: ExprId, d: ExprId| {
        let (x, y) = (graph.mul(a, b), graph.mul(c, d));
        graph.sub(x, y)
    };
    let determinant = cross(first.cosine, second.sine, second.cosine, first.sine);
    let cosine = cross(first.sine, second.rest, second.sine, first.rest);
    let sine = cross(second.cosine, first.rest, first.cosine, second.rest);
    if !is_regular(graph, mechanism, determinant) {
        return None;
    }
    let angle = [graph.div(cosine, determinant), graph.div(sine, determinant)];
    Some(angle_solution(coordinate, angle))
}

/// Solves `p s^2 + 2 q s + r = 0` for a prismatic coordinate; `None` if the equation has another form.
fn solve_prismatic(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equation: ExprId,
    coordinate: usize,
) -> Option<ClosureSolution> {
    let atom = Atom::Coordinate(coordinate);
    let slope = graph.differentiate(&[equation], atom);
    // A quadratic equation has a constant second derivative.
    let bend = graph.differentiate(&slope, atom)[0];
    if graph.atoms(&[bend]).contains(&atom) {
        return None;
    }
    let [r, slope] = set_to_zero(graph, &[equation, slope[0]], coordinate)[..] else {
        return None;
    };
    let half = Rational::new(1, 2);
    let (p, q) = (graph.scale(bend, &half), graph.scale(slope, &half));
    let length = |value| length_solution(coordinate, value);
    // A linear equation: s = -r/(2 q).
    if is_zero(graph, p) {
        if !is_regular(graph, mechanism, slope) {
            return None;
        }
        let ratio = graph.div(r, slope);
        return Some(length(graph.neg(ratio)));
    }
    if !is_regular(graph, mechanism, p) {
        return None;
    }
    let (square, product) = (graph.mul(q, q), graph.mul(p, r));
    let radicand = graph.sub(square, product);
    let at = graph.atom(atom);
    let linear = graph.mul(p, at);
    let witness = graph.add(linear, q);
    let (root, branch) = signed_root(graph, mechanism, radicand, witness)?;
    let numerator = graph.sub(root, q);
    Some(ClosureSolution {
        root: branch,
        ..length(graph.div(numerator, p))
    })
}

/// The root with the sign of its witness at the nominal pose, with the choice of branch if there is one; `None` if it
/// vanishes there.
///
/// Where the radicand is the square of a polynomial, that polynomial is the root and there is no other branch.
fn signed_root(
    graph: &mut Graph,
    mechanism: &Mechanism,
    radicand: ExprId,
    witness: ExprId,
) -> Option<(ExprId, Option<SignedRoot>)> {
    if !is_regular(graph, mechanism, witness) {
        return None;
    }
    let whole = whole_root::exact_root(graph, radicand);
    let root = whole.unwrap_or_else(|| graph.unary(Unary::Sqrt, radicand));
    // The polynomial may have the opposite sign of the witness.
    let mut sign = nominal_value(graph, mechanism, witness)?;
    if let Some(whole) = whole {
        sign *= nominal_value(graph, mechanism, whole)?;
    }
    let signed = if sign > 0.0 { root } else { graph.neg(root) };
    let branch = SignedRoot {
        radicand,
        witness,
        exact: whole,
    };
    Some((signed, whole.is_none().then_some(branch)))
}

/// Whether an expression may be a divisor: it is not zero, and not nearly zero at the nominal pose.
fn is_regular(graph: &mut Graph, mechanism: &Mechanism, id: ExprId) -> bool {
    if is_zero(graph, id) {
        return false;
    }
    let limit = SINGULAR * magnitude::nominal_magnitude(graph, mechanism, &[id]);
    nominal_value(graph, mechanism, id).is_some_and(|value| value.abs() > limit)
}

/// Whether an expression is zero for independent atoms, tested at a few points of the field.
fn is_zero(graph: &Graph, id: ExprId) -> bool {
    if id == Graph::ZERO {
        return true;
    }
    let tape = EvaluationTape::new(graph, &[id]);
    let atoms = graph.atoms(&[id]);
    let mut stream = RandomStream::new(3);
    (0..3).all(|_| {
        let mut point = FieldPoint::<FieldElement>::default();
        for atom in &atoms {
            point.values.insert(*atom, stream.next_element());
            point.angles.insert(*atom, stream.next_circle_point());
        }
        // An expression with a root or a quotient that does not exist there does not count as zero.
        tape.evaluate(&point).is_some_and(|v| v[0] == FieldElement::ZERO)
    })
}

/// Expressions with one coordinate set to zero, also in sines and cosines.
fn set_to_zero(graph: &mut Graph, roots: &[ExprId], coordinate: usize) -> Vec<ExprId> {
    let atom = Atom::Coordinate(coordinate);
    let nodes: Vec<Node> = graph
        .nodes_of(roots)
        .filter(|node| matches!(node, Node::Sin(a) | Node::Cos(a) if a.atoms().any(|x| x == atom)))
        .cloned()
        .collect();
    let own = graph.atom(atom);
    let mut replacements = BTreeMap::from([(own, Graph::ZERO)]);
    for node in nodes {
        let (Node::Sin(angle) | Node::Cos(angle)) = &node else {
            continue;
        };
        // The angle without the coordinate.
        let rest = AtomAngleSum::new(angle.terms().iter().copied().filter(|(a, _)| *a != atom));
        let (cosine, sine) = graph.cos_sin(angle, 0);
        let (c, s) = graph.cos_sin(&rest, 0);
        match node {
            Node::Cos(_) => replacements.insert(cosine, c),
            _ => replacements.insert(sine, s),
        };
    }
    graph.substitute(roots, &replacements)
}

/// Whether the steps close the loop, tested at points of the field at which all roots exist.
fn is_loop_closed(graph: &Graph, residual: &[ExprId], steps: &[(usize, ClosureSolution)]) -> bool {
    /// Largest number of draws; at each step with a root about half of them fail.
    const DRAWS: usize = 200;
    let tapes: Vec<EvaluationTape> = steps
        .iter()
        .map(|(_, solved)| {
            let mut roots: Vec<ExprId> = solved.angles.iter().flat_map(|(_, cs)| *cs).collect();
            roots.extend(solved.values.iter().map(|(_, value)| *value));
            EvaluationTape::new(graph, &roots)
        })
        .collect();
    // The residuals, evaluated after all steps.
    let target = EvaluationTape::new(graph, residual);
    let mut all = residual.to_vec();
    for (_, solved) in steps {
        all.extend(solved.angles.iter().flat_map(|(_, cs)| *cs));
        all.extend(solved.values.iter().map(|(_, value)| *value));
    }
    let atoms = graph.atoms(&all);
    let mut stream = RandomStream::new(4);
    let mut draw = || -> Option<bool> {
        let mut point = FieldPoint::<FieldElement>::default();
        for atom in &atoms {
            point.values.insert(*atom, stream.next_element());
            point.angles.insert(*atom, stream.next_circle_point());
        }
        // The steps overwrite the drawn values of the unknowns.
        for ((coordinate, solved), tape) in steps.iter().zip(&tapes) {
            let values = tape.evaluate(&point)?;
            let atom = Atom::Coordinate(*coordinate);
            if solved.values.is_empty() {
                point.angles.insert(atom, (values[0], values[1]));
            } else {
                point.values.insert(atom, values[0]);
            }
        }
        let values = target.evaluate(&point)?;
        Some(values.iter().all(|v| *v == FieldElement::ZERO))
    };
    // Two points must agree, if a second one is found.
    let mut seen = (0..DRAWS).filter_map(|_| draw());
    seen.next() == Some(true) && seen.next() != Some(false)
}
