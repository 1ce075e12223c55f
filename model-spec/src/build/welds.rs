//! Loops that weld two frames to each other.
//!
//! Two frames go in; three pairs of points that coincide come out. Three points that are not on one line determine a frame,
//! and of their nine equations the redundant ones are left out later.

use num_rational::BigRational;

use crate::build::MechanismSpans;
use crate::build::frames::{FrameTree, PointTable};
use crate::diagnostic::{Diagnostic, DiagnosticLog};
use crate::exact::ExactExpression;
use crate::mechanism::{FrameIdx, FramePoint, KinematicLoop, PointIdx};
use crate::record::EntryList;
use crate::values::SpannedName;

/// The loops of a weld of two frames: at their origins, and at points on their x and y axes, 0.1 m away.
pub(super) fn weld_loops(
    name: Option<&SpannedName>,
    welds: &EntryList<SpannedName>,
    tree: &FrameTree,
    points: &mut PointTable,
    places: &mut MechanismSpans,
    log: &mut DiagnosticLog,
) -> Vec<KinematicLoop> {
    let [first, second] = welds.entries.as_slice() else {
        log.push(
            Diagnostic::error(
                welds.span,
                format!("a weld joins two frames, not {}", welds.entries.len()),
            )
            .label("expected the names of two frames"),
        );
        return Vec::new();
    };
    // Both names are looked up, so that both are reported if both are unknown.
    let (Some(one), Some(other)) = (tree.find(first, log), tree.find(second, log)) else {
        return Vec::new();
    };
    if tree.carrying_frame(one) == tree.carrying_frame(other) {
        log.push(
            Diagnostic::error(welds.span, "these two frames are fixed to the same body")
                .label("a loop closes between two chains of frames"),
        );
        return Vec::new();
    }
    let name = name.map_or_else(|| format!("{}_{}", first.text, second.text), |name| name.text.clone());
    let axes = [("", None), ("_x", Some(0)), ("_y", Some(1))];
    axes.into_iter()
        .map(|(suffix, axis)| {
            let mut end = |frame: FrameIdx, side: &str| {
                let idx = PointIdx(points.points.len());
                let at = std::array::from_fn(|k| {
                    if Some(k) == axis {
                        ExactExpression::Rational(BigRational::new(1.into(), 10.into()))
                    } else {
                        ExactExpression::zero()
                    }
                });
                // Points of a file have no name with this prefix, since names begin with a letter.
                let name = format!("_{name}{suffix}_{side}");
                points.points.push(FramePoint { name, frame, at });
                places.points.push(welds.span);
                idx
            };
            let joins = [end(one, "first"), end(other, "second")];
            places.loops.push(welds.span);
            KinematicLoop {
                name: format!("{name}{suffix}"),
                joins,
            }
        })
        .collect()
}
