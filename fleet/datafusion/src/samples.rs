//! Collects samples of recordings, in any order, and converts them to bytes for the exchange between partitions.

use std::collections::BTreeMap;

use datafusion::arrow::array::{Array, ArrayRef, Float64Array, StringArray};
use datafusion::arrow::compute::cast;
use datafusion::arrow::datatypes::DataType;
use datafusion::common::{DataFusionError, Result, exec_err};
use modelmill_fleet::{FleetModel, FleetSummary};

/// Samples by recording, column by column, in the order of their arrival.
#[derive(Debug, Default)]
pub(crate) struct GroupSamples {
    /// Name of the recording, and its columns.
    recordings: BTreeMap<String, Vec<Vec<f64>>>,
}

impl GroupSamples {
    /// Adds rows: names of recordings, then numbers. Null values become NaN, which the reader of recordings refuses or
    /// leaves out, depending on the plan.
    pub(crate) fn add(&mut self, values: &[ArrayRef]) -> Result<()> {
        let Some((names, columns)) = values.split_first() else {
            return exec_err!("samples have no columns; give the recording's name, time, coordinates and forces");
        };
        // Convert names and numbers to the types that are stored.
        let names = cast(names, &DataType::Utf8)?;
        let Some(names) = names.as_any().downcast_ref::<StringArray>() else {
            return exec_err!("the names of recordings are not texts; cast the first column to text");
        };
        let columns: Vec<Float64Array> = columns
            .iter()
            .map(|column| {
                let column = cast(column, &DataType::Float64)?;
                let column = column.as_any().downcast_ref::<Float64Array>().cloned();
                column.ok_or_else(|| {
                    DataFusionError::Execution("a column of samples is not numeric; cast it to double".to_owned())
                })
            })
            .collect::<Result<_>>()?;
        // Rows without a name are one recording.
        let name = |row: usize| {
            if names.is_null(row) { "" } else { names.value(row) }
        };
        let mut from = 0;
        while from < names.len() {
            // Consecutive rows mostly belong to one recording, so they are copied together.
            let this = name(from);
            let to = (from..names.len())
                .find(|row| name(*row) != this)
                .unwrap_or(names.len());
            if !self.recordings.contains_key(this) {
                self.recordings.insert(this.to_owned(), vec![Vec::new(); columns.len()]);
            }
            if let Some(kept) = self.recordings.get_mut(this) {
                for (kept, column) in kept.iter_mut().zip(&columns) {
                    // Without null values complete slices can be copied.
                    if column.null_count() == 0 {
                        kept.extend_from_slice(&column.values()[from..to]);
                    } else {
                        let value = |row: usize| {
                            if column.is_null(row) {
                                f64::NAN
                            } else {
                                column.value(row)
                            }
                        };
                        kept.extend((from..to).map(value));
                    }
                }
            }
            from = to;
        }
        Ok(())
    }

    /// The sum of the summaries of all recordings; the samples are consumed.
    pub(crate) fn summary(&mut self, ground: &FleetModel, names: &[String]) -> Result<FleetSummary> {
        let mut sum = ground.empty_summary();
        for (recording, columns) in std::mem::take(&mut self.recordings) {
            let columns = names.iter().cloned().zip(columns).collect();
            sum.merge(&ground.summarise(&recording, columns))
                .map_err(external_error)?;
        }
        Ok(sum)
    }

    /// Memory of the samples, bytes.
    pub(crate) fn size(&self) -> usize {
        let columns = self
            .recordings
            .iter()
            .map(|(name, columns)| name.capacity() + columns.iter().map(|one| 8 * one.capacity()).sum::<usize>());
        columns.sum()
    }

    /// All samples as bytes: for each recording the lengths, the name, and the columns. The samples are consumed.
    pub(crate) fn bytes(&mut self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(self.size() + 64);
        for (name, columns) in std::mem::take(&mut self.recordings) {
            let rows = columns.first().map_or(0, Vec::len);
            // The lengths, so that the reader knows where each part ends.
            for number in [name.len(), columns.len(), rows] {
                bytes.extend_from_slice(&(number as u64).to_le_bytes());
            }
            bytes.extend_from_slice(name.as_bytes());
            for column in columns {
                for value in column {
                    bytes.extend_from_slice(&value.to_le_bytes());
                }
            }
        }
        bytes
    }

    /// Adds samples from the bytes of [`GroupSamples::bytes`].
    pub(crate) fn add_bytes(&mut self, bytes: &[u8]) -> Result<()> {
        let mut left = bytes;
        while !left.is_empty() {
            self.add_one(&mut left).ok_or_else(|| {
                DataFusionError::Execution(
                    "samples from another partition are incomplete; run the query again".to_owned(),
                )
            })?;
        }
        Ok(())
    }

    /// Adds the samples of one recording from the front of `left`; `None` if bytes are missing.
    fn add_one(&mut self, left: &mut &[u8]) -> Option<()> {
        let mut number = || usize::try_from(u64::from_le_bytes(take_bytes(left, 8)?.try_into().ok()?)).ok();
        // Lengths, then name and columns, as they were written.
        let [length, columns, rows] = [number()?, number()?, number()?];
        let name = std::str::from_utf8(take_bytes(left, length)?).ok()?.to_owned();
        let all = take_bytes(left, columns.checked_mul(rows)?.checked_mul(8)?)?;
        let kept = self.recordings.entry(name).or_insert_with(|| vec![Vec::new(); columns]);
        for (kept, column) in kept.iter_mut().zip(all.chunks_exact((8 * rows).max(1))) {
            let values = column
                .chunks_exact(8)
                .filter_map(|eight| Some(f64::from_le_bytes(eight.try_into().ok()?)));
            kept.extend(values);
        }
        Some(())
    }
}

/// Removes the first `n` bytes from `left` and returns them.
fn take_bytes<'a>(left: &mut &'a [u8], n: usize) -> Option<&'a [u8]> {
    let (taken, rest) = left.split_at_checked(n)?;
    *left = rest;
    Some(taken)
}

/// A fault of the library as an error of DataFusion.
pub(crate) fn external_error(fault: modelmill_fleet::FleetFault) -> DataFusionError {
    DataFusionError::External(Box::new(fault))
}
