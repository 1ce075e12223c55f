//! Exact reduction to base parameters without expanding anything.
//!
//! The columns of H are functions on the loops' variety. They are evaluated at random points of a prime field, their
//! linear dependences found by elimination there, and the constant factors of eq. (6) reconstructed as rational functions
//! of the model's constants. A wrong answer has a probability below 1e-15 (Schwartz 1980, Zippel 1979).

pub(crate) mod base;
mod constants;
mod dependences;
mod factors;
mod fit;
mod numeric;
mod oracle;
mod print;
mod rational_function;
mod reconstruct;
mod reduction;
mod relations;
mod sample;
mod support;

use modelmill_algebra::field::Stream;
use modelmill_spec::Mechanism;

pub use rational_function::{Polynomial, Powers, RationalFunction, Variable};
pub use reduction::{Dependency, Method, Reduction};

use crate::DeriveError;
use crate::expr::independent::SEED;
use crate::expr::{ExprId, Graph};
use crate::regressor::Equations;
use crate::regressor::projection::Projection;
use crate::tree::expressions::Monomial;
use constants::{occurrences, root_radicands};
use dependences::Dependences;
use sample::sampled;

/// Reduces the columns `columns[k][d]` (product by drive) to a base.
///
/// Products that the model file wants to retain are tried first, then all others in order.
pub(crate) fn reduce(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &Equations,
) -> Result<Reduction, DeriveError> {
    let Equations {
        projection,
        products: candidates,
        columns,
        ..
    } = equations;
    let effective: Vec<usize> = (0..columns.len())
        .filter(|k| columns[*k].iter().any(|x| *x != Graph::ZERO))
        .collect();
    let order = preference(mechanism, candidates, &effective);
    let outputs: Vec<ExprId> = (0..projection.drives.len())
        .flat_map(|d| effective.iter().map(move |k| columns[*k][d]))
        .collect();
    let exact = reduce_exactly(
        graph, mechanism, projection, candidates, &effective, &order, &outputs,
    );
    let exact = exact.and_then(|found| {
        // Loops are sampled on their algebraic variety; machines live on the branch of the nominal pose.
        let is_contradicted = !projection.loops.closures.is_empty()
            && numeric::contradicts(graph, mechanism, projection, candidates, columns, &found);
        if is_contradicted {
            Err(DeriveError::NotConfirmed)
        } else {
            Ok(found)
        }
    });
    match exact {
        Err(
            because @ (DeriveError::LoopsNotSampled { .. }
            | DeriveError::BranchesNotSeparated { .. }
            | DeriveError::FactorNotRecovered { .. }
            | DeriveError::FactorsTooLong { .. }
            | DeriveError::NoPointFound { .. }
            | DeriveError::NotConfirmed
            | DeriveError::RankChanged),
        ) => {
            let order: Vec<usize> = order.into_iter().map(|k| effective[k]).collect();
            numeric::reduce(
                graph, mechanism, projection, candidates, columns, &order, because,
            )
        }
        exact => exact,
    }
}

fn reduce_exactly(
    graph: &mut Graph,
    mechanism: &Mechanism,
    projection: &Projection,
    candidates: &[Monomial],
    effective: &[usize],
    order: &[usize],
    outputs: &[ExprId],
) -> Result<Reduction, DeriveError> {
    let regressor = sampled(graph, mechanism, projection, outputs, effective.len())?;
    let mut stream = Stream::new(SEED);
    let dependences = Dependences::find(&regressor, order, &mut stream)?;
    let roots = root_radicands(graph, outputs, &projection.loops.residual);
    let variables = occurrences(graph, outputs, &projection.loops.residual);
    let factors = factors::find(
        &dependences,
        &regressor,
        &variables,
        &roots,
        factors::MOST_OPERATIONS,
        &mut stream,
    )?;
    let names = |k: usize| candidates[effective[k]].clone();
    let reduction = dependences.reduction(mechanism, candidates, &names, factors)?;
    reduction.confirm(&regressor, &dependences.shown, &mut stream)?;
    Ok(reduction)
}

/// Order in which columns are tried as retained ones: those that the file names, then the others as they stand.
fn preference(mechanism: &Mechanism, candidates: &[Monomial], effective: &[usize]) -> Vec<usize> {
    let mut order: Vec<usize> = mechanism
        .retain
        .iter()
        .filter_map(|powers| {
            let wanted = powers.iter().fold(Monomial::default(), |m, (p, n)| {
                m.times(&Monomial(vec![(p.0, *n)]))
            });
            effective.iter().position(|k| candidates[*k] == wanted)
        })
        .collect();
    for k in 0..effective.len() {
        if !order.contains(&k) {
            order.push(k);
        }
    }
    order
}

/// The products that are wanted and have an effect, all retained.
pub(crate) fn unreduced(equations: &Equations, wanted: &dyn Fn(&Monomial) -> bool) -> Reduction {
    let is_zero = |column: &Vec<ExprId>| column.iter().all(|x| *x == Graph::ZERO);
    let pick = |zero: bool| -> Vec<Monomial> {
        let pairs = equations.products.iter().zip(&equations.columns);
        let found = pairs.filter(|(product, column)| wanted(product) && is_zero(column) == zero);
        found.map(|(product, _)| product.clone()).collect()
    };
    let products = pick(false);
    Reduction {
        retained: (0..products.len()).collect(),
        without_effect: pick(true),
        products,
        dependencies: Vec::new(),
        method: Method::Unreduced,
    }
}
