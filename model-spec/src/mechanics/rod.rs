//! A slender rod along a linear drive, such as its screw.
//!
//! Its generalised force is derived in `regressor/mechanics` of `modelmill-codegen`.

use crate::build::effect_places::EffectTargets;
use crate::diagnostic::{Diagnostic, DiagnosticLog};
use crate::kinds::ActsOn;
use crate::mechanics::{MechanicsEntry, MechanicsSymbols};
use crate::mechanism::{DriveKind, EffectPlace, Mechanism, ModelDrive};
use crate::unit::UnitDimension;
use crate::values::SpannedName;

/// The entry of [`crate::Mechanics::Rod`].
pub(crate) struct RodMechanics;

impl MechanicsEntry for RodMechanics {
    fn description(&self) -> &'static str {
        "a rod along the drive, about its first point"
    }

    fn introduction(&self) -> &'static str {
        "a rod that rotates about the first point (the pivot) and slides through the second point; its moment of inertia \
         and first moment of mass about the pivot, and its mass: "
    }

    fn acts_on(&self) -> ActsOn {
        ActsOn::Drive
    }

    /// Moments of its mass along itself, of order two, one and zero.
    fn parameters(&self) -> MechanicsSymbols {
        &[
            ("Jr", UnitDimension::INERTIA),
            ("Sr", UnitDimension::FIRST_MOMENT),
            ("mr", UnitDimension::MASS),
        ]
    }

    fn n_places(&self) -> Option<usize> {
        None
    }

    fn check_place(&self, name: &SpannedName, place: EffectPlace, scene: &EffectTargets<'_>, log: &mut DiagnosticLog) {
        // A rod needs the line between the two points of a drive.
        if !is_line(scene.drives, place) {
            log.push(
                Diagnostic::error(name.span, "a rod cannot act here")
                    .label("this drive is not a line between two points")
                    .help("a rod lies along a drive with `linear = { from = ..., to = ... }`"),
            );
        }
    }

    fn has_effect_at(&self, mechanism: &Mechanism, place: EffectPlace) -> bool {
        is_line(&mechanism.drives, place)
    }
}

/// Whether a place is a linear drive, which has two points.
/// Only a linear drive has a line.
fn is_line(drives: &[ModelDrive], place: EffectPlace) -> bool {
    let EffectPlace::Drive(drive) = place else {
        return false;
    };
    matches!(drives[drive.0].kind, DriveKind::Linear { .. })
}
