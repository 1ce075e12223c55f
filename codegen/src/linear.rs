//! Small linear systems of expressions, by cofactors, block by block.
//!
//! No pivot is ever divided by except the determinant of a block, so that a regular system has no spurious singularity.

use std::collections::HashMap;

use crate::DeriveError;
use crate::expr::{ExprId, Graph, Rational};

/// The largest block that is solved by cofactors.
const LARGEST_BLOCK: usize = 8;

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
    for (rows, columns) in blocks(matrix) {
        if rows.len() != columns.len() {
            return Err(DeriveError::Singular {
                what: what.to_owned(),
            });
        }
        if rows.len() > LARGEST_BLOCK {
            return Err(DeriveError::TooLarge {
                what: what.to_owned(),
                size: rows.len(),
                limit: LARGEST_BLOCK,
            });
        }
        let block: Vec<Vec<ExprId>> = rows
            .iter()
            .map(|r| columns.iter().map(|c| matrix[*r][*c]).collect())
            .collect();
        let all = (1u32 << rows.len()) - 1;
        let mut minors = Minors {
            matrix: &block,
            known: HashMap::new(),
        };
        let determinant = minors.minor(graph, all, all);
        if determinant == Graph::ZERO {
            return Err(DeriveError::Singular {
                what: what.to_owned(),
            });
        }
        let inverse = graph.pow(determinant, -1);
        if determinant.index() > 1 {
            determinants.push(determinant);
        }
        for k in 0..n_rhs {
            if rows.iter().all(|r| rhs[*r][k] == Graph::ZERO) {
                continue;
            }
            for (j, column) in columns.iter().enumerate() {
                let mut terms = Vec::new();
                for (i, row) in rows.iter().enumerate() {
                    if rhs[*row][k] == Graph::ZERO {
                        continue;
                    }
                    let minor = minors.minor(graph, all & !(1 << i), all & !(1 << j));
                    let sign = if (i + j) % 2 == 0 {
                        Rational::ONE
                    } else {
                        Rational::MINUS_ONE
                    };
                    terms.push((graph.mul(minor, rhs[*row][k]), sign));
                }
                let numerator = graph.sum(&terms);
                values[*column][k] = graph.mul(numerator, inverse);
            }
        }
    }
    Ok(Solution {
        values,
        determinants,
    })
}

/// Connected components of the matrix's pattern: sets of rows with the columns that they share.
fn blocks(matrix: &[Vec<ExprId>]) -> Vec<(Vec<usize>, Vec<usize>)> {
    let n_columns = matrix.first().map_or(0, Vec::len);
    let mut row_done = vec![false; matrix.len()];
    let mut column_done = vec![false; n_columns];
    let mut found = Vec::new();
    for start in 0..n_columns {
        if column_done[start] {
            continue;
        }
        let (mut rows, mut columns, mut frontier) = (Vec::new(), Vec::new(), vec![start]);
        column_done[start] = true;
        while let Some(column) = frontier.pop() {
            columns.push(column);
            for (i, row) in matrix.iter().enumerate() {
                if row[column] == Graph::ZERO || row_done[i] {
                    continue;
                }
                row_done[i] = true;
                rows.push(i);
                for (j, entry) in row.iter().enumerate() {
                    if *entry != Graph::ZERO && !column_done[j] {
                        column_done[j] = true;
                        frontier.push(j);
                    }
                }
            }
        }
        rows.sort_unstable();
        columns.sort_unstable();
        found.push((rows, columns));
    }
    found
}

/// Minors by expansion along their first row, each computed once.
struct Minors<'a> {
    matrix: &'a [Vec<ExprId>],
    known: HashMap<(u32, u32), ExprId>,
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
