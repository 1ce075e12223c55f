//! A slender rod along a linear drive, such as its screw.

use crate::build::effect_places::Scene;
use crate::diagnostic::{Diagnostic, Log};
use crate::kinds::ActsOn;
use crate::mechanics::{Entry, Symbols};
use crate::mechanism::{Drive, DriveKind, Mechanism, Place};
use crate::unit::Dimension;
use crate::values::Name;

pub(crate) struct Rod;

impl Entry for Rod {
    fn words(&self) -> &'static str {
        "a rod along the drive, about its first point"
    }

    fn lead(&self) -> &'static str {
        "a rod that turns about the first point and slides through the second; its second and first moment about the \
         first point, and its mass: "
    }

    fn on(&self) -> ActsOn {
        ActsOn::Drive
    }

    /// Moments of its mass along itself, of second, first and no order.
    fn parameters(&self) -> Symbols {
        &[
            ("Jr", Dimension::INERTIA),
            ("Sr", Dimension::FIRST_MOMENT),
            ("mr", Dimension::MASS),
        ]
    }

    fn n_places(&self) -> Option<usize> {
        None
    }

    fn check_place(&self, name: &Name, place: Place, scene: &Scene<'_>, log: &mut Log) {
        if !is_line(scene.drives, place) {
            log.push(
                Diagnostic::error(name.span, "a rod cannot act here")
                    .label("this drive is no line between two points")
                    .help("a rod lies along a drive with `linear = { from = ..., to = ... }`"),
            );
        }
    }

    fn has_effect_at(&self, mechanism: &Mechanism, place: Place) -> bool {
        is_line(&mechanism.drives, place)
    }
}

fn is_line(drives: &[Drive], place: Place) -> bool {
    let Place::Drive(drive) = place else {
        return false;
    };
    matches!(drives[drive.0].kind, DriveKind::Linear { .. })
}
