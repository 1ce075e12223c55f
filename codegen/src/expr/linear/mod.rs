//! Small linear systems of expressions, by cofactors, block by block.
//!
//! Blocks that are too large for cofactors are torn apart first.
//! No pivot is ever divided by except the determinant of a block, so that a regular system has no spurious singularity.

mod cofactors;
mod torn;

use petgraph::algo::{maximum_matching, tarjan_scc};
use petgraph::graph::{DiGraph, NodeIndex, UnGraph};

use cofactors::{LARGEST_BLOCK, solve_by_cofactors};

use crate::DeriveError;
use crate::expr::{ExprId, Graph, Rational};

/// The solution of a linear system, and what must not vanish for it to exist.
pub(crate) struct LinearSolution {
    /// One row per unknown, one column per right-hand side.
    pub(crate) values: Vec<Vec<ExprId>>,
    /// Determinants of the blocks.
    pub(crate) determinants: Vec<ExprId>,
}

/// Solves `matrix * x = rhs` for several right-hand sides (the columns of `rhs`).
///
/// `matrix` is square, one row per equation. `what` names the system in errors.
///
/// # Errors
/// [`DeriveError::Singular`] if the form of the matrix is singular, [`DeriveError::TooLarge`] if a block is too large.
pub(crate) fn solve(
    graph: &mut Graph,
    matrix: &[Vec<ExprId>],
    rhs: &[Vec<ExprId>],
    what: &str,
) -> Result<LinearSolution, DeriveError> {
    let n = matrix.len();
    let n_rhs = rhs.first().map_or(0, Vec::len);
    let mut values = vec![vec![Graph::ZERO; n_rhs]; n];
    let mut determinants = Vec::new();
    let singular = || DeriveError::Singular { what: what.to_owned() };
    let mut rhs = rhs.to_vec();
    // Unknowns of all blocks so far.
    let mut solved: Vec<usize> = Vec::new();
    // Blocks are solved in order: each one uses only unknowns of the blocks before it.
    for (rows, columns) in triangular_blocks(matrix).ok_or_else(singular)? {
        // Known unknowns go to the right-hand side.
        for r in &rows {
            for k in 0..n_rhs {
                let mut terms = vec![(rhs[*r][k], Rational::ONE)];
                for c in &solved {
                    let known = graph.mul(matrix[*r][*c], values[*c][k]);
                    terms.push((known, Rational::MINUS_ONE));
                }
                rhs[*r][k] = graph.sum(&terms);
            }
        }
        solved.extend(&columns);
        // The block's own square system.
        let block: Vec<Vec<ExprId>> = rows
            .iter()
            .map(|r| columns.iter().map(|c| matrix[*r][*c]).collect())
            .collect();
        let block_rhs: Vec<Vec<ExprId>> = rows.iter().map(|r| rhs[*r].clone()).collect();
        let found = if rows.len() > LARGEST_BLOCK {
            let (found, regular) =
                torn::solve_by_tearing(graph, &block, &block_rhs).ok_or_else(|| DeriveError::TooLarge {
                    what: what.to_owned(),
                    size: rows.len(),
                    limit: LARGEST_BLOCK,
                })?;
            // Indices above 1 are expressions; the number 1 cannot vanish.
            determinants.extend(regular.into_iter().filter(|d| d.index() > 1));
            found
        } else {
            let (found, determinant) = solve_by_cofactors(graph, &block, &block_rhs).ok_or_else(singular)?;
            if determinant.index() > 1 {
                determinants.push(determinant);
            }
            found
        };
        for (column, value) in columns.iter().zip(found) {
            values[*column] = value;
        }
    }
    Ok(LinearSolution { values, determinants })
}

/// Rows with the columns that they determine, such that a block needs only the columns of blocks before it
/// (Dulmage and Mendelsohn 1963). `None` if no choice of one entry per row and column avoids zeros.
fn triangular_blocks(matrix: &[Vec<ExprId>]) -> Option<Vec<(Vec<usize>, Vec<usize>)>> {
    let n = matrix.len();
    // Positions of the entries of a row that are not exactly zero.
    let entries = |i: usize| (0..n).filter(move |j| matrix[i][*j] != Graph::ZERO);
    let mut bipartite = UnGraph::<(), ()>::default();
    let nodes: Vec<_> = (0..2 * n).map(|_| bipartite.add_node(())).collect();
    for i in 0..n {
        for j in entries(i) {
            bipartite.add_edge(nodes[i], nodes[n + j], ());
        }
    }
    // Matching: each row gets a column of its own in which it is not zero.
    let matching = maximum_matching(&bipartite);
    let column_of: Vec<usize> = (0..n)
        .map(|i| matching.mate(nodes[i]).map(|j| j.index() - n))
        .collect::<Option<_>>()?;
    // Directed graph of the rows: row i needs the unknown that row k determines.
    let mut needs = DiGraph::<(), ()>::default();
    let rows: Vec<_> = (0..n).map(|_| needs.add_node(())).collect();
    for i in 0..n {
        for k in 0..n {
            if i != k && matrix[i][column_of[k]] != Graph::ZERO {
                needs.add_edge(rows[i], rows[k], ());
            }
        }
    }
    // Strongly connected components come after the components that they need.
    let blocks = tarjan_scc(&needs).into_iter().map(|component| {
        let mut rows: Vec<usize> = component.into_iter().map(NodeIndex::index).collect();
        let mut columns: Vec<usize> = rows.iter().map(|i| column_of[*i]).collect();
        rows.sort_unstable();
        columns.sort_unstable();
        (rows, columns)
    });
    Some(blocks.collect())
}
