//! The order in which loops are solved, each as a dyad or by relations, and the same made evaluable in the field.

use std::collections::BTreeSet;

use modelmill_spec::Mechanism;

use super::branches;
use crate::expr::{AngleSum, Atom, Domain, ExprId, FieldPoint, Graph, Tape};
use crate::loops::choose;
use crate::loops::closure::Closure;
use crate::loops::planar::{self, Solved};
use crate::loops::spatial;
use crate::programs::nominal_value;
use crate::regressor::projection::Projection;
use modelmill_algebra::field::Number;

/// A way to solve all loops one after the other, each for at most two coordinates.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    pub(crate) steps: Vec<PlanStep>,
}

/// One loop of a plan, or one of its coordinates.
#[derive(Clone, Debug)]
pub(crate) struct PlanStep {
    pub(crate) unknown: Vec<usize>,
    pub(crate) solved: Solved,
}

/// Which coordinates a plan may solve for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unknowns {
    /// The passive ones, with the active ones given: what a controller needs.
    Passive,
    /// Any, with the others drawn at random: what sampling needs.
    Any,
}

/// Looks for a plan. Every loop takes the root that it has at the nominal pose: loops that are alike but for their
/// assembly mode must differ in the field, too.
///
/// Given coordinates only become more from loop to loop, so for [`Unknowns::Passive`] any loop that can be solved may be
/// solved next. With [`Unknowns::Any`] a loop's unknowns must not be needed by the loops before it, so the plan is made
/// from its end: any loop with two unknowns of its own among those left may be the last of them.
pub(crate) fn plan(
    graph: &mut Graph,
    mechanism: &Mechanism,
    projection: &Projection,
    unknowns: Unknowns,
) -> Option<Plan> {
    let mut steps: Vec<PlanStep> = Vec::new();
    let mut todo: Vec<usize> = (0..projection.closures.len())
        .filter(|i| projection.closures[*i].n_independent > 0)
        .collect();
    let mut known: BTreeSet<usize> = projection.active.iter().copied().collect();
    while !todo.is_empty() {
        let next = todo.iter().enumerate().find_map(|(position, index)| {
            let closure = &projection.closures[*index];
            let free: Vec<usize> = closure
                .coordinates
                .iter()
                .copied()
                .filter(|c| match unknowns {
                    Unknowns::Passive => !known.contains(c),
                    Unknowns::Any => !todo.iter().any(|other| {
                        other != index && projection.closures[*other].coordinates.contains(c)
                    }),
                })
                .collect();
            choices(graph, mechanism, closure, &free, projection, unknowns)
                .into_iter()
                .find_map(|unknown| solve(graph, mechanism, closure, unknown))
                .map(|found| (position, found))
        });
        let Some((position, mut found)) = next else {
            let mut found = together(graph, mechanism, projection, unknowns, &todo, &known)?;
            if unknowns == Unknowns::Any {
                found.reverse();
            }
            steps.extend(found);
            break;
        };
        let index = todo.remove(position);
        known.extend(&projection.closures[index].coordinates);
        if unknowns == Unknowns::Any {
            found.reverse();
        }
        steps.extend(found);
    }
    if unknowns == Unknowns::Any {
        steps.reverse();
    }
    Some(Plan { steps })
}

/// Of more sets than this of a loop's coordinates not all are tried: each attempt derives expressions.
const MOST_SETS: usize = 1000;

/// Sets of coordinates for which a loop may be solved; passive ones first. Of very many only those that look solvable, in
/// their own order.
fn choices(
    graph: &mut Graph,
    mechanism: &Mechanism,
    closure: &Closure,
    free: &[usize],
    projection: &Projection,
    unknowns: Unknowns,
) -> Vec<Vec<usize>> {
    if !closure.relations.is_empty() {
        let related: Vec<usize> = closure.relations.iter().map(|r| r.coordinate).collect();
        let all = match unknowns {
            Unknowns::Passive => free.iter().all(|c| related.contains(c)),
            Unknowns::Any => related.iter().all(|c| free.contains(c)),
        };
        return if all { vec![related] } else { Vec::new() };
    }
    let size = if closure.chain.is_some() {
        2
    } else {
        closure.n_independent
    };
    if unknowns == Unknowns::Passive {
        return if free.len() == size {
            vec![free.to_vec()]
        } else {
            Vec::new()
        };
    }
    if closure.chain.is_none() && n_subsets(free.len(), size) > MOST_SETS {
        return choose::promising(
            graph,
            mechanism,
            &closure.equations,
            &closure.residual,
            free,
            size,
        );
    }
    let mut sets = subsets(free, size);
    sets.sort_by_key(|set| {
        set.iter()
            .filter(|c| !projection.passive.contains(c))
            .count()
    });
    sets
}

/// Solves several loops together.
fn together(
    graph: &mut Graph,
    mechanism: &Mechanism,
    projection: &Projection,
    unknowns: Unknowns,
    todo: &[usize],
    known: &BTreeSet<usize>,
) -> Option<Vec<PlanStep>> {
    let closures: Vec<&Closure> = todo.iter().map(|i| &projection.closures[*i]).collect();
    if closures
        .iter()
        .any(|c| c.equations.is_empty() || !c.relations.is_empty())
    {
        return None;
    }
    let mut equations: Vec<ExprId> = closures.iter().flat_map(|c| c.equations.clone()).collect();
    equations.sort_unstable();
    equations.dedup();
    let residual: Vec<ExprId> = closures.iter().flat_map(|c| c.residual.clone()).collect();
    let mut free: BTreeSet<usize> = closures
        .iter()
        .flat_map(|c| c.coordinates.clone())
        .collect();
    let size = closures.iter().map(|c| c.n_independent).sum();
    let sets = match unknowns {
        Unknowns::Passive => {
            free.retain(|c| !known.contains(c));
            let free: Vec<usize> = free.into_iter().collect();
            if free.len() == size {
                vec![free]
            } else {
                Vec::new()
            }
        }
        Unknowns::Any => {
            let free: Vec<usize> = free.into_iter().collect();
            choose::promising(graph, mechanism, &equations, &residual, &free, size)
        }
    };
    sets.into_iter().find_map(|unknown| {
        let steps = spatial::solve(graph, mechanism, &equations, &residual, &unknown)?;
        Some(single_steps(steps))
    })
}

/// Coordinates solved for one by one as steps of a plan.
fn single_steps(steps: Vec<(usize, Solved)>) -> Vec<PlanStep> {
    let step = |(coordinate, solved)| PlanStep {
        unknown: vec![coordinate],
        solved,
    };
    steps.into_iter().map(step).collect()
}

/// How many subsets of some size there are, or a number beyond all use.
fn n_subsets(of: usize, size: usize) -> usize {
    (0..size).fold(1_usize, |n, i| {
        n.saturating_mul(of.saturating_sub(i)) / (i + 1)
    })
}

/// All subsets of some size, in order.
fn subsets(of: &[usize], size: usize) -> Vec<Vec<usize>> {
    if size == 0 {
        return vec![Vec::new()];
    }
    let with = |i: usize| {
        let rest = subsets(&of[i + 1..], size - 1);
        rest.into_iter().map(move |mut set| {
            set.insert(0, of[i]);
            set
        })
    };
    (0..of.len()).flat_map(with).collect()
}

fn solve(
    graph: &mut Graph,
    mechanism: &Mechanism,
    closure: &Closure,
    unknown: Vec<usize>,
) -> Option<Vec<PlanStep>> {
    if closure.chain.is_none() && closure.relations.is_empty() {
        let steps = spatial::solve(
            graph,
            mechanism,
            &closure.equations,
            &closure.residual,
            &unknown,
        )?;
        return Some(single_steps(steps));
    }
    let mut solved = planar::solve(graph, closure, &unknown, true)?;
    if let Some(root) = solved.root {
        let mut sign = nominal_value(graph, mechanism, root.witness).unwrap_or(1.0);
        if let Some(whole) = root.whole {
            sign *= nominal_value(graph, mechanism, whole).unwrap_or(1.0);
        }
        if sign < 0.0 {
            solved = planar::solve(graph, closure, &unknown, false)?;
        }
    }
    // A root that is none can neither fail to exist nor choose between what hangs together.
    solved.root = solved.root.filter(|root| root.whole.is_none());
    Some(vec![PlanStep { unknown, solved }])
}

/// A step of a plan in the field.
pub(crate) struct SolveStep {
    unknown: Vec<usize>,
    angles: Vec<AngleSum>,
    /// Coordinates whose values follow: lengths, and angles that are combinations of known ones.
    numbers: Vec<usize>,
    /// Cosines and sines of the angles in pairs, then the numbers.
    tape: Tape,
    /// What the step takes roots of: one at most, as it stands.
    pub(crate) radicands: Vec<Tape>,
}

impl SolveStep {
    /// Makes a step evaluable; what it evaluates goes to `roots`.
    pub(crate) fn new(graph: &mut Graph, step: PlanStep, roots: &mut Vec<ExprId>) -> Self {
        let solved = step.solved;
        let mut angles: Vec<(AngleSum, [ExprId; 2])> = solved.angles;
        let mut numbers: Vec<(usize, ExprId)> = solved.lengths;
        for relation in &solved.relations {
            let (c, s) = graph.cos_sin(&relation.sum, relation.pi12);
            let angle = AngleSum::new([(Atom::Coordinate(relation.coordinate), 1)]);
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
            tape: Tape::new(graph, &own),
            radicands: branches::radicands(graph, &own),
        }
    }

    /// Sets the unknown coordinates of a point whose other coordinates are set; `None` if the loop does not close there.
    pub(crate) fn solve<N: Number>(&self, point: &mut FieldPoint<N>) -> Option<()> {
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
                let rest = angle.plus(&AngleSum::new([(*atom, *sign)]), -1);
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
