//! Random points of a mechanism's motion in the prime field: angles as rational points of the circle, loops solved by
//! square roots in the field (drawn again until they exist), rates and accelerations from the differentiated loops.
//!
//! Which coordinates are drawn freely does not matter for linear dependence, so those are drawn that make every loop
//! a dyad.

use modelmill_spec::{Mechanism, Motion};

use crate::DeriveError;
use crate::dyad::{self, Solved};
use crate::expr::{AngleSum, Atom, ExprId, FieldPoint, Graph, Tape};
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
pub(crate) fn plan(
    graph: &mut Graph,
    projection: &Projection,
    unknowns: Unknowns,
    positive: &mut dyn FnMut(&Graph, ExprId) -> bool,
) -> Option<Plan> {
    let mut steps = Vec::new();
    let mut fixed = Vec::new();
    let mut todo: Vec<usize> = (0..projection.closures.len()).collect();
    search(
        graph, projection, unknowns, positive, &mut todo, &mut fixed, &mut steps,
    )
    .then_some(Plan { steps })
}

fn search(
    graph: &mut Graph,
    projection: &Projection,
    unknowns: Unknowns,
    positive: &mut dyn FnMut(&Graph, ExprId) -> bool,
    todo: &mut Vec<usize>,
    fixed: &mut Vec<usize>,
    steps: &mut Vec<PlanStep>,
) -> bool {
    if todo.is_empty() {
        return true;
    }
    let may_be_unknown = |c: usize| unknowns == Unknowns::Any || projection.passive.contains(&c);
    for position in 0..todo.len() {
        let index = todo[position];
        let closure = &projection.closures[index];
        let coordinates = closure.coordinates.clone();
        // Coordinates that a later loop solves for must not be needed here.
        let candidates: Vec<usize> = coordinates
            .iter()
            .copied()
            .filter(|c| may_be_unknown(*c) && !fixed.contains(c))
            .collect();
        let mut choices: Vec<Vec<usize>> = Vec::new();
        if closure.relations.is_empty() {
            for (i, a) in candidates.iter().enumerate() {
                choices.extend(candidates[i + 1..].iter().map(|b| vec![*a, *b]));
            }
            choices.sort_by_key(|pair| {
                pair.iter()
                    .filter(|c| !projection.passive.contains(c))
                    .count()
            });
        } else {
            let related: Vec<usize> = closure.relations.iter().map(|r| r.coordinate).collect();
            choices.extend(
                related
                    .iter()
                    .all(|c| candidates.contains(c))
                    .then_some(related),
            );
        }
        for unknown in choices {
            let is_known = |c: &usize| {
                unknowns == Unknowns::Any
                    || projection.active.contains(c)
                    || unknown.contains(c)
                    || fixed.contains(c)
            };
            if !coordinates.iter().all(is_known) {
                continue;
            }
            let closure = projection.closures[index].clone();
            let Some(mut solved) = dyad::solve(graph, &closure, &unknown, true) else {
                continue;
            };
            if let Some(root) = solved.root
                && !positive(graph, root.witness)
            {
                let Some(negative) = dyad::solve(graph, &closure, &unknown, false) else {
                    continue;
                };
                solved = negative;
            }
            let known_before = fixed.len();
            fixed.extend(
                coordinates
                    .iter()
                    .filter(|c| !fixed.contains(c))
                    .copied()
                    .collect::<Vec<_>>(),
            );
            todo.remove(position);
            steps.push(PlanStep {
                unknown: unknown.clone(),
                solved,
            });
            if search(graph, projection, unknowns, positive, todo, fixed, steps) {
                return true;
            }
            steps.pop();
            todo.insert(position, index);
            fixed.truncate(known_before);
        }
    }
    false
}

/// Draws points.
pub(crate) struct Sampler {
    coordinates: Vec<(usize, Motion)>,
    n_drives: usize,
    active: Vec<usize>,
    passive: Vec<usize>,
    constants: Vec<(Atom, bool)>,
    steps: Vec<SolveStep>,
    rates: Tape,
    accelerations: Tape,
    outputs: Tape,
}

struct SolveStep {
    unknown: Vec<usize>,
    angles: Vec<AngleSum>,
    lengths: Vec<usize>,
    /// Cosines and sines of the angles in pairs, then the lengths.
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
        let steps = plan
            .steps
            .into_iter()
            .map(|step| {
                let solved = step.solved;
                let mut angles: Vec<(AngleSum, [ExprId; 2])> = solved.angles;
                for relation in &solved.relations {
                    let (c, s) = graph.cos_sin(&relation.sum, relation.pi12);
                    let angle = AngleSum::new([(Atom::Coordinate(relation.coordinate), 1)]);
                    angles.push((angle, [c, s]));
                }
                let mut roots: Vec<ExprId> = angles.iter().flat_map(|(_, cs)| *cs).collect();
                roots.extend(solved.lengths.iter().map(|(_, value)| *value));
                SolveStep {
                    unknown: step.unknown,
                    angles: angles.into_iter().map(|(angle, _)| angle).collect(),
                    lengths: solved.lengths.iter().map(|(i, _)| *i).collect(),
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
        let constants = mechanism
            .constants
            .iter()
            .enumerate()
            .map(|(i, c)| (Atom::Constant(i), c.is_angle))
            .collect();
        Ok(Self {
            coordinates,
            n_drives: mechanism.drives.len(),
            active: projection.active.clone(),
            passive: projection.passive.clone(),
            constants,
            steps,
            rates: Tape::new(graph, &projection.passive_rates),
            accelerations: Tape::new(graph, &projection.passive_accelerations),
            outputs: Tape::new(graph, outputs),
        })
    }

    /// Random constants.
    pub(crate) fn constants(&self, stream: &mut Stream) -> FieldPoint {
        let mut point = FieldPoint {
            root_seed: stream.element().representative(),
            ..FieldPoint::default()
        };
        point.values.insert(Atom::Pi, stream.element());
        for (atom, is_angle) in &self.constants {
            point.values.insert(*atom, stream.element());
            if *is_angle {
                point.angles.insert(*atom, stream.circle());
            }
        }
        point
    }

    /// Values of the outputs at a random point of motion, for the given constants.
    pub(crate) fn draw(
        &self,
        constants: &FieldPoint,
        stream: &mut Stream,
    ) -> Result<Vec<Element>, DeriveError> {
        (0..MOST_DRAWS)
            .find_map(|_| self.try_draw(constants, stream))
            .ok_or(DeriveError::NoPointFound { draws: MOST_DRAWS })
    }

    fn try_draw(&self, constants: &FieldPoint, stream: &mut Stream) -> Option<Vec<Element>> {
        let mut point = constants.clone();
        point.seed = stream.element().representative();
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

impl SolveStep {
    fn solve(&self, point: &mut FieldPoint) -> Option<()> {
        let values = self.tape.evaluate(point)?;
        let lengths = &values[2 * self.angles.len()..];
        for (i, value) in self.lengths.iter().zip(lengths) {
            point.values.insert(Atom::Coordinate(*i), *value);
        }
        let mut unknown: Vec<usize> = self
            .unknown
            .iter()
            .copied()
            .filter(|c| !self.lengths.contains(c))
            .collect();
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
