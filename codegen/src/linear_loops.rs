//! Loops in which the passive angles are integer combinations of other angles: parallelograms and their kin.
//!
//! Such a loop's variety falls apart into branches (the parallelogram and the crossed linkage), so that its closed form
//! by square roots would mix them. Which branch is meant is seen numerically around the nominal pose; that the relation
//! then closes the loop identically is shown exactly.

use modelmill_spec::{Mechanism, Motion};
use nalgebra::{DMatrix, DVector};

use crate::closure::Closure;
use crate::expr::{AngleSum, Atom, ExprId, FieldPoint, Graph, Node, Tape};
use crate::field::{Element, Stream};
use crate::numeric_pose::Loops;

/// A passive angle that equals `sum + pi12 * pi/12`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Relation {
    pub(crate) coordinate: usize,
    pub(crate) sum: AngleSum,
    pub(crate) pi12: i32,
}

/// How far the active coordinates are moved from the nominal pose, rad or m, and how exact a relation must look.
const MOVE: f64 = 0.05;
const TOLERANCE: f64 = 1e-8;

/// Finds loops that are solved by relations and writes these into them.
pub(crate) fn find(graph: &mut Graph, mechanism: &Mechanism, closures: &mut [Closure]) {
    let Some(poses) = poses(graph, mechanism, closures) else {
        return;
    };
    for closure in closures {
        let passive: Vec<usize> = closure
            .coordinates
            .iter()
            .copied()
            .filter(|c| mechanism.coordinates[*c].passive)
            .collect();
        if passive.len() != closure.residual.len() {
            continue;
        }
        let relations: Option<Vec<Relation>> = passive
            .iter()
            .map(|p| relation(mechanism, &poses, &closure.coordinates, *p))
            .collect();
        if let Some(relations) = relations
            && closes(graph, closure, &relations)
        {
            closure.residual = relations.iter().map(|r| residual(graph, r)).collect();
            closure.relations = relations;
            closure.chain = None;
        }
    }
}

/// The relation as an equation; its fixed part does not matter to derivatives.
fn residual(graph: &mut Graph, relation: &Relation) -> ExprId {
    let terms = relation
        .sum
        .terms()
        .iter()
        .map(|(atom, n)| (*atom, -i64::from(*n)));
    let terms: Vec<_> = std::iter::once((Atom::Coordinate(relation.coordinate), 1))
        .chain(terms)
        .collect();
    let terms: Vec<_> = terms
        .into_iter()
        .map(|(atom, n)| (graph.atom(atom), crate::expr::Rational::integer(n)))
        .collect();
    graph.sum(&terms)
}

/// Coordinates at the nominal pose and at some poses around it; `None` if the loops cannot be followed there.
fn poses(graph: &mut Graph, mechanism: &Mechanism, closures: &[Closure]) -> Option<Vec<Vec<f64>>> {
    if closures.is_empty() {
        return None;
    }
    let residual: Vec<ExprId> = closures
        .iter()
        .flat_map(|c| c.residual.iter().copied())
        .collect();
    let loops = Loops::new(graph, mechanism, &residual);
    let mut stream = Stream::new(1);
    let mut found = vec![loops.nominal()];
    for _ in 0..mechanism.coordinates.len() + 4 {
        found.push(loops.random(MOVE, &mut stream)?);
    }
    Some(found)
}

/// The relation that a passive angle keeps to at all poses: with the active coordinates of its loop.
fn relation(
    mechanism: &Mechanism,
    poses: &[Vec<f64>],
    coordinates: &[usize],
    p: usize,
) -> Option<Relation> {
    let others: Vec<usize> = coordinates
        .iter()
        .copied()
        .filter(|c| {
            !mechanism.coordinates[*c].passive
                && mechanism.coordinates[*c].motion == Motion::Revolute
        })
        .collect();
    if mechanism.coordinates[p].motion != Motion::Revolute {
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
        || (a * &rounded - b).iter().any(|x| x.abs() > TOLERANCE)
    {
        return None;
    }
    let offset = nominal[p]
        - others
            .iter()
            .zip(rounded.iter())
            .map(|(c, n)| n * nominal[*c])
            .sum::<f64>();
    let twelfths = offset * 12.0 / std::f64::consts::PI;
    if (twelfths - twelfths.round()).abs() > 1e-6 || twelfths.abs() > 1e6 {
        return None;
    }
    #[expect(
        clippy::cast_possible_truncation,
        reason = "both are small and rounded"
    )]
    let (pi12, integers): (i32, Vec<i32>) = (
        twelfths.round() as i32,
        rounded
            .iter()
            .map(|n| n.clamp(-100.0, 100.0) as i32)
            .collect(),
    );
    let sum = AngleSum::new(
        others
            .iter()
            .zip(integers)
            .map(|(c, n)| (Atom::Coordinate(*c), n)),
    );
    Some(Relation {
        coordinate: p,
        sum,
        pi12: pi12.rem_euclid(24),
    })
}

/// Whether the relations close the loop at every pose: shown at random points of the field.
fn closes(graph: &mut Graph, closure: &Closure, relations: &[Relation]) -> bool {
    let closed = put_in(graph, relations, &closure.residual);
    let tape = Tape::new(graph, &closed);
    let atoms = graph.atoms(&closed);
    let mut stream = Stream::new(2);
    (0..8).all(|_| {
        let mut point = FieldPoint::default();
        for atom in &atoms {
            point.values.insert(*atom, stream.element());
            point.angles.insert(*atom, stream.circle());
        }
        tape.evaluate(&point)
            .is_some_and(|values| values.iter().all(|v| *v == Element::ZERO))
    })
}

/// Replaces the related angles in sines and cosines.
fn put_in(graph: &mut Graph, relations: &[Relation], roots: &[ExprId]) -> Vec<ExprId> {
    let nodes: Vec<Node> = graph
        .nodes_of(roots)
        .filter(|n| matches!(n, Node::Sin(_) | Node::Cos(_)))
        .cloned()
        .collect();
    let mut replacements = std::collections::BTreeMap::new();
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
