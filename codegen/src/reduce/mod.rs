//! Exact reduction to base parameters without expanding anything.
//!
//! The columns of H are functions on the loops' variety. They are evaluated at random points of a prime field, their
//! linear dependences found by elimination there, and the constant factors of eq. (6) reconstructed as rational functions
//! of the model's constants. A wrong answer has a probability below 1e-15 (Schwartz 1980, Zippel 1979).
//!
//! Where exactness ends: sine, cosine and square roots are algebraic in the field. Signs, absolute values, `tanh`
//! and `exp` are opaque: equal arguments get equal random values, odd functions stay odd, a sign squares to one. So
//! the base is minimal for functions that the field knows. It may be too large by what only opaque functions or
//! numbers share (`sin(q/2)*cos(q/2)` and `sin(q)`, springs on two passive angles that are always equal, constants
//! that are equal in this file only). The numeric rank is printed too, and a difference is reported.

pub(crate) mod base;
mod conditioned;
mod constants;
mod dependences;
mod factors;
mod fit;
mod numeric;
mod oracle;
mod preference;
mod print;
mod rational_function;
mod recognise;
mod reconstruct;
mod reduction;
mod relations;
mod sample;
mod states;
mod support;

use modelmill_algebra::field::Stream;
use modelmill_spec::Mechanism;

pub use rational_function::{Polynomial, Powers, RationalFunction, Variable};
pub use reduction::{Dependency, Method, Reduction};

use crate::DeriveError;
use crate::expr::independent::SEED;
use crate::expr::{ExprId, Graph};
use crate::regressor::Equations;
use crate::tree::expressions::Monomial;
use constants::{occurrences, root_radicands};
use dependences::Dependences;
use preference::{Preference, preference};
use sample::sampled;

/// Reduces the columns `columns[k][d]` (product by drive) to a base.
///
/// Products that the model file wants to retain are tried first, then the others as [`preference`] orders them; those at
/// which factors explode with the file's values are exchanged ([`conditioned`]).
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
    let preference = preference(graph, mechanism, equations, &effective);
    let outputs: Vec<ExprId> = (0..projection.drives.len())
        .flat_map(|d| effective.iter().map(move |k| columns[*k][d]))
        .collect();
    let exact = reduce_exactly(
        graph,
        mechanism,
        equations,
        &effective,
        &preference,
        &outputs,
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
            let order = preference.own_first.iter();
            let order: Vec<usize> = order.map(|k| effective[*k]).collect();
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
    equations: &Equations,
    effective: &[usize],
    preference: &Preference,
    outputs: &[ExprId],
) -> Result<Reduction, DeriveError> {
    let (projection, candidates) = (&equations.projection, &equations.products);
    let regressor = sampled(graph, mechanism, projection, outputs, effective.len())?;
    let mut stream = Stream::new(SEED);
    let roots = root_radicands(graph, outputs, &projection.loops.residual);
    let variables = occurrences(graph, outputs, &projection.loops.residual);
    let mut order = &preference.declared;
    let mut dependences = Dependences::find(&regressor, order, &mut stream)?;
    if preference.own_first != preference.declared {
        let other = Dependences::find(&regressor, &preference.own_first, &mut stream)?;
        let mut n_quotients = |dependences: &Dependences| {
            factors::n_quotients(dependences, &regressor, &variables, &mut stream)
        };
        if other.pivots != dependences.pivots && n_quotients(&other)? < n_quotients(&dependences)? {
            (order, dependences) = (&preference.own_first, other);
        }
    }
    let columns: Vec<Vec<ExprId>> = (effective.iter())
        .map(|k| equations.columns[*k].clone())
        .collect();
    let units: Vec<String> = (effective.iter())
        .map(|k| base::unit(mechanism, &candidates[*k]))
        .collect();
    let written = conditioned::Columns {
        values: &columns,
        units: &units,
    };
    let names = |k: usize| candidates[effective[k]].clone();
    let reduced = |dependences: &Dependences, stream: &mut Stream| {
        let factors = factors::find(
            dependences,
            &regressor,
            &variables,
            &roots,
            factors::MOST_OPERATIONS,
            stream,
        )?;
        let reduction = dependences.reduction(mechanism, candidates, &names, factors)?;
        reduction.confirm(&regressor, &dependences.shown, stream)?;
        Ok(reduction)
    };
    let better = conditioned::exchanged(
        graph,
        mechanism,
        projection,
        &written,
        &dependences.pivots,
        &dependences.dependent,
        &order[..preference.n_named],
    );
    if let Some(exchange) = better {
        if !exchange.is_certain
            && let Ok(found) = reduced(&dependences, &mut stream)
        {
            let shown = &dependences.shown;
            if conditioned::is_moderate(graph, mechanism, projection, &written, &found, shown) {
                return Ok(found);
            }
        }
        let (first, rest): (Vec<usize>, Vec<usize>) =
            order.iter().partition(|k| exchange.retained.contains(k));
        dependences = Dependences::find(&regressor, &[first, rest].concat(), &mut stream)?;
    }
    reduced(&dependences, &mut stream)
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
