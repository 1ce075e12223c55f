//! The order in which loops are solved, each as a dyad, by relations or as a coupling. The loops of a mechanism go in,
//! and a list of steps comes out that can be emitted or evaluated in the prime field.
//!
//! Decision: the order is found by peeling, without search: from the front for given drive coordinates, from the
//! back for points drawn at random. Both find an order if there is one, because a solved loop never blocks another.

use std::collections::BTreeSet;

use modelmill_spec::Mechanism;

use super::all::KinematicLoops;
use super::solve_step::{LoopPlan, PlanStep};
use super::solved::ClosureSolution;
use crate::expr::{Atom, AtomAngleSum, ExprId, Graph, nominal_value};
use crate::loops::choose;
use crate::loops::closure::LoopClosure;
use crate::loops::planar;
use crate::loops::spatial;

/// Which coordinates a plan may solve for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SolvableCoordinates {
    /// The passive ones, with the active ones given: this is what a controller needs.
    Passive,
    /// Any, with the others drawn at random: this is what sampling in the field needs.
    Any,
}

/// Looks for a plan. Every loop takes the root that it has at the nominal pose: loops that differ only in their
/// assembly mode must differ in the field as well.
///
/// With [`SolvableCoordinates::Passive`] the set of given coordinates only grows from loop to loop, so any loop that
/// can be solved may be solved next. With [`SolvableCoordinates::Any`] the unknowns of a loop must not be needed by the
/// loops before it. The plan is then made from its end: any remaining loop with two unknowns of its own may be the last
/// one.
///
/// `None` if no order is found.
pub(crate) fn plan(
    graph: &mut Graph,
    mechanism: &Mechanism,
    loops: &KinematicLoops,
    unknowns: SolvableCoordinates,
) -> Option<LoopPlan> {
    let mut steps: Vec<PlanStep> = Vec::new();
    // Loops without an independent equation are closed by the others.
    let mut todo: Vec<usize> = (0..loops.closures.len())
        .filter(|i| loops.closures[*i].n_independent > 0)
        .collect();
    // Coordinates that are given, or determined by the steps so far.
    let mut known: BTreeSet<usize> = loops.active.iter().copied().collect();
    while !todo.is_empty() {
        // The first loop, with the first set of its coordinates, that can be solved now.
        let next = todo.iter().enumerate().find_map(|(position, index)| {
            let closure = &loops.closures[*index];
            let free: Vec<usize> = closure
                .coordinates
                .iter()
                .copied()
                .filter(|c| match unknowns {
                    SolvableCoordinates::Passive => !known.contains(c),
                    SolvableCoordinates::Any => !todo
                        .iter()
                        .any(|other| other != index && loops.closures[*other].coordinates.contains(c)),
                })
                .collect();
            coordinate_choices(graph, mechanism, closure, &free, loops, unknowns)
                .into_iter()
                .find_map(|unknown| solve_loop(graph, mechanism, closure, unknown, unknowns))
                .map(|found| (position, found))
        });
        // No loop can be solved alone: the remaining ones may be solvable together.
        let Some((position, mut found)) = next else {
            let mut found = solve_jointly(graph, mechanism, loops, unknowns, &todo, &known)?;
            if unknowns == SolvableCoordinates::Any {
                found.reverse();
            }
            steps.extend(found);
            break;
        };
        let index = todo.remove(position);
        known.extend(&loops.closures[index].coordinates);
        if unknowns == SolvableCoordinates::Any {
            found.reverse();
        }
        steps.extend(found);
    }
    // Steps were found from the last to the first.
    if unknowns == SolvableCoordinates::Any {
        steps.reverse();
    }
    let divided = match unknowns {
        SolvableCoordinates::Passive => Vec::new(),
        SolvableCoordinates::Any => loops.divided.clone(),
    };
    Some(LoopPlan { steps, divided })
}

/// If a loop has more sets of coordinates than this, not all are tried, because each attempt derives expressions.
const MOST_SETS: usize = 1000;

/// Sets of coordinates for which a loop may be solved; sets of passive coordinates come first. If there are very many,
/// only those that look solvable, in their own order.
fn coordinate_choices(
    graph: &mut Graph,
    mechanism: &Mechanism,
    closure: &LoopClosure,
    free: &[usize],
    loops: &KinematicLoops,
    unknowns: SolvableCoordinates,
) -> Vec<Vec<usize>> {
    // A loop with relations determines exactly the coordinates of its relations.
    let related = closure.explicit_coordinates();
    if !related.is_empty() {
        let all = match unknowns {
            SolvableCoordinates::Passive => free.iter().all(|c| related.contains(c)),
            SolvableCoordinates::Any => related.iter().all(|c| free.contains(c)),
        };
        return if all { vec![related] } else { Vec::new() };
    }
    // A planar loop has two equations.
    let size = if closure.chain.is_some() {
        2
    } else {
        closure.n_independent
    };
    // The unknowns are fixed by the active coordinates: either their number fits or it does not.
    if unknowns == SolvableCoordinates::Passive {
        return if free.len() == size {
            vec![free.to_vec()]
        } else {
            Vec::new()
        };
    }
    // A choice by the structure of the equations, without deriving each set.
    if closure.chain.is_none() && n_subsets(free.len(), size) > MOST_SETS {
        return choose::promising_sets(graph, mechanism, &closure.equations, &closure.residual, free, size);
    }
    let mut sets = subsets(free, size);
    sets.sort_by_key(|set| set.iter().filter(|c| !loops.passive.contains(c)).count());
    sets
}

/// Solves all remaining loops together, one coordinate after the other; `None` if that fails or is not possible.
fn solve_jointly(
    graph: &mut Graph,
    mechanism: &Mechanism,
    loops: &KinematicLoops,
    unknowns: SolvableCoordinates,
    todo: &[usize],
    known: &BTreeSet<usize>,
) -> Option<Vec<PlanStep>> {
    let closures: Vec<&LoopClosure> = todo.iter().map(|i| &loops.closures[*i]).collect();
    // Loops that are solved directly, and loops without equations of their own, cannot be part of a joint system.
    if closures
        .iter()
        .any(|c| c.equations.is_empty() || !c.explicit_coordinates().is_empty())
    {
        return None;
    }
    let mut equations: Vec<ExprId> = closures.iter().flat_map(|c| c.equations.clone()).collect();
    equations.sort_unstable();
    equations.dedup();
    let residual: Vec<ExprId> = closures.iter().flat_map(|c| c.residual.clone()).collect();
    let mut free: BTreeSet<usize> = closures.iter().flat_map(|c| c.coordinates.clone()).collect();
    let size = closures.iter().map(|c| c.n_independent).sum();
    // Sets of unknowns, as many as the loops have independent equations.
    let sets = match unknowns {
        SolvableCoordinates::Passive => {
            free.retain(|c| !known.contains(c));
            let free: Vec<usize> = free.into_iter().collect();
            if free.len() == size { vec![free] } else { Vec::new() }
        }
        SolvableCoordinates::Any => {
            let free: Vec<usize> = free.into_iter().collect();
            choose::promising_sets(graph, mechanism, &equations, &residual, &free, size)
        }
    };
    sets.into_iter().find_map(|unknown| {
        let steps = spatial::solve(graph, mechanism, &equations, &residual, &unknown)?;
        Some(single_steps(steps))
    })
}

/// One step of a plan for every coordinate that was solved for.
fn single_steps(steps: Vec<(usize, ClosureSolution)>) -> Vec<PlanStep> {
    let step = |(coordinate, solved)| PlanStep {
        unknown: vec![coordinate],
        solved,
    };
    steps.into_iter().map(step).collect()
}

/// Number of subsets of some size; saturates where it overflows.
fn n_subsets(of: usize, size: usize) -> usize {
    (0..size).fold(1_usize, |n, i| n.saturating_mul(of.saturating_sub(i)) / (i + 1))
}

/// All subsets of some size, in lexicographic order of the positions.
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

/// The steps that solve one loop for `unknown`; `None` if no closed form applies.
fn solve_loop(
    graph: &mut Graph,
    mechanism: &Mechanism,
    closure: &LoopClosure,
    unknown: Vec<usize>,
    unknowns: SolvableCoordinates,
) -> Option<Vec<PlanStep>> {
    // A coupling without a relation is its own solution.
    if let Some(follower) = &closure.follower
        && closure.relations.is_empty()
    {
        let angle = AtomAngleSum::new([(Atom::Coordinate(follower.coordinate), 1)]);
        let in_parts = follower.in_parts.filter(|_| unknowns == SolvableCoordinates::Any);
        let solved = ClosureSolution {
            angles: in_parts.map(|cos_sin| (angle, cos_sin)).into_iter().collect(),
            relations: Vec::new(),
            values: vec![(follower.coordinate, follower.value)],
            root: None,
        };
        return Some(vec![PlanStep { unknown, solved }]);
    }
    // A spatial loop is solved one coordinate after the other.
    if closure.chain.is_none() && closure.relations.is_empty() {
        let steps = spatial::solve(graph, mechanism, &closure.equations, &closure.residual, &unknown)?;
        return Some(single_steps(steps));
    }
    // A planar loop: the root is first taken as positive, and again as negative if the nominal pose has that sign.
    let mut solved = planar::solve(graph, closure, &unknown, true)?;
    let follower = closure.follower.as_ref();
    solved
        .values
        .extend(follower.map(|follower| (follower.coordinate, follower.value)));
    if let Some(root) = solved.root {
        let mut sign = nominal_value(graph, mechanism, root.witness).unwrap_or(1.0);
        if let Some(whole) = root.exact {
            sign *= nominal_value(graph, mechanism, whole).unwrap_or(1.0);
        }
        if sign < 0.0 {
            solved = planar::solve(graph, closure, &unknown, false)?;
        }
    }
    // A root that is a polynomial always exists, and its two signs are motions that are not connected: it is no choice.
    solved.root = solved.root.filter(|root| root.exact.is_none());
    Some(vec![PlanStep { unknown, solved }])
}
