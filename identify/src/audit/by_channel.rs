//! A regressor stored by channel: for each channel only the columns that are not zero. This saves most of the work, as
//! the joints of one leg do not depend on those of another, and friction acts on one drive.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use crate::signal::dot;

/// A regressor whose rows are those of some channels at some samples.
#[derive(Debug, Clone)]
pub struct ChannelRegressor {
    /// Number of all columns.
    columns: usize,
    /// Rows of each channel.
    channels: Vec<ChannelRows>,
}

/// Rows of one channel with its own columns.
#[derive(Debug, Clone)]
struct ChannelRows {
    /// Indices of its columns among all columns.
    column_indices: Vec<usize>,
    /// Values, `[sample, own column]`.
    rows: DMatrix<f64>,
}

impl ChannelRegressor {
    /// Splits a regressor whose rows are interleaved per sample, `row = sample * channels + channel`.
    pub fn new(regressor: &DMatrix<f64>, channels: usize) -> Self {
        let samples = regressor.nrows() / channels.max(1);
        let one = |c: usize| {
            // A column belongs to a channel if it is not zero in all of its rows.
            let acts = |k: &usize| (0..samples).any(|i| regressor[(i * channels + c, *k)] != 0.0);
            let which: Vec<usize> = (0..regressor.ncols()).filter(acts).collect();
            let rows = DMatrix::from_fn(samples, which.len(), |i, k| regressor[(i * channels + c, which[k])]);
            ChannelRows {
                column_indices: which,
                rows,
            }
        };
        Self {
            columns: regressor.ncols(),
            channels: (0..channels).map(one).collect(),
        }
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.channels.len()
    }

    /// Number of samples of each channel.
    pub fn samples(&self) -> usize {
        self.channels.first().map_or(0, |c| c.rows.nrows())
    }

    /// The row of a channel at a sample, all columns.
    pub(super) fn row(&self, channel: usize, sample: usize) -> DVector<f64> {
        let channel = &self.channels[channel];
        let mut row = DVector::zeros(self.columns);
        for (own, k) in channel.column_indices.iter().enumerate() {
            row[*k] = channel.rows[(sample, own)];
        }
        row
    }

    /// The rows of some channels, in the order of `kept`, with all columns.
    #[must_use]
    pub fn select_channels(&self, kept: &[usize]) -> Self {
        Self {
            columns: self.columns,
            channels: kept.iter().map(|c| self.channels[*c].clone()).collect(),
        }
    }

    /// Keeps every `step`-th sample.
    #[must_use]
    pub fn subsample(&self, step: usize) -> Self {
        // The columns of a channel stay the same, even if one becomes zero.
        let kept: Vec<usize> = (0..self.samples()).step_by(step).collect();
        let channels = self.channels.iter().map(|channel| ChannelRows {
            column_indices: channel.column_indices.clone(),
            rows: channel.rows.select_rows(&kept),
        });
        Self {
            columns: self.columns,
            channels: channels.collect(),
        }
    }

    /// Appends `further` columns. Channel `c` gets the values of `of` (interleaved per sample) in the new column
    /// `takes(c)`.
    pub(super) fn append_columns(&self, further: usize, takes: impl Fn(usize) -> usize, of: &DVector<f64>) -> Self {
        let n = self.channels.len();
        let channels = self.channels.iter().enumerate().map(|(c, channel)| {
            // The new column is the last one of each channel.
            let own = channel.column_indices.len();
            let mut which = channel.column_indices.clone();
            which.push(self.columns + takes(c));
            let mut rows = channel.rows.clone().resize_horizontally(own + 1, 0.0);
            for i in 0..rows.nrows() {
                rows[(i, own)] = of[i * n + c];
            }
            ChannelRows {
                column_indices: which,
                rows,
            }
        });
        Self {
            channels: channels.collect(),
            columns: self.columns + further,
        }
    }

    /// Product of the regressor with parameter values, interleaved per sample.
    pub fn multiply(&self, values: &[f64]) -> DVector<f64> {
        let n = self.channels.len();
        let mut result = DVector::zeros(self.samples() * n);
        for (c, channel) in self.channels.iter().enumerate() {
            // Values of the columns of this channel.
            let own = DVector::from_iterator(
                channel.column_indices.len(),
                channel.column_indices.iter().map(|k| values[*k]),
            );
            for (i, value) in (&channel.rows * own).iter().enumerate() {
                result[i * n + c] = *value;
            }
        }
        result
    }

    /// Normal equations of a range of samples: matrix and right side. `weights` and `measured` are interleaved per
    /// sample.
    pub(super) fn normal_equations(
        &self,
        weights: &DVector<f64>,
        measured: &DVector<f64>,
        samples: Range<usize>,
    ) -> (DMatrix<f64>, DVector<f64>) {
        let n = self.channels.len();
        let mut normal = DMatrix::zeros(self.columns, self.columns);
        let mut right = DVector::zeros(self.columns);
        for (c, channel) in self.channels.iter().enumerate() {
            let of_channel =
                |values: &DVector<f64>| -> Vec<f64> { samples.clone().map(|sample| values[sample * n + c]).collect() };
            let (weights, forces) = (of_channel(weights), of_channel(measured));
            let (rows, height) = (channel.rows.as_slice(), channel.rows.nrows());
            let column = |k: usize| &rows[k * height..(k + 1) * height][samples.clone()];
            // Products among the columns of this channel, at their places in the complete matrix, which is symmetric.
            for (j, column_j) in channel.column_indices.iter().enumerate() {
                let weighted: Vec<f64> = column(j).iter().zip(&weights).map(|(x, weight)| x * weight).collect();
                right[*column_j] += dot(&weighted, &forces);
                for (i, column_i) in channel.column_indices[..=j].iter().enumerate() {
                    let product = dot(&weighted, column(i));
                    normal[(*column_i, *column_j)] += product;
                    if i < j {
                        normal[(*column_j, *column_i)] += product;
                    }
                }
            }
        }
        (normal, right)
    }

    /// Used rows of some channels as one dense matrix, each multiplied by the weight of its channel; with their
    /// indices, `sample * channels + channel`. It has only the columns of these channels.
    pub(super) fn dense_rows(&self, of: &[usize], counts: &[bool], weights: &[f64]) -> (DMatrix<f64>, Vec<usize>) {
        let n = self.channels.len();
        let mut place = vec![None; self.columns];
        let mut width = 0;
        // Number the columns of these channels in the order in which they first appear.
        for k in of.iter().flat_map(|c| &self.channels[*c].column_indices) {
            place[*k].get_or_insert_with(|| {
                width += 1;
                width - 1
            });
        }
        // Used rows, channel by channel.
        let rows: Vec<usize> = (of.iter())
            .flat_map(|c| (0..self.samples()).map(move |i| i * n + c))
            .filter(|row| counts[*row])
            .collect();
        let mut matrix = DMatrix::zeros(rows.len(), width);
        for (to, row) in rows.iter().enumerate() {
            let channel = &self.channels[row % n];
            let weight = weights[row % n];
            for (j, k) in channel.column_indices.iter().enumerate() {
                // Each value goes to the column with the new number.
                if let Some(at) = place[*k] {
                    matrix[(to, at)] = weight * channel.rows[(row / n, j)];
                }
            }
        }
        (matrix, rows)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::TestNoise;

    /// Products channel by channel equal those of the complete matrix.
    #[test]
    fn products_are_those_of_the_whole_matrix() {
        let mut noise = TestNoise::new(5);
        let (n, samples, columns) = (3, 40, 7);
        let whole = DMatrix::from_fn(n * samples, columns, |row, k| {
            if (row % n + k) % 2 == 0 { noise.normal() } else { 0.0 }
        });
        let weights = DVector::from_fn(n * samples, |_, _| noise.normal().abs());
        let measured = DVector::from_fn(n * samples, |_, _| noise.normal());
        let rows = ChannelRegressor::new(&whole, n);
        assert!(rows.channels.iter().all(|c| c.column_indices.len() < columns));
        let values = DVector::from_fn(columns, |_, _| noise.normal());
        let close = |a: &DMatrix<f64>, b: &DMatrix<f64>| (a - b).amax() < 1e-12;
        let column = |v: DVector<f64>| DMatrix::from_column_slice(v.len(), 1, v.as_slice());
        assert!(close(
            &column(rows.multiply(values.as_slice())),
            &column(&whole * &values)
        ));
        let (normal, right) = rows.normal_equations(&weights, &measured, 10..samples);
        let part = whole.rows_range(10 * n..);
        let weighted = DMatrix::from_diagonal(&weights.rows_range(10 * n..).into_owned()) * part;
        assert!(close(&normal, &(part.transpose() * &weighted)));
        let expected = weighted.transpose() * measured.rows_range(10 * n..);
        assert!(close(&column(right), &column(expected)));
        let further = rows.append_columns(1, |_| 0, &measured);
        assert_eq!(further.columns(), columns + 1);
        let mut one = vec![0.0; columns + 1];
        one[columns] = 1.0;
        assert!(close(&column(further.multiply(&one)), &column(measured)));
    }
}
