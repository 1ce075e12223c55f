//! Gaussian elimination in the prime field.

use crate::field::Element;

/// A matrix in reduced row echelon form.
#[derive(Clone, Debug)]
pub(crate) struct Echelon {
    /// Columns that hold a pivot, in the order in which they were taken.
    pub(crate) pivots: Vec<usize>,
    /// One row per pivot.
    pub(crate) rows: Vec<Vec<Element>>,
}

impl Echelon {
    /// The entry of a column in the row of a pivot; `None` if that column holds no pivot.
    pub(crate) fn entry(&self, pivot: usize, column: usize) -> Option<Element> {
        let row = self.pivots.iter().position(|p| *p == pivot)?;
        Some(self.rows[row][column])
    }
}

/// Reduces `rows`, looking for pivots in the columns in the given order.
pub(crate) fn echelon(mut rows: Vec<Vec<Element>>, order: &[usize]) -> Echelon {
    let mut pivots = Vec::new();
    let mut rank = 0;
    for &column in order {
        let Some(found) = (rank..rows.len()).find(|r| rows[*r][column] != Element::ZERO) else {
            continue;
        };
        rows.swap(rank, found);
        let inverse = rows[rank][column].inverse().expect("a pivot is not zero");
        for x in &mut rows[rank] {
            *x = *x * inverse;
        }
        let pivot_row = std::mem::take(&mut rows[rank]);
        for (r, row) in rows.iter_mut().enumerate() {
            if r == rank || row[column] == Element::ZERO {
                continue;
            }
            let factor = -row[column];
            for (x, y) in row.iter_mut().zip(&pivot_row) {
                if *y != Element::ZERO {
                    *x = *x + factor * *y;
                }
            }
        }
        rows[rank] = pivot_row;
        pivots.push(column);
        rank += 1;
        if rank == rows.len() {
            break;
        }
    }
    rows.truncate(rank);
    Echelon { pivots, rows }
}

/// A basis of the solutions of `rows * x = 0`, one vector per column without pivot.
pub(crate) fn null_space(rows: Vec<Vec<Element>>, n_columns: usize) -> Vec<Vec<Element>> {
    let order: Vec<usize> = (0..n_columns).collect();
    let echelon = echelon(rows, &order);
    (0..n_columns)
        .filter(|c| !echelon.pivots.contains(c))
        .map(|free| {
            let mut x = vec![Element::ZERO; n_columns];
            x[free] = Element::ONE;
            for (row, pivot) in echelon.rows.iter().zip(&echelon.pivots) {
                x[*pivot] = -row[free];
            }
            x
        })
        .collect()
}
