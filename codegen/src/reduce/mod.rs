//! Exact reduction of the regressor to base parameters, without expanding any expression.
//!
//! The columns of H are functions on the variety of the loops. They are evaluated at random points of a prime field,
//! and their linear dependences are found there by elimination. The constant factors of eq. (6) are then reconstructed
//! as rational functions of the model's constants. A wrong result has a probability below 1e-15 (Schwartz 1980, Zippel
//! 1979).
//!
//! Limits of exactness: sine, cosine and square roots are algebraic in the field. Signs, absolute values, `tanh` and
//! `exp` are opaque: equal arguments get equal random values, odd functions stay odd, and a sign has square one. So the
//! base is minimal with respect to functions that the field knows. It may be too large by relations that only opaque
//! functions or numbers have (`sin(q/2)*cos(q/2)` and `sin(q)`, springs on two passive angles that are always equal,
//! constants that are equal in this file only). The numeric rank is printed as well, and a difference is reported.

pub(crate) mod base;
mod closing_constants;
mod conditioned;
mod constants;
mod dependences;
mod factors;
mod fit;
mod link_spaces;
mod link_transfer;
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
mod tree_columns;
#[cfg(test)]
mod tree_tests;
mod trigonometric;

use modelmill_algebra::field::RandomStream;
use modelmill_spec::Mechanism;

pub use rational_function::{FactorVariable, PowerProduct, RationalFunction, TrigonometricPolynomial};
pub use reduction::{BaseReduction, ColumnDependency, ReductionMethod};
#[cfg(any(test, feature = "review"))]
pub(crate) use reduction::{constant_change_text, n_verified_digits};

use crate::DeriveError;
use crate::expr::independent::SEED;
use crate::expr::{ExprId, Graph};
use crate::regressor::UnreducedEquations;
use crate::stop::StopRequest;
use crate::tree::expressions::ParameterMonomial;
use constants::{constant_occurrences, root_radicands};
use dependences::DependenceStructure;
use factors::FactorSearch;
use oracle::OperationBudget;
use preference::{RetentionPreference, retention_preference};
use relations::TreeStructure;
use sample::sample_regressor;

/// Reduces the columns `columns[k][d]` (product by drive) to a base: exactly if possible, else numerically.
///
/// Products that the model file requests to retain are tried first, then the others in the order of [`preference`].
/// Retained products with very large factors at the file's values are exchanged ([`conditioned`]).
///
/// # Errors
/// A [`DeriveError`] if neither the exact nor the numeric reduction succeeds.
pub(crate) fn reduce(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &UnreducedEquations,
    stop: StopRequest<'_>,
) -> Result<BaseReduction, DeriveError> {
    let UnreducedEquations {
        projection,
        products: candidates,
        columns,
        ..
    } = equations;
    // Products with an effect on at least one drive.
    let effective: Vec<usize> = (0..columns.len())
        .filter(|k| columns[*k].iter().any(|x| *x != Graph::ZERO))
        .collect();
    let preference = retention_preference(graph, mechanism, equations, &effective);
    // Columns drive by drive, as rows of the regressor have them.
    let outputs: Vec<ExprId> = (0..projection.drives.len())
        .flat_map(|d| effective.iter().map(move |k| columns[*k][d]))
        .collect();
    let exact = reduce_exactly(graph, mechanism, equations, &effective, &preference, &outputs, stop);
    let exact = exact.and_then(|found| {
        // Loops are sampled on their complete algebraic variety, but machines live on the branch of the nominal pose.
        let is_contradicted = !projection.loops.closures.is_empty()
            && numeric::is_contradicted(graph, mechanism, projection, candidates, columns, &found);
        if is_contradicted {
            Err(DeriveError::NotConfirmed)
        } else {
            Ok(found)
        }
    });
    // Errors that only the exact method has lead to the numeric one; all others are returned.
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
            numeric::reduce(graph, mechanism, equations, &order, because, stop)
        }
        exact => exact,
    }
}

/// Finds the dependences at random points of the field, and their factors as functions of the constants.
fn reduce_exactly(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &UnreducedEquations,
    effective: &[usize],
    preference: &RetentionPreference,
    outputs: &[ExprId],
    stop: StopRequest<'_>,
) -> Result<BaseReduction, DeriveError> {
    let (projection, candidates) = (&equations.projection, &equations.products);
    let regressor = sample_regressor(graph, mechanism, projection, outputs, effective.len())?;
    // Numbers and constants that factors may contain.
    let mut stream = RandomStream::new(SEED);
    let roots = root_radicands(graph, outputs, &projection.loops.residual);
    let variables = constant_occurrences(graph, outputs, &projection.loops.residual);
    // Dependences with the columns in the order of declaration, and with each link's own columns first.
    let mut order = &preference.declared;
    let tree = TreeStructure::new(graph, equations, effective);
    let mut dependences = DependenceStructure::find_dependences(&regressor, &tree, order, &mut stream)?;
    if preference.own_first != preference.declared {
        let other = DependenceStructure::find_dependences(&regressor, &tree, &preference.own_first, &mut stream)?;
        let mut n_quotients = |dependences: &DependenceStructure| {
            factors::n_quotients(dependences, &regressor, &tree, &variables, stop, &mut stream)
        };
        // The second order is used if its factors have fewer sums in denominators.
        if other.pivots != dependences.pivots && n_quotients(&other)? < n_quotients(&dependences)? {
            (order, dependences) = (&preference.own_first, other);
        }
    }
    // The same columns in double precision decide whether factors are moderate at the file's values.
    let columns: Vec<Vec<ExprId>> = (effective.iter()).map(|k| equations.columns[*k].clone()).collect();
    let units: Vec<String> = (effective.iter())
        .map(|k| base::product_unit(mechanism, &candidates[*k]))
        .collect();
    let written = conditioned::RegressorColumns {
        values: &columns,
        units: &units,
    };
    let names = |k: usize| candidates[effective[k]].clone();
    let values: Vec<f64> = mechanism.constants.iter().map(|c| c.value).collect();
    // Factors of a set of dependences, confirmed with fresh constants.
    let reduced = |dependences: &DependenceStructure, stream: &mut RandomStream| {
        let search = FactorSearch {
            dependences,
            regressor: &regressor,
            tree: &tree,
            variables: &variables,
            roots: &roots,
            values: &values,
            budget: OperationBudget::new(factors::MOST_OPERATIONS, stop),
        };
        let factors = factors::find_factors(search, stream)?;
        stop.check()?;
        let reduction = dependences.reduction(mechanism, candidates, &names, factors)?;
        reduction.confirm_reduction(&regressor, &dependences.shown, stream)?;
        Ok(reduction)
    };
    // Columns that nearly coincide at the file's values may be retained in place of others.
    stop.check()?;
    let better = conditioned::exchange_columns(
        graph,
        mechanism,
        projection,
        &written,
        &dependences.pivots,
        &dependences.dependent,
        &order[..preference.n_named],
    );
    if let Some(exchange) = better {
        // An uncertain exchange is made only if the exact factors are large as well.
        if !exchange.is_certain
            && let Ok(found) = reduced(&dependences, &mut stream)
        {
            let shown = &dependences.shown;
            if conditioned::is_moderate(graph, mechanism, projection, &written, &found, shown) {
                return Ok(found);
            }
        }
        // The new choice becomes the order in which columns are tried.
        let (first, rest): (Vec<usize>, Vec<usize>) = order.iter().partition(|k| exchange.retained.contains(k));
        dependences = DependenceStructure::find_dependences(&regressor, &tree, &[first, rest].concat(), &mut stream)?;
    }
    let mut found = reduced(&dependences, &mut stream)?;
    // A factor without a value at the file's values divides by a pivot that vanishes there, for example at lengths that
    // are equal on both sides of a machine. The column that it belongs to takes the place of that pivot.
    let mut tried = vec![sorted(&dependences.pivots)];
    for _ in 0..MOST_EXCHANGES {
        let pairs = undefined_factors(mechanism, &found).into_iter();
        let columns = pairs.map(|pair| pair.map(|at| dependences.shown[at]));
        let Some(wanted) = next_pivots(&dependences.pivots, columns, &order[..preference.n_named], &tried) else {
            break;
        };
        let (first, rest): (Vec<usize>, Vec<usize>) = order.iter().partition(|k| wanted.contains(k));
        tried.push(wanted);
        dependences = DependenceStructure::find_dependences(&regressor, &tree, &[first, rest].concat(), &mut stream)?;
        found = reduced(&dependences, &mut stream)?;
    }
    Ok(found)
}

/// Column numbers in ascending order.
fn sorted(columns: &[usize]) -> Vec<usize> {
    let mut columns = columns.to_vec();
    columns.sort_unstable();
    columns
}

/// The next set of pivots, sorted: the first of the `pairs` (column, pivot) is exchanged that replaces no pivot in `named`
/// and leads to no set in `tried`, so that exchanges never alternate. `None` if there is no such pair.
fn next_pivots(
    pivots: &[usize],
    pairs: impl Iterator<Item = [usize; 2]>,
    named: &[usize],
    tried: &[Vec<usize>],
) -> Option<Vec<usize>> {
    let allowed = pairs.filter(|[_, pivot]| !named.contains(pivot));
    let exchanged = allowed.map(|[column, pivot]| {
        let all: Vec<usize> = pivots.iter().map(|k| if *k == pivot { column } else { *k }).collect();
        sorted(&all)
    });
    let mut exchanged = exchanged.filter(|wanted| !tried.contains(wanted));
    exchanged.next()
}

/// Largest number of pivots that are exchanged one by one because they vanish at the file's values. By judgement: both
/// hands of a humanoid have some ten.
const MOST_EXCHANGES: usize = 20;

/// The positions of dependent products and of the retained ones whose factors in them have no finite value at the file's
/// values.
fn undefined_factors(mechanism: &Mechanism, found: &BaseReduction) -> Vec<[usize; 2]> {
    let constants: Vec<f64> = mechanism.constants.iter().map(|c| c.value).collect();
    let lines = found.dependencies.iter().zip(found.factors(&constants));
    let pairs = lines.flat_map(|(line, factors)| {
        let undefined = factors.into_iter().filter(|(_, factor)| !factor.is_finite());
        undefined.map(|(k, _)| [line.product, found.retained[k]])
    });
    pairs.collect()
}

/// A reduction that retains every wanted product with an effect; for uses that need no base.
pub(crate) fn without_reduction(
    equations: &UnreducedEquations,
    wanted: &dyn Fn(&ParameterMonomial) -> bool,
) -> BaseReduction {
    let is_zero = |column: &Vec<ExprId>| column.iter().all(|x| *x == Graph::ZERO);
    // Wanted products with or without an effect.
    let pick = |zero: bool| -> Vec<ParameterMonomial> {
        let pairs = equations.products.iter().zip(&equations.columns);
        let found = pairs.filter(|(product, column)| wanted(product) && is_zero(column) == zero);
        found.map(|(product, _)| product.clone()).collect()
    };
    let products = pick(false);
    BaseReduction {
        retained: (0..products.len()).collect(),
        without_effect: pick(true),
        products,
        dependencies: Vec::new(),
        method: ReductionMethod::Unreduced,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two columns, each of which is undefined with the other as pivot: the exchanges end, and other pairs are tried.
    #[test]
    fn exchanges_do_not_alternate() {
        let mut pivots = vec![0, 1];
        let mut tried = vec![sorted(&pivots)];
        // Column 2 and pivot 1 ask for each other; column 3 could replace pivot 0.
        let pairs = |pivots: &[usize]| {
            let by = if pivots.contains(&1) { [2, 1] } else { [1, 2] };
            [by, [3, 0]].into_iter()
        };
        let mut sets = Vec::new();
        while let Some(next) = next_pivots(&pivots, pairs(&pivots), &[], &tried) {
            tried.push(next.clone());
            sets.push(next.clone());
            pivots = next;
            assert!(sets.len() < 10, "{sets:?}");
        }
        assert_eq!(sets, [vec![0, 2], vec![2, 3], vec![1, 3]]);
        // Pivots that the file names stay.
        assert_eq!(next_pivots(&[0, 1], pairs(&[0, 1]), &[1], &[]), Some(vec![1, 3]));
        assert_eq!(next_pivots(&[0, 1], pairs(&[0, 1]), &[0, 1], &[]), None);
    }
}
