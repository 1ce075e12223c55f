//! Drives that stand in all recordings while others move. Dry friction holds them with any force up to its size, in each
//! recording with another one. So their forces show no effect, no drift and no difference between recordings.

use modelmill_identify::RecordingNote;
use modelmill_identify::diagnose::{LocatedEffect, top_speed};
use modelmill_spec::DriveKind;

use crate::along::drive_rates;
use crate::audit::events::slowest_rate;
use crate::error::Outcome;
use crate::model::Model;
use crate::regressors::SegmentList;
use crate::text::names::joined_by_and;

/// The drives that stand, with the names of all places at which an effect would act on one of them only.
#[derive(Default)]
pub(super) struct StandingDrives {
    /// Names of the drives.
    drives: Vec<String>,
    /// Names of the drives and of the coordinates of their joints.
    places: Vec<String>,
}

impl StandingDrives {
    /// The drives that are never faster than a drive at standstill; none if no drive moves.
    ///
    /// Fails when a pose has no solution.
    pub(super) fn find(model: &Model, all: &SegmentList<'_>) -> Outcome<Self> {
        let mechanism = &model.derivation.mechanism;
        let mut rates = vec![Vec::new(); mechanism.drives.len()];
        for (one, _) in all {
            for (rates, more) in rates.iter_mut().zip(drive_rates(model, one)?) {
                rates.extend(more);
            }
        }
        let stands: Vec<bool> = (rates.iter().enumerate())
            .map(|(d, rates)| top_speed(rates) <= slowest_rate(model, d))
            .collect();
        if stands.iter().all(|stands| *stands) {
            return Ok(Self::default());
        }
        let mut found = Self::default();
        for (drive, _) in mechanism.drives.iter().zip(&stands).filter(|(_, stands)| **stands) {
            found.drives.push(drive.name.clone());
            found.places.push(drive.name.clone());
            if let DriveKind::Joint(i) = drive.kind {
                found.places.push(mechanism.coordinates[i.0].name.clone());
            }
        }
        Ok(found)
    }

    /// Whether something acts at standing drives only.
    pub(super) fn has_all<'a>(&self, places: impl IntoIterator<Item = &'a str>) -> bool {
        let mut places = places.into_iter().peekable();
        places.peek().is_some() && places.all(|place| self.places.iter().any(|one| one == place))
    }

    /// Whether an effect, a drift or a change cannot be searched, because it acts at standing drives only.
    pub(super) fn excludes(&self, effect: &LocatedEffect) -> bool {
        self.has_all(effect.at.iter().map(String::as_str))
    }

    /// A note on the drives; `None` if there are none.
    pub(super) fn note(&self) -> Option<RecordingNote> {
        let names: Vec<String> = self.drives.iter().map(|name| format!("`{name}`")).collect();
        let text = || {
            format!(
                "{} {} in all recordings. Dry friction holds a standing drive with any force up to its size, so no effect is \
                 searched there. Move all drives in the next recording.",
                joined_by_and(&names),
                if names.len() == 1 { "stands" } else { "stand" }
            )
        };
        (!names.is_empty()).then(|| RecordingNote::warning(text()))
    }
}
