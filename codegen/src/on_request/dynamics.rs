//! Mass matrix, velocity terms, gravity and effects of a mechanism as separate programs, for control and simulation.
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
use crate::lower::StraightLineProgram;
use crate::lower::cost::cost;
use crate::newton_euler::{self, BodyInertia, InertiaElement, RecursionStyle};
use crate::programs::base_parameter_atoms;
use crate::programs::cheapest;
use crate::programs::closing::PassiveClosure;
use crate::regressor::UnreducedEquations;
use crate::regressor::form::{RecursionFrames, TotalForm};
use crate::tree::expressions::ParameterMonomial;

/// Straight-line programs of the equation of motion in the independent coordinates, for given p_min.
#[derive(Clone, Debug)]
pub struct DynamicsPrograms {
    /// M: one row and one column per independent coordinate, row by row. The scalar part of a quaternion has no rate;
    /// its row and column have a one on the diagonal and zeros elsewhere.
    pub mass_matrix: StraightLineProgram,
    /// c: generalised forces that depend on the rates, centrifugal and Coriolis forces.
    pub coriolis: StraightLineProgram,
    /// g: generalised forces of gravity.
    pub gravity: StraightLineProgram,
    /// e: generalised forces of the effects at zero acceleration, such as friction and springs.
    pub effects: StraightLineProgram,
    /// `c + g + e`, at a lower cost than the three separately, and then J: one row per drive, row by row.
    pub bias: StraightLineProgram,
}

impl Derivation {
    /// The equation of motion of the mechanism, prepared for forward dynamics. It is derived by this call.
    ///
    /// # Errors
    /// A mechanism with an effect that is not affine in the accelerations.
    pub fn dynamics(&self) -> Result<DynamicsPrograms, DeriveError> {
        let mut graph = self.graph.clone();
        let base = base_parameter_atoms(&mut graph, &self.reduction);
        let value = |m: &ParameterMonomial| base.get(m).copied().unwrap_or(Graph::ZERO);
        dynamics(&mut graph, &self.mechanism, &self.equations, &self.closing, &value)
    }
}

/// Derives the five programs. `value` is the expression of a product of parameters: a base parameter, or zero.
fn dynamics(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &UnreducedEquations,
    closing: &PassiveClosure,
    value: &dyn Fn(&ParameterMonomial) -> ExprId,
) -> Result<DynamicsPrograms, DeriveError> {
    let projection = &equations.projection;
    let n = mechanism.coordinates.len();
    let still: Vec<ExprId> = (0..n).map(|i| graph.atom(Atom::Acceleration(i))).collect();
    // Passive coordinates may accelerate even if the independent ones do not.
    let unaccelerated: BTreeMap<ExprId, ExprId> = projection
        .loops
        .active
        .iter()
        .map(|a| (still[*a], Graph::ZERO))
        .collect();
    // At standstill all rates and accelerations are zero.
    let mut at_rest = unaccelerated.clone();
    for i in 0..n {
        at_rest.insert(still[i], Graph::ZERO);
        at_rest.insert(graph.atom(Atom::Rate(i)), Graph::ZERO);
    }

    check_affine_in_accelerations(graph, mechanism, equations)?;
    // Generalised forces of the effects, on the independent coordinates.
    let weight = equations.gravity;
    let none = crate::expr::vector::ZERO;
    // Effects act on the tree and along the drives.
    let effects = equations.effect_forces(graph, mechanism, value)?;
    let effects = equations.project_on_active(graph, &effects.on_tree, &effects.on_drives);
    // Generalised forces of the bodies under a gravity, with some motions replaced by zero, in the cheapest form;
    // `more` is added before the cost is compared.
    let bodies = |graph: &mut Graph,
                  gravity: crate::expr::vector::SymbolicVector,
                  frozen: &BTreeMap<ExprId, ExprId>,
                  more: &[ExprId]| {
        let weigh = |graph: &mut Graph, outputs: &[ExprId]| closing.program_cost(graph, equations, outputs, frozen);
        cheapest::best_total(graph, mechanism, equations, gravity, value, &weigh, |graph, on_tree| {
            let outputs = equations.project_on_active(graph, on_tree, &[]);
            let outputs: Vec<ExprId> = outputs
                .into_iter()
                .enumerate()
                .map(|(a, force)| graph.add(force, more.get(a).copied().unwrap_or(Graph::ZERO)))
                .collect();
            graph.substitute(&outputs, frozen)
        })
    };
    // c: without gravity and accelerations. g: at standstill. The bias has all terms and ends with the Jacobian.
    let coriolis = bodies(graph, none, &unaccelerated, &[])?;
    let gravity = bodies(graph, weight, &at_rest, &[])?;
    let mut bias = bodies(graph, weight, &unaccelerated, &effects)?;
    bias.extend(projection.drive_jacobian.iter().flatten());
    let mass_matrix = mass_matrix(graph, mechanism, equations, value, &effects);
    // Each program is lowered with the motions that it does not read set to zero.
    let mut program =
        |outputs: &[ExprId], frozen: &BTreeMap<ExprId, ExprId>| closing.program_at(graph, equations, outputs, frozen);
    Ok(DynamicsPrograms {
        mass_matrix: program(&mass_matrix, &unaccelerated),
        coriolis: program(&coriolis, &unaccelerated),
        gravity: program(&gravity, &at_rest),
        effects: program(&effects, &unaccelerated),
        bias: program(&bias, &unaccelerated),
    })
}

/// Returns an error if the force of an effect is not affine in the accelerations: then M would not exist.
fn check_affine_in_accelerations(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &UnreducedEquations,
) -> Result<(), DeriveError> {
    for effect in &mechanism.effects {
        // Parameters of this effect are one and all others zero.
        let only = |m: &ParameterMonomial| {
            let of_effect = |t: &modelmill_spec::EffectTerm| m.0 == [(t.parameter.0, 1)];
            if effect.terms.iter().any(of_effect) {
                Graph::ONE
            } else {
                Graph::ZERO
            }
        };
        // The forces of this effect alone.
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

/// Degree of some expressions as polynomials in the accelerations; 2 stands for more than 1 and for everything that is
/// no polynomial.
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

/// M, row by row.
fn mass_matrix(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &UnreducedEquations,
    value: &dyn Fn(&ParameterMonomial) -> ExprId,
    effects: &[ExprId],
) -> Vec<ExprId> {
    let projection = &equations.projection;
    let n = mechanism.coordinates.len();
    // Size of M.
    let n_active = projection.loops.active.len();
    // Acceleration of every coordinate per acceleration of each independent one.
    let motion: Vec<Vec<ExprId>> = projection
        .loops
        .active
        .iter()
        .map(|a| {
            let slopes = graph.differentiate(&projection.passive_accelerations, Atom::Acceleration(*a));
            let mut column = vec![Graph::ZERO; n];
            column[*a] = Graph::ONE;
            for (p, slope) in projection.loops.passive.iter().zip(slopes) {
                column[*p] = slope;
            }
            column
        })
        .collect();
    // Scalar product of a row and a column.
    let combined = |graph: &mut Graph, row: &[ExprId], column: &[ExprId]| {
        let terms: Vec<ExprId> = row.iter().zip(column).map(|(a, b)| graph.mul(*a, *b)).collect();
        graph.add_all(&terms)
    };
    // M is symmetric if forces and moments have the same first moments of mass.
    let inertia = equations.inertia.total_inertias(graph, value);
    let is_symmetric = inertia.values().all(|inertia| {
        (0..3).all(|i| {
            inertia[InertiaElement::ForceMoment(i).index()] == inertia[InertiaElement::MomentMoment(i).index()]
        })
    });
    let mut matrix = vec![vec![Graph::ZERO; n_active]; n_active];
    // Composite bodies; of rotating and fixed axes, the cheaper ones are used.
    if is_symmetric {
        let bodies: Vec<(usize, BodyInertia)> = inertia
            .iter()
            .map(|(link, inertia)| (*link, BodyInertia::new(inertia)))
            .collect();
        // The cheapest style for composite bodies.
        let style = RecursionStyle {
            offset_after_turn: true,
            ..RecursionStyle::PLAIN
        };
        let mut least = usize::MAX;
        for fixed_axes in [false, true] {
            let gravity = &crate::expr::vector::ZERO;
            let frames = RecursionFrames::new(graph, &equations.tree, gravity, style, fixed_axes);
            let bodies: Vec<(usize, BodyInertia)> = bodies
                .iter()
                .map(|(link, body)| (*link, frames.rotate_body(graph, *link, body)))
                .collect();
            let of_tree = newton_euler::mass_matrix(graph, &frames.tree, style, n, &bodies);
            // The matrix of the tree is projected column by column; the lower triangle follows by symmetry.
            let mut found = vec![vec![Graph::ZERO; n_active]; n_active];
            for b in 0..n_active {
                let column: Vec<ExprId> = (0..n).map(|i| combined(graph, &of_tree[i], &motion[b])).collect();
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
    // Effects, and lumped masses with different points for forces and moments: derivatives of the forces by the
    // accelerations.
    let mut forces = effects.to_vec();
    if !is_symmetric {
        let form = TotalForm::PLAIN;
        let tree = &equations.tree;
        let frames = RecursionFrames::new(graph, tree, &crate::expr::vector::ZERO, form.style, false);
        let wrenches = form.wrenches(graph, &equations.inertia, &equations.tree, &frames, value);
        let on_tree = newton_euler::backward_recursion(graph, tree, form.style, n, wrenches);
        let bodies = equations.project_on_active(graph, &on_tree, &[]);
        forces = forces.iter().zip(bodies).map(|(a, b)| graph.add(*a, b)).collect();
    }
    let slopes: Vec<Vec<ExprId>> = (0..n)
        .map(|i| graph.differentiate(&forces, Atom::Acceleration(i)))
        .collect();
    for a in 0..n_active {
        // Derivatives of one generalised force by all accelerations.
        let row: Vec<ExprId> = slopes.iter().map(|column| column[a]).collect();
        for b in 0..n_active {
            let more = combined(graph, &row, &motion[b]);
            matrix[a][b] = graph.add(matrix[a][b], more);
        }
    }
    // A coordinate without a rate moves nothing; a one on the diagonal keeps the matrix regular.
    for a in 0..n_active {
        if !projection.freedoms.contains(&a) {
            matrix[a][a] = Graph::ONE;
        }
    }
    matrix.into_iter().flatten().collect()
}
