//! Steps that solve loops one after the other, and the same steps in a form that can be evaluated in the prime field.

use modelmill_algebra::field::FieldNumber;

use super::solved::ClosureSolution;
use crate::expr::{Atom, AtomAngleSum, EvaluationDomain, EvaluationTape, ExprId, FieldPoint, Graph, Node, Unary};

/// A sequence of steps that solves all loops, each for at most two coordinates.
#[derive(Clone, Debug)]
pub(crate) struct LoopPlan {
    /// The steps in the order in which they are evaluated.
    pub(crate) steps: Vec<PlanStep>,
    /// Angles that are drawn in parts, with the number of parts, so that other angles can be fractions of them.
    pub(crate) divided: Vec<(usize, i64)>,
}

/// One loop of a plan, or one of its coordinates.
#[derive(Clone, Debug)]
pub(crate) struct PlanStep {
    /// Indices of the coordinates that the step determines.
    pub(crate) unknown: Vec<usize>,
    /// Their expressions.
    pub(crate) solved: ClosureSolution,
}

/// A step of a plan that can be evaluated in the prime field.
pub(crate) struct FieldSolveStep {
    /// Indices of the coordinates that the step determines.
    unknown: Vec<usize>,
    /// The sums of angles whose cosines and sines the tape returns.
    angles: Vec<AtomAngleSum>,
    /// Coordinates whose values the tape returns: lengths, angles that are combinations of known ones, and coupled
    /// coordinates.
    numbers: Vec<usize>,
    /// Cosines and sines of the angles in pairs, then the numbers.
    tape: EvaluationTape,
    /// Radicands of the square roots of the step; at present at most one.
    pub(crate) radicands: Vec<EvaluationTape>,
}

impl FieldSolveStep {
    /// Makes a step evaluable; the expressions that it evaluates are appended to `roots`.
    pub(crate) fn new(graph: &mut Graph, step: PlanStep, roots: &mut Vec<ExprId>) -> Self {
        let solved = step.solved;
        let mut angles: Vec<(AtomAngleSum, [ExprId; 2])> = solved.angles;
        let mut numbers: Vec<(usize, ExprId)> = solved.values;
        // A relation gives both the angle's cosine and sine and its value.
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

    /// Sets the unknown coordinates of a point whose other coordinates are set; `None` if the loop does not close
    /// there.
    pub(crate) fn solve<N: FieldNumber>(&self, point: &mut FieldPoint<N>) -> Option<()> {
        let values = self.tape.evaluate(point)?;
        let numbers = &values[2 * self.angles.len()..];
        for (i, value) in self.numbers.iter().zip(numbers) {
            point.values.insert(Atom::Coordinate(*i), *value);
        }
        // Unknown angles are found one at a time from sums with one unknown.
        let in_angles = |c: &usize| self.angles.iter().any(|a| a.atoms().any(|x| x == Atom::Coordinate(*c)));
        let mut unknown: Vec<usize> = self.unknown.iter().copied().filter(in_angles).collect();
        while !unknown.is_empty() {
            let before = unknown.len();
            for (k, angle) in self.angles.iter().enumerate() {
                // The unknown coordinates in this sum; the sum is usable if there is exactly one.
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
                point.angles.insert(*atom, (c, if *sign < 0 { -s } else { s }));
                unknown.retain(|u| u != i);
            }
            // No sum has a single unknown: the step does not determine them.
            if unknown.len() == before {
                return None;
            }
        }
        Some(())
    }
}

/// Arguments of the square roots in `outputs` that depend on coordinates and constants alone.
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
