//! Columns: what a parameter adds to the forces along all recordings, per unit of the parameter.

use std::borrow::Cow;

use crate::signal::add_multiples;

/// Values along all recordings, `[channel][sample]`: recordings of the fit first, then validation runs. `None` for a
/// channel on which the column is zero throughout.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ForceColumn(pub Vec<Option<Vec<f64>>>);

impl ForceColumn {
    /// A column from all of its channels; those that are zero throughout are left out.
    pub fn new(channels: Vec<Vec<f64>>) -> Self {
        // A channel of zeros needs no memory.
        let sparse = |values: Vec<f64>| values.iter().any(|x| *x != 0.0).then_some(values);
        Self(channels.into_iter().map(sparse).collect())
    }

    /// Adds a multiple of another column.
    pub fn add(&mut self, factor: f64, other: &Self) {
        for (slot, values) in self.0.iter_mut().zip(&other.0) {
            let Some(values) = values else { continue };
            match slot {
                // A channel that is zero so far takes a copy of the other column.
                Some(sum) => {
                    for (s, x) in sum.iter_mut().zip(values) {
                        *s += factor * x;
                    }
                }
                None => *slot = Some(values.iter().map(|x| factor * x).collect()),
            }
        }
    }

    /// Adds multiples of other columns, in their order.
    pub(crate) fn add_all(&mut self, parts: &[(f64, &Self)]) {
        for (d, slot) in self.0.iter_mut().enumerate() {
            let terms: Vec<(f64, &[f64])> = parts
                .iter()
                .filter_map(|(factor, column)| Some((*factor, column.0.get(d)?.as_deref()?)))
                .collect();
            if let Some((_, first)) = terms.first() {
                add_multiples(slot.get_or_insert_with(|| vec![0.0; first.len()]), &terms);
            }
        }
    }

    /// Channels on which it is not zero.
    pub fn channels(&self) -> impl Iterator<Item = usize> + '_ {
        self.0
            .iter()
            .enumerate()
            .filter_map(|(d, values)| values.as_ref().map(|_| d))
    }

    /// Channels on which both columns act, with the values of both.
    pub(crate) fn common_channels<'a>(
        &'a self,
        other: &'a Self,
    ) -> impl Iterator<Item = (usize, &'a [f64], &'a [f64])> {
        // Channels on which one of both is zero are left out.
        let pairs = self.0.iter().zip(&other.0).enumerate();
        pairs.filter_map(|(d, (a, b))| Some((d, a.as_deref()?, b.as_deref()?)))
    }

    /// Whether it is zero everywhere.
    pub fn is_zero(&self) -> bool {
        self.0.iter().all(Option::is_none)
    }
}

impl<'a> From<&'a ForceColumn> for Cow<'a, ForceColumn> {
    fn from(column: &'a ForceColumn) -> Self {
        Cow::Borrowed(column)
    }
}

impl From<ForceColumn> for Cow<'_, ForceColumn> {
    fn from(column: ForceColumn) -> Self {
        Cow::Owned(column)
    }
}
