//! Small linear systems of expressions, by cofactors, block by block.
//!
//! Blocks that are too large for that are torn apart first.
//! No pivot is ever divided by except the determinant of a block, so that a regular system has no spurious singularity.

mod torn;

use rustc_hash::FxHashMap;

use petgraph::algo::{maximum_matching, tarjan_scc};
use petgraph::graph::{DiGraph, NodeIndex, UnGraph};

use crate::DeriveError;
use crate::expr::{ExprId, Graph, Rational};

/// The largest block that is solved by cofactors.
pub(crate) const LARGEST_BLOCK: usize = 10;

/// The solution of a linear system, and what must not vanish for it to exist.
pub(crate) struct Solution {
    /// One row per unknown, one column per right-hand side.
    pub(crate) values: Vec<Vec<ExprId>>,
    /// Determinants of the blocks.
    pub(crate) determinants: Vec<ExprId>,
}

/// Solves `matrix * x = rhs` for several right-hand sides (the columns of `rhs`).
pub(crate) fn solve(
    graph: &mut Graph,
    matrix: &[Vec<ExprId>],
    rhs: &[Vec<ExprId>],
    what: &str,
) -> Result<Solution, DeriveError> {
    let n = matrix.len();
    let n_rhs = rhs.first().map_or(0, Vec::len);
    let mut values = vec![vec![Graph::ZERO; n_rhs]; n];
    let mut determinants = Vec::new();
    let singular = || DeriveError::Singular {
        what: what.to_owned(),
    };
    let mut rhs = rhs.to_vec();
    let mut solved: Vec<usize> = Vec::new();
    for (rows, columns) in blocks(matrix).ok_or_else(singular)? {
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
        let block: Vec<Vec<ExprId>> = rows
            .iter()
            .map(|r| columns.iter().map(|c| matrix[*r][*c]).collect())
            .collect();
        let block_rhs: Vec<Vec<ExprId>> = rows.iter().map(|r| rhs[*r].clone()).collect();
        let found = if rows.len() > LARGEST_BLOCK {
            let (found, regular) =
                torn::solve(graph, &block, &block_rhs).ok_or_else(|| DeriveError::TooLarge {
                    what: what.to_owned(),
                    size: rows.len(),
                    limit: LARGEST_BLOCK,
                })?;
            determinants.extend(regular.into_iter().filter(|d| d.index() > 1));
            found
        } else {
            let (found, determinant) =
                by_cofactors(graph, &block, &block_rhs).ok_or_else(singular)?;
            if determinant.index() > 1 {
                determinants.push(determinant);
            }
            found
        };
        for (column, value) in columns.iter().zip(found) {
            values[*column] = value;
        }
    }
    Ok(Solution {
        values,
        determinants,
    })
}

/// Solves a small system by cofactors: one row of values per unknown, and the determinant. `None` if that is zero.
pub(crate) fn by_cofactors(
    graph: &mut Graph,
    block: &[Vec<ExprId>],
    rhs: &[Vec<ExprId>],
) -> Option<(Vec<Vec<ExprId>>, ExprId)> {
    let (n, n_rhs) = (block.len(), rhs.first().map_or(0, Vec::len));
    let all = (1u32 << n) - 1;
    let mut minors = Minors {
        matrix: block,
        known: FxHashMap::default(),
    };
    let determinant = minors.minor(graph, all, all);
    if determinant == Graph::ZERO {
        return None;
    }
    let inverse = graph.pow(determinant, -1);
    let mut values = vec![vec![Graph::ZERO; n_rhs]; n];
    for k in 0..n_rhs {
        if rhs.iter().all(|row| row[k] == Graph::ZERO) {
            continue;
        }
        for (j, value) in values.iter_mut().enumerate() {
            let mut terms = Vec::new();
            for (i, row) in rhs.iter().enumerate() {
                if row[k] == Graph::ZERO {
                    continue;
                }
                let minor = minors.minor(graph, all & !(1 << i), all & !(1 << j));
                let sign = if (i + j) % 2 == 0 {
                    Rational::ONE
                } else {
                    Rational::MINUS_ONE
                };
                terms.push((graph.mul(minor, row[k]), sign));
            }
            let numerator = graph.sum(&terms);
            value[k] = graph.mul(numerator, inverse);
        }
    }
    Some((values, determinant))
}

/// The determinant of a small matrix.
pub(crate) fn determinant(graph: &mut Graph, matrix: &[Vec<ExprId>]) -> ExprId {
    let all = (1u32 << matrix.len()) - 1;
    let mut minors = Minors {
        matrix,
        known: FxHashMap::default(),
    };
    minors.minor(graph, all, all)
}

/// Rows with the columns that they determine, such that a block needs only the columns of blocks before it
/// (Dulmage and Mendelsohn 1963). `None` if no choice of one entry per row and column avoids zeros.
fn blocks(matrix: &[Vec<ExprId>]) -> Option<Vec<(Vec<usize>, Vec<usize>)>> {
    let n = matrix.len();
    let entries = |i: usize| (0..n).filter(move |j| matrix[i][*j] != Graph::ZERO);
    let mut bipartite = UnGraph::<(), ()>::default();
    let nodes: Vec<_> = (0..2 * n).map(|_| bipartite.add_node(())).collect();
    for i in 0..n {
        for j in entries(i) {
            bipartite.add_edge(nodes[i], nodes[n + j], ());
        }
    }
    let matching = maximum_matching(&bipartite);
    let column_of: Vec<usize> = (0..n)
        .map(|i| matching.mate(nodes[i]).map(|j| j.index() - n))
        .collect::<Option<_>>()?;
    let mut needs = DiGraph::<(), ()>::default();
    let rows: Vec<_> = (0..n).map(|_| needs.add_node(())).collect();
    for i in 0..n {
        for k in 0..n {
            if i != k && matrix[i][column_of[k]] != Graph::ZERO {
                needs.add_edge(rows[i], rows[k], ());
            }
        }
    }
    // Components come with what they need before them.
    let blocks = tarjan_scc(&needs).into_iter().map(|component| {
        let mut rows: Vec<usize> = component.into_iter().map(NodeIndex::index).collect();
        let mut columns: Vec<usize> = rows.iter().map(|i| column_of[*i]).collect();
        rows.sort_unstable();
        columns.sort_unstable();
        (rows, columns)
    });
    Some(blocks.collect())
}

/// Minors by expansion along their first row, each computed once.
struct Minors<'a> {
    matrix: &'a [Vec<ExprId>],
    known: FxHashMap<(u32, u32), ExprId>,
}

impl Minors<'_> {
    fn minor(&mut self, graph: &mut Graph, rows: u32, columns: u32) -> ExprId {
        if rows == 0 {
            return Graph::ONE;
        }
        if let Some(value) = self.known.get(&(rows, columns)) {
            return *value;
        }
        let row = rows.trailing_zeros();
        let mut terms = Vec::new();
        let mut sign = Rational::ONE;
        for column in (0..u32::BITS as usize).filter(|c| columns & (1 << c) != 0) {
            let entry = self.matrix[row as usize][column];
            if entry != Graph::ZERO {
                let minor = self.minor(graph, rows & !(1 << row), columns & !(1 << column));
                terms.push((graph.mul(entry, minor), sign.clone()));
            }
            sign = -&sign;
        }
        let value = graph.sum(&terms);
        self.known.insert((rows, columns), value);
        value
    }
}
