//! Closed form of a loop in space: equations of the loop that hold one unknown coordinate, one after the other.
//!
//! Seen from a joint, the closing vector's component along its axis and the distance of the closing point from its
//! origin do not depend on its own angle. Written for every joint of a loop, such equations solve the chains of a
//! universal joint and a slide, of three revolute axes two of which meet or are parallel, and others (Pieper 1968,
//! Raghavan and Roth 1993, for the first axes of an arm). The same expressions serve the emitted code and exact sampling.
//!
//! Decision: an equation with a single unknown is solved next, whichever it is. Two equations that are linear in
//! its cosine and sine need no root; prismatic coordinates that occur linearly are eliminated across loops; the
//! prime field then proves that the result closes the loops. This covers UPS, RUS, RRS and PRS legs and planar ones
//! without a table of leg types.

use std::collections::{BTreeMap, BTreeSet};

use modelmill_algebra::field::{Element, Stream};
use modelmill_spec::Mechanism;

use crate::expr::vector::{Turn, push_turn};
use crate::expr::{
    AngleSum, Atom, ExprId, FieldPoint, Graph, Node, Rational, Tape, Unary, nominal_value,
};
use crate::loops::magnitude;
use crate::loops::solved::{Root, Solved};
use crate::loops::stretch::{Between, Stretch, inverse, stretches, sum_of};
use crate::loops::whole_root;
use crate::tree::Tree;

/// A determinant this much smaller than the magnitudes of its terms cannot be divided by at the nominal pose.
const SINGULAR: f64 = 1e-9;

/// Equations that hold where the loop closes: its vector in every frame along it, and the squares of distances about
/// every origin along it.
pub(crate) fn equations(graph: &mut Graph, tree: &Tree, between: &Between) -> Vec<ExprId> {
    let mut found = BTreeSet::new();
    let mut in_frame = |graph: &mut Graph, turns: &[Turn]| {
        let path = between.stretches(graph, tree, &inverse(turns));
        found.extend(sum_of(graph, &path));
    };
    in_frame(graph, &[]);
    for path in between.paths {
        let mut turns = Vec::new();
        for &i in path {
            let link = &tree.links[i];
            for turn in link.pre.iter().chain([&link.joint]) {
                push_turn(&mut turns, turn);
                in_frame(graph, &turns);
            }
        }
    }
    for side in 0..2 {
        let (path, at) = (between.paths[side], &between.at[side]);
        let other = stretches(tree, between.paths[1 - side], &[], &between.at[1 - side]);
        for k in 0..path.len() {
            let child = stretches(tree, &path[k + 1..], &[], at);
            let mut rest: Vec<Stretch> = stretches(tree, &path[..=k], &[], &[Graph::ZERO; 3]);
            for stretch in &mut rest {
                stretch.vector = stretch.vector.map(|x| graph.neg(x));
            }
            rest.extend(other.iter().cloned());
            let (one, two) = (square(graph, &child), square(graph, &rest));
            found.insert(graph.sub(one, two));
        }
    }
    found.remove(&Graph::ZERO);
    found.into_iter().collect()
}

/// The square of the length of a path, as a sum over pairs, in which no joint's cosine or sine is squared.
fn square(graph: &mut Graph, path: &[Stretch]) -> ExprId {
    let mut terms = Vec::new();
    for (i, first) in path.iter().enumerate() {
        terms.push((graph.dot(&first.vector, &first.vector), Rational::ONE));
        for second in &path[i + 1..] {
            let mut turns = inverse(&first.turns);
            for turn in &second.turns {
                push_turn(&mut turns, turn);
            }
            let turned = turns
                .iter()
                .rev()
                .fold(second.vector, |v, turn| graph.turn_out(turn, &v));
            let product = graph.dot(&first.vector, &turned);
            terms.push((product, Rational::integer(2)));
        }
    }
    graph.sum(&terms)
}

/// Solves one or more loops for all of `unknown`, one coordinate after the other; every other coordinate is known.
///
/// Where no equation holds a single unknown, a slide that stands in one linearly, with a known factor, is eliminated and
/// follows at the end. Square roots have the sign that they have at the nominal pose. Returns `None` where no order is
/// found, or where what is found does not close the loops.
pub(crate) fn solve(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &[ExprId],
    residual: &[ExprId],
    unknown: &[usize],
) -> Option<Vec<(usize, Solved)>> {
    let mut left: BTreeSet<usize> = unknown.iter().copied().collect();
    let (mut steps, mut last) = (Vec::new(), Vec::new());
    let mut open: Vec<(ExprId, BTreeSet<usize>)> = equations
        .iter()
        .map(|e| (*e, unknowns_of(graph, *e, &left)))
        .collect();
    while !left.is_empty() {
        let mut ways: Vec<Way> = Vec::new();
        for &coordinate in &left {
            let own: Vec<ExprId> = open
                .iter()
                .filter(|(_, all)| all.intersection(&left).eq([&coordinate]))
                .map(|(e, _)| *e)
                .collect();
            ways.extend(ways_for(graph, mechanism, coordinate, &own));
        }
        let best = ways
            .into_iter()
            .min_by_key(|way| (way.solved.root.is_some(), way.size, way.coordinate));
        if let Some(best) = best {
            left.remove(&best.coordinate);
            steps.push((best.coordinate, best.solved));
            continue;
        }
        let (coordinate, value) = eliminable(graph, mechanism, &open, &left)?;
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
            .map(|e| (e, unknowns_of(graph, e, &left)))
            .collect();
        last.insert(0, (coordinate, of_length(coordinate, value)));
    }
    steps.extend(last);
    closes(graph, residual, &steps).then_some(steps)
}

fn unknowns_of(graph: &Graph, equation: ExprId, left: &BTreeSet<usize>) -> BTreeSet<usize> {
    let all = crate::expr::coordinates_of(graph, &[equation]);
    all.into_iter().filter(|c| left.contains(c)).collect()
}

/// A slide that stands linearly, with a known factor, in the equation with the fewest unknowns, and what it equals.
fn eliminable(
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
        slides.into_iter().find_map(|slide| {
            let slope = graph.differentiate(&[*equation], Atom::Coordinate(slide))[0];
            if !unknowns_of(graph, slope, left).is_empty() || !is_regular(graph, mechanism, slope) {
                return None;
            }
            let rest = at_zero(graph, &[*equation], slide)[0];
            let ratio = graph.div(rest, slope);
            Some((slide, graph.neg(ratio)))
        })
    })
}

/// One way to solve for a coordinate.
struct Way {
    coordinate: usize,
    solved: Solved,
    /// Nodes of what it evaluates.
    size: usize,
}

fn ways_for(
    graph: &mut Graph,
    mechanism: &Mechanism,
    coordinate: usize,
    own: &[ExprId],
) -> Vec<Way> {
    let solved: Vec<Solved> = if mechanism.coordinates[coordinate].motion.is_angle() {
        let linear: Vec<Circular> = own
            .iter()
            .filter_map(|e| Circular::from_equation(graph, *e, coordinate))
            .collect();
        let mut solved: Vec<Solved> = linear
            .iter()
            .filter_map(|e| e.solve(graph, mechanism, coordinate))
            .collect();
        for (i, first) in linear.iter().enumerate() {
            for second in &linear[i + 1..] {
                solved.extend(both(graph, mechanism, first, second, coordinate));
            }
        }
        solved
    } else {
        own.iter()
            .filter_map(|e| slide(graph, mechanism, *e, coordinate))
            .collect()
    };
    let size = |graph: &Graph, solved: &Solved| {
        let mut roots: Vec<ExprId> = solved.angles.iter().flat_map(|(_, cs)| *cs).collect();
        roots.extend(solved.values.iter().map(|(_, value)| *value));
        graph.nodes_of(&roots).count()
    };
    solved
        .into_iter()
        .map(|solved| Way {
            coordinate,
            size: size(graph, &solved),
            solved,
        })
        .collect()
}

/// `cosine cos q + sine sin q + rest = 0`, with factors that do not depend on `q`.
struct Circular {
    cosine: ExprId,
    sine: ExprId,
    rest: ExprId,
}

impl Circular {
    /// Writes an equation in this form, if it has it: shown in the field.
    fn from_equation(graph: &mut Graph, equation: ExprId, coordinate: usize) -> Option<Self> {
        let atom = Atom::Coordinate(coordinate);
        let slope = graph.differentiate(&[equation], atom);
        let bend = graph.differentiate(&slope, atom);
        let [at_zero, slope, bend] = at_zero(graph, &[equation, slope[0], bend[0]], coordinate)[..]
        else {
            return None;
        };
        let cosine = graph.neg(bend);
        let rest = graph.sub(at_zero, cosine);
        let (c, s) = graph.cos_sin(&AngleSum::new([(atom, 1)]), 0);
        let (x, y) = (graph.mul(cosine, c), graph.mul(slope, s));
        let form = graph.add_all(&[x, y, rest]);
        let gap = graph.sub(equation, form);
        let is_it = is_zero(graph, gap) && !is_zero(graph, cosine) | !is_zero(graph, slope);
        let simplified = |graph: &Graph, x: ExprId| if is_zero(graph, x) { Graph::ZERO } else { x };
        is_it.then(|| Self {
            cosine: simplified(graph, cosine),
            sine: simplified(graph, slope),
            rest: simplified(graph, rest),
        })
    }

    /// One equation: with `r = cosine sin q - sine cos q`, `r^2 = cosine^2 + sine^2 - rest^2`.
    fn solve(&self, graph: &mut Graph, mechanism: &Mechanism, coordinate: usize) -> Option<Solved> {
        let Self { cosine, sine, rest } = *self;
        let (c, s) = graph.cos_sin(&AngleSum::new([(Atom::Coordinate(coordinate), 1)]), 0);
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
            return Some(of_angle(coordinate, angle));
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
        Some(Solved {
            root: branch,
            ..of_angle(coordinate, angle)
        })
    }
}

fn of_angle(coordinate: usize, cos_sin: [ExprId; 2]) -> Solved {
    Solved {
        angles: vec![(AngleSum::new([(Atom::Coordinate(coordinate), 1)]), cos_sin)],
        relations: Vec::new(),
        values: Vec::new(),
        root: None,
    }
}

fn of_length(coordinate: usize, value: ExprId) -> Solved {
    Solved {
        angles: Vec::new(),
        relations: Vec::new(),
        values: vec![(coordinate, value)],
        root: None,
    }
}

/// Two equations give cosine and sine without a root.
fn both(
    graph: &mut Graph,
    mechanism: &Mechanism,
    first: &Circular,
    second: &Circular,
    coordinate: usize,
) -> Option<Solved> {
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
    Some(of_angle(coordinate, angle))
}

/// `p s^2 + 2 q s + r = 0` for the length of a slide.
fn slide(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equation: ExprId,
    coordinate: usize,
) -> Option<Solved> {
    let atom = Atom::Coordinate(coordinate);
    let slope = graph.differentiate(&[equation], atom);
    let bend = graph.differentiate(&slope, atom)[0];
    if graph.atoms(&[bend]).contains(&atom) {
        return None;
    }
    let [r, slope] = at_zero(graph, &[equation, slope[0]], coordinate)[..] else {
        return None;
    };
    let half = Rational::new(1, 2);
    let (p, q) = (graph.scale(bend, &half), graph.scale(slope, &half));
    let length = |value| of_length(coordinate, value);
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
    Some(Solved {
        root: branch,
        ..length(graph.div(numerator, p))
    })
}

/// The root with the sign of its witness at the nominal pose; `None` if it vanishes there.
///
/// Where the radicand is the square of a polynomial, that polynomial is the root and there is no other branch.
fn signed_root(
    graph: &mut Graph,
    mechanism: &Mechanism,
    radicand: ExprId,
    witness: ExprId,
) -> Option<(ExprId, Option<Root>)> {
    if !is_regular(graph, mechanism, witness) {
        return None;
    }
    let whole = whole_root::exact_root(graph, radicand);
    let root = whole.unwrap_or_else(|| graph.unary(Unary::Sqrt, radicand));
    let mut sign = nominal_value(graph, mechanism, witness)?;
    if let Some(whole) = whole {
        sign *= nominal_value(graph, mechanism, whole)?;
    }
    let signed = if sign > 0.0 { root } else { graph.neg(root) };
    let branch = Root {
        radicand,
        witness,
        whole,
    };
    Some((signed, whole.is_none().then_some(branch)))
}

/// Whether an expression can be divided by at the nominal pose.
fn is_regular(graph: &mut Graph, mechanism: &Mechanism, id: ExprId) -> bool {
    if is_zero(graph, id) {
        return false;
    }
    let limit = SINGULAR * magnitude::at_nominal(graph, mechanism, &[id]);
    nominal_value(graph, mechanism, id).is_some_and(|value| value.abs() > limit)
}

/// Whether an expression is zero for free atoms: shown at a few points of the field.
fn is_zero(graph: &Graph, id: ExprId) -> bool {
    if id == Graph::ZERO {
        return true;
    }
    let tape = Tape::new(graph, &[id]);
    let atoms = graph.atoms(&[id]);
    let mut stream = Stream::new(3);
    (0..3).all(|_| {
        let mut point = FieldPoint::<Element>::default();
        for atom in &atoms {
            point.values.insert(*atom, stream.element());
            point.angles.insert(*atom, stream.circle());
        }
        // What has a root or a quotient that does not exist there is not zero as it stands.
        tape.evaluate(&point).is_some_and(|v| v[0] == Element::ZERO)
    })
}

/// Expressions with one coordinate put to zero.
fn at_zero(graph: &mut Graph, roots: &[ExprId], coordinate: usize) -> Vec<ExprId> {
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
        let rest = AngleSum::new(angle.terms().iter().copied().filter(|(a, _)| *a != atom));
        let (cosine, sine) = graph.cos_sin(angle, 0);
        let (c, s) = graph.cos_sin(&rest, 0);
        match node {
            Node::Cos(_) => replacements.insert(cosine, c),
            _ => replacements.insert(sine, s),
        };
    }
    graph.substitute(roots, &replacements)
}

/// Whether the steps close the loop, with the first roots in the field that exist.
fn closes(graph: &Graph, residual: &[ExprId], steps: &[(usize, Solved)]) -> bool {
    /// Draws until roots exist; half of them do at each step with a root.
    const DRAWS: usize = 200;
    let tapes: Vec<Tape> = steps
        .iter()
        .map(|(_, solved)| {
            let mut roots: Vec<ExprId> = solved.angles.iter().flat_map(|(_, cs)| *cs).collect();
            roots.extend(solved.values.iter().map(|(_, value)| *value));
            Tape::new(graph, &roots)
        })
        .collect();
    let target = Tape::new(graph, residual);
    let mut all = residual.to_vec();
    for (_, solved) in steps {
        all.extend(solved.angles.iter().flat_map(|(_, cs)| *cs));
        all.extend(solved.values.iter().map(|(_, value)| *value));
    }
    let atoms = graph.atoms(&all);
    let mut stream = Stream::new(4);
    let mut draw = || -> Option<bool> {
        let mut point = FieldPoint::<Element>::default();
        for atom in &atoms {
            point.values.insert(*atom, stream.element());
            point.angles.insert(*atom, stream.circle());
        }
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
        Some(values.iter().all(|v| *v == Element::ZERO))
    };
    let mut seen = (0..DRAWS).filter_map(|_| draw());
    seen.next() == Some(true) && seen.next() != Some(false)
}
