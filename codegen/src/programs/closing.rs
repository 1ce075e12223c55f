//! Closes expressions over the active coordinates: passive positions by their closed form, passive rates and
//! accelerations by the differentiated closure equations.

use std::collections::BTreeMap;

use modelmill_spec::Mechanism;
use rayon::prelude::*;

use crate::DeriveError;
use crate::expr::{Atom, AtomAngleSum, ExprId, Graph, Node, nominal_value};
use crate::loops::branches::closed_form_plan;
use crate::loops::magnitude::{self, LoopSize};
use crate::loops::solve_step::LoopPlan;
use crate::loops::solved::{multiply_angle, rotate_vector};
use crate::lower::SINGULAR;
use crate::lower::cost::cost;
use crate::lower::{
    AtomDefinition, AtomRule, LoweringPass, LoweringRequest, PASSES, StraightLineProgram, lower_with_passes,
};
use crate::regressor::UnreducedEquations;
use crate::tree::checks;

/// Programs of smaller graphs are lowered one after the other: they take some milliseconds, and each thread reserves memory
/// of its own, which a limit of address space counts. By judgement.
const FEWEST_NODES_AT_ONCE: usize = 20_000;

/// Replaces passive coordinates, rates and accelerations in expressions.
#[derive(Clone)]
pub(crate) struct PassiveClosure {
    /// The order in which the loops are solved, if they have closed forms.
    plan: Option<LoopPlan>,
    /// Rules for passive angles whose value is read or that are coupled to others.
    definitions: Vec<AtomDefinition>,
    /// Radicands that must not be negative.
    reachable: Vec<ExprId>,
    /// Replacements of passive lengths and of angles that are sums of known ones.
    position: BTreeMap<ExprId, ExprId>,
    /// Cosine and sine of solved sums of angles.
    solved: Vec<[ExprId; 2]>,
    /// Every passive angle as a sum of solved and known ones.
    angle_of: BTreeMap<usize, ResolvedAngle>,
    /// Determinants with the magnitudes of their terms.
    regular: Vec<(ExprId, ExprId)>,
    /// Size of the loops, for these magnitudes.
    size: LoopSize,
    /// Whether effects may have no finite value at some states.
    may_be_undefined: bool,
    /// The passes of lowering to use.
    passes: &'static [LoweringPass],
}

/// An angle as a sum of known angles, a multiple of pi/12, and solved sums by index.
/// Sum of known angles.
#[derive(Clone, Debug, Default)]
struct ResolvedAngle {
    /// Multiple of pi/12.
    known: AtomAngleSum,
    /// Indices of solved sums with their integer factors.
    pi12: i32,
    solved: Vec<(usize, i32)>,
}

/// The nearest integer number of quarter turns of an angle in rad.
fn quarter_turns(angle: f64) -> i32 {
    #[expect(clippy::cast_possible_truncation, reason = "bounded")]
    let quarters = (angle / std::f64::consts::FRAC_PI_2).round().clamp(-1e8, 1e8) as i32;
    quarters
}

impl PassiveClosure {
    /// Prepares the closure. Fails with `SingularNominal` if a determinant is zero at the nominal pose.
    pub(crate) fn new(
        graph: &mut Graph,
        mechanism: &Mechanism,
        equations: &UnreducedEquations,
    ) -> Result<Self, DeriveError> {
        let mut closing = Self {
            plan: closed_form_plan(graph, mechanism, &equations.projection.loops),
            definitions: Vec::new(),
            reachable: Vec::new(),
            position: BTreeMap::new(),
            solved: Vec::new(),
            angle_of: BTreeMap::new(),
            regular: Vec::new(),
            size: LoopSize::from_residual(graph, mechanism, &equations.projection.loops.residual),
            may_be_undefined: checks::may_be_undefined(mechanism),
            passes: &PASSES,
        };
        // A small determinant is singular only if its digits are significant.
        for id in &equations.projection.determinants {
            let limit = SINGULAR * magnitude::nominal_magnitude(graph, mechanism, &[*id]);
            let is_small = |value: f64| value.abs() <= limit;
            if nominal_value(graph, mechanism, *id).is_some_and(is_small)
                && magnitude::significant_digits(graph, mechanism, *id).is_none_or(|left| left <= SINGULAR)
            {
                return Err(DeriveError::SingularNominal);
            }
            let size = closing.size.determinant_magnitude(graph, mechanism, *id, SINGULAR);
            closing.regular.push((*id, size));
        }
        let Some(plan) = closing.plan.clone() else {
            return Ok(closing);
        };
        // Steps in order: each makes its unknowns known for the following ones.
        for step in &plan.steps {
            // The closed form of earlier unknowns is put into this step's expressions.
            let mut roots: Vec<ExprId> = step.solved.angles.iter().flat_map(|(_, cs)| *cs).collect();
            roots.extend(step.solved.values.iter().map(|(_, value)| *value));
            roots.extend(step.solved.root.iter().map(|root| root.radicand));
            // Angles, then values, then the radicand, in this order.
            let closed = closing.close_position(graph, &roots);
            let n_angles = step.solved.angles.len();
            let first = closing.solved.len();
            closing
                .solved
                .extend(closed[..2 * n_angles].chunks(2).map(|cs| [cs[0], cs[1]]));
            // Values of the step: angles become definitions, lengths replacements.
            for ((coordinate, _), value) in step.solved.values.iter().zip(&closed[2 * n_angles..]) {
                let atom = Atom::Coordinate(*coordinate);
                if mechanism.coordinates[*coordinate].motion.is_angle() {
                    let by = AtomRule::Value(*value);
                    closing.definitions.push(AtomDefinition { atom, rule: by });
                } else {
                    closing.position.insert(graph.atom(atom), *value);
                }
            }
            closing
                .reachable
                .extend(step.solved.root.iter().map(|_| closed[closed.len() - 1]));
            // The sums of angles that the step solves for.
            let angles: Vec<AtomAngleSum> = step.solved.angles.iter().map(|(angle, _)| angle.clone()).collect();
            // Single angles from the solved sums of this step.
            closing.resolve_angles(step.unknown.clone(), &angles, first);
            for relation in &step.solved.relations {
                let parts = closing.resolve_sum(&relation.sum, relation.pi12);
                closing.angle_of.insert(relation.coordinate, parts);
            }
        }
        // Passive angles: known sums are replaced directly, others are computed from sine and cosine if their value is
        // read.
        for p in &equations.projection.loops.passive {
            if closing.angle_of.contains_key(p) {
                let parts = &closing.angle_of[p];
                if parts.solved.is_empty() {
                    let value = graph.angle(&parts.known, parts.pi12);
                    let atom = graph.atom(Atom::Coordinate(*p));
                    closing.position.insert(atom, value);
                    continue;
                }
                // A coupled coordinate has its value already; sine and cosine would lose whole turns.
                let atom = Atom::Coordinate(*p);
                if closing.definitions.iter().any(|d| d.atom == atom) {
                    continue;
                }
                let [cosine, sine] = closing.cos_sin(graph, &AtomAngleSum::new([(atom, 1)]));
                // The angle is computed relative to the quarter turn of the nominal pose.
                let quarters = quarter_turns(mechanism.coordinates[*p].nominal);
                let back = graph.cos_sin(&AtomAngleSum::NONE, -6 * quarters);
                let [cosine, sine] = rotate_vector(graph, [back.0, back.1], [cosine, sine]);
                closing.definitions.push(AtomDefinition {
                    atom,
                    rule: AtomRule::Turn { quarters, sine, cosine },
                });
            }
        }
        Ok(closing)
    }

    /// Adds determinants to the guards, if they are new.
    pub(crate) fn add_guards(&mut self, graph: &mut Graph, mechanism: &Mechanism, more: &[ExprId]) {
        for id in more {
            if self.regular.iter().all(|(known, _)| known != id) {
                let size = self.size.determinant_magnitude(graph, mechanism, *id, SINGULAR);
                self.regular.push((*id, size));
            }
        }
    }

    /// Uses only the given passes of lowering, to count what each of them saves.
    pub(crate) fn limit_passes(&mut self, passes: &'static [LoweringPass]) {
        self.passes = passes;
    }

    /// The closed-form solution of all loops, if there is one.
    pub(crate) fn plan(&self) -> Option<&LoopPlan> {
        self.plan.as_ref()
    }

    /// Writes every unknown angle as a sum of solved sums and known coordinates. `first` is the index of the first of
    /// `angles` among the solved sums.
    fn resolve_angles(&mut self, mut unknown: Vec<usize>, angles: &[AtomAngleSum], first: usize) {
        let mut progress = true;
        while progress {
            progress = false;
            for (k, angle) in angles.iter().enumerate() {
                // A solved sum with a single unknown determines it.
                let inside: Vec<_> = angle
                    .terms()
                    .iter()
                    .filter(|(atom, _)| matches!(atom, Atom::Coordinate(i) if unknown.contains(i)))
                    .collect();
                let &[(atom @ Atom::Coordinate(i), sign)] = inside.as_slice() else {
                    continue;
                };
                // q = sign * (solved - rest)
                let rest = self.resolve_sum(&angle.plus(&AtomAngleSum::new([(*atom, *sign)]), -1), 0);
                let mut parts = ResolvedAngle {
                    known: AtomAngleSum::NONE.plus(&rest.known, -sign),
                    pi12: -sign * rest.pi12,
                    solved: rest.solved.into_iter().map(|(s, n)| (s, -n * sign)).collect(),
                };
                parts.solved.push((first + k, *sign));
                self.angle_of.insert(*i, parts);
                unknown.retain(|u| u != i);
                progress = true;
            }
        }
    }

    /// A sum of angles in which passive coordinates are replaced by their own sums.
    fn resolve_sum(&self, sum: &AtomAngleSum, pi12: i32) -> ResolvedAngle {
        let mut known = AtomAngleSum::NONE;
        let mut pi12 = pi12;
        let mut solved: BTreeMap<usize, i32> = BTreeMap::new();
        for (atom, n) in sum.terms() {
            match atom {
                Atom::Coordinate(i) if self.angle_of.contains_key(i) => {
                    let inner = &self.angle_of[i];
                    known = known.plus(&inner.known, *n);
                    pi12 += inner.pi12 * n;
                    for (piece, m) in &inner.solved {
                        *solved.entry(*piece).or_insert(0) += m * n;
                    }
                }
                _ => known = known.plus(&AtomAngleSum::new([(*atom, 1)]), *n),
            }
        }
        ResolvedAngle {
            known,
            pi12,
            solved: solved.into_iter().filter(|(_, n)| *n != 0).collect(),
        }
    }

    /// Cosine and sine of a sum of angles, by the addition theorems.
    fn cos_sin(&self, graph: &mut Graph, sum: &AtomAngleSum) -> [ExprId; 2] {
        let parts = self.resolve_sum(sum, 0);
        let (c, s) = graph.cos_sin(&parts.known, parts.pi12);
        let mut total = [c, s];
        // Solved sums are added one after the other.
        for (piece, n) in parts.solved {
            let turned = multiply_angle(graph, self.solved[piece], n.into());
            total = rotate_vector(graph, total, turned);
        }
        total
    }

    /// Replaces passive positions in expressions by their closed form.
    fn close_position(&self, graph: &mut Graph, roots: &[ExprId]) -> Vec<ExprId> {
        let mut replacements = self.position.clone();
        // Sines and cosines that contain passive angles.
        let trigonometric: Vec<(Node, AtomAngleSum)> = graph
            .nodes_of(roots)
            .filter_map(|node| match node {
                Node::Sin(angle) | Node::Cos(angle)
                    if angle
                        .atoms()
                        .any(|a| matches!(a, Atom::Coordinate(i) if self.angle_of.contains_key(&i))) =>
                {
                    Some((node.clone(), angle.clone()))
                }
                _ => None,
            })
            .collect();
        for (node, angle) in trigonometric {
            let [c, s] = self.cos_sin(graph, &angle);
            let (cosine, sine) = graph.cos_sin(&angle, 0);
            match node {
                Node::Cos(_) => replacements.insert(cosine, c),
                _ => replacements.insert(sine, s),
            };
        }
        graph.substitute(roots, &replacements)
    }

    /// The definitions of atoms that some expressions need, directly or through other definitions.
    fn definitions(&self, graph: &Graph, roots: &[ExprId]) -> Vec<AtomDefinition> {
        let mut used = graph.atoms(roots);
        // Guards may need definitions too.
        used.extend(graph.atoms(&self.reachable));
        let (mut found, mut left): (Vec<AtomDefinition>, _) = (Vec::new(), self.definitions.clone());
        loop {
            let (next, rest): (Vec<AtomDefinition>, Vec<AtomDefinition>) =
                left.into_iter().partition(|d| used.contains(&d.atom));
            if next.is_empty() {
                return found;
            }
            for definition in &next {
                used.extend(graph.atoms(&definition.rule.operands()));
            }
            found.extend(next);
            left = rest;
        }
    }

    /// Closes some expressions over the active coordinates and lowers them to a program.
    pub(crate) fn program(
        &self,
        graph: &mut Graph,
        equations: &UnreducedEquations,
        outputs: &[ExprId],
    ) -> StraightLineProgram {
        self.program_at(graph, equations, outputs, &BTreeMap::new())
    }

    /// Closes several lists of expressions in their order, and lowers them all at once.
    pub(crate) fn lower_all(
        &self,
        graph: &mut Graph,
        equations: &UnreducedEquations,
        outputs: &[Vec<ExprId>],
    ) -> Vec<StraightLineProgram> {
        let nothing = BTreeMap::new();
        let closed: Vec<ClosedOutputs> = (outputs.iter())
            .map(|outputs| self.close(graph, equations, outputs, &nothing))
            .collect();
        let graph = &*graph;
        if graph.len() < FEWEST_NODES_AT_ONCE {
            return closed.iter().map(|closed| self.lower(graph, closed)).collect();
        }
        closed
            .into_par_iter()
            .map(|closed| self.lower(graph, &closed))
            .collect()
    }

    /// Cost of a program of some expressions, in additions. In an open chain the expressions themselves are counted:
    /// closing changes nothing and lowering saves little, and that takes a small part of the time.
    pub(crate) fn program_cost(
        &self,
        graph: &mut Graph,
        equations: &UnreducedEquations,
        outputs: &[ExprId],
        known: &BTreeMap<ExprId, ExprId>,
    ) -> usize {
        if equations.projection.loops.passive.is_empty() {
            cost(graph, outputs)
        } else {
            self.program_at(graph, equations, outputs, known).weight()
        }
    }

    /// A program with some rates and accelerations replaced by `known` expressions, such as zero.
    pub(crate) fn program_at(
        &self,
        graph: &mut Graph,
        equations: &UnreducedEquations,
        outputs: &[ExprId],
        known: &BTreeMap<ExprId, ExprId>,
    ) -> StraightLineProgram {
        let closed = self.close(graph, equations, outputs, known);
        self.lower(graph, &closed)
    }

    /// Closes some expressions over the active coordinates.
    fn close(
        &self,
        graph: &mut Graph,
        equations: &UnreducedEquations,
        outputs: &[ExprId],
        known: &BTreeMap<ExprId, ExprId>,
    ) -> ClosedOutputs {
        let projection = &equations.projection;
        // Rates first, because accelerations depend on them.
        let passive_rates = graph.substitute(&projection.passive_rates, known);
        let mut rates: BTreeMap<ExprId, ExprId> = projection
            .loops
            .passive
            .iter()
            .zip(passive_rates)
            .map(|(p, rate)| (graph.atom(Atom::Rate(*p)), rate))
            .collect();
        rates.extend(known);
        let accelerations = graph.substitute(&projection.passive_accelerations, &rates);
        let mut motion = rates;
        for (p, acceleration) in projection.loops.passive.iter().zip(accelerations) {
            motion.insert(graph.atom(Atom::Acceleration(*p)), acceleration);
        }
        // Outputs and determinants are closed together, so that they share expressions.
        let mut roots = graph.substitute(outputs, &motion);
        let n = roots.len();
        roots.extend(self.regular.iter().map(|(id, _)| *id));
        roots = self.close_position(graph, &roots);
        let (outputs, regular) = roots.split_at(n);
        let definitions = self.definitions(graph, &roots);
        let regular: Vec<(ExprId, ExprId)> = regular
            .iter()
            .copied()
            .zip(&self.regular)
            .filter_map(|(closed, (_, size))| {
                // A constant that is not zero needs no guard, and a rational factor is moved to the size.
                let (base, factor) = graph.split_factor(closed);
                let varies = base != Graph::ONE || factor.is_zero();
                varies.then(|| (base, graph.scale(*size, &factor.abs().recip())))
            })
            .collect();
        ClosedOutputs {
            outputs: outputs.to_vec(),
            regular,
            definitions,
        }
    }

    /// Lowers closed expressions to a program.
    fn lower(&self, graph: &Graph, closed: &ClosedOutputs) -> StraightLineProgram {
        lower_with_passes(
            graph,
            self.passes,
            &LoweringRequest {
                may_be_undefined: self.may_be_undefined,
                outputs: &closed.outputs,
                reachable: &self.reachable,
                regular: &closed.regular,
                definitions: &closed.definitions,
            },
        )
    }
}

/// Expressions that depend on active coordinates only, ready to be lowered.
struct ClosedOutputs {
    /// The expressions.
    outputs: Vec<ExprId>,
    /// Determinants that must not vanish, with their sizes.
    regular: Vec<(ExprId, ExprId)>,
    /// Passive coordinates.
    definitions: Vec<AtomDefinition>,
}
