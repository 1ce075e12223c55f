//! Gaussian elimination in the prime field, row by row: rows go in, their reduced row echelon form comes out.

use crate::field::FieldElement;

/// The reduced row echelon form of the rows inserted so far. It does not depend on their order.
#[derive(Clone, Debug)]
pub struct RowEchelonForm<const P: u64> {
    /// Columns in the order in which they are tried as pivots; other columns are never pivots.
    order: Vec<usize>,
    /// Pivot columns, in the order of their rows.
    pub pivots: Vec<usize>,
    /// One row per pivot, with 1 in its pivot column and 0 in all other pivot columns.
    rows: Vec<Vec<FieldElement<P>>>,
    /// The row of each pivot column.
    row_of: Vec<Option<usize>>,
}

impl<const P: u64> RowEchelonForm<P> {
    /// Without rows; `order` lists the columns that may become pivots.
    pub fn new(order: &[usize]) -> Self {
        Self {
            order: order.to_vec(),
            pivots: Vec::new(),
            rows: Vec::new(),
            row_of: Vec::new(),
        }
    }

    /// Inserts a row, and returns whether it is independent of the rows so far.
    pub fn insert(&mut self, mut row: Vec<FieldElement<P>>) -> bool {
        // No known row has anything in the pivot column of another one, so that all factors are known at once.
        let known = self.pivots.iter().zip(&self.rows);
        let multiples: Vec<(FieldElement<P>, &[FieldElement<P>])> = known
            .map(|(pivot, known)| (-row[*pivot], known.as_slice()))
            .filter(|(factor, _)| *factor != FieldElement::ZERO)
            .collect();
        FieldElement::add_multiples(&mut row, &multiples);
        let Some(pivot) = self.order.iter().copied().find(|c| row[*c] != FieldElement::ZERO) else {
            return false;
        };
        // The new row is scaled, and its pivot is eliminated from the known rows.
        let inverse = row[pivot].inverse().expect("a pivot is not zero");
        for x in &mut row {
            *x = *x * inverse;
        }
        for known in &mut self.rows {
            let factor = -known[pivot];
            add_multiple(known, factor, &row);
        }
        self.row_of.resize(row.len(), None);
        self.row_of[pivot] = Some(self.rows.len());
        self.pivots.push(pivot);
        self.rows.push(row);
        true
    }

    /// Whether a column has any entry other than zero. A dependent row cannot be the first with such an entry.
    pub fn has_nonzero_value(&self, column: usize) -> bool {
        self.rows.iter().any(|row| row[column] != FieldElement::ZERO)
    }

    /// The entry of a column in the row of a pivot; `None` if `pivot` is no pivot column.
    pub fn entry(&self, pivot: usize, column: usize) -> Option<FieldElement<P>> {
        let row = self.row_of.get(pivot).copied().flatten()?;
        Some(self.rows[row][column])
    }
}

/// Adds `factor * other` to a row.
fn add_multiple<const P: u64>(row: &mut [FieldElement<P>], factor: FieldElement<P>, other: &[FieldElement<P>]) {
    if factor == FieldElement::ZERO {
        return;
    }
    for (x, y) in row.iter_mut().zip(other) {
        if *y != FieldElement::ZERO {
            *x = x.plus_product(factor, *y);
        }
    }
}

/// A basis of the solutions of `rows * x = 0`, one vector per column without pivot.
pub fn null_space<const P: u64>(rows: Vec<Vec<FieldElement<P>>>, n_columns: usize) -> Vec<Vec<FieldElement<P>>> {
    let order: Vec<usize> = (0..n_columns).collect();
    let mut echelon = RowEchelonForm::new(&order);
    for row in rows {
        echelon.insert(row);
    }
    // One solution per column without pivot: that unknown is 1, and the pivot unknowns are determined.
    (0..n_columns)
        .filter(|c| !echelon.pivots.contains(c))
        .map(|free| {
            let mut x = vec![FieldElement::ZERO; n_columns];
            x[free] = FieldElement::ONE;
            for (row, pivot) in echelon.rows.iter().zip(&echelon.pivots) {
                x[*pivot] = -row[free];
            }
            x
        })
        .collect()
}
