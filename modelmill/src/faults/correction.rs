//! Corrections of a recording: as a change of sampled states, with which a hypothesis is tested, and as an operation on
//! the recording as it was read, which is then prepared again.

use modelmill_identify::{ColumnScaling, SignalRecording};

/// A change of the motion at samples.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum MotionChange {
    /// The motion stays as it is.
    None,
    /// Coordinates are multiplied by a factor for positions, rates and accelerations each.
    Scale(Vec<(usize, [f64; 3])>),
    /// Two coordinates are exchanged. The difference of their zeros, second minus first, stays.
    Exchange(usize, usize, f64),
}

impl MotionChange {
    /// Changes the columns of one order: 0 for positions, 1 for rates, 2 for accelerations.
    pub(super) fn apply(&self, order: usize, columns: &mut [Vec<f64>]) {
        match self {
            Self::None => {}
            Self::Scale(scaled) => {
                for (coordinate, factors) in scaled {
                    columns[*coordinate].iter_mut().for_each(|x| *x *= factors[order]);
                }
            }
            Self::Exchange(a, b, difference) => {
                columns.swap(*a, *b);
                if order == 0 {
                    columns[*a].iter_mut().for_each(|x| *x -= difference);
                    columns[*b].iter_mut().for_each(|x| *x += difference);
                }
            }
        }
    }
}

/// A change of the measured forces: for each drive that changes, the drive whose column it gets, and a factor. Offsets of
/// columns are left out here.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct ForceChange(pub(super) Vec<(usize, usize, f64)>);

impl ForceChange {
    /// The column and the factor of a drive.
    pub(super) fn source(&self, drive: usize) -> (usize, f64) {
        let changed = self.0.iter().find(|(to, _, _)| *to == drive);
        changed.map_or((drive, 1.0), |(_, from, factor)| (*from, *factor))
    }

    /// Sum of squares of the changed force of a drive, from the sums of all columns.
    pub(super) fn squares(&self, drive: usize, squares: &[f64]) -> f64 {
        let (from, factor) = self.source(drive);
        factor * factor * squares[from]
    }
}

/// An operation on the columns of a recording.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum ColumnOperation {
    /// Columns are multiplied by a factor.
    Scale(Vec<String>, f64),
    /// Pairs of columns are exchanged, each with the scalings that turn the first into the second, and back.
    Exchange(Vec<(String, String, [ColumnScaling; 2])>),
}

/// The trial correction of a fault.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum FaultCorrection {
    /// Columns of the recording change.
    Columns(Vec<ColumnOperation>),
    /// The model gets this vector of gravity, m/s^2.
    Gravity([f64; 3]),
}

impl ColumnOperation {
    /// The factor for a coordinate with those of its derivatives that are recorded in the same unit.
    pub(super) fn scale(names: impl IntoIterator<Item = String>, factor: f64) -> Self {
        Self::Scale(names.into_iter().collect(), factor)
    }

    /// A force with its variance, multiplied by a factor.
    pub(super) fn scale_force(drive: &str, factor: f64) -> [Self; 2] {
        [
            Self::Scale(vec![drive.to_owned()], factor),
            Self::Scale(vec![format!("{drive}_var")], factor * factor),
        ]
    }

    /// Two coordinates with their derivatives; `difference` of their zeros, second minus first, stays. A unit belongs to the
    /// column of the file and moves with it.
    pub(super) fn exchange_coordinates(one: &str, other: &str, difference: f64) -> Self {
        let shift = |offset: f64| ColumnScaling { factor: 1.0, offset };
        let pair = |suffix: &str| {
            let offset = if suffix.is_empty() { difference } else { 0.0 };
            let conversions = [shift(offset), shift(-offset)];
            (format!("{one}{suffix}"), format!("{other}{suffix}"), conversions)
        };
        Self::Exchange(["", "_d", "_dd"].map(pair).into())
    }

    /// Two forces with their variances. Ratios and motor constants belong to the drives: `conversions` turn the force of the
    /// first into that of the second, and back.
    pub(super) fn exchange_forces(one: &str, other: &str, conversions: [ColumnScaling; 2]) -> Self {
        let squared = conversions.map(|scaling| ColumnScaling {
            factor: scaling.factor * scaling.factor,
            offset: 0.0,
        });
        let pair = |suffix: &str, conversions| (format!("{one}{suffix}"), format!("{other}{suffix}"), conversions);
        Self::Exchange(vec![pair("", conversions), pair("_var", squared)])
    }

    /// Applies the operation to a recording.
    pub(crate) fn apply(&self, raw: &mut SignalRecording) {
        match self {
            Self::Scale(names, factor) => names.iter().for_each(|name| raw.scale_column(name, *factor)),
            Self::Exchange(pairs) => {
                for (one, other, conversions) in pairs {
                    raw.exchange_columns(one, other, *conversions);
                }
            }
        }
    }
}
