//! Loops solved one after the other: the steps, and the same made evaluable in the field.

use modelmill_algebra::field::FieldNumber;

use super::solved::ClosureSolution;
use crate::expr::{
    Atom, AtomAngleSum, EvaluationDomain, EvaluationTape, ExprId, FieldPoint, Graph, Node, Unary,
};

/// A way to solve all loops one after the other, each for at most two coordinates.
#[derive(Clone, Debug)]
pub(crate) struct LoopPlan {
    pub(crate) steps: Vec<PlanStep>,
    /// Angles whose turns are drawn in so many parts, for others to follow them by fractions.
    pub(crate) divided: Vec<(usize, i64)>,
}

/// One loop of a plan, or one of its coordinates.
#[derive(Clone, Debug)]
pub(crate) struct PlanStep {
    pub(crate) unknown: Vec<usize>,
    pub(crate) solved: ClosureSolution,
}

/// A step of a plan in the field.
pub(crate) struct FieldSolveStep {
    unknown: Vec<usize>,
    angles: Vec<AtomAngleSum>,
    /// Coordinates whose values follow: lengths, angles that are combinations of known ones, and what follows others.
    numbers: Vec<usize>,
    /// Cosines and sines of the angles in pairs, then the numbers.
    tape: EvaluationTape,
    /// What the step takes roots of: one at most, as it stands.
    pub(crate) radicands: Vec<EvaluationTape>,
}

impl FieldSolveStep {
    /// Makes a step evaluable; what it evaluates goes to `roots`.
    pub(crate) fn new(graph: &mut Graph, step: PlanStep, roots: &mut Vec<ExprId>) -> Self {
        let solved = step.solved;
        let mut angles: Vec<(AtomAngleSum, [ExprId; 2])> = solved.angles;
        let mut numbers: Vec<(usize, ExprId)> = solved.values;
        for relation in &solved.relations {
            let (c, s) = graph.cos_sin(&relation.sum, relation.pi12);
            let angle = AtomAngleSum::new([(Atom::Coordinate(relation.coordinate), 1)]);
            angles.push((angle, [c, s]));
            numbers.push((relation.coordinate, relation.value(graph)));
        }
        let mut own: Vec<ExprId> = angles.iter().flat_map(|(_, cs)| *cs).collect();
        own.extend(numbers.iter().map(|(_, value)| *value));
        roots.extend(&own);
        Self {
            unknown: step.unknown,
            angles: angles.into_iter().map(|(angle, _)| angle).collect(),
            numbers: numbers.iter().map(|(i, _)| *i).collect(),
            tape: EvaluationTape::new(graph, &own),
            radicands: radicands(graph, &own),
        }
    }

    /// Sets the unknown coordinates of a point whose other coordinates are set; `None` if the loop does not close there.
    pub(crate) fn solve<N: FieldNumber>(&self, point: &mut FieldPoint<N>) -> Option<()> {
        let values = self.tape.evaluate(point)?;
        let numbers = &values[2 * self.angles.len()..];
        for (i, value) in self.numbers.iter().zip(numbers) {
            point.values.insert(Atom::Coordinate(*i), *value);
        }
        let in_angles = |c: &usize| {
            self.angles
                .iter()
                .any(|a| a.atoms().any(|x| x == Atom::Coordinate(*c)))
        };
        let mut unknown: Vec<usize> = self.unknown.iter().copied().filter(in_angles).collect();
        while !unknown.is_empty() {
            let before = unknown.len();
            for (k, angle) in self.angles.iter().enumerate() {
                let inside: Vec<_> = angle
                    .terms()
                    .iter()
                    .filter(|(atom, _)| matches!(atom, Atom::Coordinate(i) if unknown.contains(i)))
                    .collect();
                let &[(atom @ Atom::Coordinate(i), sign)] = inside.as_slice() else {
                    continue;
                };
                let rest = angle.plus(&AtomAngleSum::new([(*atom, *sign)]), -1);
                let (cr, sr) = point.cos_sin(&rest)?;
                let (c, s) = (values[2 * k], values[2 * k + 1]);
                // The unknown angle is sign * (angle - rest).
                let (c, s) = (c * cr + s * sr, s * cr - c * sr);
                point
                    .angles
                    .insert(*atom, (c, if *sign < 0 { -s } else { s }));
                unknown.retain(|u| u != i);
            }
            if unknown.len() == before {
                return None;
            }
        }
        Some(())
    }
}

/// What roots under `outputs` are taken of, if it depends on coordinates and constants alone.
pub(crate) fn radicands(graph: &Graph, outputs: &[ExprId]) -> Vec<EvaluationTape> {
    let inner = graph.nodes_of(outputs).filter_map(|node| match node {
        Node::Unary(Unary::Sqrt, inner) => Some(*inner),
        _ => None,
    });
    inner
        .filter(|inner| {
            let atoms = graph.atoms(&[*inner]);
            atoms.iter().any(|a| matches!(a, Atom::Coordinate(_)))
                && atoms
                    .iter()
                    .all(|a| matches!(a, Atom::Coordinate(_) | Atom::Constant(_) | Atom::Pi))
        })
        .map(|inner| EvaluationTape::new(graph, &[inner]))
        .collect()
}
