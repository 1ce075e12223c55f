//! A passive element along the line between two points, such as a gas strut, a spring or a damper.
//!
//! It has a constant force, a stiffness and a damping along the line, so that it is linear in its parameters.

use crate::build::effect_places::EffectTargets;
use crate::diagnostic::{Diagnostic, DiagnosticLog};
use crate::kinds::ActsOn;
use crate::mechanics::{MechanicsEntry, MechanicsSymbols};
use crate::mechanism::{DriveKind, EffectPlace, KinematicLoop, Mechanism, ModelDrive, PointIdx};
use crate::unit::UnitDimension;
use crate::values::SpannedName;

/// The entry of [`crate::Mechanics::Strut`].
pub(crate) struct StrutMechanics;

impl MechanicsEntry for StrutMechanics {
    fn description(&self) -> &'static str {
        "F0 + k*l + Fv*l' of a spring, strut or damper that pulls the points together, l their distance"
    }

    fn introduction(&self) -> &'static str {
        "an element between the points that pulls them together, by a constant, by their distance and by its rate: "
    }

    fn acts_on(&self) -> ActsOn {
        ActsOn::Point
    }

    /// The constant force, the stiffness and the damping.
    fn parameters(&self) -> MechanicsSymbols {
        &[
            ("F0", UnitDimension::FORCE),
            ("k", UnitDimension::STIFFNESS),
            ("Fv", UnitDimension::DAMPING),
        ]
    }

    fn n_places(&self) -> Option<usize> {
        Some(2)
    }

    /// A coil spring has no damping, a damper no stiffness.
    fn may_lack_parameters(&self) -> bool {
        true
    }

    fn check_places(
        &self,
        names: &[SpannedName],
        places: &[EffectPlace],
        scene: &EffectTargets<'_>,
        log: &mut DiagnosticLog,
    ) {
        // Points on one frame have a constant distance, so the element has no effect.
        let frame = |place: &EffectPlace| match place {
            EffectPlace::Point(point) => Some(scene.points.points[point.0].frame),
            _ => None,
        };
        let frames: Vec<_> = places.iter().map(frame).collect();
        // The second point is marked, because the first one is the reference.
        if let ([_, second], [a, b]) = (names, frames.as_slice())
            && a == b
        {
            log.push(
                Diagnostic::error(second.span, "an element between two points cannot act here")
                    .label("this point lies in the same frame as the first one")
                    .help("their distance never changes; name points of two bodies"),
            );
        }
    }

    fn is_part_of_load(&self) -> bool {
        false
    }

    /// Pairs of points that no loop and no drive uses. Such points are declared for elements that may be attached
    /// there.
    fn pairs(&self, mechanism: &Mechanism) -> Option<Vec<[PointIdx; 2]>> {
        let points = &mechanism.points;
        // Points of loops and drives have another purpose.
        let is_free = |p: &PointIdx| !is_loop_end(&mechanism.loops, *p) && !is_drive_end(&mechanism.drives, *p);
        let free: Vec<PointIdx> = (0..points.len()).map(PointIdx).filter(is_free).collect();
        let mut pairs = Vec::new();
        // Each pair of free points on different frames.
        for (i, one) in free.iter().enumerate() {
            for other in &free[i + 1..] {
                if points[one.0].frame != points[other.0].frame {
                    pairs.push([*one, *other]);
                }
            }
        }
        Some(pairs)
    }
}

/// Whether a point is an end of a loop.
fn is_loop_end(loops: &[KinematicLoop], point: PointIdx) -> bool {
    loops.iter().any(|one| one.joins.contains(&point))
}

/// Whether a point is an end of a linear drive.
fn is_drive_end(drives: &[ModelDrive], point: PointIdx) -> bool {
    drives.iter().any(|drive| match drive.kind {
        DriveKind::Linear { from, to } => from == point || to == point,
        DriveKind::Joint(_) => false,
    })
}
