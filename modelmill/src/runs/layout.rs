//! The order of the columns of a run: base parameters, followed by everything that may change.

use crate::model::Model;
use crate::runs::payload::{PayloadColumns, TEN};

/// Numbers of columns, from which the index of each column follows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RunColumnLayout {
    /// Number of unknown base parameters.
    pub(crate) base: usize,
    /// Number of frames that may carry a load.
    pub(crate) payloads: usize,
    /// Number of drives.
    pub(crate) drives: usize,
    /// Number of active coordinates.
    pub(crate) coordinates: usize,
}

impl RunColumnLayout {
    /// The layout for a model and its payload columns.
    pub(crate) fn new(model: &Model, payloads: &PayloadColumns) -> Self {
        Self {
            base: (0..model.base.len()).filter(|k| !model.is_known(*k)).count(),
            payloads: payloads.frames.len(),
            drives: model.row_names().len(),
            coordinates: model.active_coordinates().len(),
        }
    }

    /// First of the ten columns of a load on a frame.
    pub(crate) fn payload(self, frame: usize) -> usize {
        self.base + TEN * frame
    }

    /// The columns of base parameters, and of friction and constant forces of all drives.
    pub(crate) fn model_and_drives(self) -> Vec<usize> {
        (0..self.base).chain(self.friction(0)..self.scale(0)).collect()
    }

    /// Dry friction of a drive; viscous friction is the next column.
    pub(crate) fn friction(self, drive: usize) -> usize {
        self.payload(self.payloads) + 2 * drive
    }

    /// The constant force on a drive.
    pub(crate) fn offset(self, drive: usize) -> usize {
        self.friction(self.drives) + drive
    }

    /// The scale of a drive's measured force.
    pub(crate) fn scale(self, drive: usize) -> usize {
        self.offset(self.drives) + drive
    }

    /// The clock of the run.
    pub(crate) fn clock(self) -> usize {
        self.scale(self.drives)
    }

    /// The zero of a coordinate's encoder.
    pub(crate) fn zero(self, coordinate: usize) -> usize {
        self.clock() + 1 + coordinate
    }

    /// Total number of columns.
    pub(crate) fn total(self) -> usize {
        self.zero(self.coordinates)
    }
}
