//! The programs of a model: passive coordinates, regressor, inverse dynamics, Jacobian of the drives. Equations and
//! reduction go in, straight-line programs come out.
//!
//! Retained columns are original columns, so the inverse dynamics with base parameters is the same recursion with
//! p_min as values of the retained products and zero for all others.

pub(crate) mod cheapest;
pub(crate) mod closing;
mod scales;

use std::collections::BTreeMap;

use modelmill_spec::Mechanism;

use crate::DeriveError;
use crate::expr::{Atom, ExprId, Graph};
use crate::loops::magnitude::LoopSize;
use crate::lower::{LoweringRequest, StraightLineProgram, lower};
use crate::programs::cheapest::FormSearch;
use crate::programs::closing::PassiveClosure;
use crate::reduce::{BaseReduction, base};
use crate::regressor::UnreducedEquations;
use crate::tree::expressions::ParameterMonomial;

/// How the passive coordinates are computed.
#[derive(Clone, Debug)]
pub enum PassivePosition {
    /// The model has none.
    None,
    /// In closed form, as a part of every program.
    Closed,
    /// By Newton's method on the closure equations.
    Newton(Box<LoopPrograms>),
}

/// Programs that Newton's method evaluates.
#[derive(Clone, Debug)]
pub struct LoopPrograms {
    /// Residuals, then their Jacobian with respect to the passive coordinates, row by row.
    pub residual: StraightLineProgram,
    /// Scales of residuals, passive and active coordinates, in this order.
    pub scales: StraightLineProgram,
}

/// All straight-line programs of a model.
#[derive(Clone, Debug)]
pub struct ModelPrograms {
    /// How the passive coordinates are computed.
    pub passive_position: PassivePosition,
    /// Passive coordinates, then their rates, then their accelerations.
    pub passive: StraightLineProgram,
    /// H: one row per drive, one column per product of p_g, row by row.
    pub full_regressor: StraightLineProgram,
    /// H_min: one row per drive, one column per base parameter, row by row.
    pub regressor: StraightLineProgram,
    /// Forces of the drives for given p_min.
    pub inverse_dynamics: StraightLineProgram,
    /// p_min from parameters and constants; every operation is fixed.
    pub base_parameters: StraightLineProgram,
    /// Coordinates and rates of the drives, then their Jacobian with respect to the active coordinates, row by row.
    pub drives: StraightLineProgram,
    /// Size of the loops relative to that with the file's constants, if coordinates in them are lengths; fixed.
    pub scale: Option<StraightLineProgram>,
}

/// Writes all programs. `search` states which passes search for cheaper forms.
pub(crate) fn programs(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &UnreducedEquations,
    reduction: &BaseReduction,
    closing: &PassiveClosure,
    search: FormSearch<'_>,
) -> Result<ModelPrograms, DeriveError> {
    let n_drives = mechanism.drives.len();

    // Base parameters take the place of the retained products.
    let base = base_parameter_atoms(graph, reduction);
    let base_value = |m: &ParameterMonomial| base.get(m).copied().unwrap_or(Graph::ZERO);
    let retained: Vec<ParameterMonomial> = (reduction.retained.iter())
        .map(|k| reduction.products[*k].clone())
        .collect();
    // Columns as the rows of a matrix.
    let row_by_row = |columns: &[Vec<ExprId>]| -> Vec<ExprId> {
        (0..n_drives)
            .flat_map(|d| columns.iter().map(move |column| column[d]))
            .collect()
    };
    // Motion of loops and drives.
    let projection = &equations.projection;
    // Columns of p_g as they were derived, before any search for cheaper forms.
    let all: Vec<Vec<ExprId>> = reduction
        .products
        .iter()
        .map(|m| {
            let position = equations.products.iter().position(|p| p == m);
            equations.columns[position.expect("a product of p_g is a candidate")].clone()
        })
        .collect();
    // Outputs of the passive motion, then of the drives.
    let mut passive: Vec<ExprId> = projection
        .loops
        .passive
        .iter()
        .map(|p| graph.atom(Atom::Coordinate(*p)))
        .collect();
    passive.extend(&projection.passive_rates);
    passive.extend(&projection.passive_accelerations);
    let mut drives: Vec<ExprId> = projection.drives.iter().map(|d| d.coordinate).collect();
    drives.extend(projection.drives.iter().map(|d| d.rate));
    drives.extend(projection.drive_jacobian.iter().flatten());

    // Loops have a closed form, or Newton's method gets residuals, their Jacobian and scales.
    let passive_position = if projection.loops.passive.is_empty() {
        PassivePosition::None
    } else if closing.plan().is_some() {
        PassivePosition::Closed
    } else {
        let mut outputs = projection.loops.residual.clone();
        outputs.extend(projection.residual_jacobian.iter().flatten());
        let scales = scales::residual_scales(graph, mechanism, &projection.loops);
        PassivePosition::Newton(Box::new(LoopPrograms {
            residual: plain_program(graph, &outputs),
            scales: plain_program(graph, &scales),
        }))
    };
    // Base parameters, and the cheapest forms of regressor and inverse dynamics.
    let base_expressions = base::base_expressions(graph, reduction);
    let base_parameters = plain_program(graph, &base_expressions);
    let nothing = BTreeMap::new();
    let weigh = |graph: &mut Graph, outputs: &[ExprId]| closing.program_cost(graph, equations, outputs, &nothing);
    let regressor = cheapest::cheapest_columns(graph, mechanism, equations, &retained, search, &weigh)?;
    let regressor = row_by_row(&regressor);
    let inverse_dynamics = cheapest::cheapest_total(graph, mechanism, equations, &base_value, search, &weigh)?;
    // The scale is needed only if lengths are in the loops.
    let slides = mechanism.coordinates.iter().any(|c| c.motion.is_length());
    let scale = (slides && !projection.loops.residual.is_empty()).then(|| {
        let scale = LoopSize::from_residual(graph, mechanism, &projection.loops.residual).relative_scale(graph);
        plain_program(graph, &[scale])
    });
    search.stop.check()?;
    // Expressions are closed over the active coordinates and lowered.
    let n_motion = drives.len();
    let together = [drives.as_slice(), &inverse_dynamics].concat();
    let is_closed = matches!(passive_position, PassivePosition::Closed);
    let full_regressor = row_by_row(&all);
    let mut outputs = vec![regressor, inverse_dynamics, drives, passive, full_regressor];
    if is_closed {
        outputs.insert(3, together);
    }
    let mut programs = closing.lower_all(graph, equations, &outputs).into_iter();
    let mut next = || programs.next().expect("a program for each list of outputs");
    let (regressor, inverse_dynamics, mut drives) = (next(), next(), next());
    if is_closed {
        // Loops are closed by the same operations as in the inverse dynamics, so that the code has them once, unless
        // that costs more than a tenth.
        let same = next().with_outputs(n_motion);
        if 10 * same.weight() <= 11 * drives.weight() {
            drives = same;
        }
    }
    Ok(ModelPrograms {
        passive_position,
        passive: next(),
        full_regressor: next(),
        regressor,
        inverse_dynamics,
        base_parameters,
        drives,
        scale,
    })
}

/// Base parameters by their retained product; all other products are zero.
pub(crate) fn base_parameter_atoms(
    graph: &mut Graph,
    reduction: &BaseReduction,
) -> BTreeMap<ParameterMonomial, ExprId> {
    let retained = reduction.retained.iter().enumerate();
    retained
        .map(|(k, product)| {
            let product = reduction.products[*product].clone();
            (product, graph.atom(Atom::Base(k)))
        })
        .collect()
}

/// A program of expressions without guards and without passive coordinates to close.
fn plain_program(graph: &mut Graph, outputs: &[ExprId]) -> StraightLineProgram {
    let request = LoweringRequest {
        may_be_undefined: false,
        outputs,
        reachable: &[],
        regular: &[],
        definitions: &[],
    };
    lower(graph, &request)
}
