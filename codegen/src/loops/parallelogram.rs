//! Loops in which the passive angles are integer combinations of other angles: parallelograms and their kin.
//!
//! Such a loop's variety falls apart into branches (the parallelogram and the crossed linkage), so that its closed form
//! by square roots would mix them. Which branch is meant is seen numerically around the nominal pose; that the relation
//! then closes the loop identically is shown exactly.
//!
//! Decision: such loops are recognised one after the other, as they drive each other, and proved either for all
//! angles of the other loops or at points of the field where these close (as in a kite whose halves share a
//! prismatic joint).

use std::collections::{BTreeMap, BTreeSet};

use modelmill_algebra::field::{Element, MODULUS, Stream};
use modelmill_spec::Mechanism;
use nalgebra::{DMatrix, DVector};

use crate::expr::{
    AngleSum, Atom, ExprId, F64, FieldPoint, Graph, Node, Tape, coordinates_of, nominal_of,
};
use crate::loops::all::Loops;
use crate::loops::closure::Closure;
use crate::loops::field_poses::FieldPoses;
use crate::loops::magnitude;
use crate::loops::numeric_poses::{NumericLoops, symmetric};
use crate::loops::plan::{Unknowns, plan};
use crate::loops::relation::AngleRelation;

/// How far known coordinates are moved from the nominal pose, in rad or relative to the size of the loop, and how exact
/// a relation must look.
const MOVE: f64 = 0.05;
const TOLERANCE: f64 = 1e-8;

/// Finds loops that are solved by relations and writes these into them.
///
/// Loops are looked at one after the other, as soon as all but as many of their coordinates are known as they have
/// equations: a loop may be driven by another one.
pub(crate) fn find(
    graph: &mut Graph,
    mechanism: &Mechanism,
    closures: &mut [Closure],
    divided: &[(usize, i64)],
) {
    let mut known: BTreeSet<usize> = (0..mechanism.coordinates.len())
        .filter(|c| !mechanism.coordinates[*c].passive)
        .collect();
    let mut related: Vec<AngleRelation> = Vec::new();
    let mut solved: Vec<usize> = Vec::new();
    let mut todo: Vec<usize> = (0..closures.len()).collect();
    let unknown_of = |closure: &Closure, known: &BTreeSet<usize>| -> Vec<usize> {
        let coordinates = closure.coordinates.iter().copied();
        coordinates.filter(|c| !known.contains(c)).collect()
    };
    while let Some(position) = todo.iter().position(|i| {
        let closure = &closures[*i];
        unknown_of(closure, &known).len() == closure.residual.len()
    }) {
        let index = todo.remove(position);
        let closure = &closures[index];
        let unknown = unknown_of(closure, &known);
        let turning: Vec<usize> = (known.iter().copied())
            .filter(|c| related.iter().all(|r| r.coordinate != *c))
            .collect();
        known.extend(&unknown);
        if closure.given().is_empty() {
            // What is known of other loops' angles may be what makes this one a parallelogram.
            let residual = put_in(graph, &related, &closure.residual);
            let relations = relations_of(graph, mechanism, &residual, &unknown).or_else(|| {
                let before = solved.iter().map(|i| &closures[*i]);
                let motion = Motion::new(mechanism, before, divided)?;
                relations_along(graph, mechanism, &motion, &turning, &residual, &unknown)
            });
            if let Some(relations) = relations {
                let closure = &mut closures[index];
                closure.residual = relations.iter().map(|r| r.residual(graph)).collect();
                closure.coordinates = coordinates_of(graph, &closure.residual);
                closure.chain = None;
                closure.relations = relations;
            }
        }
        related.extend(closures[index].relations.iter().cloned());
        solved.push(index);
    }
}

/// Loops that were solved before, by whose motion others may turn.
struct Motion(Loops);

impl Motion {
    /// `None` if there are no loops.
    fn new<'a>(
        mechanism: &Mechanism,
        solved: impl Iterator<Item = &'a Closure>,
        divided: &[(usize, i64)],
    ) -> Option<Self> {
        let closures: Vec<Closure> = solved
            .cloned()
            .map(|mut closure| {
                closure.n_independent = closure.residual.len();
                closure
            })
            .collect();
        let settled: BTreeSet<usize> = (closures.iter().flat_map(|c| &c.coordinates).copied())
            .filter(|c| mechanism.coordinates[*c].passive)
            .collect();
        (!closures.is_empty()).then(|| {
            let (passive, active) =
                (0..mechanism.coordinates.len()).partition(|c| settled.contains(c));
            Self(Loops {
                active,
                passive,
                residual: closures.iter().flat_map(|c| c.residual.clone()).collect(),
                closures,
                divided: divided.to_vec(),
            })
        })
    }

    /// Whether expressions vanish wherever these loops close: shown at random points of the field.
    fn makes_vanish(&self, graph: &mut Graph, mechanism: &Mechanism, closed: &[ExprId]) -> bool {
        /// Points, and how many draws may fail to be one.
        const POINTS: usize = 8;
        const DRAWS: usize = 400;
        let Some(plan) = plan(graph, mechanism, &self.0, Unknowns::Any) else {
            return false;
        };
        let poses = FieldPoses::new(graph, mechanism, plan, closed);
        let tape = Tape::new(graph, closed);
        let mut stream = Stream::new(4);
        let Ok(constants) = poses.constants::<MODULUS>(&mut stream) else {
            return false;
        };
        let points = (0..DRAWS).filter_map(|_| {
            let open: FieldPoint<Element> = poses.open(&constants, &mut stream);
            tape.evaluate(&poses.close(open)?)
        });
        let seen: Vec<_> = points.take(POINTS).collect();
        seen.len() == POINTS && seen.iter().flatten().all(|left| *left == Element::ZERO)
    }
}

/// Relations that hold along the motion of other loops and not without it, as those of a parallelogram of which one side is
/// the side of a five-bar, or of a kite whose halves share a slide. They are seen in numbers, and then shown exactly; of a
/// mechanism for its file's values alone, to the last digits of these.
fn relations_along(
    graph: &mut Graph,
    mechanism: &Mechanism,
    motion: &Motion,
    turning: &[usize],
    residual: &[ExprId],
    unknown: &[usize],
) -> Option<Vec<AngleRelation>> {
    let all: Vec<ExprId> = (motion.0.residual.iter().chain(residual).copied()).collect();
    let following: Vec<usize> = (motion.0.passive.iter().chain(unknown).copied()).collect();
    let given: Vec<usize> = (0..mechanism.coordinates.len())
        .filter(|c| !following.contains(c))
        .collect();
    let poses = poses(graph, mechanism, &all, &following, &given)?;
    let fixed = fixed_angles(graph, residual);
    let candidates: Vec<Vec<AngleRelation>> = unknown
        .iter()
        .map(|p| relations(mechanism, &poses, turning, &fixed, *p))
        .collect();
    let size = magnitude::at_nominal(graph, mechanism, residual);
    combinations(&candidates).find(|relations| {
        let closed = put_in(graph, relations, residual);
        let tape = Tape::new(graph, &closed);
        poses.iter().all(|q| closes_at(mechanism, &tape, q, size))
            && (mechanism.is_at_values || motion.makes_vanish(graph, mechanism, &closed))
    })
}

/// The relations that solve a loop for `unknown`, if there are such; shown exactly.
fn relations_of(
    graph: &mut Graph,
    mechanism: &Mechanism,
    residual: &[ExprId],
    unknown: &[usize],
) -> Option<Vec<AngleRelation>> {
    let given: Vec<usize> = coordinates_of(graph, residual)
        .into_iter()
        .filter(|c| !unknown.contains(c))
        .collect();
    let poses = poses(graph, mechanism, residual, unknown, &given)?;
    let fixed = fixed_angles(graph, residual);
    let candidates: Vec<Vec<AngleRelation>> = unknown
        .iter()
        .map(|p| relations(mechanism, &poses, &given, &fixed, *p))
        .collect();
    combinations(&candidates).find(|relations| closes(graph, mechanism, residual, relations))
}

/// Coordinates at the nominal pose and at some poses around it; `None` if the loop cannot be followed there.
fn poses(
    graph: &mut Graph,
    mechanism: &Mechanism,
    residual: &[ExprId],
    unknown: &[usize],
    given: &[usize],
) -> Option<Vec<Vec<f64>>> {
    /// How often the reach is halved where loops cannot be followed, as near the end of a slide.
    const HALVINGS: u32 = 6;
    let loops = NumericLoops::solved_for(graph, mechanism, residual, unknown.to_vec(), given);
    // A loop that leaves some of them free keeps to relations of many kinds.
    let nominal = loops.nominal().filter(|q| loops.is_regular(q))?;
    (0..=HALVINGS).find_map(|k| {
        let reach = MOVE / f64::from(1_u32 << k);
        let mut stream = Stream::new(1);
        let mut found = vec![nominal.clone()];
        for _ in 0..given.len() + unknown.len() + 4 {
            found.push(loops.random(reach, &mut stream)?);
        }
        Some(found)
    })
}

/// Constants in sines and cosines.
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

/// One candidate of each list, in all combinations; only the first few.
fn combinations(candidates: &[Vec<AngleRelation>]) -> impl Iterator<Item = Vec<AngleRelation>> {
    const MOST: usize = 64;
    let n = candidates
        .iter()
        .try_fold(1usize, |n, list| n.checked_mul(list.len()))
        .unwrap_or(MOST);
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

/// Relations that an unknown angle keeps to at all poses: with the known angles of its loop, and in its fixed part with
/// multiples of constant angles. The simplest come first.
fn relations(
    mechanism: &Mechanism,
    poses: &[Vec<f64>],
    given: &[usize],
    fixed: &[usize],
    p: usize,
) -> Vec<AngleRelation> {
    let Some((turning, offset)) = turning(mechanism, poses, given, p) else {
        return Vec::new();
    };
    multiples(fixed.len())
        .into_iter()
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
            let constants = AngleSum::new(constants.map(|(c, n)| (Atom::Constant(*c), *n)));
            Some(AngleRelation {
                coordinate: p,
                sum: turning.plus(&constants, 1),
                pi12,
            })
        })
        .collect()
}

/// Small factors of `n` constants, sorted by size.
fn multiples(n: usize) -> Vec<Vec<i32>> {
    /// More constants than this are left out.
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

/// The known angles with which an unknown one turns, and what it is beside them.
fn turning(
    mechanism: &Mechanism,
    poses: &[Vec<f64>],
    given: &[usize],
    p: usize,
) -> Option<(AngleSum, f64)> {
    let others: Vec<usize> = given
        .iter()
        .copied()
        .filter(|c| mechanism.coordinates[*c].motion.is_angle())
        .collect();
    if !mechanism.coordinates[p].motion.is_angle() {
        return None;
    }
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
    let rounded: DVector<f64> = factors.map(f64::round);
    if (&factors - &rounded).iter().any(|x| x.abs() > 1e-5)
        || rounded.iter().any(|x| x.abs() > 100.0)
        || (a * &rounded - b).iter().any(|x| x.abs() > TOLERANCE)
    {
        return None;
    }
    let offset = others
        .iter()
        .zip(rounded.iter())
        .fold(nominal[p], |rest, (c, n)| rest - n * nominal[*c]);
    #[expect(clippy::cast_possible_truncation, reason = "small and rounded")]
    let terms = others
        .iter()
        .zip(rounded.iter())
        .map(|(c, n)| (Atom::Coordinate(*c), *n as i32));
    Some((AngleSum::new(terms), offset))
}

/// Whether the relations close the loop at every pose: shown at random points of the field; or, of a mechanism for its file's
/// values alone, in numbers, since there lengths are what is left of those that were meant.
fn closes(
    graph: &mut Graph,
    mechanism: &Mechanism,
    residual: &[ExprId],
    relations: &[AngleRelation],
) -> bool {
    let closed = put_in(graph, relations, residual);
    let tape = Tape::new(graph, &closed);
    let atoms = graph.atoms(&closed);
    let mut stream = Stream::new(2);
    let closes_exactly = (0..8).all(|_| {
        let mut point = FieldPoint::<Element>::default();
        for atom in &atoms {
            point.values.insert(*atom, stream.element());
            point.angles.insert(*atom, stream.circle());
        }
        tape.evaluate(&point)
            .is_some_and(|values| values.iter().all(|v| *v == Element::ZERO))
    });
    closes_exactly || mechanism.is_at_values && closes_in_numbers(graph, mechanism, residual, &tape)
}

/// Whether nothing but the last digits of the file's lengths is left of a loop, at any angles.
fn closes_in_numbers(
    graph: &mut Graph,
    mechanism: &Mechanism,
    residual: &[ExprId],
    closed: &Tape,
) -> bool {
    let size = magnitude::at_nominal(graph, mechanism, residual);
    let mut stream = Stream::new(3);
    (0..8).all(|_| {
        let moved: Vec<f64> = (mechanism.coordinates.iter())
            .map(|c| {
                let far = if c.motion.is_angle() { 3.0 } else { size };
                c.nominal + far * symmetric(&mut stream)
            })
            .collect();
        closes_at(mechanism, closed, &moved, size)
    })
}

/// Whether nothing but the last digits of the file's lengths is left of a loop at a pose.
fn closes_at(mechanism: &Mechanism, closed: &Tape, pose: &[f64], size: f64) -> bool {
    /// Relative to the size of the loop: what the arithmetic of other programs leaves in lengths that they write.
    const LAST_DIGITS: f64 = 1e-11;
    let value = |atom: Atom| match atom {
        Atom::Coordinate(i) => pose[i],
        fixed => nominal_of(mechanism, fixed),
    };
    let left = closed.evaluate(&F64(value));
    left.is_some_and(|left| left.iter().all(|x| x.abs() <= LAST_DIGITS * size))
}

/// Replaces the related angles in sines and cosines.
fn put_in(graph: &mut Graph, relations: &[AngleRelation], roots: &[ExprId]) -> Vec<ExprId> {
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
        let (mut sum, mut pi12) = (AngleSum::NONE, 0);
        for (atom, n) in angle.terms() {
            match relations
                .iter()
                .find(|r| Atom::Coordinate(r.coordinate) == *atom)
            {
                Some(relation) => {
                    sum = sum.plus(&relation.sum, *n);
                    pi12 += relation.pi12 * n;
                }
                None => sum = sum.plus(&AngleSum::new([(*atom, *n)]), 1),
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
