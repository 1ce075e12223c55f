//! Where the columns of a run stand: those of the base parameters, and behind them those of everything that may change.

use crate::model::Model;
use crate::runs::payload::{PayloadColumns, TEN};

/// Where columns stand.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RunColumnLayout {
    pub(crate) base: usize,
    pub(crate) payloads: usize,
    pub(crate) drives: usize,
    pub(crate) coordinates: usize,
}

impl RunColumnLayout {
    pub(crate) fn new(model: &Model, payloads: &PayloadColumns) -> Self {
        Self {
            base: (0..model.base.len())
                .filter(|k| !model.is_known(*k))
                .count(),
            payloads: payloads.frames.len(),
            drives: model.drives().len(),
            coordinates: model.active_coordinates().len(),
        }
    }

    pub(crate) fn payload(self, frame: usize) -> usize {
        self.base + TEN * frame
    }

    /// Dry friction of a drive, then viscous friction.
    pub(crate) fn friction(self, drive: usize) -> usize {
        self.payload(self.payloads) + 2 * drive
    }

    pub(crate) fn offset(self, drive: usize) -> usize {
        self.friction(self.drives) + drive
    }

    pub(crate) fn scale(self, drive: usize) -> usize {
        self.offset(self.drives) + drive
    }

    pub(crate) fn clock(self) -> usize {
        self.scale(self.drives)
    }

    /// The zero of a coordinate's encoder.
    pub(crate) fn zero(self, coordinate: usize) -> usize {
        self.clock() + 1 + coordinate
    }

    pub(crate) fn total(self) -> usize {
        self.zero(self.coordinates)
    }
}
