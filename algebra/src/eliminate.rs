//! Gaussian elimination in the prime field, row by row.

use crate::field::FieldElement;

/// The reduced row echelon form of the rows seen so far. It does not depend on their order.
#[derive(Clone, Debug)]
pub struct RowEchelonForm<const P: u64> {
    /// In which order columns are tried as pivots; others hold none.
    order: Vec<usize>,
    /// Columns that hold a pivot, in the order in which their rows came.
    pub pivots: Vec<usize>,
    /// One row per pivot.
    rows: Vec<Vec<FieldElement<P>>>,
}

impl<const P: u64> RowEchelonForm<P> {
    /// No rows yet.
    pub fn new(order: &[usize]) -> Self {
        Self {
            order: order.to_vec(),
            pivots: Vec::new(),
            rows: Vec::new(),
        }
    }

    /// Takes a row; tells whether it says anything new.
    pub fn insert(&mut self, mut row: Vec<FieldElement<P>>) -> bool {
        // No known row has anything in the pivot column of another one, so that all factors are known at once.
        let known = self.pivots.iter().zip(&self.rows);
        let multiples: Vec<(FieldElement<P>, &[FieldElement<P>])> = known
            .map(|(pivot, known)| (-row[*pivot], known.as_slice()))
            .filter(|(factor, _)| *factor != FieldElement::ZERO)
            .collect();
        FieldElement::add_multiples(&mut row, &multiples);
        let Some(pivot) = self
            .order
            .iter()
            .copied()
            .find(|c| row[*c] != FieldElement::ZERO)
        else {
            return false;
        };
        let inverse = row[pivot].inverse().expect("a pivot is not zero");
        for x in &mut row {
            *x = *x * inverse;
        }
        for known in &mut self.rows {
            let factor = -known[pivot];
            add_multiple(known, factor, &row);
        }
        self.pivots.push(pivot);
        self.rows.push(row);
        true
    }

    /// Whether a column has shown any value but zero. Rows that say nothing new cannot be the first to show one.
    pub fn has_nonzero_value(&self, column: usize) -> bool {
        self.rows
            .iter()
            .any(|row| row[column] != FieldElement::ZERO)
    }

    /// The entry of a column in the row of a pivot; `None` if that column holds no pivot.
    pub fn entry(&self, pivot: usize, column: usize) -> Option<FieldElement<P>> {
        let row = self.pivots.iter().position(|p| *p == pivot)?;
        Some(self.rows[row][column])
    }
}

fn add_multiple<const P: u64>(
    row: &mut [FieldElement<P>],
    factor: FieldElement<P>,
    other: &[FieldElement<P>],
) {
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
pub fn null_space<const P: u64>(
    rows: Vec<Vec<FieldElement<P>>>,
    n_columns: usize,
) -> Vec<Vec<FieldElement<P>>> {
    let order: Vec<usize> = (0..n_columns).collect();
    let mut echelon = RowEchelonForm::new(&order);
    for row in rows {
        echelon.insert(row);
    }
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
