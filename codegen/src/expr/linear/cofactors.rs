//! Systems and determinants of at most ten rows, by expansion along their rows.

use rustc_hash::FxHashMap;

use crate::expr::{ExprId, Graph, Rational};

/// The largest block that is solved by cofactors.
pub(super) const LARGEST_BLOCK: usize = 10;

/// Solves a small system by cofactors: one row of values per unknown, and the determinant. `None` if that is zero.
pub(super) fn solve_by_cofactors(
    graph: &mut Graph,
    block: &[Vec<ExprId>],
    rhs: &[Vec<ExprId>],
) -> Option<(Vec<Vec<ExprId>>, ExprId)> {
    let (n, n_rhs) = (block.len(), rhs.first().map_or(0, Vec::len));
    // Sets of rows and columns are bit masks.
    let all = (1u32 << n) - 1;
    let mut minors = MinorExpansion {
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
        // A right-hand side of zeros has the solution zero.
        if rhs.iter().all(|row| row[k] == Graph::ZERO) {
            continue;
        }
        for (j, value) in values.iter_mut().enumerate() {
            let mut terms = Vec::new();
            for (i, row) in rhs.iter().enumerate() {
                if row[k] == Graph::ZERO {
                    continue;
                }
                // Cramer's rule: the right-hand side replaces column j and is expanded along it.
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

/// The determinant of a square matrix of at most 31 rows.
pub(super) fn determinant(graph: &mut Graph, matrix: &[Vec<ExprId>]) -> ExprId {
    let all = (1u32 << matrix.len()) - 1;
    let mut minors = MinorExpansion {
        matrix,
        known: FxHashMap::default(),
    };
    minors.minor(graph, all, all)
}

/// Minors by expansion along their first row. Each minor is computed once and stored.
struct MinorExpansion<'a> {
    /// The complete matrix, one vector per row.
    matrix: &'a [Vec<ExprId>],
    /// Minors by bit masks of their rows and columns.
    known: FxHashMap<(u32, u32), ExprId>,
}

impl MinorExpansion<'_> {
    /// The minor of the rows and columns whose bits are set; the determinant of no rows is 1.
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
