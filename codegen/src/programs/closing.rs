//! Closes expressions over the active coordinates: passive positions by their closed form, passive rates and
//! accelerations from the differentiated loops.

use std::collections::BTreeMap;

use modelmill_spec::Mechanism;

use crate::DeriveError;
use crate::expr::{AngleSum, Atom, ExprId, Graph, Node, nominal_value};
use crate::loops::branches::closed_form;
use crate::loops::magnitude::{self, Size};
use crate::loops::solve_step::Plan;
use crate::loops::solved::{times, turn};
use crate::lower::SINGULAR;
use crate::lower::cost::cost;
use crate::lower::{By, Definition, PASSES, Pass, Program, Request, lower_by};
use crate::regressor::Equations;
use crate::tree::checks;

/// Puts the passive coordinates' closed form, rates and accelerations in place.
#[derive(Clone)]
pub(crate) struct Closing {
    /// The order in which the loops are solved, if they have closed forms.
    plan: Option<Plan>,
    /// How passive angles are computed, where their values are asked for or follow others.
    definitions: Vec<Definition>,
    reachable: Vec<ExprId>,
    /// Nodes replaced by the position's closed form.
    position: BTreeMap<ExprId, ExprId>,
    /// Sums of angles whose cosine and sine are known, and what every passive angle is made of.
    solved: Vec<[ExprId; 2]>,
    angle_of: BTreeMap<usize, AngleParts>,
    /// Determinants, with the magnitudes of their terms.
    regular: Vec<(ExprId, ExprId)>,
    size: Size,
    /// Whether effects may have no finite value at some states.
    may_be_undefined: bool,
    /// The passes of lowering that are used.
    passes: &'static [Pass],
}

/// An angle as a sum of known angles, a multiple of pi/12, and solved angles by position.
#[derive(Clone, Debug, Default)]
struct AngleParts {
    known: AngleSum,
    pi12: i32,
    solved: Vec<(usize, i32)>,
}

/// The whole number of quarter turns that is nearest to an angle.
fn quarter_turns(angle: f64) -> i32 {
    #[expect(clippy::cast_possible_truncation, reason = "bounded")]
    let quarters = (angle / std::f64::consts::FRAC_PI_2)
        .round()
        .clamp(-1e8, 1e8) as i32;
    quarters
}

impl Closing {
    pub(crate) fn new(
        graph: &mut Graph,
        mechanism: &Mechanism,
        equations: &Equations,
    ) -> Result<Self, DeriveError> {
        let mut closing = Self {
            plan: closed_form(graph, mechanism, &equations.projection.loops),
            definitions: Vec::new(),
            reachable: Vec::new(),
            position: BTreeMap::new(),
            solved: Vec::new(),
            angle_of: BTreeMap::new(),
            regular: Vec::new(),
            size: Size::from_residual(graph, mechanism, &equations.projection.loops.residual),
            may_be_undefined: checks::may_be_undefined(mechanism),
            passes: &PASSES,
        };
        for id in &equations.projection.determinants {
            let limit = SINGULAR * magnitude::at_nominal(graph, mechanism, &[*id]);
            let is_small = |value: f64| value.abs() <= limit;
            if nominal_value(graph, mechanism, *id).is_some_and(is_small)
                && magnitude::digits_left(graph, mechanism, *id).is_none_or(|left| left <= SINGULAR)
            {
                return Err(DeriveError::SingularNominal);
            }
            let size = closing.size.of_determinant(graph, mechanism, *id, SINGULAR);
            closing.regular.push((*id, size));
        }
        let Some(plan) = closing.plan.clone() else {
            return Ok(closing);
        };
        for step in &plan.steps {
            // Earlier steps' unknowns are known by now; their closed form goes into this step's expressions.
            let mut roots: Vec<ExprId> =
                step.solved.angles.iter().flat_map(|(_, cs)| *cs).collect();
            roots.extend(step.solved.values.iter().map(|(_, value)| *value));
            roots.extend(step.solved.root.iter().map(|root| root.radicand));
            let closed = closing.close_position(graph, &roots);
            let n_angles = step.solved.angles.len();
            let first = closing.solved.len();
            closing
                .solved
                .extend(closed[..2 * n_angles].chunks(2).map(|cs| [cs[0], cs[1]]));
            for ((coordinate, _), value) in step.solved.values.iter().zip(&closed[2 * n_angles..]) {
                let atom = Atom::Coordinate(*coordinate);
                if mechanism.coordinates[*coordinate].motion.is_angle() {
                    let by = By::Value(*value);
                    closing.definitions.push(Definition { atom, by });
                } else {
                    closing.position.insert(graph.atom(atom), *value);
                }
            }
            closing
                .reachable
                .extend(step.solved.root.iter().map(|_| closed[closed.len() - 1]));
            let angles: Vec<AngleSum> = step
                .solved
                .angles
                .iter()
                .map(|(angle, _)| angle.clone())
                .collect();
            closing.resolve(step.unknown.clone(), &angles, first);
            for relation in &step.solved.relations {
                let parts = closing.split(&relation.sum, relation.pi12);
                closing.angle_of.insert(relation.coordinate, parts);
            }
        }
        for p in &equations.projection.loops.passive {
            if closing.angle_of.contains_key(p) {
                let parts = &closing.angle_of[p];
                if parts.solved.is_empty() {
                    let value = graph.angle(&parts.known, parts.pi12);
                    let atom = graph.atom(Atom::Coordinate(*p));
                    closing.position.insert(atom, value);
                    continue;
                }
                // A follower has its value; its turn alone would not say how often it went round.
                let atom = Atom::Coordinate(*p);
                if closing.definitions.iter().any(|d| d.atom == atom) {
                    continue;
                }
                let [cosine, sine] = closing.cos_sin(graph, &AngleSum::new([(atom, 1)]));
                let quarters = quarter_turns(mechanism.coordinates[*p].nominal);
                let back = graph.cos_sin(&AngleSum::NONE, -6 * quarters);
                let [cosine, sine] = turn(graph, [back.0, back.1], [cosine, sine]);
                closing.definitions.push(Definition {
                    atom,
                    by: By::Turn {
                        quarters,
                        sine,
                        cosine,
                    },
                });
            }
        }
        Ok(closing)
    }

    /// Guards further determinants.
    pub(crate) fn guard(&mut self, graph: &mut Graph, mechanism: &Mechanism, more: &[ExprId]) {
        for id in more {
            if self.regular.iter().all(|(known, _)| known != id) {
                let size = self.size.of_determinant(graph, mechanism, *id, SINGULAR);
                self.regular.push((*id, size));
            }
        }
    }

    /// Uses some passes of lowering only, to see what the others do.
    pub(crate) fn limit_passes(&mut self, passes: &'static [Pass]) {
        self.passes = passes;
    }

    /// How every loop is solved in closed form, if all of them are.
    pub(crate) fn plan(&self) -> Option<&Plan> {
        self.plan.as_ref()
    }

    /// Writes every unknown angle as a sum of solved angles and known coordinates.
    fn resolve(&mut self, mut unknown: Vec<usize>, angles: &[AngleSum], first: usize) {
        let mut progress = true;
        while progress {
            progress = false;
            for (k, angle) in angles.iter().enumerate() {
                let inside: Vec<_> = angle
                    .terms()
                    .iter()
                    .filter(|(atom, _)| matches!(atom, Atom::Coordinate(i) if unknown.contains(i)))
                    .collect();
                let &[(atom @ Atom::Coordinate(i), sign)] = inside.as_slice() else {
                    continue;
                };
                // q = sign * (solved - rest)
                let rest = self.split(&angle.plus(&AngleSum::new([(*atom, *sign)]), -1), 0);
                let mut parts = AngleParts {
                    known: AngleSum::NONE.plus(&rest.known, -sign),
                    pi12: -sign * rest.pi12,
                    solved: rest
                        .solved
                        .into_iter()
                        .map(|(s, n)| (s, -n * sign))
                        .collect(),
                };
                parts.solved.push((first + k, *sign));
                self.angle_of.insert(*i, parts);
                unknown.retain(|u| u != i);
                progress = true;
            }
        }
    }

    /// A sum of angles with its passive coordinates put by what they are made of.
    fn split(&self, sum: &AngleSum, pi12: i32) -> AngleParts {
        let mut known = AngleSum::NONE;
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
                _ => known = known.plus(&AngleSum::new([(*atom, 1)]), *n),
            }
        }
        AngleParts {
            known,
            pi12,
            solved: solved.into_iter().filter(|(_, n)| *n != 0).collect(),
        }
    }

    /// Cosine and sine of a sum of angles, by the addition theorem.
    fn cos_sin(&self, graph: &mut Graph, sum: &AngleSum) -> [ExprId; 2] {
        let parts = self.split(sum, 0);
        let (c, s) = graph.cos_sin(&parts.known, parts.pi12);
        let mut total = [c, s];
        for (piece, n) in parts.solved {
            let turned = times(graph, self.solved[piece], n.into());
            total = turn(graph, total, turned);
        }
        total
    }

    /// Replaces passive positions by their closed form.
    fn close_position(&self, graph: &mut Graph, roots: &[ExprId]) -> Vec<ExprId> {
        let mut replacements = self.position.clone();
        let trigonometric: Vec<(Node, AngleSum)> = graph
            .nodes_of(roots)
            .filter_map(|node| match node {
                Node::Sin(angle) | Node::Cos(angle)
                    if angle.atoms().any(
                        |a| matches!(a, Atom::Coordinate(i) if self.angle_of.contains_key(&i)),
                    ) =>
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

    /// The definitions of atoms that some expressions need, directly or by way of other definitions.
    fn definitions(&self, graph: &Graph, roots: &[ExprId]) -> Vec<Definition> {
        let mut used = graph.atoms(roots);
        used.extend(graph.atoms(&self.reachable));
        let (mut found, mut left): (Vec<Definition>, _) = (Vec::new(), self.definitions.clone());
        loop {
            let (next, rest): (Vec<Definition>, Vec<Definition>) =
                left.into_iter().partition(|d| used.contains(&d.atom));
            if next.is_empty() {
                return found;
            }
            for definition in &next {
                used.extend(graph.atoms(&definition.by.operands()));
            }
            found.extend(next);
            left = rest;
        }
    }

    /// Closes some expressions over the active coordinates and lowers them.
    pub(crate) fn program(
        &self,
        graph: &mut Graph,
        equations: &Equations,
        outputs: &[ExprId],
    ) -> Program {
        self.program_at(graph, equations, outputs, &BTreeMap::new())
    }

    /// What a program of some expressions costs. Expressions of an open chain are counted as they stand, since closing
    /// does nothing to them and lowering finds little; that saves nearly all of the time.
    pub(crate) fn weight(
        &self,
        graph: &mut Graph,
        equations: &Equations,
        outputs: &[ExprId],
        known: &BTreeMap<ExprId, ExprId>,
    ) -> usize {
        if equations.projection.loops.passive.is_empty() {
            cost(graph, outputs)
        } else {
            self.program_at(graph, equations, outputs, known).weight()
        }
    }

    /// The same where some rates and accelerations are known, such as none at all.
    pub(crate) fn program_at(
        &self,
        graph: &mut Graph,
        equations: &Equations,
        outputs: &[ExprId],
        known: &BTreeMap<ExprId, ExprId>,
    ) -> Program {
        let projection = &equations.projection;
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
                // A number that is not zero never is, and a rational factor need not be multiplied just to be compared.
                let (base, factor) = graph.split_factor(closed);
                let varies = base != Graph::ONE || factor.is_zero();
                varies.then(|| (base, graph.scale(*size, &factor.abs().recip())))
            })
            .collect();
        lower_by(
            graph,
            self.passes,
            &Request {
                may_be_undefined: self.may_be_undefined,
                outputs,
                reachable: &self.reachable,
                regular: &regular,
                definitions: &definitions,
            },
        )
    }
}
