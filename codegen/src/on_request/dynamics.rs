//! Mass matrix, velocity terms, gravity and effects of a mechanism by itself, for control and simulation.
//!
//! With the independent coordinates z, the drives' forces f and the drives' Jacobian J,
//! `J' f = M(z) z'' + c(z, z') + g(z) + e(z, z')`, all linear in p_min. M is made of composite bodies of the open tree
//! (Walker and Orin 1982), projected on z by virtual power; c and g are the inverse dynamics without accelerations, and
//! without gravity or without rates. Effects give e, and what multiplies accelerations in them joins M.
//!
//! Decision: only two things are differentiated by the accelerations: effects, and lumped masses that forces and
//! moments see at different places (there M is not symmetric). These programs are derived on request, because they
//! would nearly double the time and the code of every build.

use std::collections::BTreeMap;

use modelmill_spec::Mechanism;

use crate::Derivation;
use crate::DeriveError;
use crate::expr::{Atom, ExprId, Graph, Node};
use crate::lower::Program;
use crate::lower::cost::cost;
use crate::newton_euler::{self, Body, Element, Style};
use crate::programs::base_atoms;
use crate::programs::cheapest;
use crate::programs::closing::Closing;
use crate::regressor::Equations;
use crate::regressor::form::{Frames, TotalForm};
use crate::tree::expressions::Monomial;

/// Straight-line programs of the equation of motion in the independent coordinates, for given p_min.
#[derive(Clone, Debug)]
pub struct Dynamics {
    /// M: a row and a column for every independent coordinate, row by row. Those of a quaternion's scalar part, which has no
    /// rate, hold a one on the diagonal and nothing else.
    pub mass_matrix: Program,
    /// c, what rates alone ask for: centrifugal and Coriolis forces.
    pub coriolis: Program,
    /// g: what weight alone asks for.
    pub gravity: Program,
    /// e: what effects ask for where nothing accelerates, such as friction and springs.
    pub effects: Program,
    /// `c + g + e`, at a lower cost than apart, and then J: a row per drive, row by row.
    pub bias: Program,
}

impl Derivation {
    /// The equation of motion of the mechanism, ready for forward dynamics. It is derived here, on demand.
    ///
    /// # Errors
    /// A mechanism with an effect that is not affine in the accelerations.
    pub fn dynamics(&self) -> Result<Dynamics, DeriveError> {
        let mut graph = self.graph.clone();
        let base = base_atoms(&mut graph, &self.reduction);
        let value = |m: &Monomial| base.get(m).copied().unwrap_or(Graph::ZERO);
        dynamics(
            &mut graph,
            &self.mechanism,
            &self.equations,
            &self.closing,
            &value,
        )
    }
}

fn dynamics(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &Equations,
    closing: &Closing,
    value: &dyn Fn(&Monomial) -> ExprId,
) -> Result<Dynamics, DeriveError> {
    let projection = &equations.projection;
    let n = mechanism.coordinates.len();
    let still: Vec<ExprId> = (0..n).map(|i| graph.atom(Atom::Acceleration(i))).collect();
    // Passive coordinates accelerate even where the independent ones do not.
    let unaccelerated: BTreeMap<ExprId, ExprId> = projection
        .loops
        .active
        .iter()
        .map(|a| (still[*a], Graph::ZERO))
        .collect();
    let mut at_rest = unaccelerated.clone();
    for i in 0..n {
        at_rest.insert(still[i], Graph::ZERO);
        at_rest.insert(graph.atom(Atom::Rate(i)), Graph::ZERO);
    }

    check_affine(graph, mechanism, equations)?;
    let weight = equations.gravity;
    let none = crate::expr::vector::ZERO;
    let effects = equations.effect_forces(graph, mechanism, value)?;
    let effects = equations.on_active(graph, &effects.on_tree, &effects.on_drives);
    let bodies = |graph: &mut Graph,
                  gravity: crate::expr::vector::Vector,
                  frozen: &BTreeMap<ExprId, ExprId>,
                  more: &[ExprId]| {
        let weigh = |graph: &mut Graph, outputs: &[ExprId]| {
            closing.weight(graph, equations, outputs, frozen)
        };
        cheapest::best_total(
            graph,
            mechanism,
            equations,
            gravity,
            value,
            &weigh,
            |graph, on_tree| {
                let outputs = equations.on_active(graph, on_tree, &[]);
                let outputs: Vec<ExprId> = outputs
                    .into_iter()
                    .enumerate()
                    .map(|(a, force)| graph.add(force, more.get(a).copied().unwrap_or(Graph::ZERO)))
                    .collect();
                graph.substitute(&outputs, frozen)
            },
        )
    };
    let coriolis = bodies(graph, none, &unaccelerated, &[])?;
    let gravity = bodies(graph, weight, &at_rest, &[])?;
    let mut bias = bodies(graph, weight, &unaccelerated, &effects)?;
    bias.extend(projection.drive_jacobian.iter().flatten());
    let mass_matrix = mass_matrix(graph, mechanism, equations, value, &effects);
    let mut program = |outputs: &[ExprId], frozen: &BTreeMap<ExprId, ExprId>| {
        closing.program_at(graph, equations, outputs, frozen)
    };
    Ok(Dynamics {
        mass_matrix: program(&mass_matrix, &unaccelerated),
        coriolis: program(&coriolis, &unaccelerated),
        gravity: program(&gravity, &at_rest),
        effects: program(&effects, &unaccelerated),
        bias: program(&bias, &unaccelerated),
    })
}

/// Refuses effects whose force is not affine in the accelerations.
fn check_affine(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &Equations,
) -> Result<(), DeriveError> {
    for effect in &mechanism.effects {
        let only = |m: &Monomial| {
            let of_effect = |t: &modelmill_spec::EffectTerm| m.0 == [(t.parameter.0, 1)];
            if effect.terms.iter().any(of_effect) {
                Graph::ONE
            } else {
                Graph::ZERO
            }
        };
        let forces = equations.effect_forces(graph, mechanism, &only)?;
        let forces: Vec<ExprId> = forces.on_tree.into_iter().chain(forces.on_drives).collect();
        if degree_in_accelerations(graph, &forces) > 1 {
            return Err(DeriveError::NotAffine {
                effect: effect.kind.clone(),
            });
        }
    }
    Ok(())
}

/// Degree of some expressions as polynomials in the accelerations; more than 1 also for what is no polynomial.
fn degree_in_accelerations(graph: &Graph, roots: &[ExprId]) -> usize {
    const NONE: usize = 2;
    let mut degree = vec![0; graph.len()];
    for (i, needed) in graph.reachable(roots).into_iter().enumerate() {
        if !needed {
            continue;
        }
        let id = ExprId(u32::try_from(i).expect("graph below 4G nodes"));
        let of = |id: ExprId| degree[id.index()];
        degree[i] = match graph.node(id) {
            Node::Atom(Atom::Acceleration(_)) => 1,
            Node::Sin(angle) | Node::Cos(angle) => {
                let moves = |a: Atom| matches!(a, Atom::Acceleration(_));
                if angle.atoms().any(moves) { NONE } else { 0 }
            }
            Node::Sum(terms) => terms.iter().map(|(c, _)| of(*c)).max().unwrap_or(0),
            Node::Product(factors) => factors
                .iter()
                .map(|(c, n)| match (of(*c), *n) {
                    (0, _) => 0,
                    (d, 1) => d,
                    _ => NONE,
                })
                .sum::<usize>()
                .min(NONE),
            Node::Unary(_, c) if of(*c) > 0 => NONE,
            Node::Rational(_) | Node::Atom(_) | Node::Unary(..) => 0,
        };
    }
    roots.iter().map(|r| degree[r.index()]).max().unwrap_or(0)
}

/// M by rows.
fn mass_matrix(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &Equations,
    value: &dyn Fn(&Monomial) -> ExprId,
    effects: &[ExprId],
) -> Vec<ExprId> {
    let projection = &equations.projection;
    let n = mechanism.coordinates.len();
    let n_active = projection.loops.active.len();
    // How every coordinate accelerates with each independent one.
    let motion: Vec<Vec<ExprId>> = projection
        .loops
        .active
        .iter()
        .map(|a| {
            let slopes =
                graph.differentiate(&projection.passive_accelerations, Atom::Acceleration(*a));
            let mut column = vec![Graph::ZERO; n];
            column[*a] = Graph::ONE;
            for (p, slope) in projection.loops.passive.iter().zip(slopes) {
                column[*p] = slope;
            }
            column
        })
        .collect();
    let combined = |graph: &mut Graph, row: &[ExprId], column: &[ExprId]| {
        let terms: Vec<ExprId> = row
            .iter()
            .zip(column)
            .map(|(a, b)| graph.mul(*a, *b))
            .collect();
        graph.add_all(&terms)
    };
    let inertia = equations.inertia.total(graph, value);
    let is_symmetric = inertia.values().all(|inertia| {
        (0..3).all(|i| {
            inertia[Element::ForceMoment(i).index()] == inertia[Element::MomentMoment(i).index()]
        })
    });
    let mut matrix = vec![vec![Graph::ZERO; n_active]; n_active];
    if is_symmetric {
        let bodies: Vec<(usize, Body)> = inertia
            .iter()
            .map(|(link, inertia)| (*link, Body::new(inertia)))
            .collect();
        let style = Style {
            offset_after_turn: true,
            ..Style::PLAIN
        };
        let mut least = usize::MAX;
        for fixed_axes in [false, true] {
            let gravity = &crate::expr::vector::ZERO;
            let frames = Frames::new(graph, &equations.tree, gravity, style, fixed_axes);
            let bodies: Vec<(usize, Body)> = bodies
                .iter()
                .map(|(link, body)| (*link, frames.turned(graph, *link, body)))
                .collect();
            let of_tree = newton_euler::mass_matrix(graph, &frames.tree, style, n, &bodies);
            let mut found = vec![vec![Graph::ZERO; n_active]; n_active];
            for b in 0..n_active {
                let column: Vec<ExprId> = (0..n)
                    .map(|i| combined(graph, &of_tree[i], &motion[b]))
                    .collect();
                let projected = projection.project(graph, &column);
                for a in 0..=b {
                    found[a][b] = projected[a];
                    found[b][a] = projected[a];
                }
            }
            let cost = cost(graph, &found.concat());
            if cost < least {
                (least, matrix) = (cost, found);
            }
        }
    }
    // Effects, and lumped masses that forces and moments see at different places: as the forces say.
    let mut forces = effects.to_vec();
    if !is_symmetric {
        let form = TotalForm::PLAIN;
        let tree = &equations.tree;
        let frames = Frames::new(graph, tree, &crate::expr::vector::ZERO, form.style, false);
        let wrenches = form.wrenches(graph, &equations.inertia, &equations.tree, &frames, value);
        let on_tree = newton_euler::backward(graph, tree, form.style, n, wrenches);
        let bodies = equations.on_active(graph, &on_tree, &[]);
        forces = forces
            .iter()
            .zip(bodies)
            .map(|(a, b)| graph.add(*a, b))
            .collect();
    }
    let slopes: Vec<Vec<ExprId>> = (0..n)
        .map(|i| graph.differentiate(&forces, Atom::Acceleration(i)))
        .collect();
    for a in 0..n_active {
        let row: Vec<ExprId> = slopes.iter().map(|column| column[a]).collect();
        for b in 0..n_active {
            let more = combined(graph, &row, &motion[b]);
            matrix[a][b] = graph.add(matrix[a][b], more);
        }
    }
    // What has no rate moves nothing: a one on the diagonal keeps the system regular.
    for a in 0..n_active {
        if !projection.freedoms.contains(&a) {
            matrix[a][a] = Graph::ONE;
        }
    }
    matrix.into_iter().flatten().collect()
}
