//! Loops in which the passive angles are integer combinations of other angles: parallelograms and similar linkages.
//!
//! The variety of such a loop splits into branches (the parallelogram and the crossed linkage), and its closed form by
//! square roots would mix them. Poses around the nominal one show numerically which branch is meant. That the relation
//! then closes the loop identically is proved exactly.
//!
//! Decision: such loops are recognised one after the other, as they drive each other, and proved either for all
//! angles of the other loops or at points of the field where these close (as in a kite whose halves share a
//! prismatic joint).

use std::collections::{BTreeMap, BTreeSet};

use modelmill_algebra::field::{FieldElement, MODULUS, RandomStream};
use modelmill_spec::Mechanism;
use nalgebra::{DMatrix, DVector};

use crate::expr::{
    Atom, AtomAngleSum, EvaluationTape, ExprId, FieldPoint, FloatDomain, Graph, Node, coordinates_of, nominal_of,
};
use crate::loops::all::KinematicLoops;
use crate::loops::closure::LoopClosure;
use crate::loops::field_poses::FieldPoseSampler;
use crate::loops::magnitude;
use crate::loops::numeric_poses::{NumericLoops, uniform_symmetric};
use crate::loops::plan::{SolvableCoordinates, plan};
use crate::loops::relation::AngleRelation;

/// How far known coordinates are moved from the nominal pose, in rad or relative to the size of the loop.
const PERTURBATION: f64 = 0.05;
/// Error up to which a relation must be satisfied at all poses, rad.
const TOLERANCE: f64 = 1e-8;

/// Finds loops that are solved by relations and stores the relations in them.
///
/// A loop is examined as soon as it has at most as many unknown coordinates as equations, since it may be driven by a
/// loop before it.
pub(crate) fn find_relations(
    graph: &mut Graph,
    mechanism: &Mechanism,
    closures: &mut [LoopClosure],
    divided: &[(usize, i64)],
) {
    // Active coordinates are known from the start.
    let mut known: BTreeSet<usize> = (0..mechanism.coordinates.len())
        .filter(|c| !mechanism.coordinates[*c].passive)
        .collect();
    // Relations of all loops so far, and indices of the loops that have been examined.
    let mut related: Vec<AngleRelation> = Vec::new();
    let mut solved: Vec<usize> = Vec::new();
    let mut todo: Vec<usize> = (0..closures.len()).collect();
    let unknown_of = |closure: &LoopClosure, known: &BTreeSet<usize>| -> Vec<usize> {
        let coordinates = closure.coordinates.iter().copied();
        coordinates.filter(|c| !known.contains(c)).collect()
    };
    while let Some((position, is_exact)) = next_loop(closures, &todo, |closure| unknown_of(closure, &known).len()) {
        let index = todo.remove(position);
        let closure = &closures[index];
        let unknown = unknown_of(closure, &known);
        // Angles that a relation may refer to: known ones without a relation of their own.
        let turning: Vec<usize> = (known.iter().copied())
            .filter(|c| related.iter().all(|r| r.coordinate != *c))
            .collect();
        let mut is_solved = is_exact;
        if closure.explicit_coordinates().is_empty() {
            // Relations of other loops may be what makes this one a parallelogram.
            let residual = substitute_relations(graph, &related, &closure.residual);
            let alone = if unknown.is_empty() {
                is_loop_closed(graph, mechanism, &residual, &[]).then(Vec::new)
            } else {
                relations_of(graph, mechanism, &residual, &unknown)
            };
            let relations = alone.or_else(|| {
                let before = solved.iter().map(|i| &closures[*i]);
                let motion = PriorLoops::new(mechanism, before, divided)?;
                relations_along(graph, mechanism, &motion, &turning, &residual, &unknown)
            });
            // The relations replace the equations of the loop; none are left if the other loops close it.
            if let Some(relations) = relations {
                let closure = &mut closures[index];
                closure.residual = relations.iter().map(|r| r.residual(graph)).collect();
                closure.coordinates = coordinates_of(graph, &closure.residual);
                closure.chain = None;
                closure.relations = relations;
                is_solved = true;
            }
        }
        // A loop with too many equations that no relations solve is left to the other methods.
        if is_solved {
            known.extend(&unknown);
            related.extend(closures[index].relations.iter().cloned());
            solved.push(index);
        }
    }
}

/// The next loop to examine, by its position in `todo`, and whether it has as many equations as unknown coordinates.
/// Loops with more equations come last, such as that of a third crank of a parallelogram with two equations for one
/// angle.
fn next_loop(
    closures: &[LoopClosure],
    todo: &[usize],
    n_unknown: impl Fn(&LoopClosure) -> usize,
) -> Option<(usize, bool)> {
    let counts = |i: &usize| (n_unknown(&closures[*i]), closures[*i].residual.len());
    let exact = todo.iter().position(|i| counts(i).0 == counts(i).1);
    let redundant = || todo.iter().position(|i| counts(i).0 < counts(i).1);
    exact.map(|at| (at, true)).or_else(|| redundant().map(|at| (at, false)))
}

/// Loops that were solved before, whose motion may drive others.
struct PriorLoops(KinematicLoops);

impl PriorLoops {
    /// `None` if there are no loops.
    fn new<'a>(
        mechanism: &Mechanism,
        solved: impl Iterator<Item = &'a LoopClosure>,
        divided: &[(usize, i64)],
    ) -> Option<Self> {
        // All equations are kept, because none has been dropped as dependent yet.
        let closures: Vec<LoopClosure> = solved
            .cloned()
            .map(|mut closure| {
                closure.n_independent = closure.residual.len();
                closure
            })
            .collect();
        // Passive coordinates that these loops determine; all others are given.
        let settled: BTreeSet<usize> = (closures.iter().flat_map(|c| &c.coordinates).copied())
            .filter(|c| mechanism.coordinates[*c].passive)
            .collect();
        (!closures.is_empty()).then(|| {
            let (passive, active) = (0..mechanism.coordinates.len()).partition(|c| settled.contains(c));
            Self(KinematicLoops {
                active,
                passive,
                residual: closures.iter().flat_map(|c| c.residual.clone()).collect(),
                dependent_residual: Vec::new(),
                contradiction: 0.0,
                closures,
                divided: divided.to_vec(),
            })
        })
    }

    /// Whether expressions vanish wherever these loops close, tested at random points of the field.
    fn is_zero_where_closed(&self, graph: &mut Graph, mechanism: &Mechanism, closed: &[ExprId]) -> bool {
        /// Number of points.
        const POINTS: usize = 8;
        /// Largest number of draws, since not every draw has a closed point.
        const DRAWS: usize = 400;
        // A plan solves the loops for any coordinates.
        let Some(plan) = plan(graph, mechanism, &self.0, SolvableCoordinates::Any) else {
            return false;
        };
        let poses = FieldPoseSampler::new(graph, mechanism, plan, closed);
        let tape = EvaluationTape::new(graph, closed);
        let mut stream = RandomStream::new(4);
        let Ok(constants) = poses.draw_constants::<MODULUS>(&mut stream) else {
            return false;
        };
        let points = (0..DRAWS).filter_map(|_| {
            let open: FieldPoint<FieldElement> = poses.draw_open_point(&constants, &mut stream);
            tape.evaluate(&poses.close_loops(open)?)
        });
        let seen: Vec<_> = points.take(POINTS).collect();
        seen.len() == POINTS && seen.iter().flatten().all(|left| *left == FieldElement::ZERO)
    }
}

/// Relations that are true along the motion of other loops only, such as those of a parallelogram one side of which is
/// the side of a five-bar, or of a kite whose halves share a prismatic joint. They are found numerically and then
/// proved exactly. If the mechanism is derived for its file's values alone, they are checked to the last digits of
/// these values.
fn relations_along(
    graph: &mut Graph,
    mechanism: &Mechanism,
    motion: &PriorLoops,
    turning: &[usize],
    residual: &[ExprId],
    unknown: &[usize],
) -> Option<Vec<AngleRelation>> {
    // The loop and those before it, with their passive coordinates as unknowns.
    let all: Vec<ExprId> = (motion.0.residual.iter().chain(residual).copied()).collect();
    let following: Vec<usize> = (motion.0.passive.iter().chain(unknown).copied()).collect();
    let given: Vec<usize> = (0..mechanism.coordinates.len())
        .filter(|c| !following.contains(c))
        .collect();
    let poses = nearby_poses(graph, mechanism, &all, &following, &given)?;
    let fixed = fixed_angles(graph, residual);
    // Candidates for every unknown angle, from the poses.
    let candidates: Vec<Vec<AngleRelation>> = unknown
        .iter()
        .map(|p| angle_relations(mechanism, &poses, turning, &fixed, *p))
        .collect();
    let size = magnitude::nominal_magnitude(graph, mechanism, residual);
    // The first combination that closes the loop at all poses, and in the field.
    combinations(&candidates).find(|relations| {
        let closed = substitute_relations(graph, relations, residual);
        let tape = EvaluationTape::new(graph, &closed);
        poses.iter().all(|q| is_loop_closed_at(mechanism, &tape, q, size))
            && (mechanism.has_numeric_constants || motion.is_zero_where_closed(graph, mechanism, &closed))
    })
}

/// The relations that solve a loop for `unknown`, if there are such; proved exactly.
fn relations_of(
    graph: &mut Graph,
    mechanism: &Mechanism,
    residual: &[ExprId],
    unknown: &[usize],
) -> Option<Vec<AngleRelation>> {
    // All other coordinates of the loop are given.
    let given: Vec<usize> = coordinates_of(graph, residual)
        .into_iter()
        .filter(|c| !unknown.contains(c))
        .collect();
    let poses = nearby_poses(graph, mechanism, residual, unknown, &given)?;
    let fixed = fixed_angles(graph, residual);
    let candidates: Vec<Vec<AngleRelation>> = unknown
        .iter()
        .map(|p| angle_relations(mechanism, &poses, &given, &fixed, *p))
        .collect();
    combinations(&candidates).find(|relations| is_loop_closed(graph, mechanism, residual, relations))
}

/// Coordinates at the closed nominal pose and at some poses around it; `None` if the loop cannot be followed there.
fn nearby_poses(
    graph: &mut Graph,
    mechanism: &Mechanism,
    residual: &[ExprId],
    unknown: &[usize],
    given: &[usize],
) -> Option<Vec<Vec<f64>>> {
    /// How often the reach is halved where loops cannot be followed, for example near the end of a stroke.
    const HALVINGS: u32 = 6;
    let loops = NumericLoops::for_unknowns(graph, mechanism, residual, unknown.to_vec(), given);
    // A loop that does not determine all unknowns would satisfy many relations by chance.
    let nominal = loops.closed_nominal_pose().filter(|q| loops.is_regular(q))?;
    (0..=HALVINGS).find_map(|k| {
        let reach = PERTURBATION / f64::from(1_u32 << k);
        let mut stream = RandomStream::new(1);
        let mut found = vec![nominal.clone()];
        // More poses than coordinates, so that no relation fits by chance.
        for _ in 0..given.len() + unknown.len() + 4 {
            found.push(loops.random_pose(reach, &mut stream)?);
        }
        Some(found)
    })
}

/// Indices of the constants in sines and cosines.
fn fixed_angles(graph: &Graph, roots: &[ExprId]) -> Vec<usize> {
    let mut found = BTreeSet::new();
    for node in graph.nodes_of(roots) {
        if let Node::Sin(angle) | Node::Cos(angle) = node {
            found.extend(angle.atoms().filter_map(|atom| match atom {
                Atom::Constant(i) => Some(i),
                _ => None,
            }));
        }
    }
    found.into_iter().collect()
}

/// One candidate of each list, in all combinations, up to a largest number.
fn combinations(candidates: &[Vec<AngleRelation>]) -> impl Iterator<Item = Vec<AngleRelation>> {
    // Largest number of combinations that are tried.
    const MOST: usize = 64;
    let n = candidates
        .iter()
        .try_fold(1usize, |n, list| n.checked_mul(list.len()))
        .unwrap_or(MOST);
    // The number k selects one candidate per list, as digits of a mixed base.
    (0..n.min(MOST)).map(move |mut k| {
        candidates
            .iter()
            .map(|list| {
                let chosen = list[k % list.len()].clone();
                k /= list.len();
                chosen
            })
            .collect()
    })
}

/// Relations that an unknown angle satisfies at all poses: with the known angles of its loop, and with multiples of
/// constant angles and of pi/12 in its fixed part. The simplest come first.
fn angle_relations(
    mechanism: &Mechanism,
    poses: &[Vec<f64>],
    given: &[usize],
    fixed: &[usize],
    p: usize,
) -> Vec<AngleRelation> {
    let Some((turning, offset)) = co_rotating_angles(mechanism, poses, given, p) else {
        return Vec::new();
    };
    multiples(fixed.len())
        .into_iter()
        // The fixed part without the constants must be a multiple of pi/12.
        .filter_map(|factors| {
            let rest = fixed.iter().zip(&factors).fold(offset, |rest, (c, n)| {
                rest - f64::from(*n) * mechanism.constants[*c].value
            });
            let twelfths = rest * 12.0 / std::f64::consts::PI;
            if (twelfths - twelfths.round()).abs() > 1e-6 || twelfths.abs() > 1e6 {
                return None;
            }
            #[expect(clippy::cast_possible_truncation, reason = "small and rounded")]
            let pi12 = twelfths.round() as i32;
            let constants = fixed.iter().zip(&factors);
            let constants = AtomAngleSum::new(constants.map(|(c, n)| (Atom::Constant(*c), *n)));
            Some(AngleRelation {
                coordinate: p,
                sum: turning.plus(&constants, 1),
                pi12,
            })
        })
        .collect()
}

/// Factors from -2 to 2 of `n` constants in all combinations, sorted by the sum of their magnitudes.
fn multiples(n: usize) -> Vec<Vec<i32>> {
    /// Further constants have the factor zero.
    const MOST: usize = 3;
    let mut found: Vec<Vec<i32>> = vec![Vec::new()];
    for k in 0..n {
        let range = if k < MOST { -2..=2 } else { 0..=0 };
        found = found
            .iter()
            .flat_map(|head| {
                range.clone().map(|x| {
                    let mut longer = head.clone();
                    longer.push(x);
                    longer
                })
            })
            .collect();
    }
    found.sort_by_key(|factors| factors.iter().map(|n| n.abs()).sum::<i32>());
    found
}

/// The known angles with which an unknown one rotates, and its constant difference to them in rad; `None` if it is no
/// integer combination of them.
fn co_rotating_angles(
    mechanism: &Mechanism,
    poses: &[Vec<f64>],
    given: &[usize],
    p: usize,
) -> Option<(AtomAngleSum, f64)> {
    let others: Vec<usize> = given
        .iter()
        .copied()
        .filter(|c| mechanism.coordinates[*c].motion.is_angle())
        .collect();
    if !mechanism.coordinates[p].motion.is_angle() {
        return None;
    }
    // Differences to the nominal pose, which do not contain the fixed part.
    let (nominal, moved) = poses.split_first()?;
    let a = DMatrix::from_fn(moved.len(), others.len(), |i, j| {
        moved[i][others[j]] - nominal[others[j]]
    });
    let b = DVector::from_fn(moved.len(), |i, _| moved[i][p] - nominal[p]);
    let factors = if others.is_empty() {
        DVector::zeros(0)
    } else {
        a.clone().svd(true, true).solve(&b, 1e-12).ok()?
    };
    // Factors must be integers, and the rounded ones must fit every pose.
    let rounded: DVector<f64> = factors.map(f64::round);
    if (&factors - &rounded).iter().any(|x| x.abs() > 1e-5)
        || rounded.iter().any(|x| x.abs() > 100.0)
        || (a * &rounded - b).iter().any(|x| x.abs() > TOLERANCE)
    {
        return None;
    }
    // The fixed part is the rest at the nominal pose.
    let offset = others
        .iter()
        .zip(rounded.iter())
        .fold(nominal[p], |rest, (c, n)| rest - n * nominal[*c]);
    #[expect(clippy::cast_possible_truncation, reason = "small and rounded")]
    let terms = others
        .iter()
        .zip(rounded.iter())
        .map(|(c, n)| (Atom::Coordinate(*c), *n as i32));
    Some((AtomAngleSum::new(terms), offset))
}

/// Whether the relations close the loop at every pose, tested at random points of the field. For a mechanism that is
/// derived for its file's values alone, a numeric test is sufficient, because lengths in the file are rounded.
fn is_loop_closed(graph: &mut Graph, mechanism: &Mechanism, residual: &[ExprId], relations: &[AngleRelation]) -> bool {
    let closed = substitute_relations(graph, relations, residual);
    let tape = EvaluationTape::new(graph, &closed);
    let atoms = graph.atoms(&closed);
    let mut stream = RandomStream::new(2);
    // All atoms are drawn independently: the relations must close the loop identically.
    let closes_exactly = (0..8).all(|_| {
        let mut point = FieldPoint::<FieldElement>::default();
        for atom in &atoms {
            point.values.insert(*atom, stream.next_element());
            point.angles.insert(*atom, stream.next_circle_point());
        }
        tape.evaluate(&point)
            .is_some_and(|values| values.iter().all(|v| *v == FieldElement::ZERO))
    });
    closes_exactly || mechanism.has_numeric_constants && is_loop_closed_numerically(graph, mechanism, residual, &tape)
}

/// Whether a loop is closed up to the last digits of the file's lengths, at random angles.
fn is_loop_closed_numerically(
    graph: &mut Graph,
    mechanism: &Mechanism,
    residual: &[ExprId],
    closed: &EvaluationTape,
) -> bool {
    let size = magnitude::nominal_magnitude(graph, mechanism, residual);
    let mut stream = RandomStream::new(3);
    (0..8).all(|_| {
        let moved: Vec<f64> = (mechanism.coordinates.iter())
            .map(|c| {
                let far = if c.motion.is_angle() { 3.0 } else { size };
                c.nominal + far * uniform_symmetric(&mut stream)
            })
            .collect();
        is_loop_closed_at(mechanism, closed, &moved, size)
    })
}

/// Whether a loop is closed up to the last digits of the file's lengths at one pose. `size` is the size of the loop, m.
fn is_loop_closed_at(mechanism: &Mechanism, closed: &EvaluationTape, pose: &[f64], size: f64) -> bool {
    /// Relative to the size of the loop: rounding errors of lengths that other programs wrote.
    const LAST_DIGITS: f64 = 1e-11;
    let value = |atom: Atom| match atom {
        Atom::Coordinate(i) => pose[i],
        fixed => nominal_of(mechanism, fixed),
    };
    let left = closed.evaluate(&FloatDomain(value));
    left.is_some_and(|left| left.iter().all(|x| x.abs() <= LAST_DIGITS * size))
}

/// Replaces angles in sines and cosines by their relations.
fn substitute_relations(graph: &mut Graph, relations: &[AngleRelation], roots: &[ExprId]) -> Vec<ExprId> {
    let nodes: Vec<Node> = graph
        .nodes_of(roots)
        .filter(|n| matches!(n, Node::Sin(_) | Node::Cos(_)))
        .cloned()
        .collect();
    let mut replacements = BTreeMap::new();
    for node in nodes {
        let (Node::Sin(angle) | Node::Cos(angle)) = &node else {
            continue;
        };
        // The angle with every related coordinate replaced.
        let (mut sum, mut pi12) = (AtomAngleSum::NONE, 0);
        for (atom, n) in angle.terms() {
            match relations.iter().find(|r| Atom::Coordinate(r.coordinate) == *atom) {
                Some(relation) => {
                    sum = sum.plus(&relation.sum, *n);
                    pi12 += relation.pi12 * n;
                }
                None => sum = sum.plus(&AtomAngleSum::new([(*atom, *n)]), 1),
            }
        }
        let (cosine, sine) = graph.cos_sin(angle, 0);
        let (c, s) = graph.cos_sin(&sum, pi12);
        match node {
            Node::Cos(_) => replacements.insert(cosine, c),
            _ => replacements.insert(sine, s),
        };
    }
    graph.substitute(roots, &replacements)
}
