//! What a set of effects leaves at least, without a fit of its own: of a million sets only those are fitted that may be among
//! the best.

use nalgebra::DMatrix;

use super::bench::{Bench, Pick, Table};
use super::factored::Factored;
use super::problem::{Sign, Source};

/// Columns of what is added to a set that are looked at; with more nothing is said.
const MOST: usize = 7;
/// A column of which the others leave a smaller share of squares than this explains nothing. Fits pass over more.
const NOTHING: f64 = 1e-12;
/// Squares are known to this share of those that the set leaves.
const ROUNDING: f64 = 1e-9;

/// A set of which it is asked what further effects would leave.
pub(crate) struct Beyond<'a> {
    table: &'a Table,
    /// What the set explains: for each column of the table a half of its inner products.
    halves: DMatrix<f64>,
    /// Squares that the set leaves.
    squares: f64,
    /// Numbers that are free in the set at least.
    freedoms: usize,
}

impl Bench<'_> {
    /// A set in a table that holds its columns and those of what may be added.
    pub(crate) fn beyond<'a>(&self, table: &'a Table, set: &[Pick]) -> Beyond<'a> {
        let columns = set.iter().flat_map(|pick| &pick.columns);
        let places: Vec<usize> = columns.map(|k| table.place[*k]).collect();
        let n = places.len();
        let own = DMatrix::from_fn(n, n, |i, j| table.left[(places[i], places[j])]);
        let factor = Factored::new(&own);
        let with = DMatrix::from_fn(n, table.left.nrows(), |i, j| table.left[(places[i], j)]);
        let halves = factor.halves(&with);
        let mut beyond = Beyond {
            table,
            halves,
            squares: 0.0,
            freedoms: set.iter().map(|pick| self.fewest_freedoms(pick)).sum(),
        };
        let measured = beyond.measured();
        beyond.squares = beyond.product(measured, measured);
        beyond
    }

    /// The criterion of a set and further effects is no less than this.
    pub(crate) fn least_criterion(
        &self,
        beyond: &Beyond<'_>,
        further: &[&Pick],
        worth: f64,
    ) -> f64 {
        let squares = beyond.least_squares(further.iter().flat_map(|pick| &pick.columns));
        let more: usize = further.iter().map(|pick| self.fewest_freedoms(pick)).sum();
        let freedoms = (beyond.freedoms + more) as f64;
        worth * squares.max(f64::MIN_POSITIVE).ln() + freedoms * worth.ln().max(1.0)
    }

    /// Numbers that are free in an effect at least: those with the wrong sign may be none.
    fn fewest_freedoms(&self, pick: &Pick) -> usize {
        let candidate = self.candidate(pick);
        let has_sign = candidate.parameters.iter().any(|p| p.sign != Sign::Any);
        let is_body = matches!(candidate.source, Source::Body(_));
        let may_lose = candidate.refines.is_none() && candidate.searched == 0;
        if may_lose && (has_sign || is_body) {
            pick.rank.min(1)
        } else {
            self.freedoms(pick)
        }
    }
}

impl Beyond<'_> {
    fn measured(&self) -> usize {
        self.table.left.nrows() - 1
    }

    /// Inner product of two columns of the table once the set is taken off.
    fn product(&self, a: usize, b: usize) -> f64 {
        let n = self.halves.nrows();
        let [one, two] = [a, b].map(|k| &self.halves.as_slice()[k * n..(k + 1) * n]);
        let known: f64 = one.iter().zip(two).map(|(x, y)| x * y).sum();
        self.table.left[(a, b)] - known
    }

    /// Squares that the set leaves at least together with further columns.
    fn least_squares<'k>(&self, columns: impl Iterator<Item = &'k usize>) -> f64 {
        let mut places = [self.measured(); MOST + 1];
        let mut n = 0;
        for k in columns {
            if n == MOST {
                return 0.0;
            }
            places[n] = self.table.place[*k];
            n += 1;
        }
        places[n] = self.measured();
        let mut left = [[0.0; MOST + 1]; MOST + 1];
        for i in 0..=n {
            for j in 0..=i {
                left[i][j] = self.product(places[i], places[j]);
            }
        }
        for i in 0..n {
            let own = self.table.left[(places[i], places[i])];
            if left[i][i] <= NOTHING * own {
                continue;
            }
            for j in i + 1..=n {
                let share = left[j][i] / left[i][i];
                for k in i + 1..=j {
                    left[j][k] -= share * left[k][i];
                }
            }
        }
        left[n][n] - ROUNDING * self.squares
    }
}
