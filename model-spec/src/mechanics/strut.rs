//! A passive element along the line between two points, such as a gas strut, a spring or a damper.

use crate::build::effect_places::Scene;
use crate::diagnostic::{Diagnostic, Log};
use crate::kinds::ActsOn;
use crate::mechanics::{Entry, Symbols};
use crate::mechanism::{Drive, DriveKind, Loop, Mechanism, Place, PointIdx};
use crate::unit::Dimension;
use crate::values::Name;

pub(crate) struct Strut;

impl Entry for Strut {
    fn words(&self) -> &'static str {
        "F0 + k*l + Fv*l' that pull the points together, l their distance"
    }

    fn lead(&self) -> &'static str {
        "an element between the points that pulls them together, by a constant, by their distance and by its rate: "
    }

    fn on(&self) -> ActsOn {
        ActsOn::Point
    }

    /// Of no order in the distance, of first order, and of first order in its rate.
    fn parameters(&self) -> Symbols {
        &[
            ("F0", Dimension::FORCE),
            ("k", Dimension::STIFFNESS),
            ("Fv", Dimension::DAMPING),
        ]
    }

    fn n_places(&self) -> Option<usize> {
        Some(2)
    }

    fn check_places(&self, names: &[Name], places: &[Place], scene: &Scene<'_>, log: &mut Log) {
        let frame = |place: &Place| match place {
            Place::Point(point) => Some(scene.points.points[point.0].frame),
            _ => None,
        };
        let frames: Vec<_> = places.iter().map(frame).collect();
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

    /// Pairs of points on which nothing else stands: whoever declares such says that something may be attached there.
    fn pairs(&self, mechanism: &Mechanism) -> Option<Vec<[PointIdx; 2]>> {
        let points = &mechanism.points;
        let is_free =
            |p: &PointIdx| !is_joined(&mechanism.loops, *p) && !is_end(&mechanism.drives, *p);
        let free: Vec<PointIdx> = (0..points.len()).map(PointIdx).filter(is_free).collect();
        let mut pairs = Vec::new();
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

fn is_joined(loops: &[Loop], point: PointIdx) -> bool {
    loops.iter().any(|one| one.joins.contains(&point))
}

fn is_end(drives: &[Drive], point: PointIdx) -> bool {
    drives.iter().any(|drive| match drive.kind {
        DriveKind::Linear { from, to } => from == point || to == point,
        DriveKind::Joint(_) => false,
    })
}
