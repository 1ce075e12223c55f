//! Linear systems of legs that share a platform: too large for cofactors at once, small after they are torn apart.
//!
//! Without the columns that tie everything together, such as the rates of a platform, a system falls into parts with
//! more rows than columns. A part with one row too many has one combination of its rows in which its own unknowns
//! cancel; its factors are the part's maximal minors. These combinations make up a small system for the columns that
//! were torn out, and every part follows by least squares, which here are exact and divide by a sum of squares: a part
//! is singular only where its own unknowns are not determined. (Tearing: Kron 1963.)

use super::cofactors::{LARGEST_BLOCK, determinant, solve_by_cofactors};
use crate::expr::{ExprId, Graph, Rational};

/// Rows and columns that remain connected without the torn columns.
struct ConnectedBlock {
    /// Indices of the rows, in increasing order.
    rows: Vec<usize>,
    /// Indices of the columns, in increasing order.
    columns: Vec<usize>,
}

/// Solves `matrix * x = rhs`: returns one row of values per unknown, then the determinants that must not vanish. `None`
/// where the system cannot be torn apart this way, or is singular.
pub(crate) fn solve_by_tearing(
    graph: &mut Graph,
    matrix: &[Vec<ExprId>],
    rhs: &[Vec<ExprId>],
) -> Option<(Vec<Vec<ExprId>>, Vec<ExprId>)> {
    let (torn, parts) = tear(matrix)?;
    let (n, n_rhs) = (matrix.len(), rhs.first().map_or(0, Vec::len));
    let mut determinants = Vec::new();
    // The small system: combinations of rows in which all columns but the torn ones cancel.
    let (mut small, mut small_rhs) = (Vec::new(), Vec::new());
    for part in &parts {
        let combinations = cancelling_rows(graph, matrix, part);
        for factors in combinations {
            let combine = |graph: &mut Graph, of: &[Vec<ExprId>], column: usize| {
                let terms: Vec<ExprId> = factors
                    .iter()
                    .map(|(row, factor)| graph.mul(*factor, of[*row][column]))
                    .collect();
                graph.add_all(&terms)
            };
            small.push(torn.iter().map(|c| combine(graph, matrix, *c)).collect::<Vec<_>>());
            small_rhs.push((0..n_rhs).map(|k| combine(graph, rhs, k)).collect::<Vec<_>>());
        }
    }
    // Its solution gives the torn unknowns.
    let (of_torn, determinant) = solve_by_cofactors(graph, &small, &small_rhs)?;
    determinants.push(determinant);
    let mut values = vec![vec![Graph::ZERO; n_rhs]; n];
    for (column, value) in torn.iter().zip(of_torn) {
        values[*column] = value;
    }
    // With these on the right-hand side, each part is solved on its own.
    for part in parts.iter().filter(|part| !part.columns.is_empty()) {
        let rest: Vec<Vec<ExprId>> = part
            .rows
            .iter()
            .map(|row| {
                (0..n_rhs)
                    .map(|k| {
                        let mut terms = vec![(rhs[*row][k], Rational::ONE)];
                        for c in &torn {
                            let known = graph.mul(matrix[*row][*c], values[*c][k]);
                            terms.push((known, Rational::MINUS_ONE));
                        }
                        graph.sum(&terms)
                    })
                    .collect()
            })
            .collect();
        let own: Vec<Vec<ExprId>> = part
            .rows
            .iter()
            .map(|row| part.columns.iter().map(|c| matrix[*row][*c]).collect())
            .collect();
        // A part with one row more than columns is solved by its normal equations.
        let (own, rest) = if part.rows.len() == part.columns.len() {
            (own, rest)
        } else {
            (
                transposed_times(graph, &own, &own),
                transposed_times(graph, &own, &rest),
            )
        };
        let (found, determinant) = solve_by_cofactors(graph, &own, &rest)?;
        determinants.push(determinant);
        for (column, value) in part.columns.iter().zip(found) {
            values[*column] = value;
        }
    }
    Some((values, determinants))
}

/// The fewest columns to tear out, those with the most rows first, so that the remaining parts can be solved.
fn tear(matrix: &[Vec<ExprId>]) -> Option<(Vec<usize>, Vec<ConnectedBlock>)> {
    let n = matrix.len();
    let mut order: Vec<usize> = (0..n).collect();
    let rows_of = |c: usize| (0..n).filter(|r| matrix[*r][c] != Graph::ZERO).count();
    order.sort_by_key(|c| std::cmp::Reverse(rows_of(*c)));
    (1..=LARGEST_BLOCK.min(n)).find_map(|k| {
        let (torn, rest) = order.split_at(k);
        let parts = connected_blocks(matrix, rest);
        // A part is solvable with as many rows as columns or one more, or if it has no columns of its own.
        let is_fine = parts.iter().all(|part| {
            let (r, c) = (part.rows.len(), part.columns.len());
            c <= LARGEST_BLOCK && (r == c || r == c + 1 || c == 0)
        });
        is_fine.then(|| (torn.to_vec(), parts))
    })
}

/// Connected components of rows and some columns.
fn connected_blocks(matrix: &[Vec<ExprId>], columns: &[usize]) -> Vec<ConnectedBlock> {
    let mut parts: Vec<ConnectedBlock> = Vec::new();
    for (row, entries) in matrix.iter().enumerate() {
        let own: Vec<usize> = columns.iter().copied().filter(|c| entries[*c] != Graph::ZERO).collect();
        let mut joined = ConnectedBlock {
            rows: vec![row],
            columns: own,
        };
        // Parts that share a column with this row become one part with it.
        let (touching, others) = parts
            .into_iter()
            .partition(|part: &ConnectedBlock| part.columns.iter().any(|c| joined.columns.contains(c)));
        parts = others;
        for part in touching {
            let part: ConnectedBlock = part;
            joined.rows.extend(part.rows);
            joined.columns.extend(part.columns);
        }
        joined.rows.sort_unstable();
        joined.columns.sort_unstable();
        joined.columns.dedup();
        parts.push(joined);
    }
    parts
}

/// Combinations of a part's rows, as pairs of a row and its factor, in which the part's own columns cancel.
fn cancelling_rows(graph: &mut Graph, matrix: &[Vec<ExprId>], part: &ConnectedBlock) -> Vec<Vec<(usize, ExprId)>> {
    // Rows without own columns are equations of the torn unknowns already.
    if part.columns.is_empty() {
        return part.rows.iter().map(|row| vec![(*row, Graph::ONE)]).collect();
    }
    // A square part only determines its own unknowns.
    if part.rows.len() == part.columns.len() {
        return Vec::new();
    }
    // One row too many: the signed maximal minors are the factors of the combination.
    let factors = part
        .rows
        .iter()
        .enumerate()
        .map(|(i, row)| {
            let others: Vec<Vec<ExprId>> = part
                .rows
                .iter()
                .filter(|other| *other != row)
                .map(|other| part.columns.iter().map(|c| matrix[*other][*c]).collect())
                .collect();
            let minor = determinant(graph, &others);
            let signed = if i % 2 == 0 { minor } else { graph.neg(minor) };
            (*row, signed)
        })
        .collect();
    vec![factors]
}

/// The matrix product of the transpose of `a` with `b`; both have the same number of rows.
fn transposed_times(graph: &mut Graph, a: &[Vec<ExprId>], b: &[Vec<ExprId>]) -> Vec<Vec<ExprId>> {
    let (n, m) = (a.first().map_or(0, Vec::len), b.first().map_or(0, Vec::len));
    (0..n)
        .map(|i| {
            (0..m)
                .map(|j| {
                    let terms: Vec<ExprId> = a.iter().zip(b).map(|(a, b)| graph.mul(a[i], b[j])).collect();
                    graph.add_all(&terms)
                })
                .collect()
        })
        .collect()
}
