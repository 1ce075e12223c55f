//! Random points of a mechanism's motion in the prime field: angles as rational points of the circle, loops solved by
//! square roots in the field (drawn again until they exist), rates and accelerations from the differentiated loops.
//!
//! Which coordinates are drawn freely does not matter for linear dependence, so those are drawn that make every loop
//! a dyad.

use std::collections::BTreeSet;

use modelmill_spec::{Mechanism, Motion};

use crate::DeriveError;
use crate::closure::Closure;
use crate::dyad::{self, Solved};
use crate::expr::{AngleSum, Atom, ExprId, FieldPoint, Graph, Node, Tape, Unary};
use crate::field::{Element, Stream};
use crate::projection::Projection;

/// How often a draw is repeated until all square roots exist.
const MOST_DRAWS: usize = 4000;

/// A way to solve all loops one after the other, each for at most two coordinates.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    pub(crate) steps: Vec<PlanStep>,
}

/// One loop of a plan.
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

/// Looks for a plan; `positive` says which root a loop takes, from an expression that equals the signed root.
///
/// Given coordinates only become more from loop to loop, so for [`Unknowns::Passive`] any loop that can be solved may be
/// solved next. With [`Unknowns::Any`] a loop's unknowns must not be needed by the loops before it, so the plan is made
/// from its end: any loop with two unknowns of its own among those left may be the last of them.
pub(crate) fn plan(
    graph: &mut Graph,
    projection: &Projection,
    unknowns: Unknowns,
    positive: &mut dyn FnMut(&Graph, ExprId) -> bool,
) -> Option<Plan> {
    let mut steps: Vec<PlanStep> = Vec::new();
    let mut todo: Vec<usize> = (0..projection.closures.len()).collect();
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
            choices(closure, &free, projection, unknowns)
                .into_iter()
                .find_map(|unknown| solve(graph, closure, unknown, positive))
                .map(|step| (position, step))
        });
        let (position, step) = next?;
        let index = todo.remove(position);
        known.extend(&projection.closures[index].coordinates);
        steps.push(step);
    }
    if unknowns == Unknowns::Any {
        steps.reverse();
    }
    Some(Plan { steps })
}

/// Sets of coordinates for which a loop may be solved; passive ones first.
fn choices(
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
    if unknowns == Unknowns::Passive {
        return if free.len() == 2 {
            vec![free.to_vec()]
        } else {
            Vec::new()
        };
    }
    let mut pairs: Vec<Vec<usize>> = Vec::new();
    for (i, a) in free.iter().enumerate() {
        pairs.extend(free[i + 1..].iter().map(|b| vec![*a, *b]));
    }
    pairs.sort_by_key(|pair| {
        pair.iter()
            .filter(|c| !projection.passive.contains(c))
            .count()
    });
    pairs
}

fn solve(
    graph: &mut Graph,
    closure: &Closure,
    unknown: Vec<usize>,
    positive: &mut dyn FnMut(&Graph, ExprId) -> bool,
) -> Option<PlanStep> {
    let mut solved = dyad::solve(graph, closure, &unknown, true)?;
    if let Some(root) = solved.root
        && !positive(graph, root.witness)
    {
        solved = dyad::solve(graph, closure, &unknown, false)?;
    }
    Some(PlanStep { unknown, solved })
}

/// Draws points.
pub(crate) struct Sampler {
    coordinates: Vec<(usize, Motion)>,
    n_drives: usize,
    active: Vec<usize>,
    passive: Vec<usize>,
    n_constants: usize,
    /// Functions of constants that exist only for some of them.
    of_constants: Tape,
    steps: Vec<SolveStep>,
    rates: Tape,
    accelerations: Tape,
    outputs: Tape,
}

struct SolveStep {
    unknown: Vec<usize>,
    angles: Vec<AngleSum>,
    /// Coordinates whose values follow: lengths, and angles that are combinations of known ones.
    numbers: Vec<usize>,
    /// Cosines and sines of the angles in pairs, then the numbers.
    tape: Tape,
}

impl Sampler {
    /// Prepares the evaluation of `outputs` at random points of the mechanism's motion.
    pub(crate) fn new(
        graph: &mut Graph,
        mechanism: &Mechanism,
        projection: &Projection,
        outputs: &[ExprId],
    ) -> Result<Self, DeriveError> {
        let plan = plan(graph, projection, Unknowns::Any, &mut |_, _| true).ok_or_else(|| {
            DeriveError::LoopsNotSampled {
                loops: projection.closures.iter().map(|c| c.name.clone()).collect(),
            }
        })?;
        let mut all = outputs.to_vec();
        all.extend(&projection.passive_rates);
        all.extend(&projection.passive_accelerations);
        let steps = plan
            .steps
            .into_iter()
            .map(|step| {
                let solved = step.solved;
                let mut angles: Vec<(AngleSum, [ExprId; 2])> = solved.angles;
                let mut numbers: Vec<(usize, ExprId)> = solved.lengths;
                for relation in &solved.relations {
                    let (c, s) = graph.cos_sin(&relation.sum, relation.pi12);
                    let angle = AngleSum::new([(Atom::Coordinate(relation.coordinate), 1)]);
                    angles.push((angle, [c, s]));
                    numbers.push((relation.coordinate, relation.value(graph)));
                }
                let mut roots: Vec<ExprId> = angles.iter().flat_map(|(_, cs)| *cs).collect();
                roots.extend(numbers.iter().map(|(_, value)| *value));
                all.extend(&roots);
                SolveStep {
                    unknown: step.unknown,
                    angles: angles.into_iter().map(|(angle, _)| angle).collect(),
                    numbers: numbers.iter().map(|(i, _)| *i).collect(),
                    tape: Tape::new(graph, &roots),
                }
            })
            .collect();
        let coordinates = mechanism
            .coordinates
            .iter()
            .enumerate()
            .map(|(i, c)| (i, c.motion))
            .collect();
        let of_constants = functions_of_constants(graph, &all);
        Ok(Self {
            coordinates,
            n_drives: mechanism.drives.len(),
            active: projection.active.clone(),
            passive: projection.passive.clone(),
            n_constants: mechanism.constants.len(),
            of_constants,
            steps,
            rates: Tape::new(graph, &projection.passive_rates),
            accelerations: Tape::new(graph, &projection.passive_accelerations),
            outputs: Tape::new(graph, outputs),
        })
    }

    /// Random constants whose functions that do not depend on the motion all exist.
    pub(crate) fn constants<const P: u64>(
        &self,
        stream: &mut Stream,
    ) -> Result<FieldPoint<P>, DeriveError> {
        (0..MOST_DRAWS)
            .find_map(|_| {
                let mut point = FieldPoint {
                    seed: stream.bits(),
                    root_seed: stream.bits(),
                    ..FieldPoint::default()
                };
                point.values.insert(Atom::Pi, stream.element());
                for i in 0..self.n_constants {
                    let atom = Atom::Constant(i);
                    point.values.insert(atom, stream.element());
                    point.angles.insert(atom, stream.circle());
                }
                self.of_constants.evaluate(&point).map(|_| point)
            })
            .ok_or(DeriveError::NoPointFound { draws: MOST_DRAWS })
    }

    /// Values of the outputs at a random point of motion, for the given constants.
    pub(crate) fn draw<const P: u64>(
        &self,
        constants: &FieldPoint<P>,
        stream: &mut Stream,
    ) -> Result<Vec<Element<P>>, DeriveError> {
        (0..MOST_DRAWS)
            .find_map(|_| self.try_draw(constants, stream))
            .ok_or(DeriveError::NoPointFound { draws: MOST_DRAWS })
    }

    fn try_draw<const P: u64>(
        &self,
        constants: &FieldPoint<P>,
        stream: &mut Stream,
    ) -> Option<Vec<Element<P>>> {
        let mut point = constants.clone();
        for (i, motion) in &self.coordinates {
            if *motion == Motion::Revolute {
                point.angles.insert(Atom::Coordinate(*i), stream.circle());
            }
            point.values.insert(Atom::Coordinate(*i), stream.element());
        }
        for a in &self.active {
            point.values.insert(Atom::Rate(*a), stream.element());
            point
                .values
                .insert(Atom::Acceleration(*a), stream.element());
        }
        for d in 0..self.n_drives {
            point.values.insert(Atom::Load(d), stream.element());
        }
        for step in &self.steps {
            step.solve(&mut point)?;
        }
        for (p, value) in self.passive.iter().zip(self.rates.evaluate(&point)?) {
            point.values.insert(Atom::Rate(*p), value);
        }
        for (p, value) in self
            .passive
            .iter()
            .zip(self.accelerations.evaluate(&point)?)
        {
            point.values.insert(Atom::Acceleration(*p), value);
        }
        self.outputs.evaluate(&point)
    }
}

/// Functions under `roots` that depend on constants alone and do not exist for all of them.
fn functions_of_constants(graph: &Graph, roots: &[ExprId]) -> Tape {
    let mut moves = vec![false; graph.len()];
    let mut found = Vec::new();
    for (i, needed) in graph.reachable(roots).into_iter().enumerate() {
        if !needed {
            continue;
        }
        let id = ExprId(u32::try_from(i).expect("graph below 4G nodes"));
        let is_fixed = |atom: Atom| matches!(atom, Atom::Constant(_) | Atom::Pi);
        let mut moving = match graph.node(id) {
            Node::Atom(atom) => !is_fixed(*atom),
            Node::Sin(angle) | Node::Cos(angle) => !angle.atoms().all(is_fixed),
            _ => false,
        };
        graph.for_each_child(id, |child| moving |= moves[child.index()]);
        moves[i] = moving;
        let partial = match graph.node(id) {
            Node::Unary(function, _) => *function == Unary::Sqrt,
            Node::Product(factors) => factors.iter().any(|(_, n)| *n < 0),
            _ => false,
        };
        if partial && !moving {
            found.push(id);
        }
    }
    Tape::new(graph, &found)
}

impl SolveStep {
    fn solve<const P: u64>(&self, point: &mut FieldPoint<P>) -> Option<()> {
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
                let (cr, sr) = crate::expr::Domain::cos_sin(point, &rest)?;
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
