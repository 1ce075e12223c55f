//! The programs of a model: passive coordinates, regressor, inverse dynamics, Jacobian of the drives.
//!
//! Retained columns are original columns, so the inverse dynamics with base parameters is the same recursion with
//! p_min put in place of the retained products and zero for all others.

use std::collections::BTreeMap;

use modelmill_spec::Mechanism;

use crate::DeriveError;
use crate::exact::Monomial;
use crate::expr::{AngleSum, Atom, ExprId, Graph, Node};
use crate::lower::{Definition, Program, Request, lower};
use crate::reduce::{Plan, Reduction, Unknowns, plan};
use crate::regressor::Equations;

/// How the passive coordinates are found.
#[derive(Clone, Debug)]
pub enum PassivePosition {
    /// There are none.
    None,
    /// In closed form, inside the programs.
    Closed,
    /// By Newton's method on the loops.
    Newton {
        /// Residuals, then their Jacobian by the passive coordinates row by row.
        residual: Program,
    },
}

/// Straight-line programs; outputs in the order given.
#[derive(Clone, Debug)]
pub struct Programs {
    /// How the passive coordinates are found.
    pub passive_position: PassivePosition,
    /// Passive coordinates, their rates, their accelerations.
    pub passive: Program,
    /// H: rows of drives, columns of p_g, row by row.
    pub full_regressor: Program,
    /// H_min: rows of drives, columns of p_min, row by row.
    pub regressor: Program,
    /// Forces of the drives for given p_min.
    pub inverse_dynamics: Program,
    /// p_min of given parameters and constants; all of it is fixed.
    pub base_parameters: Program,
    /// Coordinates and rates of the drives, then their Jacobian by the active coordinates, row by row.
    pub drives: Program,
}

pub(crate) fn programs(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &Equations,
    reduction: &Reduction,
) -> Result<Programs, DeriveError> {
    let nominal = |graph: &Graph, id: ExprId| -> bool {
        nominal_value(graph, mechanism, id).is_none_or(|v| v >= 0.0)
    };
    let plan = plan(
        graph,
        &equations.projection,
        Unknowns::Passive,
        &mut |graph, id| nominal(graph, id),
    );
    let closing = Closing::new(graph, mechanism, equations, plan);
    let n_drives = mechanism.drives.len();

    let retained: Vec<&Monomial> = reduction
        .retained
        .iter()
        .map(|k| &reduction.products[*k])
        .collect();
    let base: BTreeMap<Monomial, ExprId> = retained
        .iter()
        .enumerate()
        .map(|(k, m)| ((*m).clone(), graph.atom(Atom::Base(k))))
        .collect();
    let base_value = |m: &Monomial| base.get(m).copied().unwrap_or(Graph::ZERO);
    let row_by_row = |columns: &[Vec<ExprId>]| -> Vec<ExprId> {
        (0..n_drives).flat_map(|d| columns.iter().map(move |column| column[d])).collect()
    };
    let mut regressors = Vec::new();
    let mut inverse_dynamics = Vec::new();
    for style in equations.styles() {
        let columns = retained
            .iter()
            .map(|m| equations.column(graph, mechanism, m, style))
            .collect::<Result<Vec<_>, _>>()?;
        regressors.push(row_by_row(&columns));
        inverse_dynamics.push(equations.inverse_dynamics(graph, mechanism, &base_value, style)?);
    }

    let projection = &equations.projection;
    let all: Vec<Vec<ExprId>> = reduction
        .products
        .iter()
        .map(|m| {
            let position = equations.products.iter().position(|p| p == m);
            equations.columns[position.expect("a product of p_g is a candidate")].clone()
        })
        .collect();
    let mut passive: Vec<ExprId> = projection
        .passive
        .iter()
        .map(|p| graph.atom(Atom::Coordinate(*p)))
        .collect();
    passive.extend(&projection.passive_rates);
    passive.extend(&projection.passive_accelerations);
    let mut drives: Vec<ExprId> = projection.drives.iter().map(|d| d.coordinate).collect();
    drives.extend(projection.drives.iter().map(|d| d.rate));
    drives.extend(projection.drive_jacobian.iter().flatten());

    let passive_position = if projection.passive.is_empty() {
        PassivePosition::None
    } else if closing.plan.is_some() {
        PassivePosition::Closed
    } else {
        let mut outputs = projection.residual.clone();
        outputs.extend(projection.residual_jacobian.iter().flatten());
        let request = Request {
            outputs: &outputs,
            reachable: &[],
            regular: &[],
            definitions: &[],
        };
        PassivePosition::Newton {
            residual: lower(graph, &request),
        }
    };
    let base = crate::base::expressions(graph, reduction);
    let request = Request { outputs: &base, reachable: &[], regular: &[], definitions: &[] };
    let base_parameters = lower(graph, &request);
    let mut program = |outputs: &[ExprId]| closing.program(graph, equations, outputs);
    let regressor = cheapest(regressors.iter().map(|outputs| program(outputs)));
    let inverse_dynamics = cheapest(inverse_dynamics.iter().map(|outputs| program(outputs)));
    Ok(Programs {
        passive_position,
        passive: program(&passive),
        full_regressor: program(&row_by_row(&all)),
        regressor,
        inverse_dynamics,
        base_parameters,
        drives: program(&drives),
    })
}

/// The program that costs least per state; the first of equals.
fn cheapest(programs: impl Iterator<Item = Program>) -> Program {
    programs.min_by_key(Program::weight).expect("there is at least one way to write the equations")
}

/// Value of an expression at the nominal pose, with the file's constants; rates are zero.
pub(crate) fn nominal_value(graph: &Graph, mechanism: &Mechanism, id: ExprId) -> Option<f64> {
    let atom = |atom: Atom| match atom {
        Atom::Constant(i) => mechanism.constants[i].value,
        Atom::Coordinate(i) => mechanism.coordinates[i].nominal,
        Atom::Parameter(i) => mechanism.parameters[i].nominal,
        _ => 0.0,
    };
    crate::expr::Tape::new(graph, &[id])
        .evaluate(&crate::expr::F64(atom))
        .map(|v| v[0])
}

/// Puts the passive coordinates' closed form, rates and accelerations in place.
struct Closing {
    plan: Option<Plan>,
    /// Cosine and sine of passive coordinates alone, for their values.
    definitions: Vec<Definition>,
    reachable: Vec<ExprId>,
    /// Nodes replaced by the position's closed form.
    position: BTreeMap<ExprId, ExprId>,
    /// Sums of angles whose cosine and sine are known, and what every passive angle is made of.
    solved: Vec<[ExprId; 2]>,
    angle_of: BTreeMap<usize, (AngleSum, Vec<(usize, i32)>)>,
    /// Determinants, with the magnitudes below which they count as zero.
    regular: Vec<(ExprId, f64)>,
}

/// A determinant this much smaller than at the nominal pose counts as zero.
const SINGULAR: f64 = 1e-9;

impl Closing {
    fn new(
        graph: &mut Graph,
        mechanism: &Mechanism,
        equations: &Equations,
        plan: Option<Plan>,
    ) -> Self {
        let mut closing = Self {
            plan,
            definitions: Vec::new(),
            reachable: Vec::new(),
            position: BTreeMap::new(),
            solved: Vec::new(),
            angle_of: BTreeMap::new(),
            regular: Vec::new(),
        };
        for id in &equations.projection.determinants {
            let nominal = nominal_value(graph, mechanism, *id).unwrap_or(1.0);
            closing.regular.push((*id, SINGULAR * nominal.abs()));
        }
        let Some(plan) = closing.plan.clone() else {
            return closing;
        };
        for step in &plan.steps {
            // Earlier steps' unknowns are known by now; their closed form goes into this step's expressions.
            let mut roots: Vec<ExprId> =
                step.solved.angles.iter().flat_map(|(_, cs)| *cs).collect();
            roots.extend(step.solved.lengths.iter().map(|(_, value)| *value));
            roots.extend(step.solved.root.iter().map(|root| root.radicand));
            let closed = closing.close_position(graph, &roots);
            let n_angles = step.solved.angles.len();
            let first = closing.solved.len();
            closing
                .solved
                .extend(closed[..2 * n_angles].chunks(2).map(|cs| [cs[0], cs[1]]));
            for ((coordinate, _), value) in step.solved.lengths.iter().zip(&closed[2 * n_angles..])
            {
                let atom = graph.atom(Atom::Coordinate(*coordinate));
                closing.position.insert(atom, *value);
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
        }
        for p in &equations.projection.passive {
            if closing.angle_of.contains_key(p) {
                let [cosine, sine] =
                    closing.cos_sin(graph, &AngleSum::new([(Atom::Coordinate(*p), 1)]));
                closing.definitions.push(Definition {
                    atom: Atom::Coordinate(*p),
                    sine,
                    cosine,
                });
            }
        }
        closing
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
                let rest = angle.plus(&AngleSum::new([(*atom, *sign)]), -1);
                let (rest, pieces) = self.split(&rest);
                let mut pieces: Vec<(usize, i32)> =
                    pieces.into_iter().map(|(s, n)| (s, -n * sign)).collect();
                pieces.push((first + k, *sign));
                self.angle_of
                    .insert(*i, (AngleSum::NONE.plus(&rest, -sign), pieces));
                unknown.retain(|u| u != i);
                progress = true;
            }
        }
    }

    /// A sum of angles as a sum of known coordinates and pieces of solved angles.
    fn split(&self, sum: &AngleSum) -> (AngleSum, Vec<(usize, i32)>) {
        let mut known = AngleSum::NONE;
        let mut pieces: BTreeMap<usize, i32> = BTreeMap::new();
        for (atom, n) in sum.terms() {
            match atom {
                Atom::Coordinate(i) if self.angle_of.contains_key(i) => {
                    let (rest, inner) = &self.angle_of[i];
                    known = known.plus(rest, *n);
                    for (piece, m) in inner {
                        *pieces.entry(*piece).or_insert(0) += m * n;
                    }
                }
                _ => known = known.plus(&AngleSum::new([(*atom, 1)]), *n),
            }
        }
        (known, pieces.into_iter().filter(|(_, n)| *n != 0).collect())
    }

    /// Cosine and sine of a sum of angles, by the addition theorem.
    fn cos_sin(&self, graph: &mut Graph, sum: &AngleSum) -> [ExprId; 2] {
        let (known, pieces) = self.split(sum);
        let (c, s) = graph.cos_sin(&known, 0);
        let mut total = [c, s];
        for (piece, n) in pieces {
            let [c, mut s] = self.solved[piece];
            if n < 0 {
                s = graph.neg(s);
            }
            for _ in 0..n.abs() {
                let products = [(total[0], c), (total[1], s), (total[1], c), (total[0], s)]
                    .map(|(a, b)| graph.mul(a, b));
                total = [
                    graph.sub(products[0], products[1]),
                    graph.add(products[2], products[3]),
                ];
            }
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

    /// Closes some expressions over the active coordinates and lowers them.
    fn program(&self, graph: &mut Graph, equations: &Equations, outputs: &[ExprId]) -> Program {
        let projection = &equations.projection;
        let rates: BTreeMap<ExprId, ExprId> = projection
            .passive
            .iter()
            .zip(&projection.passive_rates)
            .map(|(p, rate)| (graph.atom(Atom::Rate(*p)), *rate))
            .collect();
        let accelerations = graph.substitute(&projection.passive_accelerations, &rates);
        let mut motion = rates;
        for (p, acceleration) in projection.passive.iter().zip(accelerations) {
            motion.insert(graph.atom(Atom::Acceleration(*p)), acceleration);
        }
        let mut roots = graph.substitute(outputs, &motion);
        let n = roots.len();
        roots.extend(self.regular.iter().map(|(id, _)| *id));
        roots = self.close_position(graph, &roots);
        let (outputs, regular) = roots.split_at(n);
        let used = graph.atoms(outputs);
        let definitions: Vec<Definition> = self
            .definitions
            .iter()
            .filter(|d| used.contains(&d.atom))
            .copied()
            .collect();
        let regular: Vec<(ExprId, f64)> = regular
            .iter()
            .copied()
            .zip(&self.regular)
            .map(|(closed, (_, limit))| {
                // A rational factor need not be multiplied just to be compared with.
                let (base, factor) = graph.split_factor(closed);
                (base, limit / factor.abs().to_f64())
            })
            .collect();
        lower(
            graph,
            &Request {
                outputs,
                reachable: &self.reachable,
                regular: &regular,
                definitions: &definitions,
            },
        )
    }
}
